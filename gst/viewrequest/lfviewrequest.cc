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
 * set are chosen so that the view stands in the middle of the array and looks where it looks.
 * - while running, these can be changed: by setting them; by mouse and keys, i.e. GstNavigation events from a video
 *   sink (drag: orbit about the point in focus; shift-drag or another button: pan; wheel: dolly; ctrl-wheel: focus;
 *   arrows: orbit; w s a d q e: fly forward, back, left, right, down, up; + -: zoom; [ ]: focus nearer, farther; r:
 *   back to the start; but with shift they are held where the array is in sight, see `keep-visible`); by a
 *   custom upstream event with a structure "lf-view-request" with any of the properties as fields (and
 *   focus-continuous, 0 or 1); by the action signal
 *   `set-view` with such a structure. The very next request has the change, and the properties notify.
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
 * Two of them that are given the same events are the two eyes of one viewer, with an `eye-offset` each. Unless they
 * are `eager` they name the same capture times, and lfcompositors make pictures with the same stamps of them.
 *
 * Upstream events that carry a field "lf-view-id" (uint) are for the view of that id alone.
 *
 * Not live, requests leave as fast as they are taken and ask for the stream time of their frame. While an lfcompositor
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
#include <vector>

#include "base/error.h"
#include "common/gst_wire.h"
#include "common/hold_event.h"
#include "common/view_feedback.h"
#include "viewrequest/lfviewrequest_private.h"

GST_DEBUG_CATEGORY(lf_view_request_debug);
#define GST_CAT_DEFAULT lf_view_request_debug

static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_CAPS ", framerate = (fraction) [ 0/1, max ]"));

G_DEFINE_FINAL_TYPE(LfViewRequest, lf_view_request, GST_TYPE_PUSH_SRC)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfviewrequest, "lfviewrequest", GST_RANK_NONE, LF_TYPE_VIEW_REQUEST,
                                      GST_DEBUG_CATEGORY_INIT(lf_view_request_debug, "lfviewrequest", 0,
                                                              "source of view requests"))

// The same seek comes more than once: through the compositor's request pad and, by way of the nodes, through its answer
// pads; and from every compositor behind a tee.
static bool lf_view_request_has_sought(LfViewRequest* self, GstEvent* event) {
  GST_OBJECT_LOCK(self);
  const bool again = std::exchange(self->seek_seqnum, gst_event_get_seqnum(event)) == gst_event_get_seqnum(event);
  GST_OBJECT_UNLOCK(self);
  return again;
}

// Every viewer behind the node's tee and funnel hears of it.
static gboolean lf_view_request_take_delay(LfViewRequest* self, GstEvent* event, GstClockTime delay) {
  if (lf_view_request_is_relay(self)) return lf_view_request_push_upstream(self, gst_event_ref(event));
  GST_OBJECT_LOCK(self);
  const bool follows = !GST_CLOCK_TIME_IS_VALID(self->settings->capture_delay);
  GST_OBJECT_UNLOCK(self);
  if (!follows || !gst_base_src_is_live(GST_BASE_SRC(self))) return TRUE;
  if (!self->auto_delay->take(delay, gst_util_get_timestamp())) return TRUE;
  GST_INFO_OBJECT(self, "capture delay: %" GST_TIME_FORMAT, GST_TIME_ARGS(self->auto_delay->delay()));
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_latency(GST_OBJECT(self)));
  return TRUE;
}

static gboolean lf_view_request_hold(LfViewRequest* self, GstEvent* event, bool held) {
  if (lf_view_request_is_relay(self)) return lf_view_request_push_upstream(self, gst_event_ref(event));
  const guint32 seqnum = gst_event_get_seqnum(event);
  GST_OBJECT_LOCK(self);
  if (held) self->held_for = seqnum;
  if (!held && self->held_for == seqnum) self->held_for = GST_SEQNUM_INVALID;
  g_cond_broadcast(&self->held_changed);
  GST_OBJECT_UNLOCK(self);
  return TRUE;
}

// Cameras out of service are named here for every view; all else is for whoever makes the view's requests, if it can be
// reached, and a surface for which nobody can is kept here. False if nobody takes any of it.
static gboolean lf_view_request_take_feedback(LfViewRequest* self, GstEvent* event, lf::ViewFeedback feedback) {
  const bool for_all = feedback.out_of_service.has_value();
  if (for_all) self->out_of_service->announce(feedback.view_id, std::move(*feedback.out_of_service));
  if (!feedback.focus && feedback.extra_requests.empty()) return for_all;
  if (lf_view_request_is_relay(self)) {
    const bool passed = lf_view_request_push_upstream(self, gst_event_ref(event));
    const bool kept =
        !passed && feedback.focus && lf_view_request_keep_focus(self, feedback.view_id, std::move(*feedback.focus));
    return passed || kept || for_all;
  }
  lf::ObjectLock lock(self);
  if (feedback.view_id != self->settings->view_id) return for_all;
  bool taken = for_all || !feedback.extra_requests.empty();
  if (!feedback.extra_requests.empty()) *self->extra = std::move(feedback.extra_requests);
  lock.unlock();
  if (feedback.focus) taken |= lf_view_request_take_focus(self, std::move(*feedback.focus));
  return taken;
}

static gboolean lf_view_request_event(GstBaseSrc* base, GstEvent* event) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  if (lf::is_reverse_seek(event)) return FALSE;
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK && lf_view_request_has_sought(self, event)) return TRUE;
  if (bool held = false; lf::parse_hold(event, &held)) return lf_view_request_hold(self, event, held);
  if (GstClockTime delay; lf::parse_capture_delay(event, &delay)) return lf_view_request_take_delay(self, event, delay);
  if (std::optional<lf::ViewFeedback> feedback = lf::parse_view_feedback(event))
    return lf_view_request_take_feedback(self, event, std::move(*feedback));
  if (!lf_view_request_is_steering(event)) return GST_BASE_SRC_CLASS(lf_view_request_parent_class)->event(base, event);
  if (lf_view_request_is_relay(self)) return lf_view_request_push_upstream(self, gst_event_ref(event));
  return lf_view_request_steer(self, event);
}

static GstCaps* lf_view_request_get_caps(GstBaseSrc* base, GstCaps* filter) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GST_OBJECT_LOCK(self);
  GstCaps* caps = gst_caps_new_simple(LF_REQUEST_MEDIA_TYPE, "parsed", G_TYPE_BOOLEAN, TRUE, "framerate",
                                      GST_TYPE_FRACTION, self->settings->fps_n, self->settings->fps_d, nullptr);
  GST_OBJECT_UNLOCK(self);
  if (!filter) return caps;
  GstCaps* filtered = gst_caps_intersect_full(filter, caps, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(caps);
  return filtered;
}

// The caps of what is relayed are known when it comes.
static gboolean lf_view_request_negotiate(GstBaseSrc* base) {
  return lf_view_request_is_relay(LF_VIEW_REQUEST(base)) ||
         GST_BASE_SRC_CLASS(lf_view_request_parent_class)->negotiate(base);
}

static gboolean lf_view_request_stop(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  self->navigation_tap->detach();
  GST_OBJECT_LOCK(self);
  delete self->stream;
  self->stream = nullptr;
  self->extra->clear();
  self->held_for = GST_SEQNUM_INVALID;
  GST_OBJECT_UNLOCK(self);
  gst_queue_array_clear(self->to_send);
  self->warned_commands = self->asked_for_focus = self->has_sent = false;
  self->seek_seqnum = GST_SEQNUM_INVALID;
  self->focus_feedback->clear();
  self->auto_delay->clear();
  self->relay->clear();
  self->relayed_focus->clear();
  self->out_of_service->clear();
  return TRUE;
}

static gboolean lf_view_request_start(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  lf::ObjectLock lock(self);
  const lf::ViewRequestSettings settings = *self->settings;
  lock.unlock();

  std::unique_ptr<lf::RequestStream> stream;
  std::shared_ptr<const lf::VisibleShare> share;
  try {
    stream = std::make_unique<lf::RequestStream>(settings);
    share = lf_view_request_visible_share(settings, stream->rig());
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return FALSE;
  }
  base->segment.duration = stream->end();
  GST_OBJECT_LOCK(self);
  self->requests_left = self->num_buffers;
  GST_OBJECT_UNLOCK(self);
  GST_INFO_OBJECT(self, "view %u at %d/%d frames/s, %s", settings.view_id, settings.fps_n, settings.fps_d,
                  stream->from_file() ? settings.location.c_str() : "from properties");
  lf_view_request_change_view(self, [&](lf::ViewControl& control) {
    // GstBaseSrc does not stop what it could not seek to its beginning.
    delete std::exchange(self->stream, stream.release());
    control.begin(self->stream->default_viewpoint());
    control.keep_visible(share);
    return true;
  });
  const auto navigated = [](GstElement* element, GstEvent* event) {
    if (lf_view_request_is_steering(event)) lf_view_request_steer(LF_VIEW_REQUEST(element), event);
  };
  if (!settings.navigation_from.empty() &&
      !self->navigation_tap->attach(GST_ELEMENT(self), settings.navigation_from, navigated)) {
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
  const bool loop = self->settings->loop;
  GST_OBJECT_UNLOCK(self);
  return !loop && !gst_base_src_is_live(base) && !lf_view_request_is_relay(self);
}

static gboolean lf_view_request_do_seek(GstBaseSrc* base, GstSegment* segment) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  gst_queue_array_clear(self->to_send);
  self->has_sent = false;  // what is on its way is flushed: no surface comes of it
  self->focus_feedback->clear();
  if (!gst_base_src_is_live(base)) self->stream->seek(segment->position);
  return TRUE;
}

static gboolean lf_view_request_query(GstBaseSrc* base, GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY || !gst_base_src_is_live(base))
    return GST_BASE_SRC_CLASS(lf_view_request_parent_class)->query(base, query);
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GST_OBJECT_LOCK(self);
  const GstClockTime period = lf::Schedule(self->settings->fps_n, self->settings->fps_d).period();
  GST_OBJECT_UNLOCK(self);
  if (lf_view_request_is_relay(self)) {
    gboolean live = FALSE;
    if (lf_view_request_relayed_latency(self, query)) gst_query_parse_latency(query, &live, nullptr, nullptr);
    // Of requests that come from a file no more is known than that they leave when they come.
    if (!live) gst_query_set_latency(query, TRUE, 0, period);
    return TRUE;
  }
  // A request is stamped with its capture time and leaves when that is old enough; the next replaces it a frame later.
  const GstClockTime capture_delay = lf_view_request_capture_delay(self);
  gst_query_set_latency(query, TRUE, capture_delay, capture_delay + period);
  return TRUE;
}

static GstStateChangeReturn lf_view_request_change_state(GstElement* element, GstStateChange transition) {
  lf::NetClock& net_clock = *LF_VIEW_REQUEST(element)->net_clock;
  if (!net_clock.before(element, transition)) return GST_STATE_CHANGE_FAILURE;
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(lf_view_request_parent_class)->change_state(element, transition);
  net_clock.after(element, transition);
  return result;
}

static GstClock* lf_view_request_provide_clock(GstElement* element) {
  return LF_VIEW_REQUEST(element)->net_clock->provide();
}

static void lf_view_request_finalize(GObject* object) {
  LfViewRequest* self = LF_VIEW_REQUEST(object);
  g_cond_clear(&self->held_changed);
  delete self->navigation_tap;
  delete self->stream;
  delete self->relay;
  delete self->relayed_focus;
  gst_queue_array_free(self->to_send);
  delete self->extra;
  delete self->focus_feedback;
  delete self->auto_delay;
  delete self->out_of_service;
  gst_clear_caps(&self->relayed_caps);
  delete self->settings;
  delete self->control;
  delete self->net_clock;
  G_OBJECT_CLASS(lf_view_request_parent_class)->finalize(object);
}

static void lf_view_request_class_init(LfViewRequestClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_view_request_finalize;
  lf_view_request_install_properties(object_class);
  lf_view_request_install_signals(object_class);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_view_request_change_state>;
  element_class->provide_clock = lf::callback<lf_view_request_provide_clock>;
  gst_element_class_add_static_pad_template(element_class, &src_template);
  lf_view_request_install_relay(element_class);
  gst_element_class_set_static_metadata(
      element_class, "Light field view request source", "Source",
      "The virtual camera of one viewer, as a stream of view requests: from a camera path (location), from properties, "
      "flown with mouse and keys, or set by the action set-view, whose structure has properties as fields (x, y, z, "
      "yaw, pitch, roll, fov, focus-distance, aperture; each optional)",
      "gst-lightfield");

  GstBaseSrcClass* base_class = GST_BASE_SRC_CLASS(klass);
  base_class->get_caps = lf::callback<lf_view_request_get_caps>;
  base_class->negotiate = lf::callback<lf_view_request_negotiate>;
  base_class->start = lf::callback<lf_view_request_start>;
  base_class->stop = lf::callback<lf_view_request_stop>;
  base_class->is_seekable = lf::callback<lf_view_request_is_seekable>;
  base_class->do_seek = lf::callback<lf_view_request_do_seek>;
  base_class->query = lf::callback<lf_view_request_query>;
  base_class->event = lf::callback<lf_view_request_event>;
  base_class->unlock = lf::callback<lf_view_request_unlock>;
  base_class->unlock_stop = lf::callback<lf_view_request_unlock_stop>;
  GST_PUSH_SRC_CLASS(klass)->create = lf_view_request_create;
}

static void lf_view_request_init(LfViewRequest* self) {
  self->settings = new lf::ViewRequestSettings;
  self->control = new lf::ViewControl;
  self->net_clock = new lf::NetClock;
  GST_OBJECT_FLAG_SET(self, GST_ELEMENT_FLAG_PROVIDE_CLOCK);
  g_cond_init(&self->held_changed);
  self->navigation_tap = new lf::NavigationTap;
  self->relay = new lf::RequestRelay;
  self->relayed_focus = new lf::RelayedFocus;
  self->to_send = gst_queue_array_new(4);
  gst_queue_array_set_clear_func(self->to_send, reinterpret_cast<GDestroyNotify>(gst_buffer_unref));
  self->extra = new std::vector<lf::ViewRequest>;
  self->focus_feedback = new lf::FocusFeedback;
  self->auto_delay = new lf::AutoCaptureDelay;
  self->num_buffers = -1;
  self->out_of_service = new lf::OutOfService;
  gst_base_src_set_format(GST_BASE_SRC(self), GST_FORMAT_TIME);
}
