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

#include <utility>

#include "base/error.h"
#include "compositor/lfcompositor_private.h"

GST_DEBUG_CATEGORY(lf_compositor_debug);

G_DEFINE_FINAL_TYPE(LfCompositor, lf_compositor, GST_TYPE_AGGREGATOR)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfcompositor, "lfcompositor", GST_RANK_NONE, LF_TYPE_COMPOSITOR,
                                      GST_DEBUG_CATEGORY_INIT(lf_compositor_debug, "lfcompositor", 0,
                                                              "view compositor"))

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
  lf_compositor_warn_without_effect(self);
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
  self->guard->clear();
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
  lf_compositor_install_properties(G_OBJECT_CLASS(klass));
  lf_compositor_install_pads(klass);
  lf::register_view_meta();
  gst_element_class_set_static_metadata(
      GST_ELEMENT_CLASS(klass), "Light field compositor", "Filter/Editor/Video/Compositor",
      "Adds the fragments that answer a view request up to its picture", "gst-lightfield developers");
}

static void lf_compositor_init(LfCompositor* self) {
  self->settings = new lf::CompositorSettings;
  self->state = new _LfCompositor::State(GST_AGGREGATOR(self));
  self->guard = lf_compositor_guard_new();
  lf_compositor_add_request_pad(self);
  g_object_set(self, "latency", LF_COMPOSITOR_LATENCY, nullptr);
}
