// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfviewrequest
 * @title: lfviewrequest
 * @short_description: the virtual camera of one viewer, as a stream of view requests
 *
 * Each buffer asks for one picture: pose, lens, size and focal plane of the view, and the capture time it should show.
 * Nodes (lffragment, lfcameranode) answer it, lfcompositor makes a picture of the answers.
 *
 * Where the view comes from:
 *
 * - `location`: a views.json file. One request per view, stamped with the view's time, then EOS. Where all views have
 *   the same time they are stamped one frame after the other, while each still asks for its own capture time. Sizes
 *   are the file's.
 * - else the properties `x`, `y`, `z`, `yaw`, `pitch`, `roll`, `fov`, `focus-distance`, `aperture`: one request per
 * frame. They are controllable; a GstController is asked for the stamp of each request. With `rig` those that are not
 * set are chosen so that the view stands in the middle of the array and looks where it looks; with `keep-visible`
 * inside of a triangle of cameras, and with the widest field of view that leaves no pixel of this shape dark.
 * - while running, these can be changed: by setting them; by mouse and keys, i.e. GstNavigation events from a video
 *   sink (drag: orbit about the point in focus; shift-drag or another button: pan; wheel: zoom on what is under it;
 *   ctrl-wheel: focus; arrows: orbit; w s a d q e: fly forward, back, left, right, down, up; + -: zoom; [ ]: focus
 *   nearer, farther; r: back to the start; all of it as far as the array sees, see `keep-visible`); by a custom
 * upstream event with a structure "lightfield-view-request" with any of the properties as fields (and focus-continuous,
 * 0 or 1); by the action signal `set-view` with such a structure. The very next request has the change, and the
 * properties notify.
 *
 * `width`, `height` and `framerate` that are not set are chosen to suit the caps behind the view's lfcompositor, where
 * that is in this process: before the first request, and again when these caps change. Where caps leave them open they
 * are those of the rig's cameras and 15/1.
 *
 * How many cameras make a pixel: three, blended by the triangles of the array; with `aperture` all within a synthetic
 * aperture of that diameter; with `nearest-cameras` those that see most nearly what the view sees. Views of a file are
 * blended so, too. With `access=warp` it is always three.
 *
 * What lfcompositor learns of the view comes back as an upstream event, "lightfield-feedback": the focal surface of the
 * next request, cameras out of service, which the view's requests name from then on, beside those of the property
 * `out-of-service`, and what it wants to know beside its pictures (`lfcompositor monitor-interval`), which leaves
 * behind the next request, with the same capture time.
 *
 * With its sink pad linked the element makes no requests of its own but relays those of other viewers, and adds the
 * cameras that are out of service: on the host of the compositors, behind the network. Live, it also gives them the
 * focal surfaces that lfcompositors find where no viewer takes them.
 *
 * For cameras that do not answer view requests (`lffragment access`) `access` makes commands of each request, which
 * leave behind it. A relay lets no commands through, because they were made before it knew which cameras are out of
 * service: it makes them itself.
 *
 * With `views` there is more than one eye, and a request for each: a stereo pair, a row, a quilt for displays of light
 * fields. They are of one moment and have one focal surface, which is found for the view next to the middle and carried
 * over to the others. lfcompositor makes one picture of them, with GStreamer's multiview-mode for pairs. Each view must
 * have an even width and height. Mouse and keys move all of them together.
 *
 * Upstream events that carry a field "lightfield-view-id" (uint) are for the view of that id alone.
 *
 * Not live, requests leave as fast as they are taken and ask for the stream time of their frame. Where an lfcompositor
 * finds the focus, up to eight rehearsals leave before the first one, and before the first one behind a seek: requests
 * for the same moment of which no picture is made, so that the first picture is in focus. While an lfcompositor
 * has them sought (upstream event "lightfield-hold") none leaves, so that viewers in one funnel flush first and go on
 * together. Live, they leave at
 * the instants of the capture schedule (multiples of the frame time on the pipeline's clock) plus `capture-delay`, and
 * ask for that instant in clock time; instants that passed while downstream was blocked are left out. Their time stamp
 * is the running time of that instant, so that of the picture is when it was captured, and `capture-delay` is told as
 * latency: sound that is captured beside it stays in step. Left to itself (-1) it is what the nodes of this process
 * find that their cameras need (upstream event "lightfield-capture-delay"): how long after their stamps all but one of
 * a hundred frames arrive, and half a frame; LATENCY messages tell when that changes. With `eager` a change of the view
 * is asked for at once, in place of the next instant. A relay tells the latency of the requests that it relays.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lfcameranode name=n rig=rig.json ! c.sink_0  r. ! queue ! c.request \
 *   lfcompositor name=c rig=rig.json ! videoconvert ! pngenc ! multifilesink location=out_%02d.png
 * ]| Pictures of the views in a file.
 * |[
 * gst-launch-1.0 lfviewrequest rig=rig.json is-live=true width=640 height=480 framerate=30/1 ! tee name=r \
 *   r. ! queue leaky=downstream ! n.request  lfcameranode name=n rig=rig.json is-live=true ! c.sink_0 \
 *   r. ! queue leaky=downstream ! c.request  lfcompositor name=c rig=rig.json ! videoconvert ! autovideosink
 * ]| A window in which mouse and keys fly.
 * |[
 * gst-launch-1.0 tcpserversrc port=5000 ! lfparse ! lfviewrequest is-live=true ! tee name=r  r. ! queue ! n.request \
 *   lfcameranode name=n rig=rig.json is-live=true ! c.sink_0  r. ! queue ! c.request \
 *   lfcompositor name=c rig=rig.json ! videoconvert ! autovideosink
 * ]| The requests of a viewer on another host.
 */

#include <memory>
#include <utility>

#include "base/error.h"
#include "viewrequest/lfviewrequest_private.h"

GST_DEBUG_CATEGORY(lf_view_request_debug);

static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_CAPS ", framerate = (fraction) [ 0/1, max ]"));

G_DEFINE_FINAL_TYPE(LfViewRequest, lf_view_request, GST_TYPE_PUSH_SRC)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfviewrequest, "lfviewrequest", GST_RANK_NONE, LF_TYPE_VIEW_REQUEST,
                                      GST_DEBUG_CATEGORY_INIT(lf_view_request_debug, "lfviewrequest", 0,
                                                              "source of view requests"))

void lf_view_request_set_in_process(LfViewRequest* self, gboolean in_process) { self->state->in_process = in_process; }

static gboolean lf_view_request_stop(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  auto& state = *self->state;
  state.navigation_tap.detach();
  lf::ObjectLock lock(self);
  state.stream.reset();
  lock.unlock();
  state.turn.forget_seek();
  state.sought.clear();
  state.outbox.clear();
  state.focus_wait.clear();
  state.warned_commands = false;
  state.extra.clear();
  state.focus.clear();
  state.auto_delay.clear();
  state.relay.clear();
  state.relayed_focus.clear();
  state.out_of_service.clear();
  return TRUE;
}

static gboolean lf_view_request_start(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  lf::ObjectLock lock(self);
  const lf::ViewRequestSettings settings = self->state->settings;
  lock.unlock();

  try {
    lf::validate(settings.place(0), 0, 0);
    lf_view_request_begin_view(self, std::make_unique<lf::RequestStream>(settings));
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return FALSE;
  }
  lf_view_request_warn_without_effect(self);
  lf::ObjectLock again(self);
  const lf::RequestStream& stream = *self->state->stream;
  base->segment.duration = stream.schedule.end().value_or(GST_CLOCK_TIME_NONE);
  self->state->requests_left = settings.num_buffers;
  self->state->agreed = self->state->form;  // the rate that the stream begins with
  again.unlock();
  GST_INFO_OBJECT(self, "view %u from %s", settings.view_id,
                  stream.from_file() ? settings.location.c_str() : "properties");
  const auto navigated = [](GstElement* element, GstEvent* event) {
    if (lf_view_request_is_steering(event)) lf_view_request_steer(LF_VIEW_REQUEST(element), event);
  };
  if (!settings.navigation_from.empty() &&
      !self->state->navigation_tap.attach(GST_ELEMENT(self), settings.navigation_from, navigated)) {
    GST_ELEMENT_ERROR(
        self, RESOURCE, SETTINGS,
        ("navigation-from: the pipeline has no element \"%s\" with a source pad.", settings.navigation_from.c_str()),
        (nullptr));
    lf_view_request_stop(base);  // GstBaseSrc stops what has started alone
    return FALSE;
  }
  return TRUE;
}

static gboolean lf_view_request_is_seekable(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GST_OBJECT_LOCK(self);
  const bool loop = self->state->settings.loop;
  GST_OBJECT_UNLOCK(self);
  return !loop && !gst_base_src_is_live(base) && !self->state->relay.is_on();
}

static gboolean lf_view_request_do_seek(GstBaseSrc* base, GstSegment* segment) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  self->state->outbox.clear();
  self->state->focus_wait.flush();
  self->state->focus.clear();
  if (!gst_base_src_is_live(base)) self->state->stream->schedule.seek(segment->position);
  return TRUE;
}

static gboolean lf_view_request_query(GstBaseSrc* base, GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY || !gst_base_src_is_live(base))
    return GST_BASE_SRC_CLASS(lf_view_request_parent_class)->query(base, query);
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GST_OBJECT_LOCK(self);
  const lf::PictureForm& form = self->state->form;
  const GstClockTime period = form.fps_n > 0 ? lf::Schedule(form.fps_n, form.fps_d).period() : 0;
  GST_OBJECT_UNLOCK(self);
  if (self->state->relay.is_on()) {
    gboolean live = FALSE;
    if (self->state->relay.query_upstream(query)) gst_query_parse_latency(query, &live, nullptr, nullptr);
    // Of requests that come from a file no more is known than that they leave when they come.
    if (!live) gst_query_set_latency(query, TRUE, 0, period);
    return TRUE;
  }
  // A request is stamped with its capture time and leaves when that is old enough; the next replaces it a frame later.
  const GstClockTime capture_delay = lf_view_request_capture_delay(self);
  gst_query_set_latency(query, TRUE, capture_delay, capture_delay + period);
  return TRUE;
}

static void lf_view_request_finalize(GObject* object) {
  delete LF_VIEW_REQUEST(object)->state;
  G_OBJECT_CLASS(lf_view_request_parent_class)->finalize(object);
}

static void lf_view_request_class_init(LfViewRequestClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_view_request_finalize;
  lf_view_request_install_properties(object_class);
  lf_view_request_install_signals(object_class);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  lf_view_request_install_relay(element_class);
  gst_element_class_set_static_metadata(
      element_class, "Light field view request source", "Source",
      "The virtual camera of one viewer, as a stream of view requests: from a camera path (location), from properties, "
      "flown with mouse and keys, or set by the action set-view, whose structure has properties as fields (x, y, z, "
      "yaw, pitch, roll, fov, focus-distance, aperture; each optional)",
      "gst-lightfield");

  GstBaseSrcClass* base_class = GST_BASE_SRC_CLASS(klass);
  lf_view_request_install_form(base_class);
  base_class->start = lf::callback<lf_view_request_start>;
  base_class->stop = lf::callback<lf_view_request_stop>;
  base_class->is_seekable = lf::callback<lf_view_request_is_seekable>;
  base_class->do_seek = lf::callback<lf_view_request_do_seek>;
  base_class->query = lf::callback<lf_view_request_query>;
  lf_view_request_install_events(base_class);
  base_class->unlock = lf::callback<lf_view_request_unlock>;
  base_class->unlock_stop = lf::callback<lf_view_request_unlock_stop>;
  GST_PUSH_SRC_CLASS(klass)->create = lf_view_request_create;
}

static void lf_view_request_init(LfViewRequest* self) {
  self->state = new _LfViewRequest::State(GST_BASE_SRC_PAD(self));
  gst_base_src_set_format(GST_BASE_SRC(self), GST_FORMAT_TIME);
}
