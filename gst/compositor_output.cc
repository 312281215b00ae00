// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/error.h"
#include "camera_image.h"
#include "composite/partial_answer.h"
#include "lfcompositor_private.h"
#include "output_caps.h"

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

// Output caps follow the requests and answers, not the sink caps: aggregate() sees to them.
gboolean lf_compositor_negotiate(GstAggregator* agg) {
  LF_COMPOSITOR(agg)->state->renegotiate = true;
  return TRUE;
}

static GstFlowReturn no_memory(LfCompositor* self) {
  GST_ELEMENT_ERROR(self, RESOURCE, NO_SPACE_LEFT, ("No memory for a picture."), (nullptr));
  return GST_FLOW_ERROR;
}

static GstFlowReturn agree_on_picture(LfCompositor* self, lf::PixelFamily family, int width, int height) {
  auto& state = *self->state;
  const bool same = state.info.width == width && state.info.height == height &&
                    (family == lf::PixelFamily::kNone || lf::family_of(state.info) == family);
  if (same && !state.renegotiate) return GST_FLOW_OK;
  GstCaps* caps = lf::choose_output_caps(GST_AGGREGATOR_SRC_PAD(self), self->request, family, width, height);
  GstVideoInfo info;
  if (!caps || !gst_video_info_from_caps(&info, caps)) {
    const char* name = family == lf::PixelFamily::kI420 ? "I420" : "RGB";
    GST_ELEMENT_ERROR(
        self, STREAM, FORMAT,
        ("Downstream takes no %s video of %dx%d pixels: put a videoconvert behind lfcompositor.", name, width, height),
        (nullptr));
    if (caps) gst_caps_unref(caps);
    return GST_FLOW_NOT_NEGOTIATED;
  }
  gst_caps_unref(caps);
  lf::set_system_colorimetry(info);
  caps = gst_video_info_to_caps(&info);
  gst_clear_buffer(&state.last_picture);  // of another size or format
  state.info = info;
  state.renegotiate = false;
  state.negotiated = true;
  gst_aggregator_set_src_caps(GST_AGGREGATOR(self), caps);
  const bool ready = state.pool.configure(GST_AGGREGATOR_SRC_PAD(self), caps, info.size);
  gst_caps_unref(caps);
  return ready ? GST_FLOW_OK : no_memory(self);
}

// What is wholly lost is taken from the picture before, if not part of the picture is made with another rig than that.
static void conceal(LfCompositor* self, GstVideoFrame* frame) {
  auto& state = *self->state;
  if (state.assembly.fragments() > 0 && state.assembly.rig_hash() != state.last_rig) return;
  GstVideoFrame before;
  if (!state.last_picture || !gst_video_frame_map(&before, &state.info, state.last_picture, GST_MAP_READ)) return;
  lf::ImageView view;
  view.family = lf::family_of(state.info);
  view.width = state.info.width;
  view.height = state.info.height;
  if (view.family == lf::PixelFamily::kRgb) view.layout = lf::rgb_layout(state.info);
  uint8_t* plane[3] = {};
  ptrdiff_t stride[3] = {};
  for (guint i = 0; i < GST_VIDEO_FRAME_N_PLANES(frame); i++) {
    plane[i] = static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(frame, i));
    stride[i] = GST_VIDEO_FRAME_PLANE_STRIDE(frame, i);
    view.plane[i] = static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&before, i));
    view.stride[i] = GST_VIDEO_FRAME_PLANE_STRIDE(&before, i);
  }
  state.assembly.picture().conceal(view, plane, stride);
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

  GstBuffer* out = state.pool.take();
  GstVideoFrame frame;
  if (!out || !gst_video_frame_map(&frame, &state.info, out, GST_MAP_WRITE)) {
    if (out) gst_buffer_unref(out);
    *flow = GST_PAD_IS_FLUSHING(GST_AGGREGATOR_SRC_PAD(self)) ? GST_FLOW_FLUSHING : no_memory(self);
    return nullptr;
  }
  uint8_t* plane[3] = {};
  ptrdiff_t stride[3] = {};
  for (guint i = 0; i < GST_VIDEO_FRAME_N_PLANES(&frame); i++) {
    plane[i] = static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, i));
    stride[i] = GST_VIDEO_FRAME_PLANE_STRIDE(&frame, i);
  }
  const lf::RgbLayout layout =
      lf::family_of(state.info) == lf::PixelFamily::kRgb ? lf::rgb_layout(state.info) : lf::RgbLayout{};
  state.assembly.picture().resolve(background, layout, plane, stride);
  if (!lf_compositor_is_complete(self)) conceal(self, &frame);
  gst_video_frame_unmap(&frame);
  return out;
}

static void agree_on_answers(LfCompositor* self) {
  auto& state = *self->state;
  if (state.negotiated && !state.renegotiate) return;
  GstCaps* caps = lf::unit_caps(LF_ANSWER_MEDIA_TYPE);
  gst_aggregator_set_src_caps(GST_AGGREGATOR(self), caps);
  gst_caps_unref(caps);
  state.root_is_near = lf::compositor_is_near(GST_AGGREGATOR_SRC_PAD(self));
  state.negotiated = true;
  state.renegotiate = false;
}

static GstBuffer* make_answer(LfCompositor* self, guint node, lf::CodecChoice codec, GstFlowReturn* flow) {
  auto& state = *self->state;
  agree_on_answers(self);
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
  const lf::CodedAs form = lf::choose_codec(codec, true, state.root_is_near, request.quality);
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
