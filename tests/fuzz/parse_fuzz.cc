// SPDX-License-Identifier: LGPL-2.1-or-later
// Byte streams through lfparse, in buffers of any size: outputs are whole units of one kind, and every byte belongs to
// a unit or was counted as skipped. Input: one byte for the caps, one for the buffer size, and the stream.
#include <gst/gst.h>

#include "common/common.h"
#include "fuzz/fuzz.h"
#include "fuzz/gst_start.h"
#include "wire/unit.h"

GST_ELEMENT_REGISTER_DECLARE(lfparse)

using lf::fuzz::require;

namespace {

struct Seen {
  uint64_t units = 0, bytes = 0;
  std::optional<lf::wire::UnitKind> kind;
};

GstFlowReturn take(GstPad* pad, GstObject*, GstBuffer* buffer) {
  auto* const seen = static_cast<Seen*>(gst_pad_get_element_private(pad));
  GstMapInfo map;
  require(gst_buffer_map(buffer, &map, GST_MAP_READ));
  const std::optional<lf::wire::UnitHeader> unit = lf::wire::peek_unit({map.data, map.size});
  require(unit && unit->size == map.size && (!seen->kind || seen->kind == unit->kind));
  seen->kind = unit->kind;
  seen->units++;
  seen->bytes += map.size;
  gst_buffer_unmap(buffer, &map);
  gst_buffer_unref(buffer);
  return GST_FLOW_OK;
}

uint64_t stat(GstElement* parse, const char* name) {
  GstStructure* stats = nullptr;
  g_object_get(parse, "stats", &stats, nullptr);
  guint64 value = 0;
  require(gst_structure_get_uint64(stats, name, &value));
  gst_structure_free(stats);
  return value;
}

}  // namespace

LF_FUZZ_TARGET(parse)(const uint8_t* data, size_t size) {
  static const bool there = GST_ELEMENT_REGISTER(lfparse, nullptr);
  require(there);
  lf::fuzz::Input input(data, size);
  const uint32_t caps_of = input.number(1) % 3, least = 1 + 8 * input.number(1);
  const std::span<const uint8_t> stream = input.take(size);
  // Long streams in one-byte buffers would take most of the time without covering more.
  const size_t piece = std::max<size_t>(least, stream.size() / 64);

  GstElement* parse = gst_element_factory_make("lfparse", nullptr);
  GstPad *src = gst_pad_new("src", GST_PAD_SRC), *sink = gst_pad_new("sink", GST_PAD_SINK);
  GstPad *in = gst_element_get_static_pad(parse, "sink"), *out = gst_element_get_static_pad(parse, "src");
  Seen seen;
  gst_pad_set_element_private(sink, &seen);
  gst_pad_set_chain_function(sink, take);
  gst_pad_set_active(sink, TRUE);
  gst_pad_set_active(src, TRUE);
  gst_pad_link_full(src, in, GST_PAD_LINK_CHECK_NOTHING);
  gst_pad_link_full(out, sink, GST_PAD_LINK_CHECK_NOTHING);
  gst_element_set_state(parse, GST_STATE_PLAYING);
  gst_pad_push_event(src, gst_event_new_stream_start("fuzz"));
  if (caps_of > 0) {
    GstCaps* caps = gst_caps_new_empty_simple(caps_of == 1 ? LF_REQUEST_MEDIA_TYPE : LF_ANSWER_MEDIA_TYPE);
    gst_pad_push_event(src, gst_event_new_caps(caps));
    gst_caps_unref(caps);
  }
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_BYTES);
  gst_pad_push_event(src, gst_event_new_segment(&segment));
  for (size_t at = 0; at < stream.size(); at += piece) {
    const std::span<const uint8_t> part = stream.subspan(at, std::min<size_t>(piece, stream.size() - at));
    GstBuffer* buffer = gst_buffer_new_memdup(part.data(), part.size());
    GST_BUFFER_OFFSET(buffer) = at;
    require(gst_pad_push(src, buffer) == GST_FLOW_OK);
  }
  gst_pad_push_event(src, gst_event_new_eos());
  require(stat(parse, "units") == seen.units);
  require(seen.bytes + stat(parse, "skipped-bytes") <= stream.size());
  // A remainder shorter than a unit's header is not counted separately.
  require(seen.bytes + stat(parse, "skipped-bytes") + lf::wire::kUnitHeaderBytes > stream.size());
  gst_element_set_state(parse, GST_STATE_NULL);
  for (GstPad* pad : {src, sink, in, out}) {
    gst_pad_set_active(pad, FALSE);
    gst_object_unref(pad);
  }
  gst_object_unref(parse);
  return 0;
}
