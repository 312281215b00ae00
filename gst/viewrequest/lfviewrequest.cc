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

#include "viewrequest/lfviewrequest.h"

#include <algorithm>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/text.h"
#include "common/custom_events.h"
#include "common/day_clock.h"
#include "common/gst_wire.h"

GST_DEBUG_CATEGORY(lf_view_request_debug);
#define GST_CAT_DEFAULT lf_view_request_debug

static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_CAPS ", framerate = (fraction) [ 0/1, max ]"));
static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
    "sink", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_REQUEST_CAPS ", framerate = (fraction) [ 0/1, max ]"));

G_DEFINE_FINAL_TYPE(LfViewRequest, lf_view_request, GST_TYPE_PUSH_SRC)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfviewrequest, "lfviewrequest", GST_RANK_NONE, LF_TYPE_VIEW_REQUEST,
                                      GST_DEBUG_CATEGORY_INIT(lf_view_request_debug, "lfviewrequest", 0,
                                                              "source of view requests"))

enum {
  PROP_0,
  PROP_IS_LIVE,
  PROP_NUM_BUFFERS,
  PROP_FIRST_FIELD,  // one for each of kViewFields, then one for each of the settings
  PROP_FIRST_SETTING = PROP_FIRST_FIELD + lf::kNumViewFields,
};

std::shared_ptr<const lf::VisibleShare> lf_view_request_visible_share(const lf::ViewRequestSettings& settings,
                                                                      const std::shared_ptr<const lf::Rig>& rig) {
  if (!rig || !settings.keep_visible) return nullptr;
  return std::make_shared<lf::VisibleShare>(*rig);
}

// While the element runs a rig is read at once. Cameras that were announced as out of service are those of the rig
// before: whoever notices that one is missing says so again.
static void set_rig(LfViewRequest* self, const lf::ViewRequestSettings& changed, std::shared_ptr<const lf::Rig> rig) {
  const uint64_t before = self->state->stream->rig_hash();
  self->state->stream->set_rig(std::move(rig), changed.out_of_service);
  if (self->state->stream->rig_hash() != before) self->state->out_of_service.clear();
}

static std::string without_effect(LfViewRequest* self) {
  const bool live = gst_base_src_is_live(GST_BASE_SRC(self));
  const lf::ObjectLock lock(self);
  return self->state->settings.without_effect(live);
}

static void set_setting(LfViewRequest* self, guint id, const GValue* value, const GParamSpec* pspec) {
  const bool is_rig = lf::is_named(pspec, "rig");
  const gchar* path = is_rig ? g_value_get_string(value) : nullptr;
  std::shared_ptr<const lf::Rig> rig;
  if (path && lf::is_running(GST_ELEMENT(self)) && !(rig = lf::reload_rig(GST_ELEMENT(self), path))) return;
  std::string problem;
  lf::ObjectLock lock(self);
  lf::ViewRequestSettings changed = self->state->settings;
  lf::ViewRequestSettings::properties().set(changed, id, value);
  try {
    if (self->state->stream && is_rig && (rig || !path)) set_rig(self, changed, rig);
    if (self->state->stream && lf::is_named(pspec, "out-of-service"))
      self->state->stream->set_out_of_service(changed.out_of_service);
    if (self->state->stream && (is_rig || lf::is_named(pspec, "keep-visible")))
      self->state->control.keep_visible(lf_view_request_visible_share(changed, self->state->stream->rig()));
    self->state->settings = changed;
    lf_view_request_choose_form(self);
    self->state->focus.follow(changed.focus_continuous);
  } catch (const lf::Error& error) {
    problem = error.what();
  }
  lock.unlock();
  if (!problem.empty())
    GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                        ("%s; %s as %s", problem.c_str(), is_rig ? "the rig stays" : "the cameras out of service stay",
                         is_rig ? "it was" : "they were"),
                        (nullptr));
}

// Posts a warning of what is set without effect, but where it is the same as `before`.
static void warn_without_effect(LfViewRequest* self, const std::string& before = "") {
  const std::string text = without_effect(self);
  if (!text.empty() && text != before) GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS, ("%s", text.c_str()), (nullptr));
}

static void lf_view_request_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfViewRequest* self = LF_VIEW_REQUEST(object);
  if (id == PROP_IS_LIVE) {
    gst_base_src_set_live(GST_BASE_SRC(self), g_value_get_boolean(value));
  } else if (id == PROP_NUM_BUFFERS) {
    GST_OBJECT_LOCK(self);
    self->state->settings.num_buffers = g_value_get_int(value);
    GST_OBJECT_UNLOCK(self);
  } else if (id >= PROP_FIRST_SETTING) {
    const std::string before = without_effect(self);
    set_setting(self, id, value, pspec);
    if (lf::is_running(GST_ELEMENT(self))) warn_without_effect(self, before);
  } else if (id >= PROP_FIRST_FIELD) {
    lf::ObjectLock lock(self);
    self->state->control.set(static_cast<int>(id) - PROP_FIRST_FIELD, g_value_get_double(value));
    self->state->turn.note_change();
    lock.unlock();
  } else {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  }
}

static void lf_view_request_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfViewRequest* self = LF_VIEW_REQUEST(object);
  if (id == PROP_IS_LIVE) return g_value_set_boolean(value, gst_base_src_is_live(GST_BASE_SRC(self)));
  lf::ObjectLock lock(self);
  if (id == PROP_NUM_BUFFERS)
    g_value_set_int(value, self->state->settings.num_buffers);
  else if (id >= PROP_FIRST_SETTING)
    lf::ViewRequestSettings::properties().get(self->state->settings, id, value);
  else if (id >= PROP_FIRST_FIELD)
    g_value_set_double(value, self->state->control.values()[id - PROP_FIRST_FIELD]);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  lock.unlock();
}

static void install_properties(GObjectClass* klass) {
  klass->set_property = lf::callback<lf_view_request_set_property>;
  klass->get_property = lf::callback<lf_view_request_get_property>;
  for (int i = 0; i < lf::kNumViewFields; i++) {
    const lf::ViewField& f = lf::kViewFields[i];
    GParamSpec* spec = g_param_spec_double(
        f.name, f.nick, f.blurb, f.min, f.max, f.initial,
        GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING | GST_PARAM_CONTROLLABLE));
    g_object_class_install_property(klass, PROP_FIRST_FIELD + i, spec);
  }
  lf::ViewRequestSettings::properties().install(klass, PROP_FIRST_SETTING);
  g_object_class_override_property(klass, PROP_NUM_BUFFERS, "num-buffers");
  g_object_class_install_property(
      klass, PROP_IS_LIVE,
      g_param_spec_boolean("is-live", "Is live",
                           "Make requests in time with the clock, for frames that live cameras make", FALSE,
                           GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY)));
}

static bool push_upstream(LfViewRequest* self, GstEvent* event) {
  return self->state->relay.push_upstream(gst_event_ref(event));
}

// Every viewer behind the node's tee and funnel hears of it.
static gboolean take_delay(LfViewRequest* self, GstEvent* event, GstClockTime delay) {
  auto& state = *self->state;
  if (state.relay.is_on()) return push_upstream(self, event);
  lf::ObjectLock lock(self);
  const bool follows = !GST_CLOCK_TIME_IS_VALID(state.settings.capture_delay);
  lock.unlock();
  if (!follows || !gst_base_src_is_live(GST_BASE_SRC(self))) return TRUE;
  if (!state.auto_delay.take(delay, gst_util_get_timestamp())) return TRUE;
  GST_INFO_OBJECT(self, "capture delay: %" GST_TIME_FORMAT, GST_TIME_ARGS(state.auto_delay.delay()));
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_latency(GST_OBJECT(self)));
  return TRUE;
}

static gboolean hold(LfViewRequest* self, GstEvent* event, bool held) {
  if (self->state->relay.is_on()) return push_upstream(self, event);
  self->state->turn.hold(gst_event_get_seqnum(event), held);
  return TRUE;
}

// The next requests of this view are focused so; false where cameras are told where to look (access).
static bool take_focus(LfViewRequest* self, lf::FoundFocus focus) {
  lf::ObjectLock lock(self);
  const bool can = self->state->settings.access == lf::Access::kSelf;
  lock.unlock();
  if (!can) return false;
  self->state->focus.announce(std::move(focus));
  if (const std::optional<double> found = self->state->focus.take_found())
    lf_view_request_set_focus_distance(self, *found);
  return true;
}

// Requests of the view get that surface here, because nobody upstream has taken it. False if the relay is not live.
static bool keep_focus(LfViewRequest* self, guint view_id, lf::FoundFocus focus) {
  if (!gst_base_src_is_live(GST_BASE_SRC(self))) return false;
  self->state->relayed_focus.announce(view_id, std::move(focus));
  return true;
}

// Cameras that the rig does not have are nobody's to name: every node would refuse the view's requests.
static void announce_out_of_service(LfViewRequest* self, guint view_id, lf::CameraSet cameras) {
  lf::ObjectLock lock(self);
  const std::shared_ptr<const lf::Rig> rig = self->state->stream ? self->state->stream->rig() : nullptr;
  lock.unlock();
  if (rig) std::erase_if(cameras, [&rig](lf::CameraIndex camera) { return camera >= rig->cameras.size(); });
  self->state->out_of_service.announce(view_id, std::move(cameras));
}

// Cameras out of service are named here for every view; all else is for whoever makes the view's requests, if it can be
// reached, and a surface for which nobody can is kept here. False if nobody takes any of it.
static gboolean take_feedback(LfViewRequest* self, GstEvent* event, const lf::ViewFeedback& feedback) {
  auto& state = *self->state;
  const bool for_all = feedback.out_of_service.has_value();
  if (for_all) announce_out_of_service(self, feedback.view_id, *feedback.out_of_service);
  if (!feedback.focus && feedback.extra_requests.empty()) return for_all;
  if (state.relay.is_on()) {
    const bool passed = push_upstream(self, event);
    const bool kept = !passed && feedback.focus && keep_focus(self, feedback.view_id, *feedback.focus);
    return passed || kept || for_all;
  }
  if (feedback.view_id != lf_view_request_view_id(self)) return for_all;
  bool taken = for_all || !feedback.extra_requests.empty();
  if (!feedback.extra_requests.empty()) state.extra.ask(feedback.extra_requests);
  if (feedback.focus) taken |= take_focus(self, *feedback.focus);
  return taken;
}

static gboolean lf_view_request_event(GstBaseSrc* base, GstEvent* event) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  if (lf::is_reverse_seek(event)) return FALSE;
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK && !self->state->sought.is_new(gst_event_get_seqnum(event))) return TRUE;
  if (bool held = false; lf::parse_hold(event, &held)) return hold(self, event, held);
  if (GstClockTime delay; lf::parse_capture_delay(event, &delay)) return take_delay(self, event, delay);
  if (const auto feedback = lf::parse_view_feedback(event)) return take_feedback(self, event, *feedback);
  if (guint view_id; lf::SharedCaps caps = lf::parse_picture_caps(event, &view_id))
    return !self->state->relay.is_on() && view_id == lf_view_request_view_id(self) &&
           lf_view_request_follow_caps(self, std::move(caps));
  if (!lf_view_request_is_steering(event))
    return GST_BASE_SRC_CLASS(g_type_class_peek(GST_TYPE_PUSH_SRC))->event(base, event);
  return self->state->relay.is_on() ? push_upstream(self, event) : lf_view_request_steer(self, event);
}

// For the cameras; null if they need none.
static GstBuffer* command_of(LfViewRequest* self, const lf::ViewRequest& request,
                             const std::shared_ptr<const lf::Rig>& rig) {
  try {
    std::vector<uint8_t> bytes = self->state->stream->command_for(request, rig);
    return bytes.empty() ? nullptr : lf::wrap_bytes(std::move(bytes));
  } catch (const lf::Error& error) {
    GST_ELEMENT_WARNING(self, STREAM, ENCODE,
                        ("View %u: no commands for the cameras: %s", request.view_id, error.what()), (nullptr));
    return nullptr;
  }
}

// What is to leave right after a request, if anything is: the command for the cameras, `beside`, the requests for the
// other views of its set, which get their numbers here, and extra requests. `stamps`: the request's buffer.
static void send_more(LfViewRequest* self, const lf::ViewRequest& request, const std::shared_ptr<const lf::Rig>& rig,
                      GstBuffer* stamps, std::vector<lf::ViewRequest> beside = {}) {
  auto& state = *self->state;
  const auto send = [&](GstBuffer* buffer) { state.outbox.put(buffer, stamps); };
  send(command_of(self, request, rig));
  for (lf::ViewRequest& other : beside) {
    other.sequence = state.stream->next_number++;
    send(lf::encode_request_buffer(other));
    send(command_of(self, other, rig));
  }
  if (!state.stream->access() && !state.relay.is_on())
    if (std::optional<lf::ViewRequest> sweep = state.focus.next_sweep(request, rig.get())) {
      sweep->sequence = state.stream->next_number++;
      state.focus.sweep_sent(sweep->sequence);
      send(lf::encode_request_buffer(*sweep));
    }
  for (const lf::ViewRequest& extra : state.extra.take_beside(request, state.stream->next_number)) {
    send(lf::encode_request_buffer(extra));
    send(command_of(self, extra, rig));
  }
}

static GstFlowReturn relay_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  LfViewRequest* self = LF_VIEW_REQUEST(parent);
  GstEvent* event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (event) {
    const GstSegment* segment = nullptr;
    gst_event_parse_segment(event, &segment);
    buffer = gst_buffer_make_writable(buffer);
    if (segment->format == GST_FORMAT_TIME)
      GST_BUFFER_PTS(buffer) = gst_segment_to_running_time(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
    gst_event_unref(event);
  }
  bool dropped = false;
  const GstFlowReturn flow = self->state->relay.push(buffer, gst_base_src_is_live(GST_BASE_SRC(self)), &dropped);
  if (dropped) GST_WARNING_OBJECT(pad, "requests come faster than they leave: dropped the oldest");
  return flow;
}

static gboolean relay_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  LfViewRequest* self = LF_VIEW_REQUEST(parent);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      GstCaps* caps = nullptr;
      gst_event_parse_caps(event, &caps);
      self->state->relay.set_caps(caps);
      break;
    }
    case GST_EVENT_EOS: self->state->relay.end(); break;
    case GST_EVENT_FLUSH_START: self->state->relay.set_flushing(true); break;
    case GST_EVENT_FLUSH_STOP: self->state->relay.set_flushing(false); break;
    default: break;
  }
  GST_LOG_OBJECT(pad, "%" GST_PTR_FORMAT, event);
  gst_event_unref(event);  // the source pad has a stream, a segment and caps of its own
  return TRUE;
}

static gboolean relay_activate(GstPad*, GstObject* parent, GstPadMode mode, gboolean active) {
  if (mode != GST_PAD_MODE_PUSH) return FALSE;
  LF_VIEW_REQUEST(parent)->state->relay.set_flushing(!active);
  return TRUE;
}

static GstPad* lf_view_request_new_pad(GstElement* element, GstPadTemplate* templ, const gchar*, const GstCaps*) {
  LfViewRequest* self = LF_VIEW_REQUEST(element);
  if (self->state->relay.is_on()) return nullptr;
  GstPad* pad = gst_pad_new_from_template(templ, "sink");
  lf::accept_unit_caps(pad);
  gst_pad_set_chain_function(pad, lf::callback<relay_chain>);
  gst_pad_set_event_function(pad, lf::callback<relay_event>);
  gst_pad_set_activatemode_function(pad, lf::callback<relay_activate>);
  self->state->relay.set_sink(pad);
  gst_element_add_pad(element, pad);
  return pad;
}

static void lf_view_request_release_pad(GstElement* element, GstPad* pad) {
  LfViewRequest* self = LF_VIEW_REQUEST(element);
  gst_pad_set_active(pad, FALSE);
  self->state->relay.set_sink(nullptr);
  self->state->relay.end();  // who waits for the next request
  gst_element_remove_pad(element, pad);
}

static void install_relay(GstElementClass* klass) {
  klass->request_new_pad = lf::callback<lf_view_request_new_pad>;
  klass->release_pad = lf::callback<lf_view_request_release_pad>;
  gst_element_class_add_static_pad_template(klass, &sink_template);
}

// Made for a mesh that may be another one here.
static void drop_command(LfViewRequest* self) {
  GST_LOG_OBJECT(self, "dropped a command");
  if (!self->state->warned_commands && !self->state->stream->access())
    GST_ELEMENT_WARNING(self, STREAM, FAILED,
                        ("Commands for cameras end here: set the property \"access\" of this relay, in place of the "
                         "viewer's."),
                        (nullptr));
  self->state->warned_commands = true;
}

// What is added to a request on its way. Whether anything is.
static bool complete_request(LfViewRequest* self, lf::ViewRequest& request) {
  lf::ObjectLock lock(self);
  const lf::CameraSet own = self->state->stream->out_of_service();
  lock.unlock();
  lf::CameraSet all;
  std::ranges::set_union(request.out_of_service, own, std::back_inserter(all));
  all = self->state->out_of_service.with_announced(request.view_id, all);
  bool changed = std::exchange(request.out_of_service, all) != all;
  const lf::CameraAccess* access = self->state->stream->access();
  if (!access) return self->state->relayed_focus.apply(request) || changed;
  const lf::Blending asked = request.view.blending;
  request.view.blending = access->blending(asked);
  // Cameras that are told where to look try no depths.
  request.trials.clear();
  request.gains = {};
  return std::exchange(request.view.focus.map, nullptr) || request.view.blending != asked || changed;
}

// The next request that came in, with the cameras that are out of service added; waits for it.
static GstFlowReturn relay_request(LfViewRequest* self, GstBuffer** out) {
  while (true) {
    g_autoptr(GstBuffer) buffer = nullptr;
    const GstFlowReturn flow = self->state->relay.pop(&buffer);
    if (flow != GST_FLOW_OK) return flow;
    g_autoptr(GstCaps) caps = self->state->relay.take_caps();
    lf::ObjectLock lock(self);
    const std::shared_ptr<const lf::Rig> rig = self->state->stream->rig();
    lock.unlock();
    if (caps) gst_base_src_set_caps(GST_BASE_SRC(self), caps);
    std::string reason;
    const std::optional<lf::wire::AnyRequest> any = lf::decode_any_request_buffer(buffer, &reason);
    if (!any || lf::wire::access_of(*any) != lf::Access::kSelf) {
      if (any)
        drop_command(self);
      else
        GST_WARNING_OBJECT(self, "dropped a view request: %s", reason.c_str());
      continue;
    }
    lf::ViewRequest request = std::get<lf::ViewRequest>(*any);
    if (!complete_request(self, request)) {
      *out = g_steal_pointer(&buffer);
    } else {
      *out = lf::encode_request_buffer(request);
      gst_buffer_copy_into(*out, buffer, GST_BUFFER_COPY_TIMESTAMPS, 0, -1);
    }
    send_more(self, request, rig, *out);
    return GST_FLOW_OK;
  }
}

// Of views of a file, too.
static lf::Blending current_blending(LfViewRequest* self) {
  const lf::Blending asked = lf::blending_of(self->state->control.viewpoint().aperture,
                                             static_cast<int>(self->state->settings.nearest_cameras));
  const lf::CameraAccess* access = self->state->stream->access();
  return access ? access->blending(asked) : asked;
}

// How much later than its capture time a live request leaves: what `capture-delay` says, or what nodes need.
static GstClockTime capture_delay_of(LfViewRequest* self) {
  lf::ObjectLock lock(self);
  const GstClockTime delay = self->state->settings.capture_delay;
  lock.unlock();
  return GST_CLOCK_TIME_IS_VALID(delay) ? delay : self->state->auto_delay.delay();
}

static gboolean set_unlocked(GstBaseSrc* base, bool unlocked) {
  auto& state = *LF_VIEW_REQUEST(base)->state;
  state.focus.set_unlocked(unlocked);
  state.relay.set_unlocked(unlocked);
  state.turn.set_unlocked(unlocked);
  return TRUE;
}

static gboolean lf_view_request_unlock(GstBaseSrc* base) { return set_unlocked(base, true); }
static gboolean lf_view_request_unlock_stop(GstBaseSrc* base) { return set_unlocked(base, false); }

// Waits for the slot's turn, or for a change before it. *leaves: the slot, with the times that it then has.
// The schedule counts in the time of day: `offset` is that less clock time.
static GstFlowReturn wait_for_turn(LfViewRequest* self, GstClock* clock, GstClockTimeDiff offset,
                                   GstClockTime capture_delay, const lf::RequestSlot& slot, lf::RequestSlot* leaves) {
  const GstClockTime base_time = gst_element_get_base_time(GST_ELEMENT(self));
  const GstClockTime turn = base_time + slot.pts + capture_delay;
  const GstClockTime early = std::min(slot.pts + capture_delay, slot.duration / 4 * 3);
  GST_OBJECT_LOCK(self);
  const bool eager = self->state->settings.eager && !slot.view;
  GST_OBJECT_UNLOCK(self);
  *leaves = slot;
  if (!eager) return self->state->turn.wait_until(clock, turn);
  GstFlowReturn flow = self->state->turn.wait_until(clock, turn - early);
  if (flow == GST_FLOW_OK) flow = self->state->turn.wait_until(clock, turn, true);
  if (const GstClockTime now = gst_clock_get_time(clock); now < turn)
    *leaves = self->state->stream->schedule.ahead_of_turn(slot, now + offset, base_time + offset, capture_delay);
  return flow;
}

// Chooses the next slot of a live stream and waits for it.
static GstFlowReturn wait_live(LfViewRequest* self, std::optional<lf::RequestSlot>* slot, lf::RequestSlot* leaves) {
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) {
    GST_ELEMENT_ERROR(self, CORE, CLOCK, ("A live source of view requests needs a clock"), (nullptr));
    return GST_FLOW_ERROR;
  }
  const GstClockTimeDiff offset = lf::day_offset(GST_ELEMENT(self));
  const GstClockTime base_time = gst_element_get_base_time(GST_ELEMENT(self));
  const GstClockTime capture_delay = capture_delay_of(self);
  *slot =
      self->state->stream->schedule.next_live(gst_clock_get_time(clock) + offset, base_time + offset, capture_delay);
  return *slot ? wait_for_turn(self, clock, offset, capture_delay, **slot, leaves) : GST_FLOW_EOS;
}

// The requests for the other views of the set around `middle`, of the moment and with the surface of the one that
// leads.
static std::vector<lf::ViewRequest> rest_of_set(const lf::ViewRequest& leader, const lf::ViewSet& set,
                                                const lf::View& middle) {
  std::vector<lf::ViewRequest> rest;
  for (const lf::PlaceInSet& place : set.places()) {
    if (place.leads()) continue;
    lf::ViewRequest& beside = rest.emplace_back(leader);
    beside.place = place;
    beside.view = set.view(middle, place);
    lf::apply_leader(leader, beside);
  }
  return rest;
}

static GstFlowReturn make_request(LfViewRequest* self, GstBuffer** out) {
  const bool live = gst_base_src_is_live(GST_BASE_SRC(self));
  std::optional<lf::RequestSlot> turn;
  lf::RequestSlot slot{};
  bool rehearsal = false;
  if (live) {
    GstFlowReturn flow = lf_view_request_follow_rate(self);
    if (flow == GST_FLOW_OK) flow = wait_live(self, &turn, &slot);
    if (flow != GST_FLOW_OK) return flow;
  } else {
    GstFlowReturn flow = self->state->turn.wait_for_seek();
    if (flow == GST_FLOW_OK && !self->state->stream->access())
      flow = self->state->focus_wait.wait(lf_view_request_view_id(self));
    if (flow != GST_FLOW_OK) return flow;
    rehearsal = self->state->focus_wait.rehearses();
    if (!rehearsal) flow = lf_view_request_follow_rate(self);
    if (flow != GST_FLOW_OK) return flow;
    turn = self->state->stream->schedule.next();
    if (!turn) return GST_FLOW_EOS;
    slot = *turn;
  }
  if (!slot.view) gst_object_sync_values(GST_OBJECT(self), slot.pts);

  lf::ViewRequest request;
  request.target_time = slot.target_time;
  request.absolute_time = live;
  request.rehearsal = rehearsal;
  if (!rehearsal) self->state->stream->schedule.advance(*turn);
  request.sequence = self->state->stream->next_number++;
  lf::ObjectLock lock(self);
  request.rig_hash = self->state->stream->rig_hash();
  const std::shared_ptr<const lf::Rig> rig = self->state->stream->rig();
  request.view_id = self->state->settings.view_id;
  request.quality = self->state->in_process ? 0 : static_cast<uint8_t>(self->state->settings.quality);
  request.out_of_service =
      self->state->out_of_service.with_announced(request.view_id, self->state->stream->out_of_service());
  const lf::ViewSet set = self->state->settings;
  lf::View middle = slot.view ? *slot.view : lf_view_request_view(self);
  middle.blending = current_blending(self);
  request.place = set.places().front();
  request.view = set.view(middle, request.place);
  self->state->turn.forget_change();
  lock.unlock();

  // Cameras that are told where to look try no depths: their pictures are of the viewer's plane.
  if (!self->state->stream->access()) self->state->focus.apply(request);
  self->state->focus_wait.sent(request.sequence);
  *out = lf::encode_request_buffer(request);
  GST_BUFFER_PTS(*out) = slot.pts;
  GST_BUFFER_DURATION(*out) = slot.duration;
  GST_LOG_OBJECT(self, "request %u of view %u for %" GST_TIME_FORMAT, request.sequence, request.view_id,
                 GST_TIME_ARGS(request.target_time));
  if (!rehearsal) send_more(self, request, rig, *out, rest_of_set(request, set, middle));
  return GST_FLOW_OK;
}

static GstFlowReturn make_buffer(LfViewRequest* self, GstBuffer** out) {
  gint& left = self->state->requests_left;
  if ((*out = self->state->outbox.take())) return GST_FLOW_OK;
  if (left == 0) return GST_FLOW_EOS;
  const GstFlowReturn flow = self->state->relay.is_on() ? relay_request(self, out) : make_request(self, out);
  if (flow == GST_FLOW_OK && left > 0 && !self->state->focus_wait.is_rehearsing()) left--;
  return flow;
}

// What is thrown costs the request that was being made; where this goes on and on, it ends the stream.
static GstFlowReturn lf_view_request_create(GstPushSrc* push, GstBuffer** out) {
  constexpr int kMostInARow = 32;
  LfViewRequest* self = LF_VIEW_REQUEST(push);
  GstBuffer* made = nullptr;
  for (int i = 0; i < kMostInARow; i++) {
    const uint64_t turn = self->state->stream->schedule.turn();
    try {
      const GstFlowReturn flow = make_buffer(self, &made);
      if (flow == GST_FLOW_OK) *out = made;
      return flow;
    } catch (...) {
      gst_clear_buffer(&made);
      lf::warn_of_current_exception(self);
      self->state->stream->schedule.pass(turn);
    }
  }
  return lf::guarded(push, GST_FLOW_ERROR, [=] { return make_buffer(self, out); });
}

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
  warn_without_effect(self);
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
  const GstClockTime capture_delay = capture_delay_of(self);
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
  install_properties(object_class);
  lf_view_request_install_signals(object_class);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  install_relay(element_class);
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
  base_class->event = lf::callback<lf_view_request_event>;
  base_class->unlock = lf::callback<lf_view_request_unlock>;
  base_class->unlock_stop = lf::callback<lf_view_request_unlock_stop>;
  GST_PUSH_SRC_CLASS(klass)->create = lf_view_request_create;
}

static void lf_view_request_init(LfViewRequest* self) {
  self->state = new _LfViewRequest::State(GST_BASE_SRC_PAD(self));
  gst_base_src_set_format(GST_BASE_SRC(self), GST_FORMAT_TIME);
}
