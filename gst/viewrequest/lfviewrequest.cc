// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfviewrequest
 * @title: lfviewrequest
 * @short_description: virtual camera of one viewer, as a stream of view requests
 *
 * lfviewrequest is the virtual camera of one viewer. Each buffer that it sends is a request for one picture: pose,
 * lens, size and focal plane of the view, and the capture time that the picture shows. Nodes (lffragment, lfcameranode)
 * answer the requests, and lfcompositor combines the answers to a picture.
 *
 * The view comes from one of these inputs:
 *
 * - `location`: a views.json file. The element sends one request per view with the view's timestamp, then EOS. If all
 *   views have the same time, timestamps advance by one frame per view, but each request keeps its own capture time.
 *   The file also defines the sizes of the views.
 * - the properties `x`, `y`, `z`, `yaw`, `pitch`, `roll`, `fov`, `focus-distance`, `aperture`, `margin`: one request
 *   per frame. The properties are controllable; a GstController is synchronised to the timestamp of each request. If
 *   `rig` is set, unset properties get values that place the view in the middle of the array, with the orientation of
 *   the array. If `constrain-view` is also set, the view starts inside a triangle of cameras, with the widest field of
 *   view without black pixels.
 * - mouse and keys, as GstNavigation events from a video sink. Drag: orbit about the focus point. Shift-drag or another
 *   button: pan. Wheel: zoom at the pointer. Ctrl-wheel: focus. Arrows: orbit. w s a d q e: move forward, back, left,
 *   right, down, up. + -: zoom. [ ]: focus nearer, farther. r: return to the start. `constrain-view` limits the
 *   movement to the visible range.
 * - the custom upstream event "lightfield-view-request", which has any of these properties and focus-continuous (0 or
 *   1) as fields, or the action signal `set-view` with such a structure.
 *
 * Changes apply to the next request. When the view changes, the element sets these properties to the new values and
 * emits `notify`.
 *
 * If `width`, `height` or `framerate` is not set, it follows the caps downstream of the view's lfcompositor, if that is
 * in this process. The element negotiates them before the first request and when the caps change. Otherwise pictures
 * have the size of the rig's cameras, and the rate is 15/1.
 *
 * By default each pixel is blended from three cameras, the corners of a triangle in the mesh of the array. If
 * `aperture` is set, all cameras within a synthetic aperture of that diameter contribute. Objects out of focus then
 * blur if the compositor uses a focal plane (`lfcompositor focus=plane`). If `nearest-cameras` is set, the cameras with
 * the most similar viewing direction contribute. These properties also apply to views of a file. `access=warp` always
 * uses three cameras.
 *
 * After each picture, lfcompositor sends feedback with the upstream event "lightfield-feedback": the focal surface (the
 * depths) for the next request, cameras that are out of service, and extra requests (`lfcompositor monitor-interval`).
 * All further requests exclude the cameras that are out of service, in addition to the cameras in the property
 * `out-of-service`. Extra requests follow the next request and have its capture time.
 *
 * If the sink pad is linked, the element is a relay. Instead of making requests, it forwards the requests of viewers
 * and adds the list of cameras that are out of service. Use a relay on a compositor host behind a network. A live relay
 * also adds focal surfaces from lfcompositor if no viewer accepts these surfaces.
 *
 * Some cameras are too simple to answer view requests (see `lffragment access`). Set `access` for such cameras. A
 * command for these cameras then follows every request, with the transformations of their images or the image regions
 * to deliver. A relay drops the commands that it receives and generates new ones, because only the relay knows which of
 * its cameras are out of service.
 *
 * If `views` is set, the element sends a request for each eye of a stereo pair, a row, or a quilt (a grid of views for
 * light field displays). All eyes have the same capture time. The focal surface is found for the view next to the
 * middle, and then transformed to the remaining viewpoints. lfcompositor combines the views in one picture, with
 * GStreamer's multiview-mode for pairs. Width and height of a view must be even. Mouse and keys move all views
 * together.
 *
 * Upstream events with the field "lightfield-view-id" (uint) apply to the view with that id only.
 *
 * If the element is not live, it sends requests as fast as downstream accepts them, with the stream time of their
 * frame. If an lfcompositor finds the focus, up to eight warm-up requests precede the first request and follow each
 * seek. A warm-up produces no picture; it only measures depths, so that the first picture is in focus. During a seek
 * the upstream event "lightfield-hold" blocks requests, so that all viewers of a funnel flush before any viewer
 * continues.
 *
 * If the element is live, it requests pictures for a schedule of instants, the multiples of the frame period on the
 * pipeline clock. It sends the request for an instant after `capture-delay`, when the frames have reached the nodes,
 * and skips instants while downstream blocks. Each request asks for its instant in clock time. The timestamp of a
 * request is the running time of its instant, so the timestamp of a picture is its capture time. The element reports
 * `capture-delay` as latency, which keeps sound synchronised if it was captured at the same time.
 *
 * The automatic `capture-delay` (-1) follows the nodes in this process. They send the upstream event
 * "lightfield-capture-delay" with the time within which 99 % of the frames arrive, plus half a frame. The element posts
 * LATENCY messages when the delay changes. If `eager` is set, a change of the view is requested immediately instead of
 * at the next instant. A relay reports the latency of the requests that it forwards.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lfcameranode name=n rig=rig.json ! c.sink_0  r. ! queue ! c.request \
 *   lfcompositor name=c rig=rig.json ! videoconvert ! pngenc ! multifilesink location=out_%02d.png
 * ]| Writes a PNG file for each view in a file.
 * |[
 * gst-launch-1.0 lfviewrequest rig=rig.json is-live=true width=640 height=480 framerate=30/1 ! tee name=r \
 *   r. ! queue leaky=downstream ! n.request  lfcameranode name=n rig=rig.json is-live=true ! c.sink_0 \
 *   r. ! queue leaky=downstream ! c.request  lfcompositor name=c rig=rig.json ! videoconvert ! autovideosink
 * ]| Opens a window; mouse and keys move the view.
 * |[
 * gst-launch-1.0 tcpserversrc port=5000 ! lfparse ! lfviewrequest is-live=true ! tee name=r  r. ! queue ! n.request \
 *   lfcameranode name=n rig=rig.json is-live=true ! c.sink_0  r. ! queue ! c.request \
 *   lfcompositor name=c rig=rig.json ! videoconvert ! autovideosink
 * ]| Serves the requests of a viewer on another host.
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
#include "common/gst_wire.h"
#include "common/wall_clock.h"

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
  PROP_FIRST_FIELD,  // one per field of kViewFields, then one per setting
  PROP_FIRST_SETTING = PROP_FIRST_FIELD + lf::kNumViewFields,
};

std::shared_ptr<const lf::VisibleFraction> lf_view_request_visible_share(const lf::ViewRequestSettings& settings,
                                                                         const std::shared_ptr<const lf::Rig>& rig) {
  if (!rig || !settings.constrain_view) return nullptr;
  return std::make_shared<lf::VisibleFraction>(*rig);
}

// Loads the rig immediately if the element runs. Forgets cameras that the compositor has announced as out of service,
// because they belong to the old rig; the compositor announces missing cameras again.
static void set_rig(LfViewRequest* self, const lf::ViewRequestSettings& changed, std::shared_ptr<const lf::Rig> rig) {
  const uint64_t before = self->state->stream->rig_hash();
  self->state->stream->set_rig(std::move(rig), changed.out_of_service);
  if (self->state->stream->rig_hash() != before) self->state->out_of_service.clear();
}

static std::string ignored_settings(LfViewRequest* self) {
  return lf_view_request_settings(self).ignored_settings(gst_base_src_is_live(GST_BASE_SRC(self)));
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
    if (self->state->stream && (is_rig || lf::is_named(pspec, "constrain-view")))
      self->state->control.constrain_view(lf_view_request_visible_share(changed, self->state->stream->rig()));
    self->state->settings = changed;
    lf_view_request_choose_format(self);
    self->state->focus.follow(changed.focus_continuous);
  } catch (const lf::Error& error) {
    problem = error.what();
  }
  lock.unlock();
  if (!problem.empty())
    GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                        ("%s; %s %s", problem.c_str(), is_rig ? "the current rig" : "the cameras out of service",
                         is_rig ? "stays in use" : "are unchanged"),
                        (nullptr));
}

static void warn_ignored_settings(LfViewRequest* self, const std::string& before = "") {
  const std::string text = ignored_settings(self);
  if (!text.empty() && text != before) GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS, ("%s", text.c_str()), (nullptr));
}

static void lf_view_request_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfViewRequest* self = LF_VIEW_REQUEST(object);
  if (id == PROP_IS_LIVE) {
    gst_base_src_set_live(GST_BASE_SRC(self), g_value_get_boolean(value));
  } else if (id == PROP_NUM_BUFFERS) {
    const lf::ObjectLock lock(self);
    self->state->settings.num_buffers = g_value_get_int(value);
  } else if (id >= PROP_FIRST_SETTING) {
    const std::string before = ignored_settings(self);
    set_setting(self, id, value, pspec);
    if (lf::is_running(GST_ELEMENT(self))) warn_ignored_settings(self, before);
  } else if (id >= PROP_FIRST_FIELD) {
    const lf::ObjectLock lock(self);
    self->state->control.set(static_cast<int>(id) - PROP_FIRST_FIELD, g_value_get_double(value));
    self->state->turn.note_change();
  } else {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  }
}

static void lf_view_request_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfViewRequest* self = LF_VIEW_REQUEST(object);
  if (id == PROP_IS_LIVE) return g_value_set_boolean(value, gst_base_src_is_live(GST_BASE_SRC(self)));
  const lf::ObjectLock lock(self);
  if (id == PROP_NUM_BUFFERS)
    g_value_set_int(value, self->state->settings.num_buffers);
  else if (id >= PROP_FIRST_SETTING)
    lf::ViewRequestSettings::properties().get(self->state->settings, id, value);
  else if (id >= PROP_FIRST_FIELD)
    g_value_set_double(value, self->state->control.values()[id - PROP_FIRST_FIELD]);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
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
      g_param_spec_boolean(
          "is-live", "Is live",
          "If true, the element sends requests in real time, according to the pipeline clock. Set this for live "
          "cameras. If false, it sends requests as fast as the pipeline answers them, for example to write a file",
          FALSE, GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY)));
}

static bool push_upstream(LfViewRequest* self, GstEvent* event) {
  return self->state->relay.push_upstream(gst_event_ref(event));
}

// Called once for every viewer behind the tee and funnel of the node.
static gboolean take_delay(LfViewRequest* self, GstEvent* event, GstClockTime delay) {
  auto& state = *self->state;
  if (state.relay.is_on()) return push_upstream(self, event);
  const bool follows = lf_view_request_settings(self).capture_delay < 0;
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

// Focuses the next requests of this view. Returns false if the cameras do not have self access.
static bool take_focus(LfViewRequest* self, lf::DepthEstimate focus) {
  if (lf_view_request_settings(self).access != lf::Access::kSelf) return false;
  self->state->focus.announce(std::move(focus));
  if (const std::optional<double> found = self->state->focus.take_found())
    lf_view_request_set_focus_distance(self, *found);
  return true;
}

// Stores a focal surface in the relay, because no upstream viewer accepted the surface. Returns false if the relay is
// not live.
static bool keep_focus(LfViewRequest* self, guint view_id, lf::DepthEstimate focus) {
  if (!gst_base_src_is_live(GST_BASE_SRC(self))) return false;
  self->state->relayed_focus.announce(view_id, std::move(focus));
  return true;
}

// Ignores cameras that the rig lacks, because every node would refuse requests with such cameras.
static void announce_out_of_service(LfViewRequest* self, guint view_id, lf::CameraSet cameras) {
  lf::ObjectLock lock(self);
  const std::shared_ptr<const lf::Rig> rig = self->state->stream ? self->state->stream->rig() : nullptr;
  lock.unlock();
  if (rig) std::erase_if(cameras, [&rig](lf::CameraIndex camera) { return camera >= rig->cameras.size(); });
  self->state->out_of_service.announce(view_id, std::move(cameras));
}

// Handles feedback of a compositor. Cameras out of service apply to every view here; other feedback goes to the source
// of the view's requests. A relay stores a focal surface that no viewer accepts. Returns false if nothing was accepted.
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
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK && !self->state->seek_filter.is_new(gst_event_get_seqnum(event)))
    return TRUE;
  if (bool held = false; lf::parse_hold(event, &held)) return hold(self, event, held);
  if (GstClockTime delay; lf::parse_capture_delay(event, &delay)) return take_delay(self, event, delay);
  if (const auto feedback = lf::parse_view_feedback(event)) return take_feedback(self, event, *feedback);
  if (guint view_id; lf::SharedCaps caps = lf::parse_picture_caps(event, &view_id))
    return !self->state->relay.is_on() && view_id == lf_view_request_view_id(self) &&
           lf_view_request_follow_caps(self, std::move(caps));
  if (!lf_view_request_is_navigation(event))
    return GST_BASE_SRC_CLASS(g_type_class_peek(GST_TYPE_PUSH_SRC))->event(base, event);
  return self->state->relay.is_on() ? push_upstream(self, event) : lf_view_request_navigate(self, event);
}

// Returns the command for simple cameras (property `access`) that follows a request. Returns null if the cameras need
// none.
static GstBuffer* command_of(LfViewRequest* self, const lf::ViewRequest& request,
                             const std::shared_ptr<const lf::Rig>& rig) {
  try {
    std::vector<uint8_t> bytes = self->state->stream->command_for(request, rig);
    return bytes.empty() ? nullptr : lf::wrap_bytes(std::move(bytes));
  } catch (const lf::Error& error) {
    GST_ELEMENT_WARNING(self, STREAM, ENCODE,
                        ("View %u: can't create commands for the cameras: %s", request.view_id, error.what()),
                        (nullptr));
    return nullptr;
  }
}

// Queues the buffers that follow a request: its command, the requests `beside` for other views of its set, which get
// their numbers here, and extra requests. The timestamps come from `stamps`, the buffer of the request.
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
  for (const lf::ViewRequest& extra : state.extra.take_for(request, state.stream->next_number)) {
    send(lf::encode_request_buffer(extra));
    send(command_of(self, extra, rig));
  }
}

static GstFlowReturn relay_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  LfViewRequest* self = LF_VIEW_REQUEST(parent);
  g_autoptr(GstEvent) event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (event) {
    const GstSegment* segment = nullptr;
    gst_event_parse_segment(event, &segment);
    buffer = gst_buffer_make_writable(buffer);
    if (segment->format == GST_FORMAT_TIME)
      GST_BUFFER_PTS(buffer) = gst_segment_to_running_time(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
  }
  bool dropped = false;
  const GstFlowReturn flow = self->state->relay.push(buffer, gst_base_src_is_live(GST_BASE_SRC(self)), &dropped);
  if (dropped)
    GST_WARNING_OBJECT(pad,
                       "the request queue is full: dropped the oldest request, because downstream is "
                       "too slow");
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
  gst_event_unref(event);
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
  self->state->relay.end();
  gst_element_remove_pad(element, pad);
}

static void install_relay(GstElementClass* klass) {
  klass->request_new_pad = lf::callback<lf_view_request_new_pad>;
  klass->release_pad = lf::callback<lf_view_request_release_pad>;
  gst_element_class_add_static_pad_template(klass, &sink_template);
}

// Drops a command from upstream, which may be for another mesh than the one here.
static void drop_command(LfViewRequest* self) {
  GST_LOG_OBJECT(self, "dropped a command");
  if (!self->state->warned_commands && !self->state->stream->access())
    GST_ELEMENT_WARNING(self, STREAM, FAILED,
                        ("This relay drops the commands for cameras that it receives: set the property \"access\" of "
                         "the relay instead of the viewer's."),
                        (nullptr));
  self->state->warned_commands = true;
}

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
  // Cameras with other access kinds cannot test depths.
  request.hypotheses.clear();
  request.gains = {};
  return std::exchange(request.view.focus.map, nullptr) || request.view.blending != asked || changed;
}

// Takes the next relayed request, waiting if necessary, and adds the cameras out of service.
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
        GST_WARNING_OBJECT(self, "dropped an invalid view request: %s", reason.c_str());
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

static lf::Blending current_blending(LfViewRequest* self) {
  const lf::Blending asked = lf::make_blending(self->state->control.viewpoint().aperture,
                                               static_cast<int>(self->state->settings.nearest_cameras));
  const lf::CameraAccess* access = self->state->stream->access();
  return access ? access->blending(asked) : asked;
}

// Returns the delay from the capture time to the sending of a live request: the property, or the automatic delay.
static GstClockTime capture_delay_of(LfViewRequest* self) {
  const GstClockTime delay = lf_view_request_settings(self).capture_delay;
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

// Waits for the time of the slot, an instant of the capture schedule, or for a change of the view. *leaves becomes the
// slot with updated times. The schedule counts time of day; `offset` is time of day minus clock time.
static GstFlowReturn wait_for_turn(LfViewRequest* self, GstClock* clock, GstClockTimeDiff offset,
                                   GstClockTime capture_delay, const lf::RequestSlot& slot, lf::RequestSlot* leaves) {
  const GstClockTime base_time = gst_element_get_base_time(GST_ELEMENT(self));
  const GstClockTime turn = base_time + slot.pts + capture_delay;
  const GstClockTime early = std::min(slot.pts + capture_delay, slot.duration / 4 * 3);
  const bool eager = !slot.view && lf_view_request_settings(self).eager;
  *leaves = slot;
  if (!eager) return self->state->turn.wait_until(clock, turn);
  GstFlowReturn flow = self->state->turn.wait_until(clock, turn - early);
  if (flow == GST_FLOW_OK) flow = self->state->turn.wait_until(clock, turn, true);
  if (const GstClockTime now = gst_clock_get_time(clock); now < turn)
    *leaves = self->state->stream->schedule.early_request(slot, now + offset, base_time + offset, capture_delay);
  return flow;
}

static GstFlowReturn wait_live(LfViewRequest* self, std::optional<lf::RequestSlot>* slot, lf::RequestSlot* leaves) {
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) {
    GST_ELEMENT_ERROR(self, CORE, CLOCK,
                      ("A live source of view requests needs a clock. Let the pipeline select a "
                       "clock, or set is-live=false"),
                      (nullptr));
    return GST_FLOW_ERROR;
  }
  const GstClockTimeDiff offset = lf::wall_offset(GST_ELEMENT(self));
  const GstClockTime base_time = gst_element_get_base_time(GST_ELEMENT(self));
  const GstClockTime capture_delay = capture_delay_of(self);
  *slot =
      self->state->stream->schedule.next_live(gst_clock_get_time(clock) + offset, base_time + offset, capture_delay);
  return *slot ? wait_for_turn(self, clock, offset, capture_delay, **slot, leaves) : GST_FLOW_EOS;
}

// Waits for the time of the next request that the application does not skip.
static GstFlowReturn wait_for_request(LfViewRequest* self, std::optional<lf::RequestSlot>* slot,
                                      lf::RequestSlot* leaves) {
  while (true) {
    GstFlowReturn flow = lf_view_request_follow_rate(self);
    if (flow == GST_FLOW_OK) flow = wait_live(self, slot, leaves);
    if (flow != GST_FLOW_OK) return flow;
    gboolean skips = FALSE;
    g_signal_emit_by_name(self, "skip-request", leaves->pts, &skips);
    if (!skips) return GST_FLOW_OK;
    self->state->stream->schedule.advance(**slot);
  }
}

// Returns the requests for all views of the set except `middle`, the leader, with the capture time and the focal
// surface of the leader.
static std::vector<lf::ViewRequest> rest_of_set(const lf::ViewRequest& leader, const lf::ViewSet& set,
                                                const lf::View& middle) {
  std::vector<lf::ViewRequest> rest;
  for (const lf::ViewSetPosition& place : set.places()) {
    if (place.leads()) continue;
    lf::ViewRequest& beside = rest.emplace_back(leader);
    beside.place = place;
    beside.view = set.view(middle, place);
    lf::apply_reference_view(leader, beside);
  }
  return rest;
}

static GstFlowReturn make_request(LfViewRequest* self, GstBuffer** out) {
  const bool live = gst_base_src_is_live(GST_BASE_SRC(self));
  std::optional<lf::RequestSlot> turn;
  lf::RequestSlot slot{};
  bool warmup = false;
  if (live) {
    const GstFlowReturn flow = wait_for_request(self, &turn, &slot);
    if (flow != GST_FLOW_OK) return flow;
  } else {
    GstFlowReturn flow = self->state->turn.wait_for_seek();
    if (flow == GST_FLOW_OK && !self->state->stream->access())
      flow = self->state->focus_wait.wait(lf_view_request_view_id(self));
    if (flow != GST_FLOW_OK) return flow;
    warmup = self->state->focus_wait.is_warm_up_next();
    if (!warmup) flow = lf_view_request_follow_rate(self);
    if (flow != GST_FLOW_OK) return flow;
    turn = self->state->stream->schedule.next();
    if (!turn) return GST_FLOW_EOS;
    slot = *turn;
  }
  if (!slot.view) gst_object_sync_values(GST_OBJECT(self), slot.pts);

  lf::ViewRequest request;
  request.target_time = slot.target_time;
  request.absolute_time = live;
  request.warmup = warmup;
  if (!warmup) self->state->stream->schedule.advance(*turn);
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

  // Cameras with other access kinds cannot test depths, so their pictures use the focal plane of the viewer.
  if (!self->state->stream->access()) self->state->focus.apply(request);
  self->state->focus_wait.sent(request.sequence);
  *out = lf::encode_request_buffer(request);
  GST_BUFFER_PTS(*out) = slot.pts;
  GST_BUFFER_DURATION(*out) = slot.duration;
  GST_LOG_OBJECT(self, "request %u of view %u for %" GST_TIME_FORMAT, request.sequence, request.view_id,
                 GST_TIME_ARGS(request.target_time));
  if (!warmup) send_more(self, request, rig, *out, rest_of_set(request, set, middle));
  return GST_FLOW_OK;
}

static GstFlowReturn make_buffer(LfViewRequest* self, GstBuffer** out) {
  gint& left = self->state->requests_left;
  if ((*out = self->state->outbox.take())) return GST_FLOW_OK;
  if (left == 0) return GST_FLOW_EOS;
  const GstFlowReturn flow = self->state->relay.is_on() ? relay_request(self, out) : make_request(self, out);
  if (flow == GST_FLOW_OK && left > 0 && !self->state->focus_wait.is_warming_up()) left--;
  return flow;
}

// An exception loses only the current request. Repeated exceptions end the stream.
static GstFlowReturn lf_view_request_create(GstPushSrc* push, GstBuffer** out) {
  constexpr int kMaxInARow = 32;
  LfViewRequest* self = LF_VIEW_REQUEST(push);
  GstBuffer* made = nullptr;
  for (int i = 0; i < kMaxInARow; i++) {
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
  state.seek_filter.clear();
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

// GstBaseSrc posts a second error after each failed start, "some element failed to post a proper error message". It
// would hide the reason in programs that show the last error.
static gboolean lf_view_request_post_message(GstElement* element, GstMessage* message) {
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR) {
    g_autoptr(GError) error = nullptr;
    gst_message_parse_error(message, &error, nullptr);
    const bool had_error = LF_VIEW_REQUEST(element)->state->posted_error.exchange(true);
    if (had_error && g_error_matches(error, GST_CORE_ERROR, GST_CORE_ERROR_STATE_CHANGE)) {
      gst_message_unref(message);
      return TRUE;
    }
  }
  return GST_ELEMENT_CLASS(lf_view_request_parent_class)->post_message(element, message);
}

static gboolean lf_view_request_start(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  self->state->posted_error = false;
  const lf::ViewRequestSettings settings = lf_view_request_settings(self);
  try {
    lf::validate(settings.place(0), 0, 0);
    lf_view_request_begin_view(self, std::make_unique<lf::RequestStream>(settings));
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return FALSE;
  }
  warn_ignored_settings(self);
  lf::ObjectLock lock(self);
  const lf::RequestStream& stream = *self->state->stream;
  base->segment.duration = stream.schedule.end().value_or(GST_CLOCK_TIME_NONE);
  self->state->requests_left = settings.num_buffers;
  self->state->agreed = self->state->form;
  lock.unlock();
  GST_INFO_OBJECT(self, "view %u from %s", settings.view_id,
                  stream.from_file() ? settings.location.c_str() : "properties");
  const auto navigated = [](GstElement* element, GstEvent* event) {
    if (lf_view_request_is_navigation(event)) lf_view_request_navigate(LF_VIEW_REQUEST(element), event);
  };
  if (!settings.navigation_element.empty() &&
      !self->state->navigation_tap.attach(GST_ELEMENT(self), settings.navigation_element, navigated)) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS,
                      ("navigation-element: the pipeline has no element \"%s\" with a source pad. Use the name of an "
                       "element that the pictures pass through, such as a decoder.",
                       settings.navigation_element.c_str()),
                      (nullptr));
    lf_view_request_stop(base);  // Stops the element, because GstBaseSrc does not stop an element that failed to start.
    return FALSE;
  }
  return TRUE;
}

static gboolean lf_view_request_is_seekable(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  return !lf_view_request_settings(self).loop && !gst_base_src_is_live(base) && !self->state->relay.is_on();
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
  lf::ObjectLock lock(self);
  const lf::PictureFormat form = self->state->form;
  lock.unlock();
  const GstClockTime period = form.fps_n > 0 ? lf::Schedule(form.fps_n, form.fps_d).period() : 0;
  if (self->state->relay.is_on()) {
    gboolean live = FALSE;
    if (self->state->relay.query_upstream(query)) gst_query_parse_latency(query, &live, nullptr, nullptr);
    if (!live) gst_query_set_latency(query, TRUE, 0, period);
    return TRUE;
  }
  // A request is sent after the capture delay and replaced a frame later. Its timestamp is its capture time.
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
  element_class->post_message = lf::callback<lf_view_request_post_message>;
  gst_element_class_set_static_metadata(
      element_class, "Light field view request source", "Source",
      "Sends view requests for the virtual camera of one viewer. The view comes from a camera path (location), "
      "properties, mouse and keys, or the set-view action, which takes a structure with optional fields (x, y, z, yaw, "
      "pitch, roll, fov, focus-distance, aperture, margin)",
      "gst-lightfield");

  GstBaseSrcClass* base_class = GST_BASE_SRC_CLASS(klass);
  lf_view_request_install_format(base_class);
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
