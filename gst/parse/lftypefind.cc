// SPDX-License-Identifier: LGPL-2.1-or-later
#include "parse/lftypefind.h"

#include <algorithm>
#include <optional>
#include <string_view>

#include "common/common.h"
#include "wire/unit.h"

namespace {

std::optional<lf::wire::UnitHeader> peek(GstTypeFind* find, gint64 offset) {
  const guint8* data = gst_type_find_peek(find, offset, lf::wire::kUnitHeaderBytes);
  if (!data) return std::nullopt;
  return lf::wire::peek_unit({data, lf::wire::kUnitHeaderBytes});
}

// Certain where a second unit follows or the stream ends with the first.
void find_units(GstTypeFind* find, gpointer user_data) {
  const auto kind = static_cast<lf::wire::UnitKind>(GPOINTER_TO_INT(user_data));
  const std::optional<lf::wire::UnitHeader> first = peek(find, 0);
  if (!first || first->kind != kind) return;
  const bool alone = gst_type_find_get_length(find) == first->size;
  const std::optional<lf::wire::UnitHeader> second = alone ? first : peek(find, static_cast<gint64>(first->size));
  gst_type_find_suggest_simple(find, second && second->kind == kind ? GST_TYPE_FIND_MAXIMUM : GST_TYPE_FIND_LIKELY,
                               kind == lf::wire::UnitKind::kRequest ? LF_REQUEST_MEDIA_TYPE : LF_ANSWER_MEDIA_TYPE,
                               "parsed", G_TYPE_BOOLEAN, FALSE, nullptr);
}

constexpr std::string_view kBlank = " \t\r\n";

// Whether `text` goes on with `word` from `at` on, after blanks; then `at` is behind it.
bool goes_on(std::string_view text, size_t& at, std::string_view word) {
  at = std::min(text.find_first_not_of(kBlank, at), text.size());
  if (!text.substr(at).starts_with(word)) return false;
  at += word.size();
  return true;
}

// As much of it as there is, up to `most` bytes.
std::string_view peek_text(GstTypeFind* find, guint most) {
  const guint64 length = gst_type_find_get_length(find);
  guint known = 0;
  if (length > 0) most = known = static_cast<guint>(MIN(length, most));
  // Where nobody knows the length what is there is found by halves.
  for (guint step = length > 0 ? 0 : most; step > 0; step /= 2)
    if (known + step <= most && gst_type_find_peek(find, 0, known + step)) known += step;
  const guint8* data = known > 0 ? gst_type_find_peek(find, 0, known) : nullptr;
  if (!data) return {};
  return {reinterpret_cast<const char*>(data), known};
}

// A JSON object with "format": "lightfield-rig", which may come behind all cameras.
void find_rig(GstTypeFind* find, gpointer) {
  constexpr guint kFew = 64, kMost = 4 << 20;
  constexpr std::string_view kKey = "\"format\"";
  size_t at = 0;
  if (!goes_on(peek_text(find, kFew), at, "{")) return;
  const std::string_view text = peek_text(find, kMost);
  for (at = text.find(kKey); at != text.npos; at = text.find(kKey, at)) {
    at += kKey.size();
    if (goes_on(text, at, ":") && goes_on(text, at, "\"lightfield-rig\"")) {
      gst_type_find_suggest_empty_simple(find, GST_TYPE_FIND_MAXIMUM, LF_RIG_MEDIA_TYPE);
      return;
    }
  }
}

gboolean register_rig(GstPlugin* plugin) {
  GstCaps* caps = gst_caps_new_empty_simple(LF_RIG_MEDIA_TYPE);
  const gboolean ok =
      gst_type_find_register(plugin, LF_RIG_MEDIA_TYPE, GST_RANK_PRIMARY, find_rig, nullptr, caps, nullptr, nullptr);
  gst_caps_unref(caps);
  return ok;
}

gboolean register_kind(GstPlugin* plugin, const char* media_type, const char* extension, lf::wire::UnitKind kind) {
  GstCaps* caps = gst_caps_new_empty_simple(media_type);
  const gboolean ok = gst_type_find_register(plugin, media_type, GST_RANK_PRIMARY, find_units, extension, caps,
                                             GINT_TO_POINTER(static_cast<int>(kind)), nullptr);
  gst_caps_unref(caps);
  return ok;
}

}  // namespace

gboolean lf_typefind_register(GstPlugin* plugin) {
  return register_kind(plugin, LF_REQUEST_MEDIA_TYPE, "lfq", lf::wire::UnitKind::kRequest) &&
         register_kind(plugin, LF_ANSWER_MEDIA_TYPE, "lfa", lf::wire::UnitKind::kAnswer) && register_rig(plugin);
}
