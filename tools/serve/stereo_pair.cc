// SPDX-License-Identifier: LGPL-2.1-or-later
#include "stereo_pair.h"

#include <gst/video/video.h>

#include <algorithm>
#include <cstring>

namespace lf::serve {
namespace {

constexpr size_t kMostWaiting = 3;  // pictures of a side

GstClockTime stamp_of(GstSample* sample) { return GST_BUFFER_PTS(gst_sample_get_buffer(sample)); }

// `from` into the left or right half of `to`.
void copy_half(const GstVideoFrame& from, GstVideoFrame& to, bool right) {
  for (guint plane = 0; plane < GST_VIDEO_FRAME_N_PLANES(&from); plane++) {
    gint components[GST_VIDEO_MAX_COMPONENTS];
    gst_video_format_info_component(from.info.finfo, plane, components);
    const gint component = components[0];
    const auto bytes = static_cast<size_t>(GST_VIDEO_FRAME_COMP_WIDTH(&from, component) *
                                           GST_VIDEO_FRAME_COMP_PSTRIDE(&from, component));
    const guint8* source = static_cast<const guint8*>(GST_VIDEO_FRAME_PLANE_DATA(&from, plane));
    guint8* target = static_cast<guint8*>(GST_VIDEO_FRAME_PLANE_DATA(&to, plane)) + (right ? bytes : 0);
    for (gint y = 0; y < GST_VIDEO_FRAME_COMP_HEIGHT(&from, component); y++)
      std::memcpy(target + y * static_cast<ptrdiff_t>(GST_VIDEO_FRAME_PLANE_STRIDE(&to, plane)),
                  source + y * static_cast<ptrdiff_t>(GST_VIDEO_FRAME_PLANE_STRIDE(&from, plane)), bytes);
  }
}

}  // namespace

GstSample* StereoPair::add(Side side, GstSample* picture) {
  SamplePtr added(picture), other;
  {
    const std::lock_guard lock(mutex_);
    auto& others = waiting_[1 - side];
    const GstClockTime stamp = stamp_of(picture);
    const auto found = std::find_if(others.begin(), others.end(),
                                    [&](const SamplePtr& sample) { return stamp_of(sample.get()) == stamp; });
    if (found == others.end()) {
      auto& own = waiting_[side];
      own.push_back(std::move(added));
      if (own.size() > kMostWaiting) own.pop_front();
      return nullptr;
    }
    other = std::move(*found);
    // What is older never finds its other half: each side's pictures come in order.
    others.erase(others.begin(), found + 1);
    waiting_[side].clear();
  }
  GstSample *left = added.get(), *right = other.get();
  return side == kLeft ? join(left, right) : join(right, left);
}

GstSample* StereoPair::join(GstSample* left, GstSample* right) {
  GstVideoInfo info, wide;
  if (!gst_video_info_from_caps(&info, gst_sample_get_caps(left)) ||
      !gst_caps_is_equal(gst_sample_get_caps(left), gst_sample_get_caps(right)))
    return nullptr;
  GstCaps* caps = gst_caps_copy(gst_sample_get_caps(left));
  gst_caps_set_simple(caps, "width", G_TYPE_INT, 2 * GST_VIDEO_INFO_WIDTH(&info), nullptr);
  gst_video_info_from_caps(&wide, caps);
  GstBuffer* both = gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&wide), nullptr);
  gst_buffer_copy_into(both, gst_sample_get_buffer(left), GST_BUFFER_COPY_TIMESTAMPS, 0, -1);
  GstVideoFrame from, to;
  bool mapped = gst_video_frame_map(&to, &wide, both, GST_MAP_WRITE);
  for (GstSample* half : {left, right}) {
    if (!mapped || !gst_video_frame_map(&from, &info, gst_sample_get_buffer(half), GST_MAP_READ)) break;
    copy_half(from, to, half == right);
    gst_video_frame_unmap(&from);
  }
  if (mapped) gst_video_frame_unmap(&to);
  GstSample* sample = gst_sample_new(both, caps, gst_sample_get_segment(left), nullptr);
  gst_buffer_unref(both);
  gst_caps_unref(caps);
  return sample;
}

}  // namespace lf::serve
