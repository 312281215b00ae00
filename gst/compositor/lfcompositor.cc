// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfcompositor
 * @title: lfcompositor
 * @short_description: adds the fragments of a view up to its picture
 *
 * Takes the view requests of one viewer on `request` and the answers of any number of nodes (`lffragment`) on
 * `sink_%u`, and puts out one picture per request, when every node has answered or, in a live pipeline, when the time
 * that `latency` allows is over. Requests and answers of other views than `view-id` are ignored, so that one `tee` can
 * serve many compositors. Fragments that never came count as lost: with `rig` set the others make up for them.
 *
 * Live, what has come is composed when the request's deadline (`latency` after it) is over, and `incomplete` says what
 * is done with a picture of which something is missing. Cameras missing from more than `max-missed` pictures in a row
 * are announced upstream as out of service (custom event "lightfield-feedback"): lfviewrequest names them in the
 * requests from then on, and everybody leaves them out of the mesh, so that their neighbours close the gap. Corners of
 * the array (with `rig`, as long as three cameras work) stay in it: others show what they had a part in, and what the
 * array covers does not shrink. They come back the same way. A node that is gone is not waited for.
 *
 * With `rig`, unless `focus` is plane, every pixel is focused on its own: requests have trials, whose moments (sums
 * that tell how far cameras disagree on a trial surface) come before the answers, and after each picture the better
 * surface and the next trials go upstream (the same event) to the view's lfviewrequest. Files
 * in, files out, that waits for them, so that pictures do not depend on how fast anything is.
 *
 * Of a set of views (`lfviewrequest views`) the pictures make one, which is put out when the last of them is there.
 * That of a pair has GStreamer's multiview-mode in its caps. In `stats` and messages each view counts as a picture.
 *
 * With `monitor-interval` the array is watched as it runs: now and then one camera, each in turn, is predicted from the
 * others and compared with what it sees itself. For that its lfviewrequest asks for two small views more (the same
 * event), which are answered like any other and not shown.
 *
 * With `partial` the output is not a picture but the sum of the answers, as the answer of one node: compositors make a
 * tree, whose root takes in one answer a rack.
 *
 * Where a sink says that pictures come too late (QoS events), requests of this view that can't be in time any more are
 * left out here and answered without a picture by the nodes, until one can. A QoS message tells of each.
 *
 * Each picture has a #GstReferenceTimestampMeta of `timestamp/x-lightfield-capture`, the capture time asked for: clock
 * time where requests are live, else stream time.
 *
 * Each picture says which view it shows: it has a #GstCustomMeta "lightfield-view", which elements such as `queue`,
 * `videoconvert` and encoders pass on. Fields:
 *
 * - view-id, sequence (uint): of the request that the picture answers.
 * - capture-time (uint64, nanoseconds): as the meta above has it.
 * - position (array of 3 doubles: x, y, z in metres) and orientation (array of 4 doubles: w, x, y, z): the pose of the
 *   view in the world.
 * - lens (structure): model (string: COLMAP's name), params (array of double, COLMAP's order), width, height (int,
 *   pixels).
 * - focus (structure): mode (string: plane or surface), plane (array of 4 doubles: a, b, c, d with
 *   a x + b y + c z + d = 0), distance (double: of that plane along the optical axis, metres); of a surface nearest and
 *   farthest (double, metres from the array).
 * - aperture (double, metres; 0: none), nearest-cameras (int; 0: three, by the mesh).
 * - coverage (double: share of the view that cameras can see; with `rig`).
 * - complete (boolean), fragments, missing, damaged (uint): as in the element message.
 * - missing-cameras (array of uint: indices in the rig) and missing-nodes (array of string): cameras that gave nothing
 *   to the picture, and nodes that had not answered.
 * - views (array of structures), of a set alone: for each view column, row (int: where it is in the picture), sequence,
 *   position, orientation, lens, coverage and completeness. The fields above are then of the view next to the middle.
 *
 * A picture that is shown again (`incomplete=repeat`) keeps the meta of the view that it was made for.
 *
 * Where sizes are left open, and the frame rate, the view's lfviewrequest chooses them so that they suit downstream
 * caps, also when these change while playing. Pictures have the format of the cameras, RGB or YCbCr 4:2:0: a
 * `videoconvert` makes other formats.
 *
 * Pictures have the time stamps and the segment of their requests. A seek goes to the requests, if all pads lead there.
 *
 * Navigation events (mouse, keys) and custom "lightfield-view-request" events go upstream to the view's own
 * `lfviewrequest`.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lfcameranode name=n rig=rig.json ! c.sink_0  r. ! queue ! c.request \
 *   lfcompositor name=c rig=rig.json ! videoconvert ! pngenc ! multifilesink location=out_%02d.png
 * ]|
 *
 * |[
 * ... lfcompositor name=rack partial=true rig=rig.json node=7 ! tcpserversink port=5007
 * ]| The compositor of a rack inside a tree.
 *
 * ## Element messages
 * With `post-messages` an element message "lightfield-view" per picture: view-id, sequence (uint), pts (uint64),
 * complete (boolean), coverage (double: share of the view that cameras can see; with `rig`), fragments, missing,
 * damaged (uint), bytes, trial-bytes (of what came of trials), skew-ns, latency-ns (request to picture), add-ns
 * (decoding and adding what came) and composite-ns (uint64). Always "lightfield-out-of-service" when that set changes:
 * view-id (uint), cameras (array of uint). "lightfield-suspects" when the monitor changes its mind: view-id (uint),
 * suspects (array of structures: camera (uint), fault (string: colour, direction or picture)).
 */

#include "compositor/lfcompositor.h"

#include <utility>

#include "base/text.h"
#include "common/custom_events.h"
#include "compositor/picture_output.h"
#include "fragment/lffragment.h"

GST_DEBUG_CATEGORY(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

#define LF_PICTURE_FORMATS LF_VIDEO_CAPS("{ " LF_RGB_FORMATS ", I420, NV12 }")

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_ANSWER_CAPS));
static GstStaticPadTemplate request_template =
    GST_STATIC_PAD_TEMPLATE("request", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_CAPS));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_PICTURE_FORMATS "; " LF_ANSWER_CAPS));

G_DEFINE_FINAL_TYPE(LfCompositor, lf_compositor, GST_TYPE_AGGREGATOR)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfcompositor, "lfcompositor", GST_RANK_NONE, LF_TYPE_COMPOSITOR,
                                      GST_DEBUG_CATEGORY_INIT(lf_compositor_debug, "lfcompositor", 0,
                                                              "view compositor"))

static GstAggregatorClass* parent_class() { return GST_AGGREGATOR_CLASS(lf_compositor_parent_class); }

GType lf_compositor_incomplete_get_type(void) {
  static const GType type = lf::register_enum<LfCompositorIncomplete>(
      "LfCompositorIncomplete",
      {{LF_COMPOSITOR_INCOMPLETE_CONCEAL,
        "Show what there is; with `rig`, the other cameras make up for what is missing, and the picture before where "
        "nothing is left",
        "conceal"},
       {LF_COMPOSITOR_INCOMPLETE_REPEAT, "Show the picture before again; conceal before the first", "repeat"},
       {LF_COMPOSITOR_INCOMPLETE_DROP, "Show nothing", "drop"}});
  return type;
}

GType lf_compositor_focus_get_type(void) {
  static const GType type = lf::register_enum<lf::FocusMode>(
      "LfCompositorFocus", {{lf::FocusMode::kPlane, "The viewer's focal plane", "plane"},
                            {lf::FocusMode::kSurface, "Every pixel on its own: trials with every request", "surface"},
                            {lf::FocusMode::kAuto, "The same with as many trials as the scene needs", "auto"}});
  return type;
}

GType lf_compositor_show_get_type(void) {
  static const GType type = lf::register_enum<lf::ShownWeights>(
      "LfCompositorShow",
      {{lf::ShownWeights::kNone, "What the cameras see", "picture"},
       {lf::ShownWeights::kContributions, "Over it in colours which cameras make each pixel, and the mesh between them",
        "contributions"},
       {lf::ShownWeights::kCoverage, "Over it how much of each pixel's weight is lost", "coverage"}});
  return type;
}

GType lf_compositor_gains_get_type(void) {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {LF_COMPOSITOR_GAINS_OFF, "Cameras' images are shown as bright as they come", "off"},
        {LF_COMPOSITOR_GAINS_ON, "Cameras match their brightness, behind what the rig says of their colours", "on"},
        {LF_COMPOSITOR_GAINS_AUTO, "They do until the rig says how their colours are to be corrected", "auto"},
        {0, nullptr, nullptr}};
    return g_enum_register_static("LfCompositorGains", values);
  }();
  return type;
}

namespace lf {

FocusControl::Settings CompositorSettings::view_focus() const {
  const bool on_plane = partial || (focus == FocusMode::kAuto && rig.empty());
  const FocusMode mode = on_plane ? FocusMode::kPlane : focus;
  if (!has_focus_range()) return {.mode = mode};
  return {.mode = mode, .near = focus_near, .far = focus_far};
}

std::string CompositorSettings::without_effect() const {
  std::string text;
  const auto say = [&text](bool idle, const std::string& why) {
    if (idle) text += (text.empty() ? "" : " ") + why;
  };
  const std::string range = format_text("focus-near is %g m and focus-far %g m", focus_near, focus_far);
  say(!has_focus_range(), range + ": the near end must be nearer. Both are left out, and the surface is " +
                              "looked for as the scene asks.");
  say(partial && focus == FocusMode::kSurface,
      "focus: inside a tree (partial) no surface is looked for; set it at the tree's root.");
  say(!partial && (node != 0 || codec != CodecChoice::kAuto),
      "node and codec: only a compositor inside a tree (partial) has answers of its own.");
  say(monitor_interval > 0 && rig.empty(), "monitor-interval: without a rig no camera is watched.");
  say(view_focus().mode == FocusMode::kPlane && (focus_near > 0 || focus_far > 0),
      "focus-near and focus-far: on a plane no depth is looked for.");
  say(gains == LF_COMPOSITOR_GAINS_ON && view_focus().mode == FocusMode::kPlane,
      "gains: cameras match their brightness where a surface is looked for, not on a plane.");
  say(show != ShownWeights::kNone && (partial || rig.empty()),
      "show: only pictures have colours of weights, and only with a rig.");
  return text;
}

PropertyTable<CompositorSettings>& CompositorSettings::properties() {
  using S = CompositorSettings;
  constexpr double kMaxFocus = 1e9;  // metres
  static PropertyTable<S> table = {
      property<&S::view_id>(kWhileReady, "view-id", "View id",
                            "The view to compose: requests and answers of others are ignored", 0, G_MAXUINT),
      property<&S::rig>(kWhilePlaying, "rig", "Rig",
                        "Rig file (rig.json); optional: with it the weight of fragments that never came is known and "
                        "made up for, `background` shows outside the array's mesh, and cameras that never answered at "
                        "all are noticed. Set while running, it is read again and serves from the next request on"),
      property<&S::background>(kWhilePlaying, "background", "Background",
                               "Colour where nothing contributes, 0xAARRGGBB (alpha is ignored)", 0, G_MAXUINT32),
      property<&S::post_messages>(kWhilePlaying, "post-messages", "Post messages",
                                  "Post an element message \"lightfield-view\" for every picture"),
      property<&S::incomplete>(kWhilePlaying, "incomplete", "Incomplete",
                               "What is put out for a request of which something is missing at its deadline",
                               LF_TYPE_COMPOSITOR_INCOMPLETE),
      property<&S::max_missed>(
          kWhileReady, "max-missed", "Max missed",
          "Live, a camera that is missing from more pictures in a row is announced upstream as out of service, and a "
          "node that is is not waited for, until they answer in time again (0: never)",
          0, G_MAXUINT),
      property<&S::partial>(kWhileReady, "partial", "Partial",
                            "Put out the sum of the answers as one answer for the next compositor of a tree, in place "
                            "of a picture; needs `rig`"),
      property<&S::node>(kWhileReady, "node", "Node", "Number carried in partial answers, as that of a node", 0,
                         G_MAXUINT),
      property<&S::codec>(kWhilePlaying, "codec", "Codec", "How pixels travel in partial answers",
                          LF_TYPE_FRAGMENT_CODEC),
      property<&S::focus>(
          kWhilePlaying, "focus", "Focus",
          "What pictures are focused on. Other than on a plane, the focal surface is found from what the cameras have "
          "in common on trial surfaces, and the view's lfviewrequest is told of it. Without `rig` auto is plane",
          LF_TYPE_COMPOSITOR_FOCUS),
      property<&S::focus_near>(kWhilePlaying, "focus-near", "Focus near",
                               "Nearest that a focal surface can be, metres from the array (0: at first as near as the "
                               "array can tell depths apart, then as the scene asks)",
                               0, kMaxFocus),
      property<&S::focus_far>(
          kWhilePlaying, "focus-far", "Focus far",
          "Farthest that a focal surface can be, metres from the array (0: at first infinity, then as the scene asks)",
          0, kMaxFocus),
      property<&S::monitor_interval>(
          kWhilePlaying, "monitor-interval", "Monitor interval",
          "Beside one of so many requests a camera, each in turn, is left out and predicted from the others, in a "
          "small view: `stats` tell how well, and which cameras stand out (0: never). Needs `rig`",
          0, G_MAXUINT16),
      property<&S::trial_interval>(kWhilePlaying, "trial-interval", "Trial interval",
                                   "At most one of so many requests has trials, by which a focal surface is found: "
                                   "more where time is short and the surface may follow the scene more slowly",
                                   1, G_MAXUINT16),
      property<&S::gains>(
          kWhilePlaying, "gains", "Gains",
          "Let cameras match their brightness to that of the others; with focus surface or auto. auto: as long as "
          "`rig` does not say how their colours are to be corrected. The lffragments' stats have each camera's gain",
          LF_TYPE_COMPOSITOR_GAINS),
      property<&S::show>(kWhilePlaying, "show", "Show",
                         "What pictures show: what the cameras see, or over it who makes what of it. Needs `rig`",
                         LF_TYPE_COMPOSITOR_SHOW),
  };
  return table;
}

}  // namespace lf

using Settings = lf::CompositorSettings;

static Settings& settings_of(LfCompositor* self) { return *self->settings; }

static GstStructure* stats_of(LfCompositor* self) {
  GstStructure* stats = self->state->stats.structure();
  self->guard->add_stats(stats);
  return stats;
}

using Properties = lf::Properties<settings_of, stats_of>;

Settings lf_compositor_settings(LfCompositor* self) { return Properties::now(self); }

bool lf_compositor_is_live(LfCompositor* self) {
  return GST_CLOCK_TIME_IS_VALID(gst_aggregator_get_latency(GST_AGGREGATOR(self)));
}

guint lf_compositor_view_id(LfCompositor* self) {
  const lf::ObjectLock lock(self);
  return self->settings->view_id;
}

// While it runs the file is read at once, and serves from the next request on. False if it can't be.
static bool lf_compositor_reload_rig(LfCompositor* self, const gchar* path) {
  std::shared_ptr<const lf::Rig> rig;
  if ((path || lf_compositor_settings(self).partial) && !(rig = lf::reload_rig(GST_ELEMENT(self), path))) return false;
  const lf::ObjectLock lock(self);
  delete self->new_rig;
  self->new_rig = new std::shared_ptr<const lf::Rig>(std::move(rig));
  return true;
}

// What comes out has the caps that it began with: while the element runs it stays what it is.
static bool lf_compositor_may_be_partial(LfCompositor* self, gboolean partial) {
  if (partial == lf_compositor_settings(self).partial) return true;
  GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                      ("partial: can't be changed while the element runs; it stays %s", partial ? "false" : "true"),
                      (nullptr));
  return false;
}

// Posts a warning of what is set without effect, but where it is the same as `before`.
static void warn_without_effect(LfCompositor* self, const std::string& before = "") {
  const std::string text = lf_compositor_settings(self).without_effect();
  if (!text.empty() && text != before) GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS, ("%s", text.c_str()), (nullptr));
}

static void lf_compositor_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfCompositor* self = LF_COMPOSITOR(object);
  if (self->guard->set(GST_ELEMENT(self), id, value)) return;
  if (lf::is_running(GST_ELEMENT(self))) {
    if (lf::is_named(pspec, "rig") && !lf_compositor_reload_rig(self, g_value_get_string(value))) return;
    if (lf::is_named(pspec, "partial") && !lf_compositor_may_be_partial(self, g_value_get_boolean(value))) return;
  }
  const std::string before = lf_compositor_settings(self).without_effect();
  Properties::set(object, id, value, pspec);
  if (lf::is_running(GST_ELEMENT(self))) warn_without_effect(self, before);
}

static void lf_compositor_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  if (!LF_COMPOSITOR(object)->guard->get(id, value)) Properties::get(object, id, value, pspec);
}

static void install_properties(GObjectClass* klass) {
  Properties::install(
      klass,
      "Counts of pictures (complete, incomplete, unseen: no camera sees anything of the view, repeated, dropped; "
      "card-pictures: made on a graphics card), "
      "requests skipped (too late to be shown, as QoS events say), requests refused for one of the limits "
      "(refused, "
      "and of these refused-pixels, -aperture, -trials, -rate, -views, -lens), "
      "coverage (share of the latest view that cameras can see; with `rig`), fragments (missing, damaged), late, "
      "repeated, stray (to requests that nobody has asked) and bad answers, pictures that failed (no memory), "
      "bytes, cameras out of service; the largest skew; of a focal surface: rounds of "
      "trials, their bytes, how far cameras disagree (residual, 255ths) and by how much the last round lessened "
      "it (gained), requests from one with trials to the next (interval), whether one plane is enough (flat); of "
      "the monitor: "
      "turns of cameras, their bytes, for each camera the PSNR, gain and shift (pixels of the small view) of its "
      "prediction, and suspects with their fault (colour, direction, picture); "
      "latency per stage (p50, p95, "
      "p99 over the latest 1024 pictures, nanoseconds)");
  lf::RequestGuard::install(klass);
  klass->set_property = lf::callback<lf_compositor_set_property>;
  klass->get_property = lf::callback<lf_compositor_get_property>;
  gst_type_mark_as_plugin_api(LF_TYPE_COMPOSITOR_INCOMPLETE, GstPluginAPIFlags(0));
  gst_type_mark_as_plugin_api(LF_TYPE_COMPOSITOR_FOCUS, GstPluginAPIFlags(0));
  gst_type_mark_as_plugin_api(LF_TYPE_COMPOSITOR_GAINS, GstPluginAPIFlags(0));
  gst_type_mark_as_plugin_api(LF_TYPE_COMPOSITOR_SHOW, GstPluginAPIFlags(0));
}

// Whether all that comes in follows a seek of the requests: answers out of a file or a socket don't.
static bool is_seekable(LfCompositor* self) {
  std::vector<GstPad*> pads;
  lf::ObjectLock lock(self);
  for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next)
    pads.push_back(GST_PAD(gst_object_ref(item->data)));
  lock.unlock();
  gboolean all = TRUE;
  for (GstPad* pad : pads) {
    GstQuery* query = gst_query_new_seeking(GST_FORMAT_TIME);
    gboolean seekable = FALSE;
    if (all && gst_pad_peer_query(pad, query)) gst_query_parse_seeking(query, nullptr, &seekable, nullptr, nullptr);
    all = all && seekable;
    gst_query_unref(query);
    gst_object_unref(pad);
  }
  return all;
}

// While the element runs: answers or video, and of video the formats of the cameras, once these are known. Before, the
// template: applications may set `partial` after they have linked the pad.
static bool lf_compositor_answer_caps_query(LfCompositor* self, GstQuery* query) {
  if (!lf::is_running(GST_ELEMENT(self))) return false;
  const lf::SharedCaps caps =
      lf::share_caps(lf_compositor_settings(self).partial ? lf::unit_caps(LF_ANSWER_MEDIA_TYPE)
                                                          : lf::offered_caps(self->state->output.family()));
  GstCaps* filter = nullptr;
  gst_query_parse_caps(query, &filter);
  const lf::SharedCaps filtered =
      filter ? lf::share_caps(gst_caps_intersect_full(filter, caps.get(), GST_CAPS_INTERSECT_FIRST)) : caps;
  gst_query_set_caps_result(query, filtered.get());
  return true;
}

// Where the output is and how long it is the requests tell.
static gboolean lf_compositor_src_query(GstAggregator* agg, GstQuery* query) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_SEEKING: {
      if (!gst_pad_peer_query(self->request, query)) return FALSE;
      GstFormat format = GST_FORMAT_UNDEFINED;
      gboolean seekable = FALSE;
      gint64 start = 0, stop = -1;
      gst_query_parse_seeking(query, &format, &seekable, &start, &stop);
      if (seekable && !is_seekable(self)) gst_query_set_seeking(query, format, FALSE, start, stop);
      return TRUE;
    }
    case GST_QUERY_DURATION: return gst_pad_peer_query(self->request, query);
    case GST_QUERY_POSITION: {
      GstFormat format = GST_FORMAT_UNDEFINED;
      gst_query_parse_position(query, &format, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      GST_OBJECT_LOCK(self);
      const GstSegment& segment = GST_AGGREGATOR_PAD(GST_AGGREGATOR_SRC_PAD(self))->segment;
      const guint64 position = gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, segment.position);
      GST_OBJECT_UNLOCK(self);
      if (!GST_CLOCK_TIME_IS_VALID(position)) return FALSE;
      gst_query_set_position(query, format, static_cast<gint64>(position));
      return TRUE;
    }
    case GST_QUERY_CAPS: return lf_compositor_answer_caps_query(self, query) || parent_class()->src_query(agg, query);
    case GST_QUERY_CONTEXT:
      return self->state->output.own_card().answer(query) || parent_class()->src_query(agg, query);
    default: return parent_class()->src_query(agg, query);
  }
}

lf::SharedCaps lf_compositor_accepted_caps(LfCompositor* self) {
  GstPad* src = GST_AGGREGATOR_SRC_PAD(self);
  g_autoptr(GstCaps) video = gst_caps_from_string(LF_PICTURE_FORMATS);
  return lf::share_caps(gst_pad_peer_query_caps(src, video));
}

// All whose requests come here are sought, one after the other, and go on together. Takes the event.
static gboolean seek(LfCompositor* self, GstEvent* event) {
  GstSeekFlags flags{};
  gst_event_parse_seek(event, nullptr, nullptr, &flags, nullptr, nullptr, nullptr, nullptr);
  const guint32 seqnum = gst_event_get_seqnum(event);
  const bool flushes = flags & GST_SEEK_FLAG_FLUSH;
  if (flushes) gst_pad_push_event(self->request, lf::hold_event(true, seqnum));
  const gboolean done = parent_class()->src_event(GST_AGGREGATOR(self), event);
  if (flushes) gst_pad_push_event(self->request, lf::hold_event(false, seqnum));
  return done;
}

// What a viewer does concerns its own requests alone. (GstAggregator 1.22.0 drops navigation events.)
static gboolean lf_compositor_src_event(GstAggregator* agg, GstEvent* event) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  const GstStructure* structure = gst_event_get_structure(event);
  const bool is_navigation = GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION;
  const bool is_view = GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && structure &&
                       gst_structure_has_name(structure, "lightfield-view-request");
  // The base class flushes what is downstream and asks every pad: each has to lead to the requests.
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK && (lf::is_reverse_seek(event) || !is_seekable(self))) {
    gst_event_unref(event);
    return FALSE;
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) {
    const guint view_id = lf_compositor_view_id(self);
    if (lf::QosWatch::view_of(event).value_or(view_id) == view_id) {
      event = lf::QosWatch::name_view(event, view_id);
      self->state->qos.see(event, lf_compositor_is_live(self));  // before the nodes, whose answers then say nothing
    }
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK) return seek(self, event);
  if (!is_navigation && !is_view) return parent_class()->src_event(agg, event);
  event = gst_event_make_writable(event);
  gst_structure_set(gst_event_writable_structure(event), LF_VIEW_ID_FIELD, G_TYPE_UINT, lf_compositor_view_id(self),
                    nullptr);
  return gst_pad_push_event(self->request, event);
}

// Events come here in the order of the data: at EOS of the requests all of them have been answered. That ends the
// output, whether or not the nodes ever end theirs (GstAggregator waits for all).
static gboolean lf_compositor_sink_event(GstAggregator* agg, GstAggregatorPad* pad, GstEvent* event) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  const bool of_requests = GST_PAD(pad) == self->request;
  const bool ended = of_requests && GST_EVENT_TYPE(event) == GST_EVENT_EOS;
  const guint32 seqnum = gst_event_get_seqnum(event);
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT_DONE && !of_requests) {
    gst_event_unref(event);  // said by the requests, behind the last picture
    return TRUE;
  }
  // Requests may come at another rate: output caps name it.
  if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS && of_requests) gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(agg));
  if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP && of_requests) {
    self->state->qos.clear();
    self->state->request_flushed = true;
  } else if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP) {
    lf::NodeInput::of(pad).flushed();
  }
  // Whoever writes a file would have an empty one, and be told that all went well.
  const uint64_t refused = self->guard->refused();
  if (ended && refused > 0 && !self->state->output.has_begun() && !lf_compositor_is_live(self))
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS,
                      ("There is no picture: of all requests %" G_GUINT64_FORMAT
                       " were refused. A warning before says which of the limits (max-pixels, ...) they are beyond.",
                       refused),
                      (nullptr));
  const gboolean ok = parent_class()->sink_event(agg, pad, event);
  // Before the first picture the source pad has no segment to end yet.
  if (ended && self->state->output.has_begun()) {
    GstEvent* eos = gst_event_new_eos();
    gst_event_set_seqnum(eos, seqnum);
    gst_pad_push_event(GST_AGGREGATOR_SRC_PAD(agg), eos);
    self->state->over = true;
  }
  return ok;
}

static gboolean lf_compositor_sink_query(GstAggregator* agg, GstAggregatorPad* pad, GstQuery* query) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  if (lf::is_in_process_query(query)) {
    lf::answer_in_process_query(query, self->state->output.context().get());
    return TRUE;
  }
  if (guint view_id; lf::is_focus_query(query, &view_id)) {
    const lf::CompositorSettings settings = lf_compositor_settings(self);
    if (view_id != settings.view_id || settings.view_focus().mode == lf::FocusMode::kPlane) return FALSE;
    lf::set_focus_waits(query, self->state->output.is_pushing());
    return TRUE;
  }
  if (guint view_id; lf::is_picture_caps_query(query, &view_id)) {
    const lf::CompositorSettings settings = lf_compositor_settings(self);
    if (view_id != settings.view_id || settings.partial) return FALSE;
    lf::answer_picture_caps_query(query, lf_compositor_accepted_caps(self).get());
    return TRUE;
  }
  return parent_class()->sink_query(agg, pad, query);
}

// Most often a view-id that was forgotten.
static void note_other_view(LfCompositor* self, uint32_t other) {
  if (!self->state->silence.others_asked(g_get_monotonic_time())) return;
  GST_ELEMENT_WARNING(
      self, STREAM, FAILED,
      ("Nobody asks for view %u, of this compositor, but for view %u and perhaps others: is view-id right?",
       lf_compositor_view_id(self), other),
      (nullptr));
}

// What is of other views never gets as far as to the pads' queues: nobody would take it from there while no own request
// comes, and a full queue stops the other views behind the same tee.
static GstPadProbeReturn lf_compositor_request_arrives(GstPad*, GstPadProbeInfo* info, gpointer data) {
  LfCompositor* self = LF_COMPOSITOR(data);
  if (self->state->over) return GST_PAD_PROBE_DROP;
  const lf::MappedBuffer mapped(GST_PAD_PROBE_INFO_BUFFER(info));
  const std::optional<lf::wire::RequestPeek> peek = lf::wire::peek_request(mapped.bytes());
  if (!peek) return GST_PAD_PROBE_OK;  // counted where it is taken
  if (peek->head.view_id != lf_compositor_view_id(self)) {
    note_other_view(self, peek->head.view_id);
    return GST_PAD_PROBE_DROP;
  }
  self->state->silence.asked();
  if (lf::wire::access_of_type(peek->type).value_or(lf::Access::kSelf) != lf::Access::kSelf)
    return GST_PAD_PROBE_DROP;  // for cameras
  if (!self->guard->admits(GST_ELEMENT(self), mapped.bytes(), self->state->extent, self->state->live))
    return GST_PAD_PROBE_DROP;
  if (!peek->head.probe && !peek->head.rehearsal)
    self->state->stats.request_arrived(peek->head.sequence, g_get_monotonic_time());
  return GST_PAD_PROBE_OK;
}

// GstAggregator bounds what waits on a pad by time. Answers out of a file or a TCP stream have none: with a duration
// they have their share of it, too.
static GstBuffer* give_duration(GstBuffer* answer) {
  constexpr GstClockTime kShare = 10 * GST_MSECOND;
  answer = gst_buffer_make_writable(answer);
  GST_BUFFER_DURATION(answer) = kShare;
  return answer;
}

static GstPadProbeReturn lf_compositor_answer_arrives(GstPad* pad, GstPadProbeInfo* info, gpointer data) {
  if (LF_COMPOSITOR(data)->state->over) return GST_PAD_PROBE_DROP;
  GstBuffer* answer = GST_PAD_PROBE_INFO_BUFFER(info);
  const std::optional<uint32_t> view_id = lf::peek_answer_view(answer);
  if (view_id && *view_id != lf_compositor_view_id(LF_COMPOSITOR(data))) return GST_PAD_PROBE_DROP;
  LF_COMPOSITOR(data)->state->silence.answered();
  lf::NodeInput::of(GST_AGGREGATOR_PAD(pad)).silence().answered();
  if (!GST_BUFFER_PTS_IS_VALID(answer) && !GST_BUFFER_DTS_IS_VALID(answer)) info->data = give_duration(answer);
  return GST_PAD_PROBE_OK;
}

// GstAggregator's own would name every pad sink_N and keep no name that was asked for.
static GstAggregatorPad* lf_compositor_create_pad(GstAggregator* agg, GstPadTemplate* templ, const gchar* name,
                                                  const GstCaps*) {
  g_autofree gchar* pad_name = nullptr;
  if (name && g_str_has_prefix(name, "sink_")) {
    pad_name = g_strdup(name);
  } else {
    guint number = 0;
    do {
      g_free(pad_name);
      pad_name = g_strdup_printf("sink_%u", number++);
      GstPad* taken = gst_element_get_static_pad(GST_ELEMENT(agg), pad_name);
      if (!taken) break;
      gst_object_unref(taken);
    } while (true);
  }
  gpointer pad =
      g_object_new(GST_TYPE_AGGREGATOR_PAD, "name", pad_name, "direction", GST_PAD_SINK, "template", templ, nullptr);
  lf::NodeInput::attach(GST_AGGREGATOR_PAD(pad));
  lf::accept_unit_caps(GST_PAD(pad));
  gst_pad_add_probe(GST_PAD(pad), GST_PAD_PROBE_TYPE_BUFFER, lf::callback<lf_compositor_answer_arrives>, agg, nullptr);
  return GST_AGGREGATOR_PAD(pad);
}

static void lf_compositor_release_pad(GstElement* element, GstPad* pad) {
  lf::NodeInput::of(GST_AGGREGATOR_PAD(pad)).let_go();
  GST_ELEMENT_CLASS(parent_class())->release_pad(element, pad);
}

static void add_request_pad(LfCompositor* self) {
  GstPadTemplate* templ = gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(self), "request");
  self->request = GST_PAD(
      g_object_new(GST_TYPE_AGGREGATOR_PAD, "name", "request", "direction", GST_PAD_SINK, "template", templ, nullptr));
  lf::accept_unit_caps(self->request);
  gst_pad_add_probe(self->request, GST_PAD_PROBE_TYPE_BUFFER, lf::callback<lf_compositor_request_arrives>, self,
                    nullptr);
  gst_element_add_pad(GST_ELEMENT(self), self->request);
}

static void install_pads(LfCompositorClass* klass) {
  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  aggregator_class->src_event = lf::callback<lf_compositor_src_event>;
  aggregator_class->src_query = lf::callback<lf_compositor_src_query>;
  aggregator_class->sink_event = lf::callback<lf_compositor_sink_event>;
  aggregator_class->sink_query = lf::callback<lf_compositor_sink_query>;
  aggregator_class->create_new_pad = lf::callback<lf_compositor_create_pad>;
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->release_pad = lf::callback<lf_compositor_release_pad>;
  gst_element_class_add_static_pad_template_with_gtype(element_class, &sink_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype(element_class, &request_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype(element_class, &src_template, GST_TYPE_AGGREGATOR_PAD);
}

// So that pictures from the beginning on are the same each time.
static void forget_history(LfCompositor* self) {
  auto& state = *self->state;
  state.focus.clear();
  state.turns.clear();
}

static void forget_early_answers(LfCompositor* self) {
  self->state->past.clear();
  for (lf::NodeInput* node : lf::NodeInputs(self->request)) node->forget_later();
}

// Null without a rig. Throws Error if it can't be read.
static std::shared_ptr<const lf::Rig> load_rig(const lf::CompositorSettings& settings) {
  if (!settings.rig.empty()) return lf::shared_rig(settings.rig);
  if (settings.partial)
    throw lf::Error("A compositor inside a tree must know what is missing: set the property \"rig\".");
  return nullptr;
}

static gboolean lf_compositor_start(GstAggregator* agg) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  auto& state = *self->state;
  const lf::CompositorSettings& settings = state.settings = lf_compositor_settings(self);
  try {
    lf_compositor_use_rig(self, load_rig(settings));
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return FALSE;
  }
  GST_OBJECT_LOCK(self);
  delete std::exchange(self->new_rig, nullptr);  // of the run before; `rig` may have been set again since
  GST_OBJECT_UNLOCK(self);
  warn_without_effect(self);
  state.health = lf::CameraHealth(settings.max_missed);
  if (state.rig && !settings.partial) state.health.expect(state.rig->cameras.size());
  state.gone = {};
  state.current.reset();
  state.request_flushed = state.over = false;
  state.warned_unseen = state.warned_unlinked = false;
  state.first_set.reset();
  state.latency_asked_at = 0;
  state.silence.clear();
  for (lf::NodeInput* node : lf::NodeInputs(self->request)) node->silence().clear();
  state.output.start(settings.partial, self->request);
  state.view_meta.clear();
  state.past.clear();
  state.qos.clear();
  forget_history(self);
  state.stats.reset();
  self->guard->start(GST_ELEMENT(self));
  return TRUE;
}

static GstFlowReturn lf_compositor_flush(GstAggregator* agg) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  lf_compositor_forget_request(self);
  forget_early_answers(self);
  self->state->over = false;
  self->state->output.flush();
  forget_history(self);
  return GST_FLOW_OK;
}

static gboolean lf_compositor_stop(GstAggregator* agg) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  lf_compositor_forget_request(self);
  forget_early_answers(self);
  self->state->output.stop();
  return TRUE;
}

static void lf_compositor_finalize(GObject* object) {
  LfCompositor* self = LF_COMPOSITOR(object);
  delete self->state;
  delete self->guard;
  delete self->new_rig;
  delete self->settings;
  G_OBJECT_CLASS(lf_compositor_parent_class)->finalize(object);
}

static lf::PictureOutput& output_of(GstAggregator* agg) { return LF_COMPOSITOR(agg)->state->output; }

static gboolean lf_compositor_negotiate(GstAggregator* agg) {
  output_of(agg).negotiate(lf_compositor_tell_caps(LF_COMPOSITOR(agg)));
  return TRUE;
}

static GstFlowReturn lf_compositor_update_src_caps(GstAggregator* agg, GstCaps* downstream, GstCaps** caps) {
  return output_of(agg).update_src_caps(downstream, caps);
}

static gboolean lf_compositor_negotiated_src_caps(GstAggregator* agg, GstCaps* caps) {
  return output_of(agg).negotiated_src_caps(caps);
}

static gboolean lf_compositor_decide_allocation(GstAggregator* agg, GstQuery* query) {
  return output_of(agg).decide_allocation(query);
}

static void lf_compositor_set_context(GstElement* element, GstContext* context) {
  output_of(GST_AGGREGATOR(element)).own_card().share(context);
  GST_ELEMENT_CLASS(lf_compositor_parent_class)->set_context(element, context);
}

static void lf_compositor_class_init(LfCompositorClass* klass) {
  G_OBJECT_CLASS(klass)->finalize = lf_compositor_finalize;
  GST_ELEMENT_CLASS(klass)->set_context = lf::callback<lf_compositor_set_context>;
  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  aggregator_class->start = lf::callback<lf_compositor_start>;
  aggregator_class->stop = lf::callback<lf_compositor_stop>;
  aggregator_class->flush = lf::callback<lf_compositor_flush>;
  aggregator_class->aggregate = lf::callback<lf_compositor_aggregate>;
  aggregator_class->negotiate = lf::callback<lf_compositor_negotiate>;
  aggregator_class->update_src_caps = lf::callback<lf_compositor_update_src_caps>;
  aggregator_class->negotiated_src_caps = lf::callback<lf_compositor_negotiated_src_caps>;
  aggregator_class->decide_allocation = lf::callback<lf_compositor_decide_allocation>;
  aggregator_class->get_next_time = lf::callback<lf_compositor_next_time>;
  install_properties(G_OBJECT_CLASS(klass));
  install_pads(klass);
  lf::register_view_meta();
  gst_element_class_set_static_metadata(
      GST_ELEMENT_CLASS(klass), "Light field compositor", "Filter/Editor/Video/Compositor",
      "Adds the fragments that answer a view request up to its picture", "gst-lightfield developers");
}

static void lf_compositor_init(LfCompositor* self) {
  self->settings = new lf::CompositorSettings;
  self->state = new _LfCompositor::State(GST_AGGREGATOR(self));
  self->guard = new lf::RequestGuard;
  add_request_pad(self);
  g_object_set(self, "latency", LF_COMPOSITOR_LATENCY, nullptr);
}
