// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/depth_output.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include <gst/video/video.h>

#include "common/common.h"
#include "common/guard.h"
#include "compositor/view_meta.h"
#include "focus/focus_array.h"
#include "view/depth_image.h"

namespace lf {
namespace {

constexpr double kMost = 65535;  // the largest value of a depth

bool is_depth(GstPad* pad) { return g_str_equal(GST_PAD_NAME(pad), LF_DEPTH_PAD); }

PadPtr share(GstPad* pad) { return PadPtr(GST_PAD(gst_object_ref(pad))); }

// The source pad handles the events from downstream, so that they reach the requests.
gboolean on_event(GstPad*, GstObject* parent, GstEvent* event) {
  const PadPtr src(gst_element_get_static_pad(GST_ELEMENT(parent), "src"));
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_QOS:          // pictures are not skipped because of their depths
    case GST_EVENT_LATENCY:      // arrives at the source pad, too
    case GST_EVENT_RECONFIGURE:  // the size of the depths is the size of the pictures
      gst_event_unref(event);
      return TRUE;
    default: return gst_pad_send_event(src.get(), event);
  }
}

gboolean on_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_LATENCY:
    case GST_QUERY_SEEKING:
    case GST_QUERY_DURATION:
    case GST_QUERY_POSITION: {
      const PadPtr src(gst_element_get_static_pad(GST_ELEMENT(parent), "src"));
      return gst_pad_query(src.get(), query);
    }
    default: return gst_pad_query_default(pad, parent, query);
  }
}

// Writes the values of one view into a picture: value(x, y) for each pixel.
template <typename Pixel, typename Value>
void write(const PictureView& picture, GstVideoFrame& frame, Value value) {
  const View& view = picture.view;
  const int left = picture.column * view.width, top = picture.row * view.height;
  for (int y = 0; y < view.height; y++) {
    auto* const row = reinterpret_cast<Pixel*>(static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, 0)) +
                                               (top + y) * GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0));
    for (int x = 0; x < view.width; x++) row[left + x] = value(x, y);
  }
}

void write_depths(const PictureView& picture, double scale, double offset, GstVideoFrame& frame) {
  const DepthImage image = depth_image(picture.view);
  write<uint16_t>(picture, frame, [&](int x, int y) {
    const float depth = image.depths[static_cast<size_t>(y) * image.width + x];
    const double value = std::clamp((1 / static_cast<double>(depth) - offset) / scale, 1., kMost);
    return GUINT16_TO_LE(depth > 0 ? static_cast<uint16_t>(std::lround(value)) : uint16_t{0});
  });
}

void write_confidences(const PictureView& picture, GstVideoFrame& frame) {
  std::vector<float> row(static_cast<size_t>(picture.view.width));
  write<uint8_t>(picture, frame, [&](int x, int y) {
    if (x == 0 && picture.confidence) picture.confidence->inverse_row(0, 1, y, picture.view.width, row.data());
    return static_cast<uint8_t>(std::lround(255 * row[static_cast<size_t>(x)]));
  });
}

}  // namespace

GstPad* DepthOutput::add_pad(GstPadTemplate* templ) {
  GstPad* pad = gst_pad_new_from_template(templ, GST_PAD_TEMPLATE_NAME_TEMPLATE(templ));
  gst_pad_set_event_function(pad, callback<on_event>);
  gst_pad_set_query_function(pad, callback<on_query>);
  if (is_running(element_)) gst_pad_set_active(pad, TRUE);
  const PadPtr kept = share(pad);
  if (!gst_element_add_pad(element_, pad)) return nullptr;  // the name is taken
  const ObjectLock lock(element_);
  pads_.push_back(pad);
  return pad;
}

bool DepthOutput::remove_pad(GstPad* pad) {
  ObjectLock lock(element_);
  const bool is_known = std::erase(pads_, pad) > 0;
  lock.unlock();
  if (!is_known) return false;
  gst_pad_set_active(pad, FALSE);
  gst_element_remove_pad(element_, pad);
  return true;
}

void DepthOutput::set_rig(std::shared_ptr<const Rig> rig) {
  rig_ = std::move(rig);
  values_ = {};
}

std::vector<PadPtr> DepthOutput::pads() const {
  const ObjectLock lock(element_);
  std::vector<PadPtr> all;
  for (GstPad* pad : pads_) all.push_back(share(pad));
  return all;
}

void DepthOutput::set_limits(double near, double far) {
  if (near == near_ && far == far_) return;
  near_ = near;
  far_ = far;
  values_ = {};
}

// Without a near limit, the largest value stands for a quarter of the nearest distance that the array can measure, so
// that a unit is a small fraction of a pixel of disparity. It is also at most a quarter of the far limit. A power of
// two makes the numbers of the caps exact.
const DepthOutput::Values& DepthOutput::values() {
  constexpr double kNearer = 4, kUnknown = 4;  // 1/m
  if (values_.scale > 0) return values_;
  const double farthest = far_ > 0 ? 1 / far_ : 0;
  const double measured = near_ > 0 || !rig_ ? 0 : FocusArray(*rig_).nearest();
  const double reached = std::max(measured > 0 ? measured : kUnknown, farthest);
  const double nearest = near_ > 0 ? 1 / near_ : std::exp2(std::ceil(std::log2(kNearer * reached)));
  // Values must differ even if both limits are equal.
  const double span = std::max(nearest - farthest, nearest * std::numeric_limits<float>::epsilon());
  values_.scale = span / (near_ > 0 ? kMost - 1 : kMost + 1);
  values_.offset = farthest - values_.scale;
  return values_;
}

std::vector<DepthOutput::Output> DepthOutput::make(GstBuffer* picture) {
  std::vector<Output> outputs;
  std::vector<PadPtr> wanted = pads();
  GstCustomMeta* meta = wanted.empty() ? nullptr : gst_buffer_get_custom_meta(picture, LF_VIEW_META);
  if (!meta) return outputs;
  const std::vector<PictureView> views = views_of_picture(gst_custom_meta_get_structure(meta));
  int columns = 0, rows = 0;
  for (const PictureView& view : views) {
    columns = std::max(columns, view.column + 1);
    rows = std::max(rows, view.row + 1);
  }
  for (PadPtr& pad : wanted) {
    if (views.empty() || !gst_pad_is_linked(pad.get())) continue;
    GstVideoInfo info;
    gst_video_info_set_format(&info, is_depth(pad.get()) ? GST_VIDEO_FORMAT_GRAY16_LE : GST_VIDEO_FORMAT_GRAY8,
                              static_cast<guint>(columns * views[0].view.width),
                              static_cast<guint>(rows * views[0].view.height));
    BufferPtr buffer(gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&info), nullptr));
    GstVideoFrame frame;
    if (!buffer || !gst_video_frame_map(&frame, &info, buffer.get(), GST_MAP_WRITE)) continue;
    for (const PictureView& view : views) {
      if (is_depth(pad.get()))
        write_depths(view, values().scale, values().offset, frame);
      else
        write_confidences(view, frame);
    }
    gst_video_frame_unmap(&frame);
    gst_buffer_copy_into(buffer.get(), picture,
                         static_cast<GstBufferCopyFlags>(GST_BUFFER_COPY_FLAGS | GST_BUFFER_COPY_TIMESTAMPS), 0, -1);
    copy_view_meta(picture, buffer.get());
    if (const GstReferenceTimestampMeta* captured = find_capture_time(picture))
      add_capture_time(buffer.get(), captured->timestamp, captured->duration);
    if (is_depth(pad.get()))
      gst_structure_set(gst_custom_meta_get_structure(gst_buffer_get_custom_meta(buffer.get(), LF_VIEW_META)),
                        "depth-scale", G_TYPE_DOUBLE, values().scale, "depth-offset", G_TYPE_DOUBLE, values().offset,
                        nullptr);
    outputs.push_back({std::move(pad), std::move(buffer)});
  }
  return outputs;
}

// Returns the caps for a pad: those of the pictures, in another format. Null before the first picture.
GstCaps* DepthOutput::caps_of(GstPad* pad, GstPad* src) {
  const SharedCaps pictures = share_caps(gst_pad_get_current_caps(src));
  if (!pictures) return nullptr;
  GstStructure* structure = gst_structure_copy(gst_caps_get_structure(pictures.get(), 0));
  gst_structure_remove_fields(structure, "colorimetry", "chroma-site", "texture-target", nullptr);
  gst_structure_set(structure, "format", G_TYPE_STRING, is_depth(pad) ? "GRAY16_LE" : "GRAY8", nullptr);
  if (is_depth(pad))
    gst_structure_set(structure, "depth-scale", G_TYPE_DOUBLE, values().scale, "depth-offset", G_TYPE_DOUBLE,
                      values().offset, nullptr);
  return gst_caps_new_full(structure, nullptr);
}

// Sends the events that precede buffers, if they are new: the start of the stream, the caps and the segment.
void DepthOutput::push_headers(GstPad* pad, GstPad* src) {
  g_autoptr(GstEvent) started = gst_pad_get_sticky_event(pad, GST_EVENT_STREAM_START, 0);
  g_autoptr(GstEvent) src_started = gst_pad_get_sticky_event(src, GST_EVENT_STREAM_START, 0);
  if (!started && src_started) {
    const gchar* id = nullptr;
    gst_event_parse_stream_start(src_started, &id);
    GstEvent* start = gst_event_new_stream_start((std::string(id) + "/" + GST_PAD_NAME(pad)).c_str());
    if (guint group = 0; gst_event_parse_group_id(src_started, &group)) gst_event_set_group_id(start, group);
    gst_pad_push_event(pad, start);
  }
  const SharedCaps caps = share_caps(caps_of(pad, src)), current = share_caps(gst_pad_get_current_caps(pad));
  if (caps && !(current && gst_caps_is_equal(caps.get(), current.get())))
    gst_pad_push_event(pad, gst_event_new_caps(caps.get()));
  g_autoptr(GstEvent) segment = gst_pad_get_sticky_event(src, GST_EVENT_SEGMENT, 0);
  g_autoptr(GstEvent) sent = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (caps && segment && segment != sent) gst_pad_push_event(pad, gst_event_ref(segment));
}

GstFlowReturn DepthOutput::push(std::vector<Output> outputs, GstPad* src, GstFlowReturn src_flow) {
  GstFlowReturn all = src_flow;
  for (Output& output : outputs) {
    push_headers(output.pad.get(), src);
    const GstFlowReturn flow = gst_pad_push(output.pad.get(), output.buffer.release());
    if (flow == GST_FLOW_OK && all == GST_FLOW_NOT_LINKED) all = GST_FLOW_OK;
    if (flow <= GST_FLOW_NOT_NEGOTIATED && all == GST_FLOW_OK) all = flow;
  }
  return all;
}

void DepthOutput::forward(GstEvent* event, GstPad* src) {
  const GstEventType type = GST_EVENT_TYPE(event);
  const bool flushes = type == GST_EVENT_FLUSH_START || type == GST_EVENT_FLUSH_STOP;
  if (!flushes && type != GST_EVENT_EOS && type != GST_EVENT_SEGMENT_DONE) return;
  for (const PadPtr& pad : pads()) {
    if (!flushes) push_headers(pad.get(), src);
    gst_pad_push_event(pad.get(), gst_event_ref(event));
  }
}

}  // namespace lf
