// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-lfparse
 * @title: lfparse
 * @short_description: splits a byte stream into light field requests or answers
 *
 * lfparse splits data from a file or a TCP connection into units, which are single requests or parts of an answer. Each
 * output buffer is one unit. Use it before elements that need parsed requests (`application/x-lightfield-request`) or
 * answers (`application/x-lightfield-answer`). If the caps do not name the stream type, the first unit determines the
 * type. Invalid bytes are skipped up to the next unit and counted in #lfparse:stats.
 *
 * Timestamps pass through. A request without a timestamp gets the running time that it asks for, so a recorded camera
 * path plays in real time.
 *
 * ## Replay recorded requests
 * |[
 * gst-launch-1.0 filesrc location=path.lfq ! lfparse ! fakesink sync=true silent=false -v
 * ]|
 * ## Receive the answers of a node by TCP
 * |[
 * gst-launch-1.0 tcpclientsrc host=CAMHOST port=5000 ! lfparse ! filesink location=answers.lfa
 * ]|
 */
#include <algorithm>
#include <optional>
#include <span>
#include <string_view>

#include <gst/base/gstbaseparse.h>
#include <gst/gst.h>

#include "common/common.h"
#include "common/properties.h"
#include "wire/request_codec.h"
#include "wire/unit.h"

GST_DEBUG_CATEGORY_STATIC(lf_parse_debug);
#define GST_CAT_DEFAULT lf_parse_debug

using lf::wire::UnitHeader;
using lf::wire::UnitKind;

namespace {

struct Settings {
  guint max_size_bytes = lf::wire::kTypicalAnswerBytes;

  static lf::PropertyTable<Settings>& properties() {
    static lf::PropertyTable<Settings> table = {lf::property<&Settings::max_size_bytes>(
        lf::kWhilePlaying, "max-size-bytes", "Maximum size in bytes",
        "Maximum size of a unit (one request or one part of an answer), in bytes. The element skips larger units as "
        "damaged. Increase it only for very large views, because a damaged stream can claim any size. Requests are "
        "never larger than 1 MiB",
        guint{lf::wire::kUnitHeaderBytes}, guint{lf::wire::kMaxAnswerBytes})};
    return table;
  }
};

}  // namespace

#define LF_TYPE_PARSE (lf_parse_get_type())
G_DECLARE_FINAL_TYPE(LfParse, lf_parse, LF, PARSE, GstBaseParse)

struct _LfParse {
  GstBaseParse parent;

  // Streaming thread:
  gboolean kind_known;  // set by caps or the first unit; the source pad has caps
  UnitKind kind;
  gboolean in_garbage;

  // Guarded by the object lock:
  Settings settings;
  guint64 units, skipped_bytes, gaps;
};

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_MEDIA_TYPE "; " LF_ANSWER_MEDIA_TYPE));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS,
                            GST_STATIC_CAPS(LF_REQUEST_CAPS ", framerate = (fraction) [ 0/1, max ]; " LF_ANSWER_CAPS));

G_DEFINE_TYPE(LfParse, lf_parse, GST_TYPE_BASE_PARSE)
GST_ELEMENT_REGISTER_DEFINE(lfparse, "lfparse", GST_RANK_PRIMARY, LF_TYPE_PARSE)

static Settings& settings_of(LfParse* self) { return self->settings; }

static GstStructure* stats_of(LfParse* self) {
  const lf::ObjectLock lock(self);
  return gst_structure_new("lightfield-parse-stats", "units", G_TYPE_UINT64, self->units, "skipped-bytes",
                           G_TYPE_UINT64, self->skipped_bytes, "gaps", G_TYPE_UINT64, self->gaps, nullptr);
}

using Properties = lf::Properties<settings_of, stats_of>;

static gboolean set_src_caps(LfParse* self, UnitKind kind, GstCaps* caps) {
  if (kind == UnitKind::kRequest && !gst_structure_has_field(gst_caps_get_structure(caps, 0), "framerate"))
    gst_caps_set_simple(caps, "framerate", GST_TYPE_FRACTION, 0, 1, nullptr);
  gst_caps_set_simple(caps, "parsed", G_TYPE_BOOLEAN, TRUE, nullptr);
  self->kind = kind;
  self->kind_known = TRUE;
  const gboolean ok = gst_pad_set_caps(GST_BASE_PARSE_SRC_PAD(self), caps);
  gst_caps_unref(caps);
  return ok;
}

static gboolean lf_parse_start(GstBaseParse* base) {
  LfParse* self = LF_PARSE(base);
  self->kind_known = FALSE;
  self->in_garbage = FALSE;
  GST_OBJECT_LOCK(self);
  self->units = self->skipped_bytes = self->gaps = 0;
  GST_OBJECT_UNLOCK(self);
  gst_base_parse_set_min_frame_size(base, lf::wire::kUnitHeaderBytes);
  return TRUE;
}

static gboolean lf_parse_set_sink_caps(GstBaseParse* base, GstCaps* caps) {
  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  const bool request = gst_structure_has_name(structure, LF_REQUEST_MEDIA_TYPE);
  return set_src_caps(LF_PARSE(base), request ? UnitKind::kRequest : UnitKind::kAnswer, gst_caps_copy(caps));
}

static std::optional<UnitHeader> unit_at(LfParse* self, std::span<const uint8_t> bytes) {
  std::optional<UnitHeader> header = lf::wire::peek_unit(bytes);
  if (!header) return std::nullopt;
  if (self->kind_known && header->kind != self->kind) return std::nullopt;
  if (header->size > Properties::now(self).max_size_bytes) {
    GST_WARNING_OBJECT(self,
                       "a unit of %" G_GSIZE_FORMAT
                       " bytes is larger than max-size-bytes, so it is skipped as "
                       "damaged; increase max-size-bytes if the "
                       "stream is valid",
                       header->size);
    return std::nullopt;
  }
  return header;
}

static void skip(LfParse* self, size_t count) {
  GST_OBJECT_LOCK(self);
  self->skipped_bytes += count;
  if (!self->in_garbage) self->gaps++;
  GST_OBJECT_UNLOCK(self);
  if (!self->in_garbage) GST_WARNING_OBJECT(self, "invalid data: searching for the next unit");
  self->in_garbage = TRUE;
}

static GstClockTime time_asked_for(std::span<const uint8_t> unit) {
  const std::optional<lf::wire::RequestPeek> request = lf::wire::peek_request(unit);
  return !request || request->head.absolute_time ? GST_CLOCK_TIME_NONE : request->head.target_time;
}

static GstFlowReturn take_bytes(LfParse* self, GstBaseParseFrame* frame, gint* skip_size) {
  GstBaseParse* base = GST_BASE_PARSE(self);
  GstMapInfo map;
  if (!gst_buffer_map(frame->buffer, &map, GST_MAP_READ)) {
    GST_ELEMENT_ERROR(self, RESOURCE, READ, (nullptr), ("the buffer can't be mapped"));
    return GST_FLOW_ERROR;
  }
  const std::span<const uint8_t> bytes(map.data, map.size);
  const bool draining = GST_BASE_PARSE_DRAINING(base);
  const std::optional<UnitHeader> unit = unit_at(self, bytes);
  const bool complete = unit && unit->size <= bytes.size();

  if (!complete) {
    if (unit && !draining) {
      gst_base_parse_set_min_frame_size(base, unit->size);
    } else {
      // Skips a unit that is incomplete at the end of the stream, because its length may be wrong and hide other units.
      const size_t count = lf::wire::distance_to_magic(bytes, !draining);
      skip(self, count);
      *skip_size = static_cast<gint>(count);
      gst_base_parse_set_min_frame_size(base, lf::wire::kUnitHeaderBytes);
    }
    gst_buffer_unmap(frame->buffer, &map);
    return GST_FLOW_OK;
  }

  GstClockTime time = GST_BUFFER_PTS(frame->buffer);
  if (unit->kind == UnitKind::kRequest && !GST_CLOCK_TIME_IS_VALID(time))
    time = time_asked_for(bytes.first(unit->size));
  gst_buffer_unmap(frame->buffer, &map);
  GST_BUFFER_PTS(frame->buffer) = time;
  GST_BUFFER_DTS(frame->buffer) = GST_CLOCK_TIME_NONE;

  if (!self->kind_known)
    set_src_caps(
        self, unit->kind,
        gst_caps_new_empty_simple(unit->kind == UnitKind::kRequest ? LF_REQUEST_MEDIA_TYPE : LF_ANSWER_MEDIA_TYPE));
  self->in_garbage = FALSE;
  GST_OBJECT_LOCK(self);
  self->units++;
  GST_OBJECT_UNLOCK(self);
  gst_base_parse_set_min_frame_size(base, lf::wire::kUnitHeaderBytes);
  return gst_base_parse_finish_frame(base, frame, static_cast<gint>(unit->size));
}

static GstFlowReturn lf_parse_handle_frame(GstBaseParse* base, GstBaseParseFrame* frame, gint* skip_size) {
  return lf::guard_buffer(base, [=] { return take_bytes(LF_PARSE(base), frame, skip_size); });
}

static void lf_parse_class_init(LfParseClass* klass) {
  GST_DEBUG_CATEGORY_INIT(lf_parse_debug, "lfparse", 0, "light field stream parser");
  Properties::install(
      G_OBJECT_CLASS(klass),
      "Counters since the start of the stream, all uint64. units counts the units (requests or parts of answers) that "
      "were forwarded. skipped-bytes counts bytes that do not belong to a unit of this stream, and gaps counts the "
      "runs of such bytes. An undamaged stream has neither skipped bytes nor gaps");

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(
      element_class, "Light field stream parser", "Codec/Parser",
      "Splits files and TCP streams of light field requests or answers into one unit per buffer",
      "gst-lightfield developers");

  GstBaseParseClass* parse_class = GST_BASE_PARSE_CLASS(klass);
  parse_class->start = lf::callback<lf_parse_start>;
  parse_class->set_sink_caps = lf::callback<lf_parse_set_sink_caps>;
  parse_class->handle_frame = lf_parse_handle_frame;
}

static void lf_parse_init(LfParse* self) {
  self->settings = {};
  // Disables timestamps by byte position. They come from buffers or requests.
  gst_base_parse_set_infer_ts(GST_BASE_PARSE(self), FALSE);
  gst_base_parse_set_pts_interpolation(GST_BASE_PARSE(self), FALSE);
  GST_PAD_SET_ACCEPT_TEMPLATE(GST_BASE_PARSE_SINK_PAD(self));
}

// --- Type finders ----------------------------------------------------------------------------------------------------

namespace {

std::optional<UnitHeader> peek(GstTypeFind* find, gint64 offset) {
  const guint8* data = gst_type_find_peek(find, offset, lf::wire::kUnitHeaderBytes);
  if (!data) return std::nullopt;
  return lf::wire::peek_unit({data, lf::wire::kUnitHeaderBytes});
}

// The type is certain if a second unit follows or the stream ends after the first unit.
void find_units(GstTypeFind* find, gpointer user_data) {
  const auto kind = static_cast<UnitKind>(GPOINTER_TO_INT(user_data));
  const std::optional<UnitHeader> first = peek(find, 0);
  if (!first || first->kind != kind) return;
  const bool alone = gst_type_find_get_length(find) == first->size;
  const std::optional<UnitHeader> second = alone ? first : peek(find, static_cast<gint64>(first->size));
  gst_type_find_suggest_simple(find, second && second->kind == kind ? GST_TYPE_FIND_MAXIMUM : GST_TYPE_FIND_LIKELY,
                               kind == UnitKind::kRequest ? LF_REQUEST_MEDIA_TYPE : LF_ANSWER_MEDIA_TYPE, "parsed",
                               G_TYPE_BOOLEAN, FALSE, nullptr);
}

constexpr std::string_view kBlank = " \t\r\n";

// Skips blanks, then tests for `word`. If the text continues with `word`, advances `at` behind the word and returns
// true.
bool skip_token(std::string_view text, size_t& at, std::string_view word) {
  at = std::min(text.find_first_not_of(kBlank, at), text.size());
  if (!text.substr(at).starts_with(word)) return false;
  at += word.size();
  return true;
}

std::string_view peek_text(GstTypeFind* find, guint most) {
  const guint64 length = gst_type_find_get_length(find);
  guint known = 0;
  if (length > 0) most = known = static_cast<guint>(MIN(length, most));
  // Finds the available size by binary search if the length is unknown.
  for (guint step = length > 0 ? 0 : most; step > 0; step /= 2)
    if (known + step <= most && gst_type_find_peek(find, 0, known + step)) known += step;
  const guint8* data = known > 0 ? gst_type_find_peek(find, 0, known) : nullptr;
  if (!data) return {};
  return {reinterpret_cast<const char*>(data), known};
}

// Detects a rig file: a JSON object with "format": "lightfield-rig". This key may follow after all cameras.
void find_rig(GstTypeFind* find, gpointer) {
  constexpr guint kFew = 64, kMost = 4 << 20;
  constexpr std::string_view kKey = "\"format\"";
  size_t at = 0;
  if (!skip_token(peek_text(find, kFew), at, "{")) return;
  const std::string_view text = peek_text(find, kMost);
  for (at = text.find(kKey); at != text.npos; at = text.find(kKey, at)) {
    at += kKey.size();
    if (skip_token(text, at, ":") && skip_token(text, at, "\"lightfield-rig\"")) {
      gst_type_find_suggest_empty_simple(find, GST_TYPE_FIND_MAXIMUM, LF_RIG_MEDIA_TYPE);
      return;
    }
  }
}

gboolean register_rig(GstPlugin* plugin) {
  g_autoptr(GstCaps) caps = gst_caps_new_empty_simple(LF_RIG_MEDIA_TYPE);
  return gst_type_find_register(plugin, LF_RIG_MEDIA_TYPE, GST_RANK_PRIMARY, find_rig, nullptr, caps, nullptr, nullptr);
}

gboolean register_kind(GstPlugin* plugin, const char* media_type, const char* extension, UnitKind kind) {
  g_autoptr(GstCaps) caps = gst_caps_new_empty_simple(media_type);
  return gst_type_find_register(plugin, media_type, GST_RANK_PRIMARY, find_units, extension, caps,
                                GINT_TO_POINTER(static_cast<int>(kind)), nullptr);
}

}  // namespace

static gboolean register_typefinders(GstPlugin* plugin) {
  return register_kind(plugin, LF_REQUEST_MEDIA_TYPE, "lfq", UnitKind::kRequest) &&
         register_kind(plugin, LF_ANSWER_MEDIA_TYPE, "lfa", UnitKind::kAnswer) && register_rig(plugin);
}
GST_TYPE_FIND_REGISTER_DEFINE_CUSTOM(lightfield, register_typefinders)
