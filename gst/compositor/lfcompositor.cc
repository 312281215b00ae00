// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfcompositor
 * @title: lfcompositor
 * @short_description: combines the fragments of a view into its picture
 *
 * lfcompositor produces the pictures of one view. It takes the view's requests on `request`, collects the answers of
 * any number of camera nodes (`lffragment`) on `sink_%u`, and outputs one picture per request. An answer consists of
 * fragments: parts of the view with the contribution of one node's cameras. Use this element if nodes and viewer are
 * separate elements; `lfviewsrc` contains all of them.
 *
 * ## Example launch line
 *
 * Renders the views of views.json from the cameras of rig.json and writes one PNG file per view:
 *
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lfcameranode name=n rig=rig.json ! c.sink_0  r. ! queue ! c.request \
 *   lfcompositor name=c rig=rig.json ! videoconvert ! pngenc ! multifilesink location=out_%02d.png
 * ]|
 *
 * In a large array, each rack of hosts can have a compositor that adds the answers of its nodes:
 *
 * |[
 * ... lfcompositor name=rack partial=true rig=rig.json node=7 ! tcpserversink port=5007
 * ]|
 *
 * ## Live pipelines and missing cameras
 *
 * A picture is finished when every node has answered. In a live pipeline, the compositor waits only until the deadline
 * of the picture, which is `latency` after the request. The property `incomplete` selects the output if an answer is
 * still missing then. If all answers arrive after the deadlines, for example on a busy machine, the compositor
 * increases `latency` to at most 6 times its value. It decreases `latency` again when answers arrive early, and
 * restores it when it stops. After each change, it posts a LATENCY message. If `rig` is set, the remaining cameras
 * compensate for missing fragments. The compositor ignores requests and answers of views other than `view-id`, so that
 * one `tee` can feed several compositors.
 *
 * A camera that misses more than `max-missed` consecutive pictures is out of service. The compositor announces this
 * upstream with the custom event "lightfield-feedback", and lfviewrequest names the camera in later requests. All nodes
 * then leave the camera out of the mesh (the triangles of neighbouring cameras), so that its neighbours close the gap.
 * A camera returns to service after it answers again. The compositor also does not wait for nodes that miss too many
 * pictures.
 *
 * If `rig` is set, the cameras at the corners of the array stay in the mesh as long as three cameras work, even if they
 * are out of service. Without them, the mesh and therefore the visible area would be smaller.
 *
 * If a sink reports with QoS events that pictures arrive too late, the compositor skips requests that cannot be
 * answered in time. The nodes then send empty answers to these requests, and the compositor posts a QoS message for
 * each of them.
 *
 * ## Focus
 *
 * If `rig` is set and `focus` is not plane, the whole picture is sharp, because each part of it has its own depth.
 * These depths are called the focal surface. The compositor finds them by search: requests contain depth hypotheses,
 * which are guesses of the depths. Nodes answer each hypothesis with photo-consistency sums, which show how well the
 * cameras agree on the guess. After each picture, the improved focal surface and the next hypotheses go upstream in a
 * "lightfield-feedback" event. If nothing is live, lfviewrequest waits for this event before the next request, so that
 * pictures do not depend on the speed of the machine.
 *
 * ## Sets, monitoring and trees
 *
 * A set consists of several views that form one picture, such as a stereo pair (`views` of lfviewrequest). The picture
 * is output when the last view is complete. The caps of a stereo pair contain GStreamer's multiview-mode. `stats` and
 * messages count each view as a picture.
 *
 * If `monitor-interval` is set, the compositor checks the cameras one after another, to find cameras that are out of
 * adjustment. It compares the image of a camera with a prediction from its neighbours. For this comparison,
 * lfviewrequest sends requests for two small extra views, which are not shown.
 *
 * If `partial` is true, the output is not a picture but the sum of all answers, encoded like the answer of a single
 * node. Another compositor can therefore use it as an input. In such a tree of compositors, for example, the compositor
 * at the root receives only one answer from each rack of hosts.
 *
 * ## Depths
 *
 * The request pads `depth_src` and `confidence_src` deliver the depths of each picture, as a depth camera does, with
 * the same size, pose and time. Put a queue behind every source pad if several are linked. The depths are those of the
 * focal surface that the picture shows.
 *
 * - depth_src: `video/x-raw, format=GRAY16_LE`. A value v of 1 or more stands for the inverse depth
 *   depth-offset + v * depth-scale, in 1/metre (or 1/unit of the rig). The caps have both numbers as fields (double),
 *   and so has the meta of each buffer. The depth is the distance along the optical axis of the view. 0 means that the
 *   depth is unknown. 1 is `focus-far` or farther, and infinity by default. 65535 is `focus-near` or nearer, and by
 *   default at most a quarter of the nearest distance that the array can measure, and at most a quarter of `focus-far`.
 *   The numbers of the caps are constant unless the rig or these properties change.
 * - confidence_src: `video/x-raw, format=GRAY8`, from 0 (the depth is a guess) to 255 (certain). It is high where the
 *   cameras agree about the depth and disagree about other depths. It is 0 in regions without detail, where the picture
 *   shows the focal plane, and for all views of a set but the middle one.
 *
 * ## Output
 *
 * Pictures have the format of the cameras, RGB or YCbCr 4:2:0; use `videoconvert` for other formats. If the size or the
 * frame rate of lfviewrequest is not set, it follows the downstream caps, even if these change while playing.
 *
 * Pictures have the time stamps and the segment of their requests. A seek is forwarded to the requests if all pads lead
 * to the source of the requests. Navigation events (mouse, keys) and custom "lightfield-view-request" events go
 * upstream to the view's `lfviewrequest`.
 *
 * Each picture has a #GstReferenceTimestampMeta of `timestamp/x-lightfield-capture` with the requested capture time.
 * This is clock time if requests are live, otherwise stream time.
 *
 * Each picture has a #GstCustomMeta "lightfield-view" that describes its view. Elements such as `queue`, `videoconvert`
 * and encoders keep the meta. A repeated picture (`incomplete=repeat`) keeps the meta of its original view. Fields:
 *
 * - view-id, sequence (uint): identify the request.
 * - capture-time (uint64, nanoseconds): as in the reference timestamp.
 * - position (array of 3 doubles: x, y, z in metres) and orientation (array of 4 doubles: w, x, y, z): the pose of the
 *   view in the world.
 * - lens (structure): model (string: COLMAP's name), params (array of double, COLMAP's order), width, height (int,
 *   pixels).
 * - focus (structure): mode (string: plane or surface), plane (array of 4 doubles: a, b, c, d with
 *   a x + b y + c z + d = 0), distance (double: distance of that plane along the optical axis, metres); in mode surface
 *   also nearest and farthest (double, metres from the array) and map.
 * - focus.map (structure): the surface in focus, as a grid of inverse distances. Node (i, j) is at the pixel position
 *   ((i + 1/2) step - 1/2, (j + 1/2) step - 1/2), and the depth between nodes is interpolated. step, columns, rows
 *   (int); levels (GBytes: one byte per node, row by row); inverse-farthest and inverse-nearest (double, 1/metres: the
 *   inverse distances of levels 0 and 255); from (array of 4 doubles: the plane that distances are measured from, along
 *   its normal).
 * - focus.confidence (structure): the confidence of the surface, see `confidence_src`, at nodes like those of the map.
 *   step, columns, rows (int); values (GBytes: 0 to 255). Missing if the picture shows the focal plane.
 * - depth-scale, depth-offset (double): only on `depth_src`, see above.
 * - aperture (double, metres; 0: none), nearest-cameras (int; 0: three, by the mesh).
 * - coverage (double: share of the view that cameras can see; with `rig`).
 * - extrapolated (double: part of `coverage` that is beside the camera mesh, where the nearest cameras fill in).
 * - complete (boolean), fragments, missing, damaged (uint): as in the element message below.
 * - missing-cameras (array of uint: indices in the rig): cameras without a contribution to the picture.
 * - missing-nodes (array of string): nodes that had not answered when the picture was made.
 * - views (array of structures), only for sets: column, row (int: position in the picture), sequence, position,
 *   orientation, lens, focus, coverage and completeness of each view. The fields above then describe the view next to
 *   the middle.
 *
 * ## Element messages
 *
 * - "lightfield-view", per picture, with `post-messages`: view-id, sequence (uint), pts (uint64), complete (boolean),
 *   coverage and extrapolated (double: as in the meta above; with `rig`), fragments, missing, damaged (uint), bytes,
 *   consistency-bytes (size of the photo-consistency units), skew-ns, latency-ns (request to picture), add-ns (decoding
 * and adding answers) and composite-ns (uint64).
 * - "lightfield-out-of-service", when the set of cameras out of service changes: view-id (uint), cameras (array of
 *   uint).
 * - "lightfield-suspects", when the camera check (`monitor-interval`) finds or clears a suspicious camera: view-id
 *   (uint), suspects (array of structures: camera (uint), fault (string: colour, direction or picture)).
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

static GstStaticPadTemplate depth_template = GST_STATIC_PAD_TEMPLATE(LF_DEPTH_PAD, GST_PAD_SRC, GST_PAD_REQUEST,
                                                                     GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("GRAY16_LE")));
static GstStaticPadTemplate confidence_template = GST_STATIC_PAD_TEMPLATE(
    LF_CONFIDENCE_PAD, GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("GRAY8")));

G_DEFINE_FINAL_TYPE(LfCompositor, lf_compositor, GST_TYPE_AGGREGATOR)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfcompositor, "lfcompositor", GST_RANK_NONE, LF_TYPE_COMPOSITOR,
                                      GST_DEBUG_CATEGORY_INIT(lf_compositor_debug, "lfcompositor", 0,
                                                              "view compositor"))

static GstAggregatorClass* parent_class() { return GST_AGGREGATOR_CLASS(lf_compositor_parent_class); }

static GType incomplete_type() {
  static const GType type = lf::register_enum<LfCompositorIncomplete>(
      "LfCompositorIncomplete",
      {{LF_COMPOSITOR_INCOMPLETE_CONCEAL,
        "Show the parts that have arrived. If `rig` is set, the remaining cameras compensate for the missing parts, "
        "and the previous picture fills empty pixels",
        "conceal"},
       {LF_COMPOSITOR_INCOMPLETE_REPEAT,
        "Repeat the previous picture. If there is no previous picture, do the same as conceal", "repeat"},
       {LF_COMPOSITOR_INCOMPLETE_DROP, "Output no picture for this request", "drop"}});
  return type;
}

static GType focus_type() {
  static const GType type = lf::register_enum<lf::FocusMode>(
      "LfCompositorFocus",
      {{lf::FocusMode::kPlane,
        "One focal plane, at the distance in the request. Objects at other distances are blurred or appear double",
        "plane"},
       {lf::FocusMode::kSurface, "A depth for each pixel (a focal surface), updated with every request", "surface"},
       {lf::FocusMode::kAuto, "A depth for each pixel (a focal surface), updated as often as the scene needs",
        "auto"}});
  return type;
}

static GType show_type() {
  static const GType type = lf::register_enum<lf::WeightOverlayMode>(
      "LfCompositorShow",
      {{lf::WeightOverlayMode::kNone, "The picture without an overlay", "picture"},
       {lf::WeightOverlayMode::kContributions,
        "The cameras that contribute to each pixel, as colours, and the mesh of the array", "contributions"},
       {lf::WeightOverlayMode::kCoverage, "The share of each pixel that no camera contributed", "coverage"}});
  return type;
}

static GType gains_type() {
  static const GType type = lf::register_enum<LfCompositorGains>(
      "LfCompositorGains",
      {{LF_COMPOSITOR_GAINS_OFF, "No exposure compensation. The cameras keep their differences in brightness", "off"},
       {LF_COMPOSITOR_GAINS_ON,
        "Exposure compensation, in addition to the colour corrections of the rig, which are applied first", "on"},
       {LF_COMPOSITOR_GAINS_AUTO,
        "Exposure compensation, unless the rig file already has colour corrections, for example from lf-calibrate "
        "colour",
        "auto"}});
  return type;
}

namespace lf {

DepthEstimator::Settings CompositorSettings::view_depths() const {
  const bool on_plane = partial || (focus == FocusMode::kAuto && rig.empty());
  const FocusMode mode = on_plane ? FocusMode::kPlane : focus;
  if (!has_focus_range()) return {.mode = mode};
  return {.mode = mode, .near = focus_near, .far = focus_far};
}

std::string CompositorSettings::ignored_settings() const {
  std::string text;
  const auto say = [&text](bool idle, const std::string& why) {
    if (idle) text += (text.empty() ? "" : " ") + why;
  };
  const std::string range = format_text("focus-near is %g m and focus-far %g m", focus_near, focus_far);
  say(!has_focus_range(), range + ": the near end must be nearer. The compositor ignores " +
                              "these limits and adapts the range to the scene.");
  say(partial && focus == FocusMode::kSurface,
      "focus: inside a tree (partial) there is no focal surface; set focus at the root of the tree.");
  say(!partial && (node != 0 || codec != CodecChoice::kAuto),
      "node and codec: have no effect on pictures, only on partial answers (partial=true).");
  say(monitor_interval > 0 && rig.empty(), "monitor-interval: the camera monitor needs a rig. Set the property rig.");
  say(view_depths().mode == FocusMode::kPlane && (focus_near > 0 || focus_far > 0),
      "focus-near and focus-far: have no effect, because the focus is a plane and no depths are estimated.");
  say(gains == LF_COMPOSITOR_GAINS_ON && view_depths().mode == FocusMode::kPlane,
      "gains: exposure compensation needs a focal surface, so it is off while the focus is a plane.");
  say(show != WeightOverlayMode::kNone && (partial || rig.empty()),
      "show: only pictures have an overlay, not partial answers, and the overlay needs a rig.");
  return text;
}

// The properties of the focal surface.
static std::vector<Property<CompositorSettings>> surface_properties() {
  using S = CompositorSettings;
  constexpr double kMaxFocus = 1e9;
  return {
      property<&S::focus>(
          kWhilePlaying, "focus", "Focus",
          "Selects between one focal plane for the whole picture and a focal surface, which has a depth for each pixel "
          "and makes the whole picture sharp. The compositor estimates these depths by comparing the camera images at "
          "several distances, and sends them to the lfviewrequest of the view. Without `rig`, auto means plane",
          focus_type()),
      property<&S::focus_near>(
          kWhilePlaying, "focus-near", "Focus near",
          "Nearest distance that the search for the focal surface tests, in metres from the array. Set this if the "
          "range of depths is known, because the search is then faster and makes fewer errors (0: the distance adapts "
          "to the scene, starting at the nearest distance that the array can measure)",
          0, kMaxFocus),
      property<&S::focus_far>(
          kWhilePlaying, "focus-far", "Focus far",
          "Farthest distance that the search for the focal surface tests, in metres from the array. See also "
          "`focus-near` (0: the distance adapts to the scene, starting at infinity)",
          0, kMaxFocus),
      property<&S::depth_interval>(kWhilePlaying, "depth-interval", "Depth interval",
                                   "Minimum number of requests between two updates of the focal surface. A larger "
                                   "value saves time, but the surface follows the scene more slowly. Increase it for "
                                   "static scenes or slow machines",
                                   1, G_MAXUINT16),
      property<&S::gains>(
          kWhilePlaying, "gains", "Gains",
          "Exposure compensation for cameras that are brighter or darker than the rest of the array, for example "
          "because of automatic exposure. It prevents visible seams between the contributions of different cameras. "
          "The gains are estimated with the focal surface (the depth of each pixel), so there is no compensation if "
          "`focus` is plane. The `stats` property of lffragment lists the gains",
          gains_type()),
  };
}

PropertyTable<CompositorSettings>& CompositorSettings::properties() {
  using S = CompositorSettings;
  static PropertyTable<S> table = {
      {
          property<&S::view_id>(
              kWhileReady, "view-id", "View id",
              "Number of the view that this element composes. Requests and answers of other views are "
              "ignored, so several compositors can receive the same stream",
              0, G_MAXUINT),
          property<&S::rig>(
              kWhilePlaying, "rig", "Rig",
              "Path of the rig file (rig.json), which describes the cameras of the array. The compositor "
              "needs a rig to compensate for missing cameras, to detect cameras that have never answered, to "
              "estimate depths, and to show `background` in areas that no camera sees. If the property is "
              "set while the element runs, the new rig applies from the next request on"),
          property<&S::background>(
              kWhilePlaying, "background", "Background",
              "Colour of pixels that no camera sees, as 0xAARRGGBB. For example, 0xff808080 is medium "
              "grey. The alpha value is ignored. Requires `rig`",
              0, G_MAXUINT32),
          property<&S::post_messages>(kWhilePlaying, "post-messages", "Post messages",
                                      "If true, the element posts an element message \"lightfield-view\" for every "
                                      "picture. The message contains "
                                      "sizes and durations, such as the latency. Use it to measure a pipeline"),
          property<&S::incomplete>(
              kWhilePlaying, "incomplete", "Incomplete",
              "Selects the output if parts of a picture have not arrived by its deadline (see "
              "`latency`). This happens only in live pipelines, where an answer can be late or lost",
              incomplete_type()),
          property<&S::max_missed>(
              kWhileReady, "max-missed", "Max missed",
              "Maximum number of consecutive pictures that a camera or a node may miss in a live pipeline (0: "
              "unlimited). "
              "If a camera misses more pictures, other cameras replace it. If a node misses more pictures, the "
              "compositor "
              "no longer waits for it. Cameras and nodes return to service when their answers arrive in time again",
              0, G_MAXUINT),
          property<&S::partial>(
              kWhileReady, "partial", "Partial",
              "If true, the element outputs partial answers instead of pictures. A partial answer is the weighted sum "
              "of "
              "the images of all cameras that feed this compositor. Another compositor takes it as input. Use this for "
              "a "
              "tree of compositors, for example with one compositor for each rack of hosts. Requires `rig`"),
          property<&S::node>(kWhileReady, "node", "Node",
                             "Number that identifies this compositor in its partial answers. All nodes and compositors "
                             "that feed the same compositor must have different numbers",
                             0, G_MAXUINT),
          property<&S::codec>(
              kWhilePlaying, "codec", "Codec",
              "Pixel encoding of partial answers (see `partial`). JPEG compression saves network bandwidth, but costs "
              "computing time on both hosts and changes the picture slightly. Pictures are never compressed",
              LF_TYPE_FRAGMENT_CODEC),
          property<&S::monitor_interval>(
              kWhilePlaying, "monitor-interval", "Monitor interval",
              "Number of requests between two camera checks, which find cameras that are out of adjustment (0: no "
              "checks). "
              "A check predicts a small image of one camera from its neighbours and compares it with the real image. "
              "`stats` lists the results and the suspicious cameras. Requires `rig`",
              0, G_MAXUINT16),
          property<&S::show>(
              kWhilePlaying, "show", "Show",
              "Overlay that shows how the cameras contribute to each pixel. Use it to find cameras that are "
              "missing, hidden or misplaced. Requires `rig`",
              show_type()),
      },
      surface_properties()};
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

static lf::RequestGuard& guard_of(LfCompositor* self) { return *self->guard; }

using Properties = lf::Properties<settings_of, stats_of, guard_of>;

Settings lf_compositor_settings(LfCompositor* self) { return Properties::now(self); }

bool lf_compositor_is_live(LfCompositor* self) {
  return GST_CLOCK_TIME_IS_VALID(gst_aggregator_get_latency(GST_AGGREGATOR(self)));
}

guint lf_compositor_view_id(LfCompositor* self) {
  const lf::ObjectLock lock(self);
  return self->settings->view_id;
}

// Loads a new rig file while the element runs. The rig is used from the next request on. Returns false if the file
// cannot be loaded.
static bool lf_compositor_reload_rig(LfCompositor* self, const gchar* path) {
  std::shared_ptr<const lf::Rig> rig;
  if ((path || lf_compositor_settings(self).partial) && !(rig = lf::reload_rig(GST_ELEMENT(self), path))) return false;
  const lf::ObjectLock lock(self);
  delete self->new_rig;
  self->new_rig = new std::shared_ptr<const lf::Rig>(std::move(rig));
  return true;
}

// Refuses the change while the element runs, because `partial` determines the output caps.
static bool lf_compositor_may_be_partial(LfCompositor* self, gboolean partial) {
  if (partial == lf_compositor_settings(self).partial) return true;
  GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                      ("partial: can't be changed while the element runs; it stays %s", partial ? "false" : "true"),
                      (nullptr));
  return false;
}

static void warn_ignored_settings(LfCompositor* self, const std::string& before = "") {
  const std::string text = lf_compositor_settings(self).ignored_settings();
  if (!text.empty() && text != before) GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS, ("%s", text.c_str()), (nullptr));
}

static void lf_compositor_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfCompositor* self = LF_COMPOSITOR(object);
  if (lf::is_running(GST_ELEMENT(self))) {
    if (lf::is_named(pspec, "rig") && !lf_compositor_reload_rig(self, g_value_get_string(value))) return;
    if (lf::is_named(pspec, "partial") && !lf_compositor_may_be_partial(self, g_value_get_boolean(value))) return;
  }
  const std::string before = lf_compositor_settings(self).ignored_settings();
  Properties::set(object, id, value, pspec);
  if (lf::is_running(GST_ELEMENT(self))) warn_ignored_settings(self, before);
}

static void install_properties(GObjectClass* klass) {
  Properties::install(
      klass,
      "Counters since the start, measurements and durations. Pictures are counted as complete, incomplete, unseen (no "
      "camera sees any part of the view), repeated, dropped or failed (no memory). gpu-pictures counts the pictures "
      "that a GPU has made. Requests are counted as skipped (too late, according to QoS events) or refused, by the "
      "exceeded limit: refused-pixels, -aperture, -hypotheses, -rate, -views, -lens. Fragments, which are the parts of "
      "the answers, are counted as missing or damaged. Answers are counted as late, repeated, bad or unexpected "
      "(without a request). bytes counts the bytes of answers, and out-of-service is the number of cameras out of "
      "service. coverage is the share of the latest view that cameras see (with `rig`). max-skew-ns is the largest "
      "capture-time error. The fields of the focal surface count the rounds of the depth search and their bytes. "
      "focus-residual is the disagreement between the cameras, in 255ths, and focus-improvement is its latest "
      "reduction. focus-interval is the number of requests per update, and focus-flat is true if one plane is enough. "
      "monitor-turns and monitor-bytes count the camera checks and their bytes. For each camera, the checks compare a "
      "prediction with the image and report the PSNR, the gain and the shift in pixels of the small view. A suspicious "
      "camera also has its fault (colour, direction or picture). The latency of each stage has p50, p95 and p99 over "
      "the latest 1024 pictures, in nanoseconds");
  klass->set_property = lf::callback<lf_compositor_set_property>;
}

// Returns true if all inputs follow a seek of the requests. Inputs from files or sockets do not.
static bool is_seekable(LfCompositor* self) {
  const GstElementForeachPadFunc is_pad_seekable = [](GstElement*, GstPad* pad, gpointer) {
    g_autoptr(GstQuery) query = gst_query_new_seeking(GST_FORMAT_TIME);
    gboolean seekable = FALSE;
    if (gst_pad_peer_query(pad, query)) gst_query_parse_seeking(query, nullptr, &seekable, nullptr, nullptr);
    return seekable;
  };
  return gst_element_foreach_sink_pad(GST_ELEMENT(self), is_pad_seekable, nullptr);
}

// Returns the possible caps of the source pad. A running element outputs either answers or video. If the formats of the
// cameras are known, video has only these formats. Before that, the template applies, because applications may set
// `partial` after linking the pad.
static bool lf_compositor_answer_caps_query(LfCompositor* self, GstQuery* query) {
  if (!lf::is_running(GST_ELEMENT(self))) return false;
  GstCaps* filter = nullptr;
  gst_query_parse_caps(query, &filter);
  g_autoptr(GstCaps) caps = lf_compositor_settings(self).partial ? lf::unit_caps(LF_ANSWER_MEDIA_TYPE)
                                                                 : lf::offered_caps(self->state->output.family());
  caps = lf::filter_caps(caps, filter);
  gst_query_set_caps_result(query, caps);
  return true;
}

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
      lf::ObjectLock lock(self);
      const GstSegment& segment = GST_AGGREGATOR_PAD(GST_AGGREGATOR_SRC_PAD(self))->segment;
      const guint64 position = gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, segment.position);
      lock.unlock();
      if (!GST_CLOCK_TIME_IS_VALID(position)) return FALSE;
      gst_query_set_position(query, format, static_cast<gint64>(position));
      return TRUE;
    }
    case GST_QUERY_CAPS: return lf_compositor_answer_caps_query(self, query) || parent_class()->src_query(agg, query);
    case GST_QUERY_CONTEXT: return self->state->output.own_gpu().answer(query) || parent_class()->src_query(agg, query);
    default: return parent_class()->src_query(agg, query);
  }
}

lf::SharedCaps lf_compositor_accepted_caps(LfCompositor* self) {
  GstPad* src = GST_AGGREGATOR_SRC_PAD(self);
  g_autoptr(GstCaps) video = gst_caps_from_string(LF_PICTURE_FORMATS);
  return lf::share_caps(gst_pad_peer_query_caps(src, video));
}

// Blocks all lfviewrequest elements during a flushing seek, because they are sought one after another but must resume
// together. Takes the event.
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

// Forwards navigation events to the requests of this view only. GstAggregator 1.22.0 would drop such events.
static gboolean lf_compositor_src_event(GstAggregator* agg, GstEvent* event) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  const GstStructure* structure = gst_event_get_structure(event);
  const bool is_navigation = GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION;
  const bool is_view = GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && structure &&
                       gst_structure_has_name(structure, LF_VIEW_EVENT);
  // A pipeline sends a seek to each of its sinks, which may follow different source pads.
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK &&
      self->state->seek_seqnum.exchange(gst_event_get_seqnum(event)) == gst_event_get_seqnum(event)) {
    gst_event_unref(event);
    return TRUE;
  }
  // The base class flushes downstream and seeks all pads, so each pad must lead to the requests.
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK && (lf::is_reverse_seek(event) || !is_seekable(self))) {
    gst_event_unref(event);
    return FALSE;
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) {
    const guint view_id = lf_compositor_view_id(self);
    if (lf::QosTracker::view_of(event).value_or(view_id) == view_id) {
      event = lf::QosTracker::set_view_id(event, view_id);
      self->state->qos.see(event, lf_compositor_is_live(self));  // before the nodes, which then answer without pixels
    }
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK) return seek(self, event);
  if (!is_navigation && !is_view) return parent_class()->src_event(agg, event);
  event = gst_event_make_writable(event);
  gst_structure_set(gst_event_writable_structure(event), LF_VIEW_ID_FIELD, G_TYPE_UINT, lf_compositor_view_id(self),
                    nullptr);
  return gst_pad_push_event(self->request, event);
}

// Ends the output at EOS of the requests, even if the nodes never send EOS. All requests have been answered by then,
// because events arrive in data order. GstAggregator would wait for all pads.
static gboolean lf_compositor_sink_event(GstAggregator* agg, GstAggregatorPad* pad, GstEvent* event) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  const bool of_requests = GST_PAD(pad) == self->request;
  const bool ended = of_requests && GST_EVENT_TYPE(event) == GST_EVENT_EOS;
  const guint32 seqnum = gst_event_get_seqnum(event);
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT_DONE && !of_requests) {
    gst_event_unref(event);
    return TRUE;
  }
  // The frame rate in the output caps may have changed.
  if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS && of_requests) gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(agg));
  if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP && of_requests) {
    self->state->qos.clear();
    self->state->request_flushed = true;
  } else if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP) {
    lf::NodeInput::of(pad).flushed();
  }
  // Posts an error if there was no picture. Otherwise a file writer would produce an empty file and report success.
  const uint64_t refused = self->guard->refused();
  if (ended && refused > 0 && !self->state->output.has_begun() && !lf_compositor_is_live(self))
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS,
                      ("There is no picture, because %" G_GUINT64_FORMAT
                       " requests were refused. An earlier warning names the exceeded limit (max-pixels, ...).",
                       refused),
                      (nullptr));
  const gboolean ok = parent_class()->sink_event(agg, pad, event);
  // Before the first picture, the source pad has no segment to end.
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
  if (const auto view_id = lf::view_of_query(query, LF_FOCUS_QUERY)) {
    const lf::CompositorSettings settings = lf_compositor_settings(self);
    if (*view_id != settings.view_id || settings.view_depths().mode == lf::FocusMode::kPlane) return FALSE;
    lf::set_focus_waits(query, self->state->output.is_pushing());
    return TRUE;
  }
  if (const auto view_id = lf::view_of_query(query, LF_PICTURE_CAPS)) {
    const lf::CompositorSettings settings = lf_compositor_settings(self);
    if (*view_id != settings.view_id || settings.partial) return FALSE;
    lf::answer_picture_caps_query(query, lf_compositor_accepted_caps(self).get());
    return TRUE;
  }
  return parent_class()->sink_query(agg, pad, query);
}

// Warns if there are requests for other views, but none for this view. The usual cause is that view-id was not set.
static void note_other_view(LfCompositor* self, uint32_t other) {
  if (!self->state->silence.request_of_other_view(g_get_monotonic_time())) return;
  GST_ELEMENT_WARNING(
      self, STREAM, FAILED,
      ("No client requests view %u of this compositor, but there are requests for view %u: check view-id.",
       lf_compositor_view_id(self), other),
      (nullptr));
}

// Drops requests of other views before they reach the pad's queue. Otherwise these requests would fill the queue while
// this view is idle, and then block the tee.
static GstPadProbeReturn lf_compositor_request_arrives(GstPad*, GstPadProbeInfo* info, gpointer data) {
  LfCompositor* self = LF_COMPOSITOR(data);
  if (self->state->over) return GST_PAD_PROBE_DROP;
  const lf::MappedBuffer mapped(GST_PAD_PROBE_INFO_BUFFER(info));
  const std::optional<lf::wire::RequestPeek> peek = lf::wire::peek_request(mapped.bytes());
  if (!peek) return GST_PAD_PROBE_OK;  // counted when it is taken from the pad
  if (peek->head.view_id != lf_compositor_view_id(self)) {
    note_other_view(self, peek->head.view_id);
    return GST_PAD_PROBE_DROP;
  }
  self->state->silence.asked();
  if (lf::wire::access_of_type(peek->type).value_or(lf::Access::kSelf) != lf::Access::kSelf)
    return GST_PAD_PROBE_DROP;  // a command for cameras
  if (!self->guard->admits(GST_ELEMENT(self), mapped.bytes(), self->state->extent, self->state->live))
    return GST_PAD_PROBE_DROP;
  if (!peek->head.probe && !peek->head.warmup)
    self->state->stats.request_arrived(peek->head.sequence, g_get_monotonic_time());
  return GST_PAD_PROBE_OK;
}

// Sets a duration on answers from a file or a TCP stream, which have no timestamps. Without a duration, GstAggregator
// could not limit the queue of a pad, because its limit is a time.
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

// Uses the requested name. The default implementation would name every pad sink_N.
static GstAggregatorPad* lf_compositor_create_pad(GstAggregator* agg, GstPadTemplate* templ, const gchar* name,
                                                  const GstCaps*) {
  g_autofree gchar* pad_name = nullptr;
  if (name && g_str_has_prefix(name, "sink_")) {
    pad_name = g_strdup(name);
  } else {
    guint number = 0;
    lf::PadPtr taken;
    do {
      g_free(pad_name);
      pad_name = g_strdup_printf("sink_%u", number++);
      taken.reset(gst_element_get_static_pad(GST_ELEMENT(agg), pad_name));
    } while (taken);
  }
  gpointer pad =
      g_object_new(GST_TYPE_AGGREGATOR_PAD, "name", pad_name, "direction", GST_PAD_SINK, "template", templ, nullptr);
  lf::NodeInput::attach(GST_AGGREGATOR_PAD(pad));
  lf::accept_unit_caps(GST_PAD(pad));
  gst_pad_add_probe(GST_PAD(pad), GST_PAD_PROBE_TYPE_BUFFER, lf::callback<lf_compositor_answer_arrives>, agg, nullptr);
  return GST_AGGREGATOR_PAD(pad);
}

static GstPad* lf_compositor_request_pad(GstElement* element, GstPadTemplate* templ, const gchar* name,
                                         const GstCaps* caps) {
  if (GST_PAD_TEMPLATE_DIRECTION(templ) == GST_PAD_SRC) return LF_COMPOSITOR(element)->state->depths.add_pad(templ);
  return GST_ELEMENT_CLASS(parent_class())->request_new_pad(element, templ, name, caps);
}

static void lf_compositor_release_pad(GstElement* element, GstPad* pad) {
  if (LF_COMPOSITOR(element)->state->depths.remove_pad(pad)) return;
  lf::NodeInput::of(GST_AGGREGATOR_PAD(pad)).detach();
  GST_ELEMENT_CLASS(parent_class())->release_pad(element, pad);
}

// Sends the events of the source pad that end or flush the stream to the request pads for depths, too.
static GstPadProbeReturn lf_compositor_src_event_sent(GstPad* src, GstPadProbeInfo* info, gpointer data) {
  LF_COMPOSITOR(data)->state->depths.forward(GST_PAD_PROBE_INFO_EVENT(info), src);
  return GST_PAD_PROBE_OK;
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
  element_class->request_new_pad = lf::callback<lf_compositor_request_pad>;
  element_class->release_pad = lf::callback<lf_compositor_release_pad>;
  gst_element_class_add_static_pad_template_with_gtype(element_class, &sink_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype(element_class, &request_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype(element_class, &src_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template(element_class, &depth_template);
  gst_element_class_add_static_pad_template(element_class, &confidence_template);
}

static void forget_history(LfCompositor* self) {
  auto& state = *self->state;
  state.focus.clear();
  state.turns.clear();
}

static void drop_early_answers(LfCompositor* self) {
  self->state->past.clear();
  for (lf::NodeInput* node : lf::NodeInputs(self->request)) node->drop_early();
}

// Loads the rig file. Returns null if no rig is set. Throws Error if the file cannot be loaded.
static std::shared_ptr<const lf::Rig> load_rig(const lf::CompositorSettings& settings) {
  if (!settings.rig.empty()) return lf::shared_rig(settings.rig);
  if (settings.partial)
    throw lf::Error("A compositor inside a tree needs a rig to detect missing cameras: set the property \"rig\".");
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
  lf::ObjectLock lock(self);
  delete std::exchange(self->new_rig, nullptr);
  lock.unlock();
  warn_ignored_settings(self);
  state.health = lf::CameraHealth(settings.max_missed);
  if (state.rig && !settings.partial) state.health.expect(state.rig->cameras.size());
  state.cameras_without_frame = {};
  state.current.reset();
  state.request_flushed = state.over = false;
  state.warned_unseen = state.warned_unlinked = false;
  state.first_set.reset();
  state.latency_query_time = 0;
  state.latency.clear();
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
  drop_early_answers(self);
  self->state->over = false;
  self->state->output.flush();
  forget_history(self);
  return GST_FLOW_OK;
}

static gboolean lf_compositor_stop(GstAggregator* agg) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  lf_compositor_forget_request(self);
  drop_early_answers(self);
  if (const std::optional<GstClockTime> latency = self->state->latency.clear())
    g_object_set(self, "latency", *latency, nullptr);
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
  output_of(agg).negotiate(lf_compositor_announce_caps(LF_COMPOSITOR(agg)));
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
  output_of(GST_AGGREGATOR(element)).own_gpu().share(context);
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
      "Combines the fragments of a view into its picture", "gst-lightfield developers");
}

static void lf_compositor_init(LfCompositor* self) {
  self->settings = new lf::CompositorSettings;
  self->state = new _LfCompositor::State(GST_AGGREGATOR(self));
  self->guard = new lf::RequestGuard;
  add_request_pad(self);
  gst_pad_add_probe(GST_AGGREGATOR_SRC_PAD(self),
                    static_cast<GstPadProbeType>(GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM | GST_PAD_PROBE_TYPE_EVENT_FLUSH),
                    lf::callback<lf_compositor_src_event_sent>, self, nullptr);
  g_object_set(self, "latency", LF_COMPOSITOR_LATENCY, nullptr);
}
