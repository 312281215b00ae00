// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/camera_input.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <vector>

#include <gst/gl/gl.h>

#include "common/common.h"
#include "common/gst_wire.h"
#include "fragment/fragment_state.h"
#include "fragment/raw_picture.h"

GST_DEBUG_CATEGORY_EXTERN(lf_fragment_debug);
#define GST_CAT_DEFAULT lf_fragment_debug

namespace lf {
namespace {

GstFlowReturn flow_of(CameraFrames::PushResult pushed) {
  switch (pushed) {
    case CameraFrames::PushResult::kTaken: return GST_FLOW_OK;
    case CameraFrames::PushResult::kStopped: return GST_FLOW_FLUSHING;
    case CameraFrames::PushResult::kEnded: break;
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
  if (!rig) return false;  // the state change has already failed with an error
  const guint number = static_cast<guint>(g_ascii_strtoull(GST_PAD_NAME(pad_) + strlen("sink_"), nullptr, 10));
  const guint id =
      pad_->settings.camera >= 0 ? static_cast<guint>(pad_->settings.camera) : stream_camera_id_.value_or(number);
  if (!rig->index_of_id(id)) {
    const std::string path = lf_fragment_settings(element_).rig;
    GST_ELEMENT_ERROR(element_, RESOURCE, SETTINGS,
                      ("Pad %s: the rig %s has no camera %u. Set the property camera of the pad to the id of a camera "
                       "in the rig file.",
                       GST_PAD_NAME(pad_), path.c_str(), id),
                      ("%zu cameras in the rig", rig->cameras.size()));
    return false;
  }
  if (!node_.inputs().set_camera(frames_, id)) {
    GST_ELEMENT_ERROR(
        element_, RESOURCE, SETTINGS,
        ("Pad %s: camera %u already has a pad. Give each pad a different camera.", GST_PAD_NAME(pad_), id), (nullptr));
    return false;
  }
  id_ = id;
  return true;
}

void CameraInput::name(CameraIndex camera) {
  const std::shared_ptr<const Rig> rig = node_.inputs().array()->rig;
  if (rig && camera < rig->cameras.size()) stream_camera_id_ = rig->cameras[camera].id;
}

bool CameraInput::check_size(int width, int height) {
  const auto camera = this->camera();
  const std::pair size(width, height);
  if (!camera || size == std::pair(camera->width, camera->height)) {
    valid_size_ = size;
    return true;
  }
  if (size == valid_size_) return true;  // the rig has changed since, with a warning, so the node ignores these frames
  const std::string path = lf_fragment_settings(element_).rig;
  GST_ELEMENT_ERROR(element_, STREAM, FORMAT,
                    ("Pad %s: the video of camera %u has %dx%d pixels, the rig %s says %dx%d. Set the camera to the "
                     "size in the rig, or calibrate the rig for the new size.",
                     GST_PAD_NAME(pad_), camera->id, width, height, path.c_str(), camera->width, camera->height),
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

// Applies a new video format. Call this with the first frame of the format instead of with the caps, because
// LF_CAMERA_EVENT, which names the camera, arrives after the caps.
void CameraInput::take_format(const Format& format) {
  converter_.reset();
  format_.reset();
  if (assign() && (format.jpeg || check_size(format.info.width, format.info.height))) format_ = format;
}

// Returns the capture time of a frame: clock time for live cameras, otherwise stream time, which continues over seeks.
// Uses the timestamp meta of lfcamsrc if present, otherwise PTS plus the time offset in the rig.
uint64_t CameraInput::capture_time(GstBuffer* buffer, const GstSegment* segment) const {
  if (const GstReferenceTimestampMeta* meta = find_capture_time(buffer)) return meta->timestamp;
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
  // The latency that the source declares does not count as lateness.
  const GstClockTimeDiff late = GST_CLOCK_DIFF(captured, now);
  frames_->note_arrival(std::max(late, static_cast<GstClockTimeDiff>(latency_)));
}

// Copies the frame if keeping the frame itself could exhaust the camera's buffer pool, which would stall the camera.
GstBuffer* CameraInput::copy_if_pool_is_low(GstBuffer* buffer) const {
  constexpr size_t kForCamera = 3;  // one being filled, one in transit, one spare
  if (!buffer->pool) return buffer;
  g_autoptr(GstStructure) config = gst_buffer_pool_get_config(buffer->pool);
  guint most = 0;
  gst_buffer_pool_config_get_params(config, nullptr, nullptr, nullptr, &most);
  if (most == 0 || frames_->held() + kForCamera < most) return buffer;
  GstBuffer* copy = gst_buffer_copy_deep(buffer);
  if (!copy) return buffer;
  gst_buffer_unref(buffer);
  return copy;
}

// Stores the frame in the pixel family of the node, or in its own family if the node has not chosen one yet.
GstFlowReturn CameraInput::take_raw(GstBuffer* buffer, uint64_t time) {
  GstMemory* const memory = gst_buffer_n_memory(buffer) > 0 ? gst_buffer_peek_memory(buffer, 0) : nullptr;
  if (memory && gst_is_gl_memory(memory)) {
    const bool may_stay = FrameConverter::takes_samples_of(format_->info, family_of(format_->info)) &&
                          has_planes_on_gpu(buffer, format_->info);
    if (may_stay) lf_fragment_note_context(element_, reinterpret_cast<GstGLMemory*>(memory)->mem.context);
    auto picture = std::make_shared<GpuPicture>(buffer, format_->info);
    return flow_of(frames_->push({.picture = std::move(picture), .time = time}));
  }
  const PixelFamily chosen = node_.inputs().family();
  const bool open = chosen == PixelFamily::kNone;
  const PixelFamily family = open ? family_of(format_->info) : chosen;
  if (!converter_ || converter_->family() != family) {
    converter_ = std::make_unique<FrameConverter>(format_->info, family);
    still_.reset();
  }
  // A still is the same memory in each frame. These frames share a picture, which is converted and compared only once.
  const bool may_repeat = memory && gst_buffer_n_memory(buffer) == 1 && !buffer->pool;
  if (!may_repeat || !still_ || memory != gst_buffer_peek_memory(still_.get(), 0)) {
    still_.reset(may_repeat ? gst_buffer_ref(buffer) : nullptr);
    std::shared_ptr<RawPicture> picture = converter_->convert(buffer, open);
    still_picture_ = may_repeat ? picture : nullptr;
    if (picture) return flow_of(frames_->push({.picture = std::move(picture), .time = time}));
  } else {
    gst_buffer_unref(buffer);
    if (still_picture_) return flow_of(frames_->push({.picture = still_picture_, .time = time}));
  }
  GST_WARNING_OBJECT(pad_, "dropped a frame that can't be mapped to system memory");
  return GST_FLOW_OK;
}

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
      reason = "its size differs from earlier frames of this camera";
      frame.reset();
    } else if (!jpeg_size_ && !check_size(size.first, size.second)) {
      return GST_FLOW_ERROR;
    }
  }
  if (frame) return flow_of(frames_->push({.picture = std::make_shared<JpegPicture>(std::move(frame)), .time = time}));
  node_.stats().damaged_frames++;
  if (!std::exchange(warned_damaged_, true))
    GST_ELEMENT_WARNING(element_, STREAM, DECODE,
                        ("Pad %s: dropped a damaged frame of camera %u: %s.", GST_PAD_NAME(pad_),
                         static_cast<guint>(id_), reason.c_str()),
                        ("later damaged frames are only counted in stats"));
  return flow_of(frames_->push_damaged(time));
}

GstFlowReturn CameraInput::take(GstBuffer* buffer, const GstSegment* segment) {
  if (next_) take_format(*std::exchange(next_, std::nullopt));
  if (!format_) {
    gst_buffer_unref(buffer);
    return GST_FLOW_NOT_NEGOTIATED;
  }
  buffer = copy_if_pool_is_low(buffer);
  const uint64_t time = capture_time(buffer, segment);
  note_arrival(time);
  return format_->jpeg ? take_jpeg(buffer, time) : take_raw(buffer, time);
}

void CameraInput::reset() {
  node_.inputs().remove(frames_);
  frames_->clear();
  arrivals_.clear();
  converter_.reset();
  still_.reset();
  still_picture_.reset();
  next_.reset();
  format_.reset();
  jpeg_size_.reset();
  stream_camera_id_.reset();
  warned_damaged_ = false;
  valid_size_.reset();
  id_ = -1;
}

}  // namespace lf

G_DEFINE_FINAL_TYPE(LfFragmentPad, lf_fragment_pad, GST_TYPE_PAD)

lf::PropertyTable<LfFragmentPadSettings>& LfFragmentPadSettings::properties() {
  static lf::PropertyTable<LfFragmentPadSettings> table = {
      lf::property<&LfFragmentPadSettings::camera>(lf::kWhileReady, "camera", "Camera",
                                                   "Id of the camera of this pad, as in the rig file (-1: the id that "
                                                   "an upstream lfcamsrc announces, or else the number of the pad)",
                                                   -1, G_MAXINT)};
  return table;
}

static LfFragmentPadSettings& settings_of(LfFragmentPad* pad) { return pad->settings; }

static void lf_fragment_pad_finalize(GObject* object) {
  delete LF_FRAGMENT_PAD(object)->input;
  G_OBJECT_CLASS(lf_fragment_pad_parent_class)->finalize(object);
}

static void lf_fragment_pad_class_init(LfFragmentPadClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_fragment_pad_finalize;
  lf::Properties<settings_of>::install(object_class);
}

static void lf_fragment_pad_init(LfFragmentPad* pad) { pad->settings = {}; }

static gboolean lf_fragment_camera_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  lf::CameraInputs& inputs = LF_FRAGMENT(parent)->state->node.inputs();
  lf::CameraInput& input = *LF_FRAGMENT_PAD(pad)->input;
  gboolean ok = TRUE;
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CUSTOM_DOWNSTREAM_STICKY: {
      const GstStructure* structure = gst_event_get_structure(event);
      guint camera;
      if (gst_structure_has_name(structure, LF_CAMERA_EVENT) && gst_structure_get_uint(structure, "camera", &camera))
        input.name(camera);
      gboolean paced = FALSE;
      if (gst_structure_get_boolean(structure, "paced", &paced) && paced) input.note_paced();
      break;
    }
    case GST_EVENT_CAPS: {
      GstCaps* caps;
      gst_event_parse_caps(event, &caps);
      ok = input.set_caps(caps);
      break;
    }
    case GST_EVENT_SEGMENT: input.start_stream(lf::live_latency(pad)); break;
    case GST_EVENT_CUSTOM_DOWNSTREAM:
      if (!gst_event_has_name(event, LF_CAMERA_LOST)) break;
      inputs.give_up(input.frames());
      input.frames()->lose_stream();
      break;
    case GST_EVENT_EOS:
      inputs.give_up(input.frames());
      input.frames()->end_stream();
      break;
    case GST_EVENT_FLUSH_START: input.frames()->set_flushing(true); break;
    case GST_EVENT_FLUSH_STOP: input.frames()->set_flushing(false); break;
    default: break;
  }
  gst_event_unref(event);  // camera events end here, because the answers follow the events of the requests
  return ok;
}

// Proposes a pool with one more buffer than the node keeps by default.
static gboolean lf_fragment_propose_allocation(GstPad* pad, GstQuery* query) {
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  GstVideoInfo info;
  if (caps && gst_structure_has_name(gst_caps_get_structure(caps, 0), "video/x-raw") &&
      gst_video_info_from_caps(&info, caps)) {
    const size_t kept = lf::live_latency(pad) ? lf::CameraFrames::kLiveFrames : lf::CameraFrames::kFileFrames;
    gst_query_add_allocation_pool(query, nullptr, static_cast<guint>(info.size), static_cast<guint>(kept + 1), 0);
  }
  gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
  gst_query_add_allocation_meta(query, GST_GL_SYNC_META_API_TYPE, nullptr);
  return TRUE;
}

static gboolean lf_fragment_camera_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_ALLOCATION) return lf_fragment_propose_allocation(pad, query);
  return gst_pad_query_default(pad, parent, query);
}

static GstFlowReturn lf_fragment_camera_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  return lf::guard_buffer(parent, [=] {
    lf_fragment_trim_memory(LF_FRAGMENT(parent));
    const GstSegment* segment = nullptr;
    g_autoptr(GstEvent) event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
    if (event) gst_event_parse_segment(event, &segment);
    return LF_FRAGMENT_PAD(pad)->input->take(buffer, segment);
  });
}

GstPad* lf_fragment_camera_pad_new(LfFragment* self, GstPadTemplate* templ, const gchar* name) {
  LfFragmentPad* pad = static_cast<LfFragmentPad*>(
      g_object_new(LF_TYPE_FRAGMENT_PAD, "name", name, "direction", templ->direction, "template", templ, nullptr));
  pad->input = new lf::CameraInput(self, pad, self->state->node);
  GST_PAD_SET_ACCEPT_INTERSECT(GST_PAD(pad));  // GPU caps may omit the texture target if it is 2D
  gst_pad_set_chain_function(GST_PAD(pad), lf::callback<lf_fragment_camera_chain>);
  gst_pad_set_event_function(GST_PAD(pad), lf::callback<lf_fragment_camera_event>);
  gst_pad_set_query_function(GST_PAD(pad), lf::callback<lf_fragment_camera_query>);
  return GST_PAD(pad);
}

std::vector<lf::PadPtr> lf_fragment_camera_pads(LfFragment* self) {
  std::vector<lf::PadPtr> pads;
  const lf::ObjectLock lock(self);
  for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next)
    if (LF_IS_FRAGMENT_PAD(item->data)) pads.emplace_back(GST_PAD(gst_object_ref(item->data)));
  return pads;
}

static lf::CameraInput& input_of(const lf::PadPtr& pad) { return *LF_FRAGMENT_PAD(pad.get())->input; }

void lf_fragment_set_mode(LfFragment* self, lf::CameraFrames::Mode mode, std::optional<lf::CameraFrames::Mode> before) {
  const bool running = mode == lf::CameraFrames::Mode::kRunning;
  lf::CameraInputs& inputs = self->state->node.inputs();
  lf::ObjectLock lock(self);
  if (before && self->state->mode != *before) return;
  self->state->mode = mode;
  for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next) {
    if (!LF_IS_FRAGMENT_PAD(item->data)) continue;
    const auto& frames = LF_FRAGMENT_PAD(item->data)->input->frames();
    frames->set_mode(mode);
    if (running) inputs.add(frames);
  }
  lock.unlock();
  inputs.set_running(running);
}

uint64_t lf_fragment_needed_delay(LfFragment* self, uint64_t now) {
  uint64_t needed = 0;
  for (const lf::PadPtr& pad : lf_fragment_camera_pads(self))
    needed = std::max(needed, input_of(pad).needed_delay(now));
  return needed;
}

// Returns the seek position for frames of `time`. The position is a little earlier, because a decoder may stamp the
// first frame with the seek position. It is also before the last frame, because that frame is valid for all later
// times.
static gint64 seek_position(const lf::PadPtr& pad, uint64_t time) {
  const auto camera = input_of(pad).camera();
  const gint64 offset = camera ? static_cast<gint64>(camera->time_offset * GST_SECOND) : 0;
  const gint64 before = GST_SECOND + 2 * static_cast<gint64>(input_of(pad).frames()->period());
  gint64 position = static_cast<gint64>(time) - offset, duration = 0;
  if (gst_pad_peer_query_duration(pad.get(), GST_FORMAT_TIME, &duration) && duration > 0)
    position = MIN(position, duration);
  return MAX(position - before, 0);
}

void lf_fragment_seek_cameras(LfFragment* self, uint64_t time, guint32 seqnum) {
  const std::lock_guard seeking(self->state->seeking);
  if (!self->state->seek_filter.is_new(seqnum)) return;
  std::vector<lf::PadPtr> pads = lf_fragment_camera_pads(self);
  std::erase_if(pads, [](const lf::PadPtr& pad) { return input_of(pad).is_live(); });
  lf_fragment_set_mode(self, lf::CameraFrames::Mode::kRunning, lf::CameraFrames::Mode::kFinished);
  for (const lf::PadPtr& pad : pads) {
    const gint64 position = seek_position(pad, time);
    GST_DEBUG_OBJECT(pad.get(), "seeking to %" GST_TIME_FORMAT, GST_TIME_ARGS(position));
    GstEvent* seek = gst_event_new_seek(1, GST_FORMAT_TIME, GstSeekFlags(GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE),
                                        GST_SEEK_TYPE_SET, position, GST_SEEK_TYPE_NONE, -1);
    gst_event_set_seqnum(seek, seqnum);
    if (!gst_pad_push_event(pad.get(), seek))
      GST_ELEMENT_WARNING(
          self, RESOURCE, SEEK,
          ("Pad %s: the camera cannot seek, so it continues at its own position. Use a seekable file if its frames "
           "must follow the requested times.",
           GST_PAD_NAME(pad.get())),
          (nullptr));
  }
}

void lf_fragment_note_context(LfFragment* self, GstGLContext* context) {
  const lf::ObjectLock lock(self);
  lf::WeakGlContext& latest = self->state->frames_context;
  if (latest.get().get() != context) latest = context ? lf::WeakGlContext(context) : lf::WeakGlContext();
}
