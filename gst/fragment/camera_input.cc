// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/camera_input.h"

#include <gst/gl/gl.h>

#include <algorithm>
#include <cstring>

#include "common/common.h"
#include "common/gst_wire.h"
#include "fragment/card_picture.h"
#include "fragment/lffragment_private.h"

namespace lf {
namespace {

GstFlowReturn flow_of(CameraFrames::Pushed pushed) {
  switch (pushed) {
    case CameraFrames::Pushed::kTaken: return GST_FLOW_OK;
    case CameraFrames::Pushed::kStopped: return GST_FLOW_FLUSHING;
    case CameraFrames::Pushed::kEnded: break;
  }
  return GST_FLOW_EOS;
}

}  // namespace

std::shared_ptr<const Camera> CameraInput::camera() const {
  const int64_t id = id_;
  return id < 0 ? nullptr : node_.inputs().camera(static_cast<uint32_t>(id));
}

bool CameraInput::assign() {
  if (id_ >= 0) return true;
  const std::shared_ptr<const Rig> rig = node_.inputs().array()->rig;
  if (!rig) return false;  // the state change has failed with an error already
  const guint number = static_cast<guint>(g_ascii_strtoull(GST_PAD_NAME(pad_) + strlen("sink_"), nullptr, 10));
  const guint id =
      pad_->settings.camera >= 0 ? static_cast<guint>(pad_->settings.camera) : from_stream_.value_or(number);
  if (!rig->index_of_id(id)) {
    const std::string path = lf_fragment_settings(element_).rig;
    GST_ELEMENT_ERROR(element_, RESOURCE, SETTINGS,
                      ("Pad %s: the rig %s has no camera %u.", GST_PAD_NAME(pad_), path.c_str(), id),
                      ("%zu cameras in the rig", rig->cameras.size()));
    return false;
  }
  if (!node_.inputs().set_camera(frames_, id)) {
    GST_ELEMENT_ERROR(element_, RESOURCE, SETTINGS, ("Pad %s: camera %u has a pad already.", GST_PAD_NAME(pad_), id),
                      (nullptr));
    return false;
  }
  id_ = id;
  return true;
}

void CameraInput::name(CameraIndex camera) {
  const std::shared_ptr<const Rig> rig = node_.inputs().array()->rig;
  if (rig && camera < rig->cameras.size()) from_stream_ = rig->cameras[camera].id;
}

bool CameraInput::check_size(int width, int height) {
  const auto camera = this->camera();
  const std::pair size(width, height);
  if (!camera || size == std::pair(camera->width, camera->height)) {
    fitted_ = size;
    return true;
  }
  if (size == fitted_) return true;  // there is another rig since, which has been told of: the frames are left out
  const std::string path = lf_fragment_settings(element_).rig;
  GST_ELEMENT_ERROR(element_, STREAM, FORMAT,
                    ("Pad %s: the video of camera %u has %dx%d pixels, the rig %s says %dx%d.", GST_PAD_NAME(pad_),
                     camera->id, width, height, path.c_str(), camera->width, camera->height),
                    (nullptr));
  return false;
}

bool CameraInput::set_caps(GstCaps* caps) {
  Format format{.jpeg = gst_structure_has_name(gst_caps_get_structure(caps, 0), "image/jpeg") != FALSE};
  next_.reset();
  if (!format.jpeg && !gst_video_info_from_caps(&format.info, caps)) return false;
  next_ = format;
  node_.inputs().set_family(frames_, format.jpeg ? PixelFamily::kI420 : family_of(format.info));
  return true;
}

void CameraInput::start_stream(std::optional<GstClockTime> latency) {
  live_ = latency.has_value();
  latency_ = latency.value_or(0);
  frames_->start_stream(live_);
}

// Only at the first frame of a format: which camera it is comes after the caps.
void CameraInput::take_format(const Format& format) {
  converter_.reset();
  format_.reset();
  if (assign() && (format.jpeg || check_size(format.info.width, format.info.height))) format_ = format;
}

// Clock time where it is live, else stream time, which a seek does not begin anew: the stamp that lfcamsrc left, else
// PTS and the rig's time offset.
uint64_t CameraInput::capture_time(GstBuffer* buffer, const GstSegment* segment) const {
  static GstStaticCaps reference_caps = GST_STATIC_CAPS(LF_CAPTURE_TIME_CAPS);
  GstCaps* reference = gst_static_caps_get(&reference_caps);
  const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(buffer, reference);
  gst_caps_unref(reference);
  if (meta) return meta->timestamp;
  uint64_t taken = 0;
  if (segment) {
    const guint64 time = live_ ? gst_segment_to_running_time(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer))
                               : gst_segment_to_stream_time(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
    if (GST_CLOCK_TIME_IS_VALID(time)) taken = time;
  }
  if (live_) taken += gst_element_get_base_time(GST_ELEMENT(element_));
  const auto camera = this->camera();
  const gint64 offset = camera ? static_cast<gint64>(camera->time_offset * GST_SECOND) : 0;
  return offset < 0 && static_cast<uint64_t>(-offset) > taken ? 0 : taken + static_cast<uint64_t>(offset);
}

void CameraInput::note_arrival(uint64_t captured) {
  if (!live_) return;
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(element_));
  if (!clock) return;
  const GstClockTime now = gst_clock_get_time(clock);
  arrivals_.arrived(captured, now);
  // What the source states to take is no lateness.
  const GstClockTimeDiff late = GST_CLOCK_DIFF(captured, now);
  frames_->note_arrival(std::max(late, static_cast<GstClockTimeDiff>(latency_)));
}

// A camera whose pool has no buffer left stands still. Frames of a pool that what is kept here would exhaust are
// copied.
GstBuffer* CameraInput::spare_pool(GstBuffer* buffer) const {
  constexpr size_t kForCamera = 3;  // one that is filled, one on its way, one to spare
  if (!buffer->pool) return buffer;
  GstStructure* config = gst_buffer_pool_get_config(buffer->pool);
  guint most = 0;
  gst_buffer_pool_config_get_params(config, nullptr, nullptr, nullptr, &most);
  gst_structure_free(config);
  if (most == 0 || frames_->held() + kForCamera < most) return buffer;
  GstBuffer* copy = gst_buffer_copy_deep(buffer);
  if (!copy) return buffer;
  gst_buffer_unref(buffer);
  return copy;
}

// In the node's family, or in its own as long as that is not chosen.
GstFlowReturn CameraInput::take_raw(GstBuffer* buffer, uint64_t time) {
  GstMemory* const memory = gst_buffer_n_memory(buffer) > 0 ? gst_buffer_peek_memory(buffer, 0) : nullptr;
  if (memory && gst_is_gl_memory(memory)) {
    const bool may_stay = FrameConverter::takes_samples_of(format_->info, family_of(format_->info)) &&
                          has_planes_on_card(buffer, format_->info);
    if (may_stay) lf_fragment_note_context(element_, reinterpret_cast<GstGLMemory*>(memory)->mem.context);
    auto picture = std::make_shared<CardPicture>(buffer, format_->info);
    return flow_of(frames_->push({.picture = std::move(picture), .time = time}));
  }
  const PixelFamily chosen = node_.inputs().family();
  const bool open = chosen == PixelFamily::kNone;
  const PixelFamily family = open ? family_of(format_->info) : chosen;
  if (!converter_ || converter_->family() != family)
    converter_ = std::make_unique<FrameConverter>(format_->info, family);
  std::shared_ptr<RawPicture> picture = converter_->convert(buffer, open);
  if (picture) return flow_of(frames_->push({.picture = std::move(picture), .time = time}));
  GST_WARNING_OBJECT(pad_, "dropped a frame that can't be mapped");
  return GST_FLOW_OK;
}

// A damaged frame is dropped and counted.
GstFlowReturn CameraInput::take_jpeg(GstBuffer* buffer, uint64_t time) {
  const auto bytes = std::make_shared<const MappedBuffer>(buffer);
  gst_buffer_unref(buffer);
  std::string reason;
  std::shared_ptr<JpegFrame> frame = JpegFrame::open(bytes, bytes->bytes(), &reason);
  if (frame) {
    const std::pair size(frame->width(), frame->height());
    const auto camera = this->camera();
    if (camera && size == std::pair(camera->width, camera->height)) jpeg_size_ = size;
    if (size != jpeg_size_ && jpeg_size_) {
      reason = "it is of another size than those before";
      frame.reset();
    } else if (!jpeg_size_ && !check_size(size.first, size.second)) {
      return GST_FLOW_ERROR;  // the camera's own size is wrong from the first frame on
    }
  }
  if (frame) return flow_of(frames_->push({.picture = std::make_shared<JpegPicture>(std::move(frame)), .time = time}));
  node_.stats().damaged_frames++;
  if (!std::exchange(warned_damaged_, true))
    GST_ELEMENT_WARNING(element_, STREAM, DECODE,
                        ("Pad %s: dropped a damaged frame of camera %u: %s.", GST_PAD_NAME(pad_),
                         static_cast<guint>(id_), reason.c_str()),
                        ("further ones are counted in stats"));
  return flow_of(frames_->push_damaged(time));
}

GstFlowReturn CameraInput::take(GstBuffer* buffer, const GstSegment* segment) {
  if (next_) take_format(*std::exchange(next_, std::nullopt));
  if (!format_) {
    gst_buffer_unref(buffer);
    return GST_FLOW_NOT_NEGOTIATED;
  }
  buffer = spare_pool(buffer);
  const uint64_t time = capture_time(buffer, segment);
  note_arrival(time);
  return format_->jpeg ? take_jpeg(buffer, time) : take_raw(buffer, time);
}

void CameraInput::reset() {
  node_.inputs().remove(frames_);
  frames_->clear();
  arrivals_.clear();
  converter_.reset();
  next_.reset();
  format_.reset();
  jpeg_size_.reset();
  from_stream_.reset();
  warned_damaged_ = false;
  fitted_.reset();
  id_ = -1;
}

}  // namespace lf
