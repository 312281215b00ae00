// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "common/common.h"
#include "fragment/lffragment_private.h"

GST_DEBUG_CATEGORY_EXTERN(lf_fragment_debug);
#define GST_CAT_DEFAULT lf_fragment_debug

G_DEFINE_FINAL_TYPE(LfFragmentPad, lf_fragment_pad, GST_TYPE_PAD)

enum { PAD_PROP_0, PAD_PROP_CAMERA };

static void lf_fragment_pad_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfFragmentPad* pad = LF_FRAGMENT_PAD(object);
  if (id == PAD_PROP_CAMERA)
    pad->camera = g_value_get_int(value);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
}

static void lf_fragment_pad_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfFragmentPad* pad = LF_FRAGMENT_PAD(object);
  if (id == PAD_PROP_CAMERA)
    g_value_set_int(value, pad->camera);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
}

static void lf_fragment_pad_finalize(GObject* object) {
  delete LF_FRAGMENT_PAD(object)->input;
  G_OBJECT_CLASS(lf_fragment_pad_parent_class)->finalize(object);
}

static void lf_fragment_pad_class_init(LfFragmentPadClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = lf::callback<lf_fragment_pad_set_property>;
  object_class->get_property = lf::callback<lf_fragment_pad_get_property>;
  object_class->finalize = lf_fragment_pad_finalize;
  g_object_class_install_property(
      object_class, PAD_PROP_CAMERA,
      g_param_spec_int("camera", "Camera",
                       "Id of this pad's camera in the rig (-1: as the stream of lfcamsrc says, else the pad's number)",
                       -1, G_MAXINT, -1,
                       GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY)));
}

static void lf_fragment_pad_init(LfFragmentPad* pad) {
  pad->camera = -1;
  pad->input = new _LfFragmentPad::Input;
}

// Which camera this pad has; posts an error and returns false if there is none such or another pad has it.
bool lf_fragment_assign_camera(LfFragment* self, LfFragmentPad* pad) {
  auto& input = *pad->input;
  if (input.id) return true;
  const std::shared_ptr<const lf::Rig> rig = self->node->inputs().array()->rig;
  if (!rig) return false;  // the state change has failed with an error already
  const guint number = static_cast<guint>(g_ascii_strtoull(GST_PAD_NAME(pad) + strlen("sink_"), nullptr, 10));
  const guint id = pad->camera >= 0 ? static_cast<guint>(pad->camera) : input.from_stream.value_or(number);
  if (!rig->index_of_id(id)) {
    const std::string path = lf_fragment_settings(self).rig;
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS,
                      ("Pad %s: the rig %s has no camera %u.", GST_PAD_NAME(pad), path.c_str(), id),
                      ("%zu cameras in the rig", rig->cameras.size()));
    return false;
  }
  if (!self->node->inputs().set_camera(input.frames, id)) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("Pad %s: camera %u has a pad already.", GST_PAD_NAME(pad), id),
                      (nullptr));
    return false;
  }
  GST_OBJECT_LOCK(self);
  input.id = id;
  GST_OBJECT_UNLOCK(self);
  return true;
}

static bool lf_fragment_check_size(LfFragment* self, LfFragmentPad* pad, int width, int height) {
  const auto camera = self->node->inputs().camera(*pad->input->id);
  if (!camera || (width == camera->width && height == camera->height)) return true;
  const std::string path = lf_fragment_settings(self).rig;
  GST_ELEMENT_ERROR(self, STREAM, FORMAT,
                    ("Pad %s: the video of camera %u has %dx%d pixels, the rig %s says %dx%d.", GST_PAD_NAME(pad),
                     camera->id, width, height, path.c_str(), camera->width, camera->height),
                    (nullptr));
  return false;
}

// Only at the first frame of a format: which camera it is comes after the caps.
static bool lf_fragment_set_camera_format(LfFragment* self, LfFragmentPad* pad, const GstVideoInfo& info) {
  if (!lf_fragment_assign_camera(self, pad) || !lf_fragment_check_size(self, pad, info.width, info.height))
    return false;
  pad->input->format = info;
  return true;
}

// In the node's family, or in its own as long as that is not chosen.
static lf::CameraFrame lf_fragment_convert(LfFragment* self, LfFragmentPad* pad, GstBuffer* buffer) {
  auto& input = *pad->input;
  const lf::PixelFamily chosen = self->node->inputs().family();
  const bool open = chosen == lf::PixelFamily::kNone;
  const lf::PixelFamily family = open ? lf::family_of(*input.format) : chosen;
  if (!input.converter || input.converter->family() != family)
    input.converter = std::make_unique<lf::FrameConverter>(*input.format, family);
  return input.converter->convert(buffer, open);
}

static gboolean lf_fragment_camera_event(GstPad* gst_pad, GstObject* parent, GstEvent* event) {
  LfFragment* self = LF_FRAGMENT(parent);
  LfFragmentPad* pad = LF_FRAGMENT_PAD(gst_pad);
  gboolean ok = TRUE;
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CUSTOM_DOWNSTREAM_STICKY: {
      const GstStructure* structure = gst_event_get_structure(event);
      guint camera;
      const std::shared_ptr<const lf::Rig> rig = self->node->inputs().array()->rig;
      if (gst_structure_has_name(structure, LF_CAMERA_EVENT) && gst_structure_get_uint(structure, "camera", &camera) &&
          rig && camera < rig->cameras.size())
        pad->input->from_stream = rig->cameras[camera].id;
      gboolean paced = FALSE;
      if (gst_structure_get_boolean(structure, "paced", &paced) && paced)
        pad->input->frames->note_arrival(static_cast<int64_t>(pad->input->latency));
      break;
    }
    case GST_EVENT_CAPS: {
      GstCaps* caps;
      gst_event_parse_caps(event, &caps);
      GstVideoInfo info;
      pad->input->new_jpeg = gst_structure_has_name(gst_caps_get_structure(caps, 0), "image/jpeg");
      pad->input->new_format.reset();
      if (!pad->input->new_jpeg) {
        ok = gst_video_info_from_caps(&info, caps);
        if (!ok) break;
        pad->input->new_format = info;
      }
      self->node->inputs().set_family(pad->input->frames,
                                      pad->input->new_jpeg ? lf::PixelFamily::kI420 : lf::family_of(info));
      break;
    }
    case GST_EVENT_SEGMENT:
      pad->input->live = lf_fragment_upstream_is_live(gst_pad, &pad->input->latency);
      pad->input->frames->start_stream(pad->input->live);
      break;
    case GST_EVENT_CUSTOM_DOWNSTREAM:
      if (!gst_event_has_name(event, LF_CAMERA_LOST)) break;
      self->node->inputs().give_up(pad->input->frames);
      pad->input->frames->lose_stream();
      break;
    case GST_EVENT_EOS:
      self->node->inputs().give_up(pad->input->frames);
      pad->input->frames->end_stream();
      break;
    case GST_EVENT_FLUSH_START: pad->input->frames->set_flushing(true); break;
    case GST_EVENT_FLUSH_STOP: pad->input->frames->set_flushing(false); break;
    default: break;
  }
  gst_event_unref(event);  // a camera's events end here: answers follow the requests
  return ok;
}

// How many frames are kept here as long as requests do not look further back: a pool needs as many more.
static gboolean lf_fragment_propose_allocation(GstPad* pad, GstQuery* query) {
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  GstVideoInfo info;
  if (caps && gst_structure_has_name(gst_caps_get_structure(caps, 0), "video/x-raw") &&
      gst_video_info_from_caps(&info, caps)) {
    const size_t kept =
        lf_fragment_upstream_is_live(pad) ? lf::CameraFrames::kLiveFrames : lf::CameraFrames::kFileFrames;
    gst_query_add_allocation_pool(query, nullptr, static_cast<guint>(info.size), static_cast<guint>(kept + 1), 0);
  }
  gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
  return TRUE;
}

static gboolean lf_fragment_camera_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_ALLOCATION) return lf_fragment_propose_allocation(pad, query);
  return gst_pad_query_default(pad, parent, query);
}

// A camera whose pool has no buffer left stands still. Frames of a pool that what is kept here would exhaust are
// copied.
static GstBuffer* lf_fragment_spare_pool(LfFragmentPad* pad, GstBuffer* buffer) {
  constexpr size_t kForCamera = 3;  // one that is filled, one on its way, one to spare
  if (!buffer->pool) return buffer;
  GstStructure* config = gst_buffer_pool_get_config(buffer->pool);
  guint most = 0;
  gst_buffer_pool_config_get_params(config, nullptr, nullptr, nullptr, &most);
  gst_structure_free(config);
  if (most == 0 || pad->input->frames->held() + kForCamera < most) return buffer;
  GstBuffer* copy = gst_buffer_copy_deep(buffer);
  gst_buffer_unref(buffer);
  return copy;
}

// When a frame was taken, clock time where it is live, else stream time, which a seek does not begin anew: the stamp
// that lfcamsrc left, else PTS and the rig's time offset.
static uint64_t lf_fragment_capture_time(LfFragment* self, GstPad* pad, GstBuffer* buffer, double time_offset,
                                         bool live) {
  static GstStaticCaps reference_caps = GST_STATIC_CAPS(LF_CAPTURE_TIME_CAPS);
  GstCaps* reference = gst_static_caps_get(&reference_caps);
  const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(buffer, reference);
  gst_caps_unref(reference);
  if (meta) return meta->timestamp;
  uint64_t taken = 0;
  GstEvent* event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (event) {
    const GstSegment* segment;
    gst_event_parse_segment(event, &segment);
    const guint64 time = live ? gst_segment_to_running_time(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer))
                              : gst_segment_to_stream_time(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
    if (GST_CLOCK_TIME_IS_VALID(time)) taken = time;
    gst_event_unref(event);
  }
  if (live) taken += gst_element_get_base_time(GST_ELEMENT(self));
  const gint64 offset = static_cast<gint64>(time_offset * GST_SECOND);
  return offset < 0 && static_cast<uint64_t>(-offset) > taken ? 0 : taken + static_cast<uint64_t>(offset);
}

// Keeps a compressed frame; a damaged one is dropped and counted.
static GstFlowReturn lf_fragment_take_jpeg(LfFragment* self, LfFragmentPad* pad, GstBuffer* buffer, uint64_t time) {
  auto& input = *pad->input;
  const auto bytes = std::make_shared<const lf::MappedBuffer>(buffer);
  gst_buffer_unref(buffer);
  std::string reason;
  lf::CameraFrame frame;
  frame.time = time;
  frame.jpeg = lf::JpegFrame::open(bytes, bytes->bytes(), &reason);
  if (frame.jpeg) {
    const std::pair size(frame.jpeg->width(), frame.jpeg->height());
    const auto camera = self->node->inputs().camera(*input.id);
    if (camera && size == std::pair(camera->width, camera->height)) input.jpeg_size = size;
    if (size != input.jpeg_size && input.jpeg_size) {
      reason = "it is of another size than those before";
      frame.jpeg.reset();
    } else if (!input.jpeg_size && !lf_fragment_check_size(self, pad, size.first, size.second)) {
      return GST_FLOW_ERROR;  // the camera's own size is wrong from the first frame on
    }
  }
  if (frame.jpeg) return input.frames->push(std::move(frame));
  self->node->stats().damaged_frames++;
  if (!input.warned_damaged)
    GST_ELEMENT_WARNING(
        self, STREAM, DECODE,
        ("Pad %s: dropped a damaged frame of camera %u: %s.", GST_PAD_NAME(pad), *input.id, reason.c_str()),
        ("further ones are counted in stats"));
  input.warned_damaged = true;
  return input.frames->push_damaged(time);
}

static void lf_fragment_note_arrival(LfFragment* self, LfFragmentPad* pad, uint64_t captured) {
  if (!pad->input->live) return;
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) return;
  const GstClockTime now = gst_clock_get_time(clock);
  pad->input->arrivals.arrived(captured, now);
  // What the source states to take is no lateness.
  const GstClockTimeDiff late = GST_CLOCK_DIFF(captured, now);
  pad->input->frames->note_arrival(std::max(late, static_cast<GstClockTimeDiff>(pad->input->latency)));
}

// Frames come where no requests do any more.
static void lf_fragment_trim_memory(LfFragment* self) {
  constexpr gint64 kInterval = 10 * G_USEC_PER_SEC;
  const gint64 now = g_get_monotonic_time();
  const lf::ObjectLock lock(self);
  if (now < self->trimmed_at + kInterval) return;
  self->trimmed_at = now;
  for (PadPair* pair : *self->pairs) pair->memory->trim();
}

static GstFlowReturn lf_fragment_take_frame(LfFragment* self, GstPad* gst_pad, GstBuffer* buffer) {
  LfFragmentPad* pad = LF_FRAGMENT_PAD(gst_pad);
  lf_fragment_trim_memory(self);
  auto& input = *pad->input;
  if (input.new_format) {
    input.converter.reset();
    input.format.reset();
    input.jpeg = false;
    lf_fragment_set_camera_format(self, pad, *input.new_format);
    input.new_format.reset();
  }
  if (input.new_jpeg) {
    input.format.reset();
    input.new_jpeg = false;
    input.jpeg = lf_fragment_assign_camera(self, pad);
  }
  if (!input.format && !input.jpeg) {
    gst_buffer_unref(buffer);
    return GST_FLOW_NOT_NEGOTIATED;
  }
  buffer = lf_fragment_spare_pool(pad, buffer);
  const auto camera = self->node->inputs().camera(*input.id);
  const uint64_t time = lf_fragment_capture_time(self, gst_pad, buffer, camera ? camera->time_offset : 0, input.live);
  lf_fragment_note_arrival(self, pad, time);
  if (input.jpeg) return lf_fragment_take_jpeg(self, pad, buffer, time);
  lf::CameraFrame frame = lf_fragment_convert(self, pad, buffer);
  if (!frame.buffer) {
    GST_WARNING_OBJECT(gst_pad, "dropped a frame that can't be mapped");
    return GST_FLOW_OK;
  }
  frame.time = time;
  return input.frames->push(std::move(frame));
}

// Where to seek a camera for frames of `time`: a little before it, because a decoder may stamp the first frame behind a
// seek with where it was sought, and before the last frame, because that stands for all times after it.
static gint64 lf_fragment_seek_position(GstPad* pad, LfFragment* self, uint64_t time) {
  const auto& input = *LF_FRAGMENT_PAD(pad)->input;
  GST_OBJECT_LOCK(self);
  const std::optional<guint> id = input.id;
  GST_OBJECT_UNLOCK(self);
  const auto camera = id ? self->node->inputs().camera(*id) : nullptr;
  const gint64 offset = camera ? static_cast<gint64>(camera->time_offset * GST_SECOND) : 0;
  const gint64 before = GST_SECOND + 2 * static_cast<gint64>(input.frames->period());
  gint64 position = static_cast<gint64>(time) - offset, duration = 0;
  if (gst_pad_peer_query_duration(pad, GST_FORMAT_TIME, &duration) && duration > 0) position = MIN(position, duration);
  return MAX(position - before, 0);
}

uint64_t lf_fragment_needed_delay(LfFragment* self, uint64_t now) {
  uint64_t needed = 0;
  GST_OBJECT_LOCK(self);
  for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next) {
    if (!LF_IS_FRAGMENT_PAD(item->data)) continue;
    const auto& input = *LF_FRAGMENT_PAD(item->data)->input;
    needed = MAX(needed, input.arrivals.needed(input.frames->period(), now));
  }
  GST_OBJECT_UNLOCK(self);
  return needed;
}

void lf_fragment_seek_cameras(LfFragment* self, uint64_t time, guint32 seqnum) {
  g_mutex_lock(&self->seek_lock);
  if (std::exchange(self->seek_seqnum, seqnum) == seqnum) return g_mutex_unlock(&self->seek_lock);
  std::vector<PadPtr> pads;
  lf::ObjectLock lock(self);
  const bool finished = self->mode == lf::CameraFrames::Mode::kFinished;
  for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next)
    if (LF_IS_FRAGMENT_PAD(item->data) && !LF_FRAGMENT_PAD(item->data)->input->live)
      pads.emplace_back(GST_PAD(gst_object_ref(item->data)));
  lock.unlock();
  if (finished) lf_fragment_set_mode(self, lf::CameraFrames::Mode::kRunning);
  for (const PadPtr& pad : pads) {
    const gint64 position = lf_fragment_seek_position(pad.get(), self, time);
    GST_DEBUG_OBJECT(pad.get(), "seeking to %" GST_TIME_FORMAT, GST_TIME_ARGS(position));
    GstEvent* seek = gst_event_new_seek(1, GST_FORMAT_TIME, GstSeekFlags(GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE),
                                        GST_SEEK_TYPE_SET, position, GST_SEEK_TYPE_NONE, -1);
    gst_event_set_seqnum(seek, seqnum);
    if (!gst_pad_push_event(pad.get(), seek))
      GST_ELEMENT_WARNING(self, RESOURCE, SEEK,
                          ("Pad %s: its camera can't be sought; it shows what it has.", GST_PAD_NAME(pad.get())),
                          (nullptr));
  }
  g_mutex_unlock(&self->seek_lock);
}

static GstFlowReturn lf_fragment_camera_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  return lf::guarded_buffer(parent, [=] { return lf_fragment_take_frame(LF_FRAGMENT(parent), pad, buffer); });
}

GstPad* lf_fragment_camera_pad_new(GstPadTemplate* templ, const gchar* name, lf::CameraFrames::Mode mode) {
  LfFragmentPad* pad = static_cast<LfFragmentPad*>(
      g_object_new(LF_TYPE_FRAGMENT_PAD, "name", name, "direction", templ->direction, "template", templ, nullptr));
  pad->input->frames = std::make_shared<lf::CameraFrames>();
  pad->input->frames->set_mode(mode);
  gst_pad_set_chain_function(GST_PAD(pad), lf::callback<lf_fragment_camera_chain>);
  gst_pad_set_event_function(GST_PAD(pad), lf::callback<lf_fragment_camera_event>);
  gst_pad_set_query_function(GST_PAD(pad), lf::callback<lf_fragment_camera_query>);
  return GST_PAD(pad);
}

void lf_fragment_camera_pad_reset(LfFragment* self, LfFragmentPad* pad) {
  auto& input = *pad->input;
  self->node->inputs().remove(input.frames);
  input.frames->clear();
  input.arrivals.clear();
  input.converter.reset();
  input.format.reset();
  input.new_format.reset();
  input.jpeg_size.reset();
  input.new_jpeg = input.jpeg = input.warned_damaged = false;
  GST_OBJECT_LOCK(self);
  input.id.reset();
  GST_OBJECT_UNLOCK(self);
  input.from_stream.reset();
}
