// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>

#include "base/error.h"
#include "common/pixel_family.h"
#include "composite/assembly.h"
#include "compositor/lfcompositor_private.h"
#include "compositor/output_caps.h"

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

// What the base class asks of its own accord, when downstream has changed, is answered when the next picture is made:
// that downstream takes none ends this view, not the stream of requests, which others share.
gboolean lf_compositor_negotiate(GstAggregator* agg) {
  auto& state = *LF_COMPOSITOR(agg)->state;
  // Before the first request there is nothing to agree on, which the base class would warn of (1.22).
  state.agreed = state.wanted.width > 0 && GST_AGGREGATOR_CLASS(g_type_class_peek(GST_TYPE_AGGREGATOR))->negotiate(agg);
  return TRUE;
}

GstFlowReturn lf_compositor_update_src_caps(GstAggregator* agg, GstCaps* downstream, GstCaps** caps) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  const auto& wanted = self->state->wanted;
  *caps = self->partial ? lf::unit_caps(LF_ANSWER_MEDIA_TYPE)
                        : lf::choose_output_caps(downstream, self->request, wanted.family, wanted.width, wanted.height);
  return *caps ? GST_FLOW_OK : GST_FLOW_NOT_NEGOTIATED;
}

gboolean lf_compositor_negotiated_src_caps(GstAggregator* agg, GstCaps* caps) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  auto& state = *self->state;
  GstVideoInfo info = {};
  if (!self->partial && !gst_video_info_from_caps(&info, caps)) return FALSE;
  if (!state.negotiated || !gst_video_info_is_equal(&info, &state.info)) gst_clear_buffer(&state.last_picture);
  state.info = info;
  state.negotiated = true;
  return TRUE;
}

gboolean lf_compositor_decide_allocation(GstAggregator* agg, GstQuery* query) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  if (!self->partial) return self->state->pool.decide(query);
  while (gst_query_get_n_allocation_pools(query) > 0) gst_query_remove_nth_allocation_pool(query, 0);
  return TRUE;  // answers have memory of their own
}

// Has the base class agree with downstream on caps and memory for pictures like this.
static GstFlowReturn agree_on(LfCompositor* self, lf::PixelFamily family, int width, int height) {
  auto& state = *self->state;
  state.wanted = {family, width, height};
  gst_aggregator_negotiate(GST_AGGREGATOR(self));
  if (state.agreed) return GST_FLOW_OK;
  if (GST_PAD_IS_FLUSHING(GST_AGGREGATOR_SRC_PAD(self))) return GST_FLOW_FLUSHING;
  if (self->partial) {
    GST_ELEMENT_ERROR(self, STREAM, FORMAT, ("Downstream takes no answers."), (nullptr));
    return GST_FLOW_NOT_NEGOTIATED;
  }
  const char* name = family == lf::PixelFamily::kI420 ? "I420" : "RGB";
  GST_ELEMENT_ERROR(
      self, STREAM, FORMAT,
      ("Downstream takes no %s video of %dx%d pixels: put a videoconvert behind lfcompositor.", name, width, height),
      (nullptr));
  return GST_FLOW_NOT_NEGOTIATED;
}

static GstFlowReturn no_memory(LfCompositor* self) {
  GST_ELEMENT_ERROR(self, RESOURCE, NO_SPACE_LEFT, ("No memory for a picture."), (nullptr));
  return GST_FLOW_ERROR;
}

static GstFlowReturn agree_on_picture(LfCompositor* self, lf::PixelFamily family, int width, int height) {
  auto& state = *self->state;
  const bool same = state.info.width == width && state.info.height == height &&
                    (family == lf::PixelFamily::kNone || lf::family_of(state.info) == family);
  return same && state.agreed ? GST_FLOW_OK : agree_on(self, family, width, height);
}

static GstBuffer* take_picture(LfCompositor* self) {
  GstBufferPool* pool = gst_aggregator_get_buffer_pool(GST_AGGREGATOR(self));
  GstBuffer* picture = self->state->pool.take(pool);
  gst_clear_object(&pool);
  return picture;
}

// Where a picture's colours are: R, G and B in one plane, or Y, Cb and Cr.
struct Planes {
  explicit Planes(const GstVideoFrame& frame) {
    const guint count = lf::family_of(frame.info) == lf::PixelFamily::kRgb ? 1 : 3;
    for (guint i = 0; i < count; i++) {
      data[i] = static_cast<uint8_t*>(count == 1 ? GST_VIDEO_FRAME_PLANE_DATA(&frame, 0)
                                                 : GST_VIDEO_FRAME_COMP_DATA(&frame, i));
      stride[i] = count == 1 ? GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0) : GST_VIDEO_FRAME_COMP_STRIDE(&frame, i);
    }
  }
  uint8_t* data[3] = {};
  ptrdiff_t stride[3] = {};
};

// What is wholly lost is taken from the picture before, if not part of the picture is made with another rig than that.
static void conceal(LfCompositor* self, const Planes& picture) {
  auto& state = *self->state;
  if (state.assembly.fragments() > 0 && state.assembly.rig_hash() != state.last_rig) return;
  GstVideoFrame before;
  if (!state.last_picture || !gst_video_frame_map(&before, &state.info, state.last_picture, GST_MAP_READ)) return;
  lf::ImageView view;
  view.family = lf::family_of(state.info);
  view.width = state.info.width;
  view.height = state.info.height;
  if (view.family == lf::PixelFamily::kRgb) view.layout = lf::rgb_layout(state.info);
  const Planes planes(before);
  std::ranges::copy(planes.data, view.plane);
  std::ranges::copy(planes.stride, view.stride);
  state.assembly.picture().conceal(view, picture.data, picture.stride);
  gst_video_frame_unmap(&before);
}

static GstBuffer* make_video(LfCompositor* self, const lf::Background& background, GstFlowReturn* flow) {
  auto& state = *self->state;
  const lf::View& view = state.current->view;
  *flow = agree_on_picture(self, state.assembly.family(), view.width, view.height);
  if (*flow != GST_FLOW_OK) return nullptr;
  // It would show the picture before, and the work would make a machine that is too slow slower still.
  if (state.last_picture && state.assembly.all_is_missing()) return gst_buffer_copy(state.last_picture);
  state.assembly.finish(lf::family_of(state.info), background != lf::Background{});

  GstBuffer* out = take_picture(self);
  GstVideoFrame frame;
  if (!out || !gst_video_frame_map(&frame, &state.info, out, GST_MAP_WRITE)) {
    if (out) gst_buffer_unref(out);
    *flow = GST_PAD_IS_FLUSHING(GST_AGGREGATOR_SRC_PAD(self)) ? GST_FLOW_FLUSHING : no_memory(self);
    return nullptr;
  }
  const Planes planes(frame);
  const lf::RgbLayout layout =
      lf::family_of(state.info) == lf::PixelFamily::kRgb ? lf::rgb_layout(state.info) : lf::RgbLayout{};
  const lf::Levels levels = lf::has_video_levels(state.info) ? lf::kVideoLevels : lf::kFullLevels;
  state.assembly.picture().resolve(background, layout, planes.data, planes.stride, levels);
  if (!lf_compositor_is_complete(self)) conceal(self, planes);
  gst_video_frame_unmap(&frame);
  return out;
}

static GstFlowReturn agree_on_answers(LfCompositor* self) {
  auto& state = *self->state;
  if (state.agreed) return GST_FLOW_OK;
  const lf::View& view = state.current->view;
  const GstFlowReturn flow = agree_on(self, lf::PixelFamily::kNone, view.width, view.height);
  if (flow == GST_FLOW_OK) state.root_is_near = lf::compositor_is_near(GST_AGGREGATOR_SRC_PAD(self));
  return flow;
}

static GstBuffer* make_answer(LfCompositor* self, guint node, lf::CodecChoice codec, GstFlowReturn* flow) {
  auto& state = *self->state;
  *flow = agree_on_answers(self);
  if (*flow != GST_FLOW_OK) return nullptr;
  lf::Assembly& assembly = state.assembly;
  assembly.finish_partial();
  const lf::ViewRequest& request = *state.current;
  lf::wire::AnswerHeader header;
  header.view_id = request.view_id;
  header.sequence = request.sequence;
  header.view_width = request.view.width;
  header.view_height = request.view.height;
  header.family = assembly.family();
  header.target_time = request.target_time;
  header.actual_time = assembly.actual_time();
  header.rig_hash = assembly.rig_hash();
  header.node = node;
  header.cameras = header.blind = assembly.cameras();
  header.blind.remove(assembly.seeing());
  const lf::CodedAs form = lf::choose_codec(codec, state.root_is_near, request.quality);
  try {
    *flow = GST_FLOW_OK;
    return lf::wrap_answer(lf::partial_answer(header, assembly.picture(), form, state.memory->take()), state.memory);
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, STREAM, ENCODE, ("View %u: %s.", request.view_id, error.what()), (nullptr));
    *flow = GST_FLOW_ERROR;
    return nullptr;
  }
}

GstBuffer* lf_compositor_make_picture(LfCompositor* self, GstFlowReturn* flow) {
  GST_OBJECT_LOCK(self);
  const guint32 argb = self->background;
  const bool partial = self->partial;
  const guint node = self->node;
  const lf::CodecChoice codec = self->codec;
  GST_OBJECT_UNLOCK(self);
  if (partial) return make_answer(self, node, codec, flow);
  const lf::Background background{static_cast<uint8_t>(argb >> 16), static_cast<uint8_t>(argb >> 8),
                                  static_cast<uint8_t>(argb)};
  return make_video(self, background, flow);
}
