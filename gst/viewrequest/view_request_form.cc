// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Size and rate of pictures. Properties decide; where properties are not set, the caps behind the view's lfcompositor
// do.
#include <optional>
#include <utility>

#include "common/picture_caps.h"
#include "viewrequest/lfviewrequest_private.h"

using lf::PictureForm;

static PictureForm usual_form(const lf::RequestStream& stream) {
  return {stream.default_width(), stream.default_height(), lf::kUsualFps, 1};
}

// Views of a file have sizes of their own, but no rate.
static lf::SharedCaps without_size(const GstCaps* caps) {
  GstCaps* copy = gst_caps_copy(caps);
  for (guint i = 0; i < gst_caps_get_size(copy); i++)
    gst_structure_remove_fields(gst_caps_get_structure(copy, i), "width", "height", nullptr);
  return lf::share_caps(copy);
}

void lf_view_request_choose_form(LfViewRequest* self) {
  auto& state = *self->state;
  if (!state.stream) return;
  const lf::ViewRequestSettings& settings = state.settings;
  const PictureForm set{settings.width, settings.height, settings.fps_n, settings.fps_d};
  const PictureForm usual = usual_form(*state.stream);
  const bool from_file = state.stream->from_file();
  std::optional<PictureForm> fitted;
  if (state.downstream) {
    const lf::SharedCaps caps = from_file ? without_size(state.downstream.get()) : state.downstream;
    const lf::PlaceInSet place = settings.place(0);
    fitted = lf::fit_to_caps(caps.get(), set, usual, place.columns, place.rows);
  }
  state.form = fitted.value_or(lf::with_usual(set, usual));
  state.follows_caps = fitted && !from_file;
}

gboolean lf_view_request_follow_caps(LfViewRequest* self, lf::SharedCaps caps) {
  const lf::ObjectLock lock(self);
  self->state->downstream = std::move(caps);
  lf_view_request_choose_form(self);
  return self->state->stream && self->state->follows_caps;
}

void lf_view_request_begin_view(LfViewRequest* self, std::unique_ptr<lf::RequestStream> stream) {
  auto& state = *self->state;
  lf::ObjectLock lock(self);
  const lf::ViewRequestSettings settings = state.settings;
  auto share = state.control.visible_share();
  lock.unlock();
  if (stream) share = lf_view_request_visible_share(settings, stream->rig());  // before anything changes: may throw
  lf::ObjectLock again(self);
  if (stream) {
    // GstBaseSrc does not stop an element that could not seek to its beginning.
    state.stream = std::move(stream);
    state.downstream.reset();
    lf_view_request_choose_form(self);
  }
  const PictureForm form = state.form;
  const bool from_file = state.stream->from_file();
  lf::Viewpoint home = state.stream->default_viewpoint();
  again.unlock();
  if (share && !from_file) home = share->home(static_cast<double>(form.width) / form.height, 0, settings);
  lf_view_request_change_view(self, [&](lf::ViewControl& control) {
    control.begin(home);
    control.keep_visible(share);
    return TRUE;
  });
}

static PictureForm form_of(LfViewRequest* self) {
  const lf::ObjectLock lock(self);
  return self->state->form;
}

// Without an answer, as from a compositor on another host, pictures have the size and rate of the properties.
static void ask_downstream(LfViewRequest* self) {
  const PictureForm before = form_of(self);
  lf::SharedCaps caps = lf::query_picture_caps(GST_BASE_SRC_PAD(self), lf_view_request_view_id(self));
  if (!caps) return;
  lf_view_request_follow_caps(self, std::move(caps));
  const PictureForm now = form_of(self);
  const bool is_other_shape = now.width * before.height != before.width * now.height;
  if (is_other_shape && self->state->stream->next_number == 0) lf_view_request_begin_view(self);
}

// Makes requests at the rate of the current caps.
static void use_agreed_rate(LfViewRequest* self) {
  const lf::SharedCaps caps = lf::share_caps(gst_pad_get_current_caps(GST_BASE_SRC_PAD(self)));
  PictureForm agreed;
  if (!caps ||
      !gst_structure_get_fraction(gst_caps_get_structure(caps.get(), 0), "framerate", &agreed.fps_n, &agreed.fps_d))
    return;
  auto& state = *self->state;
  lf::ObjectLock lock(self);
  state.form.fps_n = agreed.fps_n, state.form.fps_d = agreed.fps_d;
  lock.unlock();
  if (agreed.fps_n == state.agreed.fps_n && agreed.fps_d == state.agreed.fps_d) return;
  state.agreed = agreed;
  if (!state.stream->schedule.set_rate(lf::Schedule(agreed.fps_n, agreed.fps_d)))
    GST_ELEMENT_WARNING(
        self, STREAM, FAILED,
        ("location: downstream asks for %d/%d pictures a second, but a list of views keeps the rate that "
         "it began with: put a videorate in between.",
         agreed.fps_n, agreed.fps_d),
        (nullptr));
  GST_INFO_OBJECT(self, "%d/%d requests a second", agreed.fps_n, agreed.fps_d);
  if (gst_base_src_is_live(GST_BASE_SRC(self)))
    gst_element_post_message(GST_ELEMENT(self), gst_message_new_latency(GST_OBJECT(self)));
}

// A relay gets its caps with the first request.
static gboolean lf_view_request_negotiate(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  if (self->state->relay.is_on()) return TRUE;
  ask_downstream(self);
  if (!GST_BASE_SRC_CLASS(g_type_class_peek(GST_TYPE_PUSH_SRC))->negotiate(base)) return FALSE;
  use_agreed_rate(self);
  return TRUE;
}

static GstCaps* lf_view_request_get_caps(GstBaseSrc* base, GstCaps* filter) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GstCaps* caps = gst_caps_make_writable(lf::unit_caps(LF_REQUEST_MEDIA_TYPE));
  lf::ObjectLock lock(self);
  const gint fps_n = self->state->settings.fps_n, fps_d = self->state->settings.fps_d;
  lock.unlock();
  if (fps_n > 0)
    gst_caps_set_simple(caps, "framerate", GST_TYPE_FRACTION, fps_n, fps_d, nullptr);
  else
    gst_caps_set_simple(caps, "framerate", GST_TYPE_FRACTION_RANGE, 1, G_MAXINT, G_MAXINT, 1, nullptr);
  if (!filter) return caps;
  GstCaps* filtered = gst_caps_intersect_full(filter, caps, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(caps);
  return filtered;
}

static GstCaps* lf_view_request_fixate(GstBaseSrc* base, GstCaps* caps) {
  const PictureForm form = form_of(LF_VIEW_REQUEST(base));
  caps = gst_caps_make_writable(caps);
  for (guint i = 0; i < gst_caps_get_size(caps); i++)
    gst_structure_fixate_field_nearest_fraction(gst_caps_get_structure(caps, i), "framerate", form.fps_n, form.fps_d);
  return GST_BASE_SRC_CLASS(g_type_class_peek(GST_TYPE_PUSH_SRC))->fixate(base, caps);
}

GstFlowReturn lf_view_request_follow_rate(LfViewRequest* self) {
  const PictureForm form = form_of(self);
  const PictureForm& agreed = self->state->agreed;
  if (form.fps_n == agreed.fps_n && form.fps_d == agreed.fps_d) return GST_FLOW_OK;
  if (gst_base_src_negotiate(GST_BASE_SRC(self))) return GST_FLOW_OK;
  return GST_PAD_IS_FLUSHING(GST_BASE_SRC_PAD(self)) ? GST_FLOW_FLUSHING : GST_FLOW_NOT_NEGOTIATED;
}

void lf_view_request_install_form(GstBaseSrcClass* klass) {
  klass->get_caps = lf::callback<lf_view_request_get_caps>;
  klass->fixate = lf::callback<lf_view_request_fixate>;
  klass->negotiate = lf::callback<lf_view_request_negotiate>;
}
