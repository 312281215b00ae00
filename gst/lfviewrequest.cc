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
 * - else the properties `x`, `y`, `z`, `yaw`, `pitch`, `roll`, `fov`, `focus-distance`, `aperture`: one request per frame. They are
 *   controllable; a GstController is asked for the stamp of each request. With `rig` those that are not set are chosen
 *   so that the view stands in the middle of the array and looks where it looks.
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
 * Cameras that lfcompositor announces as out of service (upstream event "lightfield-out-of-service") are named in the
 * view's requests from then on, beside those of the property `out-of-service`.
 *
 * With its sink pad linked the element makes no requests of its own but relays those of other viewers, and adds the
 * cameras that are out of service: on the host of the compositors, behind the network.
 *
 * What a compositor wants to know beside its pictures (upstream event "lightfield-extra-requests": lfcompositor
 * monitor-interval) leaves behind the next request, with the same capture time.
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
 * Not live, requests leave as fast as they are taken and ask for the running time of their frame. Live, they leave at
 * the instants of the capture schedule (multiples of the frame time on the pipeline's clock) plus `capture-delay`, and
 * ask for that instant in clock time; instants that passed while downstream was blocked are left out. With `eager` a
 * change of the view is asked for at once, in place of the next instant.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lfcameranode name=n rig=rig.json ! c.sink_0  r. ! queue ! c.request \
 *   lfcompositor name=c ! videoconvert ! pngenc ! multifilesink location=out_%02d.png
 * ]| Pictures of the views in a file.
 * |[
 * gst-launch-1.0 lfviewrequest rig=rig.json is-live=true width=640 height=480 framerate=30/1 ! tee name=r \
 *   r. ! queue leaky=downstream ! n.request  lfcameranode name=n rig=rig.json is-live=true ! c.sink_0 \
 *   r. ! queue leaky=downstream ! c.request  lfcompositor name=c ! videoconvert ! autovideosink
 * ]| A window in which mouse and keys fly.
 * |[
 * gst-launch-1.0 tcpserversrc port=5000 ! lfparse ! lfviewrequest is-live=true ! tee name=r  r. ! queue ! n.request \
 *   lfcameranode name=n rig=rig.json is-live=true ! c.sink_0  r. ! queue ! c.request \
 *   lfcompositor name=c rig=rig.json ! videoconvert ! autovideosink
 * ]| The requests of a viewer on another host.
 */

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "extra_requests_event.h"
#include "focal_surface_event.h"
#include "gst_wire.h"
#include "lfviewrequest_private.h"

GST_DEBUG_CATEGORY(lf_view_request_debug);
#define GST_CAT_DEFAULT lf_view_request_debug

enum {
  PROP_0,
  PROP_IS_LIVE,
  PROP_FIRST_FIELD,  // one for each of kViewFields, then one for each of the settings
  PROP_FIRST_SETTING = PROP_FIRST_FIELD + lf::kNumViewFields,
  PROP_NET_CLOCK = PROP_FIRST_SETTING + lf::ViewRequestSettings::kNumProperties,
};
enum { SIGNAL_SET_VIEW, SIGNAL_FOCUS_AT, NUM_SIGNALS };
static guint signals[NUM_SIGNALS];
static GParamSpec* field_pspecs[lf::kNumViewFields];

static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_MEDIA_TYPE ", framerate = (fraction) [ 0/1, max ]"));

G_DEFINE_FINAL_TYPE(LfViewRequest, lf_view_request, GST_TYPE_PUSH_SRC)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfviewrequest, "lfviewrequest", GST_RANK_NONE, LF_TYPE_VIEW_REQUEST,
                                      GST_DEBUG_CATEGORY_INIT(lf_view_request_debug, "lfviewrequest", 0,
                                                              "source of view requests"))

// ------------------------------------------------------------------------------------------------- the view's state

lf::View lf_view_request_view(LfViewRequest* self) {
  const int width = self->settings->width, height = self->settings->height;
  return lf::make_view(self->control->viewpoint(), width ? width : self->stream->default_width(),
                       height ? height : self->stream->default_height());
}

// Of views of a file, too. Cameras that are told triangles know no other weights.
static lf::Blending current_blending(LfViewRequest* self) {
  if (self->settings->access == lf::Access::kWarp) return {};
  return lf::blending_of(self->control->viewpoint().aperture, static_cast<int>(self->settings->nearest_cameras));
}

// What mouse and keys are held back by, if they are.
static std::shared_ptr<const lf::VisibleShare> visible_share(const lf::ViewRequestSettings& settings,
                                                             const std::shared_ptr<const lf::Rig>& rig) {
  if (!rig || !settings.keep_visible) return nullptr;
  return std::make_shared<lf::VisibleShare>(*rig);
}

// With the object lock: a request that waits for its turn may leave.
static void note_change(LfViewRequest* self) {
  self->changed = true;
  if (self->waits_for_change && self->clock_id) gst_clock_id_unschedule(self->clock_id);
}

gboolean lf_view_request_change_view(LfViewRequest* self, const std::function<gboolean(lf::ViewControl&)>& change) {
  GST_OBJECT_LOCK(self);
  const lf::ViewValues before = self->control->values();
  const gboolean done = change(*self->control);
  const lf::ViewValues after = self->control->values();
  if (before != after) note_change(self);
  GST_OBJECT_UNLOCK(self);
  for (int i = 0; i < lf::kNumViewFields; i++)
    if (before[i] != after[i]) g_object_notify_by_pspec(G_OBJECT(self), field_pspecs[i]);
  return done;
}

static gboolean lf_view_request_set_view(LfViewRequest* self, const GstStructure* structure) {
  return structure && lf_view_request_change_view(
                          self, [&](lf::ViewControl& control) { return control.set_view(structure); });
}

static guint view_id_of(LfViewRequest* self) {
  GST_OBJECT_LOCK(self);
  const guint view_id = self->settings->view_id;
  GST_OBJECT_UNLOCK(self);
  return view_id;
}

static bool is_navigation(GstEvent* event) { return GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION; }
static bool is_view(GstEvent* event) {
  return GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && gst_event_has_name(event, lf::kViewEvent);
}

// What a view event says beside the numbers of the view. False if that is nothing.
static gboolean follow(LfViewRequest* self, const GstStructure* structure) {
  const GValue* value = gst_structure_get_value(structure, lf::kFocusContinuous);
  GValue number = G_VALUE_INIT;
  g_value_init(&number, G_TYPE_DOUBLE);
  const bool given = value && g_value_transform(value, &number);
  if (given) g_object_set(self, lf::kFocusContinuous, g_value_get_double(&number) != 0, nullptr);
  g_value_unset(&number);
  return given;
}

// By an event that is one of these two.
static gboolean steer(LfViewRequest* self, GstEvent* event) {
  std::optional<lf::Vec2> click;
  const gboolean done = lf_view_request_change_view(self, [&](lf::ViewControl& control) {
    if (!self->stream || self->stream->from_file()) return FALSE;
    if (!lf::is_for_view(event, self->settings->view_id)) return FALSE;
    if (is_view(event)) return gboolean(control.set_view(gst_event_get_structure(event)));
    const lf::View view = lf_view_request_view(self);
    const bool changed = self->settings->navigation && control.navigate(event, view.width, view.height);
    click = control.take_click();
    return gboolean(changed);
  });
  if (click) lf_view_request_focus_at(self, click->x, click->y);
  const bool own = is_view(event) && lf::is_for_view(event, view_id_of(self));
  return (own && follow(self, gst_event_get_structure(event))) || done;
}

static gboolean lf_view_request_event(GstBaseSrc* base, GstEvent* event) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  if (self->out_of_service->announce(event)) return TRUE;
  const bool of_focus = lf::is_focal_surface(event), of_more = lf::is_extra_requests(event);
  if (!of_focus && !of_more && !is_navigation(event) && !is_view(event))
    return GST_BASE_SRC_CLASS(lf_view_request_parent_class)->event(base, event);
  if (lf_view_request_is_relay(self)) return gst_pad_push_event(self->sink, gst_event_ref(event));
  if (of_more) return lf_view_request_take_extra(self, event);
  return of_focus ? lf_view_request_take_focus(self, event) : steer(self, event);
}

// ----------------------------------------------------------------------------------------------------------- stream

static GstCaps* lf_view_request_get_caps(GstBaseSrc* base, GstCaps* filter) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GST_OBJECT_LOCK(self);
  GstCaps* caps = gst_caps_new_simple(LF_REQUEST_MEDIA_TYPE, "framerate", GST_TYPE_FRACTION, self->settings->fps_n,
                                      self->settings->fps_d, nullptr);
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

static gboolean lf_view_request_start(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GST_OBJECT_LOCK(self);
  const lf::ViewRequestSettings settings = *self->settings;
  GST_OBJECT_UNLOCK(self);

  std::unique_ptr<lf::RequestStream> stream;
  std::shared_ptr<const lf::VisibleShare> share;
  try {
    stream = std::make_unique<lf::RequestStream>(settings);
    share = visible_share(settings, stream->rig());
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return FALSE;
  }
  base->segment.duration = stream->end();
  GST_INFO_OBJECT(self, "view %u at %d/%d frames/s, %s", settings.view_id, settings.fps_n, settings.fps_d,
                  stream->from_file() ? settings.location.c_str() : "from properties");
  lf_view_request_change_view(self, [&](lf::ViewControl& control) {
    self->stream = stream.release();
    control.begin(self->stream->default_viewpoint());
    control.keep_visible(share);
    return true;
  });
  const auto navigated = [self](GstEvent* event) {
    if (is_navigation(event) || is_view(event)) steer(self, event);
  };
  if (!settings.navigation_from.empty() &&
      !self->navigation_tap->attach(GST_ELEMENT(self), settings.navigation_from, navigated)) {
    GST_ELEMENT_ERROR(
        self, RESOURCE, SETTINGS,
        ("navigation-from: the pipeline has no element \"%s\" with a source pad.", settings.navigation_from.c_str()),
        (nullptr));
    return FALSE;
  }
  return TRUE;
}

static gboolean lf_view_request_stop(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  self->navigation_tap->detach();
  GST_OBJECT_LOCK(self);
  delete self->stream;
  self->stream = nullptr;
  self->extra->clear();
  GST_OBJECT_UNLOCK(self);
  gst_queue_array_clear(self->to_send);
  self->warned_commands = self->asked_for_focus = self->has_sent = false;
  self->focus_feedback->clear();
  self->relay->clear();
  self->out_of_service->clear();
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
  if (segment->rate <= 0) return FALSE;
  gst_queue_array_clear(LF_VIEW_REQUEST(base)->to_send);
  if (!gst_base_src_is_live(base)) LF_VIEW_REQUEST(base)->stream->seek(segment->position);
  return TRUE;
}

static gboolean lf_view_request_query(GstBaseSrc* base, GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY || !gst_base_src_is_live(base))
    return GST_BASE_SRC_CLASS(lf_view_request_parent_class)->query(base, query);
  // A request leaves at its stamp, and is replaced by the next a frame later.
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GST_OBJECT_LOCK(self);
  const GstClockTime period = lf::Schedule(self->settings->fps_n, self->settings->fps_d).period();
  GST_OBJECT_UNLOCK(self);
  gst_query_set_latency(query, TRUE, 0, period);
  return TRUE;
}

static gboolean lf_view_request_unlock(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GST_OBJECT_LOCK(self);
  self->unlocked = true;
  self->focus_feedback->set_unlocked(true);
  self->relay->set_unlocked(true);
  if (self->clock_id) gst_clock_id_unschedule(self->clock_id);
  GST_OBJECT_UNLOCK(self);
  return TRUE;
}

static gboolean lf_view_request_unlock_stop(GstBaseSrc* base) {
  LfViewRequest* self = LF_VIEW_REQUEST(base);
  GST_OBJECT_LOCK(self);
  self->unlocked = false;
  self->focus_feedback->set_unlocked(false);
  self->relay->set_unlocked(false);
  GST_OBJECT_UNLOCK(self);
  return TRUE;
}

// GstBaseSrc would wait after create(), with a request that is then a frame old: so the wait is here, before the view
// is looked at.
static GstFlowReturn wait_until(LfViewRequest* self, GstClock* clock, GstClockTime time, bool or_change = false) {
  GST_OBJECT_LOCK(self);
  if (self->unlocked || (or_change && self->changed)) {
    const GstFlowReturn flow = self->unlocked ? GST_FLOW_FLUSHING : GST_FLOW_OK;
    GST_OBJECT_UNLOCK(self);
    return flow;
  }
  self->waits_for_change = or_change;
  GstClockID id = self->clock_id = gst_clock_new_single_shot_id(clock, time);
  GST_OBJECT_UNLOCK(self);
  const GstClockReturn result = gst_clock_id_wait(id, nullptr);
  GST_OBJECT_LOCK(self);
  self->clock_id = nullptr;
  const bool ended = result == GST_CLOCK_UNSCHEDULED && !(or_change && self->changed && !self->unlocked);
  GST_OBJECT_UNLOCK(self);
  gst_clock_id_unref(id);
  return ended ? GST_FLOW_FLUSHING : GST_FLOW_OK;
}

// Waits for the slot's turn, or for a change before it. *leaves: the slot, with the times that it then has.
static GstFlowReturn wait_for_turn(LfViewRequest* self, GstClock* clock, GstClockTime base_time,
                                   const lf::RequestSlot& slot, lf::RequestSlot* leaves) {
  const GstClockTime turn = base_time + slot.pts, early = std::min(slot.pts, slot.duration / 4 * 3);
  GST_OBJECT_LOCK(self);
  const bool eager = self->settings->eager && !slot.view;
  GST_OBJECT_UNLOCK(self);
  *leaves = slot;
  if (!eager) return wait_until(self, clock, turn);
  GstFlowReturn flow = wait_until(self, clock, turn - early);
  if (flow == GST_FLOW_OK) flow = wait_until(self, clock, turn, true);
  if (const GstClockTime now = gst_clock_get_time(clock); now < turn)
    *leaves = self->stream->ahead_of_turn(slot, now, base_time);
  return flow;
}

// Chooses the next slot of a live stream and waits for it.
static GstFlowReturn wait_live(LfViewRequest* self, std::optional<lf::RequestSlot>* slot, lf::RequestSlot* leaves) {
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) {
    GST_ELEMENT_ERROR(self, CORE, CLOCK, ("A live source of view requests needs a clock"), (nullptr));
    return GST_FLOW_ERROR;
  }
  const GstClockTime base_time = gst_element_get_base_time(GST_ELEMENT(self));
  *slot = self->stream->next_live(gst_clock_get_time(clock), base_time);
  return *slot ? wait_for_turn(self, clock, base_time, **slot, leaves) : GST_FLOW_EOS;
}

static GstFlowReturn lf_view_request_create(GstPushSrc* push, GstBuffer** out) {
  LfViewRequest* self = LF_VIEW_REQUEST(push);
  if ((*out = static_cast<GstBuffer*>(gst_queue_array_pop_head(self->to_send)))) return GST_FLOW_OK;
  if (lf_view_request_is_relay(self)) return lf_view_request_relay(self, out);
  const bool live = gst_base_src_is_live(GST_BASE_SRC(push));
  std::optional<lf::RequestSlot> turn;
  lf::RequestSlot slot{};
  if (live) {
    const GstFlowReturn flow = wait_live(self, &turn, &slot);
    if (flow != GST_FLOW_OK) return flow;
  } else {
    const GstFlowReturn flow = lf_view_request_wait_for_focus(self);
    if (flow != GST_FLOW_OK) return flow;
    turn = self->stream->next();
    if (!turn) return GST_FLOW_EOS;
    slot = *turn;
  }
  if (!slot.view) gst_object_sync_values(GST_OBJECT(self), slot.pts);

  lf::ViewRequest request;
  request.target_time = slot.target_time;
  request.absolute_time = live;
  request.sequence = self->stream->advance(*turn);
  GST_OBJECT_LOCK(self);
  request.rig_hash = self->stream->rig_hash();
  const std::shared_ptr<const lf::Rig> rig = self->stream->rig();
  request.view_id = self->settings->view_id;
  request.quality = static_cast<uint8_t>(self->settings->quality);
  request.out_of_service = self->out_of_service->with_announced(request.view_id, self->stream->out_of_service());
  request.view = lf::seen_beside(slot.view ? *slot.view : lf_view_request_view(self), self->settings->eye_offset);
  request.view.blending = current_blending(self);
  self->changed = false;
  GST_OBJECT_UNLOCK(self);

  self->focus_feedback->apply(request);
  self->has_sent = true;
  self->last_sequence = request.sequence;
  *out = lf::encode_request_buffer(request);
  GST_BUFFER_PTS(*out) = slot.pts;
  GST_BUFFER_DURATION(*out) = slot.duration;
  GST_LOG_OBJECT(self, "request %u of view %u for %" GST_TIME_FORMAT, request.sequence, request.view_id,
                 GST_TIME_ARGS(request.target_time));
  lf_view_request_send_more(self, request, rig, *out);
  return GST_FLOW_OK;
}

// ------------------------------------------------------------------------------------------------------- properties

// While the element runs a rig is read at once. Cameras that were announced as out of service are those of the rig
// before: whoever notices that one is missing says so again.
static void set_rig(LfViewRequest* self, const lf::ViewRequestSettings& changed, std::shared_ptr<const lf::Rig> rig) {
  const uint64_t before = self->stream->rig_hash();
  self->stream->set_rig(std::move(rig), changed.out_of_service);
  if (self->stream->rig_hash() != before) self->out_of_service->clear();
}

static void set_setting(LfViewRequest* self, lf::ViewRequestSettings::Property property, const GValue* value) {
  const bool is_rig = property == lf::ViewRequestSettings::kRig;
  const gchar* path = is_rig ? g_value_get_string(value) : nullptr;
  std::shared_ptr<const lf::Rig> rig;
  if (path && lf::is_running(GST_ELEMENT(self)) && !(rig = lf::reload_rig(GST_ELEMENT(self), path))) return;
  std::string problem;
  GST_OBJECT_LOCK(self);
  lf::ViewRequestSettings changed = *self->settings;
  changed.set(property, value);
  try {
    if (self->stream && is_rig && (rig || !path)) set_rig(self, changed, rig);
    if (self->stream && property == lf::ViewRequestSettings::kOutOfService)
      self->stream->set_out_of_service(changed.out_of_service);
    if (self->stream && (is_rig || property == lf::ViewRequestSettings::kKeepVisible))
      self->control->keep_visible(visible_share(changed, self->stream->rig()));
    *self->settings = changed;
    self->focus_feedback->follow(changed.focus_continuous);
  } catch (const lf::Error& error) {
    problem = error.what();
  }
  GST_OBJECT_UNLOCK(self);
  if (!problem.empty())
    GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                        ("%s; %s as %s", problem.c_str(), is_rig ? "the rig stays" : "the cameras out of service stay",
                         is_rig ? "it was" : "they were"),
                        (nullptr));
}

static void lf_view_request_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfViewRequest* self = LF_VIEW_REQUEST(object);
  if (id == PROP_IS_LIVE) {
    gst_base_src_set_live(GST_BASE_SRC(self), g_value_get_boolean(value));
  } else if (id >= PROP_NET_CLOCK) {
    self->net_clock->set(static_cast<lf::NetClock::Property>(id - PROP_NET_CLOCK), value);
  } else if (id >= PROP_FIRST_SETTING) {
    set_setting(self, static_cast<lf::ViewRequestSettings::Property>(id - PROP_FIRST_SETTING), value);
  } else if (id >= PROP_FIRST_FIELD) {
    GST_OBJECT_LOCK(self);
    self->control->set(static_cast<int>(id) - PROP_FIRST_FIELD, g_value_get_double(value));
    note_change(self);
    GST_OBJECT_UNLOCK(self);
  } else {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  }
}

static void lf_view_request_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfViewRequest* self = LF_VIEW_REQUEST(object);
  if (id == PROP_IS_LIVE) return g_value_set_boolean(value, gst_base_src_is_live(GST_BASE_SRC(self)));
  if (id >= PROP_NET_CLOCK)
    return self->net_clock->get(static_cast<lf::NetClock::Property>(id - PROP_NET_CLOCK), value);
  GST_OBJECT_LOCK(self);
  if (id >= PROP_FIRST_SETTING)
    self->settings->get(static_cast<lf::ViewRequestSettings::Property>(id - PROP_FIRST_SETTING), value);
  else if (id >= PROP_FIRST_FIELD)
    g_value_set_double(value, self->control->values()[id - PROP_FIRST_FIELD]);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  GST_OBJECT_UNLOCK(self);
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
  delete self->navigation_tap;
  delete self->relay;
  gst_queue_array_free(self->to_send);
  delete self->extra;
  delete self->focus_feedback;
  delete self->out_of_service;
  gst_clear_caps(&self->relayed_caps);
  delete self->settings;
  delete self->control;
  delete self->net_clock;
  G_OBJECT_CLASS(lf_view_request_parent_class)->finalize(object);
}

static void install_properties(GObjectClass* klass) {
  for (int i = 0; i < lf::kNumViewFields; i++) {
    const lf::ViewField& f = lf::kViewFields[i];
    field_pspecs[i] = g_param_spec_double(
        f.name, f.nick, f.blurb, f.min, f.max, f.initial,
        GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING | GST_PARAM_CONTROLLABLE));
    g_object_class_install_property(klass, PROP_FIRST_FIELD + i, field_pspecs[i]);
  }
  lf::ViewRequestSettings::install(klass, PROP_FIRST_SETTING);
  lf::NetClock::install(klass, PROP_NET_CLOCK);
  g_object_class_install_property(
      klass, PROP_IS_LIVE,
      g_param_spec_boolean("is-live", "Is live",
                           "Make requests in time with the clock, for frames that live cameras make", FALSE,
                           GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY)));
}

static void lf_view_request_class_init(LfViewRequestClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = lf_view_request_set_property;
  object_class->get_property = lf_view_request_get_property;
  object_class->finalize = lf_view_request_finalize;
  install_properties(object_class);

  /**
   * LfViewRequest::set-view:
   * @request: the element
   * @view: a structure of any name with any of the fields x, y, z, yaw, pitch, roll, fov, focus-distance, aperture, as
   * numbers
   *
   * Moves the view; values beyond the properties' ranges are put inside them. The next request has it.
   *
   * Returns: %FALSE, and nothing is changed, if there is none of these fields or one is not a finite number.
   */
  signals[SIGNAL_SET_VIEW] = g_signal_new_class_handler(
      "set-view", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
      G_CALLBACK(lf_view_request_set_view), nullptr, nullptr, nullptr, G_TYPE_BOOLEAN, 1,
      GST_TYPE_STRUCTURE | G_SIGNAL_TYPE_STATIC_SCOPE);

  /**
   * LfViewRequest::focus-at:
   * @request: the element
   * @x: pixels of the view, from the middle of its first one
   * @y: the same
   *
   * Puts the focal plane where the view is in focus at a pixel, as a click on the picture does: at once if its
   * lfcompositor has a focal surface, else as soon as two small views have swept all depths. With `focus-continuous` it is
   * kept in focus from then on.
   *
   * Returns: %FALSE if a number is not finite, or the view is a file's, or the element does not run, or its cameras are
   * told where to look (`access`).
   */
  signals[SIGNAL_FOCUS_AT] = g_signal_new_class_handler(
      "focus-at", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
      G_CALLBACK(lf_view_request_focus_at), nullptr, nullptr, nullptr, G_TYPE_BOOLEAN, 2, G_TYPE_DOUBLE, G_TYPE_DOUBLE);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf_view_request_change_state;
  element_class->provide_clock = lf_view_request_provide_clock;
  gst_element_class_add_static_pad_template(element_class, &src_template);
  lf_view_request_install_relay(element_class);
  gst_element_class_set_static_metadata(
      element_class, "Light field view request source", "Source",
      "The virtual camera of one viewer, as a stream of view requests: from a camera path (location), from properties, "
      "flown with mouse and keys, or set by the action set-view, whose structure has properties as fields (x, y, z, "
      "yaw, "
      "pitch, roll, fov, focus-distance, aperture; each optional)",
      "gst-lightfield");

  GstBaseSrcClass* base_class = GST_BASE_SRC_CLASS(klass);
  base_class->get_caps = lf_view_request_get_caps;
  base_class->negotiate = lf_view_request_negotiate;
  base_class->start = lf_view_request_start;
  base_class->stop = lf_view_request_stop;
  base_class->is_seekable = lf_view_request_is_seekable;
  base_class->do_seek = lf_view_request_do_seek;
  base_class->query = lf_view_request_query;
  base_class->event = lf_view_request_event;
  base_class->unlock = lf_view_request_unlock;
  base_class->unlock_stop = lf_view_request_unlock_stop;
  GST_PUSH_SRC_CLASS(klass)->create = lf_view_request_create;
}

static void lf_view_request_init(LfViewRequest* self) {
  self->settings = new lf::ViewRequestSettings;
  self->control = new lf::ViewControl;
  self->net_clock = new lf::NetClock;
  GST_OBJECT_FLAG_SET(self, GST_ELEMENT_FLAG_PROVIDE_CLOCK);
  self->navigation_tap = new lf::NavigationTap;
  self->relay = new lf::RequestRelay;
  self->to_send = gst_queue_array_new(4);
  gst_queue_array_set_clear_func(self->to_send, reinterpret_cast<GDestroyNotify>(gst_buffer_unref));
  self->extra = new std::vector<lf::ViewRequest>;
  self->focus_feedback = new lf::FocusFeedback;
  self->out_of_service = new lf::OutOfService;
  gst_base_src_set_format(GST_BASE_SRC(self), GST_FORMAT_TIME);
}
