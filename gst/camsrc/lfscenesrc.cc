// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/lfscenesrc.h"

#include <gst/base/gstpushsrc.h>
#include <gst/video/video.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/schedule.h"
#include "common/common.h"
#include "common/day_clock.h"
#include "scene/scene.h"

G_DECLARE_FINAL_TYPE(LfSceneSrc, lf_scene_src, LF, SCENE_SRC, GstPushSrc)

struct _LfSceneSrc {
  GstPushSrc parent;
  lf::SceneCamera* camera;
  double time_offset;  // seconds
  GstVideoInfo info;
  guint64 next;  // number of the next frame
  GstClockTimeDiff day_offset;
};

G_DEFINE_TYPE(LfSceneSrc, lf_scene_src, GST_TYPE_PUSH_SRC)

static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("RGB")));

static GstCaps* lf_scene_src_get_caps(GstBaseSrc* base, GstCaps* filter) {
  LfSceneSrc* self = LF_SCENE_SRC(base);
  GstCaps* caps = gst_video_info_to_caps(&self->info);
  if (!filter) return caps;
  GstCaps* filtered = gst_caps_intersect_full(filter, caps, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(caps);
  return filtered;
}

static gboolean lf_scene_src_start(GstBaseSrc* base) {
  LF_SCENE_SRC(base)->next = 0;
  return TRUE;
}

static gboolean lf_scene_src_is_seekable(GstBaseSrc* base) { return !gst_base_src_is_live(base); }

static gboolean lf_scene_src_do_seek(GstBaseSrc* base, GstSegment* segment) {
  LfSceneSrc* self = LF_SCENE_SRC(base);
  if (segment->rate <= 0) return FALSE;
  self->next = lf::Schedule(self->info.fps_n, self->info.fps_d).first_from(segment->position);
  return TRUE;
}

// It has nothing that could run over: frames that come too late are left out.
static gboolean lf_scene_src_query(GstBaseSrc* base, GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY || !gst_base_src_is_live(base))
    return GST_BASE_SRC_CLASS(lf_scene_src_parent_class)->query(base, query);
  const GstVideoInfo& info = LF_SCENE_SRC(base)->info;
  gst_query_set_latency(query, TRUE, lf::Schedule(info.fps_n, info.fps_d).instant(1), GST_CLOCK_TIME_NONE);
  return TRUE;
}

// Goes on to the next frame that is not over already. Returns the time of day of running time 0; 0 where there is no
// clock.
static GstClockTime catch_up(LfSceneSrc* self, const lf::Schedule& schedule) {
  GstClock* clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) return 0;
  const GstClockTimeDiff offset = lf::day_offset(clock);
  const GstClockTime now = gst_clock_get_time(clock) + offset;
  gst_object_unref(clock);
  const GstClockTime base_time = gst_element_get_base_time(GST_ELEMENT(self)) + offset;
  if (std::exchange(self->day_offset, offset) != offset) self->next = 0;  // the clock of this machine was set
  self->next = std::max<guint64>(self->next, schedule.index_at(std::max(now, base_time)) + 1);
  return base_time;
}

static GstFlowReturn film(LfSceneSrc* self, GstBuffer** out) {
  const GstVideoInfo& info = self->info;
  const lf::Schedule schedule(info.fps_n, info.fps_d);
  const GstClockTime base_time = gst_base_src_is_live(GST_BASE_SRC(self)) ? catch_up(self, schedule) : 0;
  const GstClockTime stamp = schedule.instant(self->next);
  const GstClockTime end = schedule.instant(self->next + 1);
  ++self->next;

  const double time = static_cast<double>(stamp) / GST_SECOND + self->time_offset;
  const lf::Image image = lf::render_scene(*self->camera, time);

  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&info), nullptr);
  GstVideoFrame frame;
  if (!buffer || !gst_video_frame_map(&frame, &info, buffer, GST_MAP_WRITE)) {
    gst_clear_buffer(&buffer);
    GST_ELEMENT_ERROR(self, RESOURCE, FAILED, ("no memory for a frame"), (nullptr));
    return GST_FLOW_ERROR;
  }
  auto* row = static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, 0));
  for (int y = 0; y < image.height(); ++y, row += GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0))
    std::memcpy(row, image.pixel(0, y), static_cast<size_t>(image.width()) * 3);
  gst_video_frame_unmap(&frame);

  GST_BUFFER_PTS(buffer) = stamp - base_time;
  GST_BUFFER_DURATION(buffer) = end - stamp;
  *out = buffer;
  return GST_FLOW_OK;
}

static GstFlowReturn lf_scene_src_create(GstPushSrc* push, GstBuffer** out) {
  return lf::guarded(push, GST_FLOW_ERROR, [=] { return film(LF_SCENE_SRC(push), out); });
}

static void lf_scene_src_finalize(GObject* object) {
  delete LF_SCENE_SRC(object)->camera;
  G_OBJECT_CLASS(lf_scene_src_parent_class)->finalize(object);
}

static void lf_scene_src_class_init(LfSceneSrcClass* klass) {
  G_OBJECT_CLASS(klass)->finalize = lf_scene_src_finalize;
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(element_class, "Light field scene source", "Source/Video",
                                        "Films the built-in scene with one camera", "gst-lightfield");
  GstBaseSrcClass* base_class = GST_BASE_SRC_CLASS(klass);
  base_class->get_caps = lf::callback<lf_scene_src_get_caps>;
  base_class->start = lf::callback<lf_scene_src_start>;
  base_class->is_seekable = lf::callback<lf_scene_src_is_seekable>;
  base_class->do_seek = lf::callback<lf_scene_src_do_seek>;
  base_class->query = lf::callback<lf_scene_src_query>;
  GST_PUSH_SRC_CLASS(klass)->create = lf_scene_src_create;
}

static void lf_scene_src_init(LfSceneSrc* self) { gst_base_src_set_format(GST_BASE_SRC(self), GST_FORMAT_TIME); }

namespace lf {

GstElement* new_scene_source(const Camera& camera, int fps_n, int fps_d, bool live) {
  auto* self = LF_SCENE_SRC(g_object_new(lf_scene_src_get_type(), nullptr));
  self->camera = new SceneCamera{camera.width, camera.height, camera.lens, camera.pose};
  self->time_offset = camera.time_offset;
  gst_video_info_set_format(&self->info, GST_VIDEO_FORMAT_RGB, camera.width, camera.height);
  self->info.fps_n = fps_n;
  self->info.fps_d = fps_d;
  gst_base_src_set_live(GST_BASE_SRC(self), live);
  return GST_ELEMENT(self);
}

}  // namespace lf
