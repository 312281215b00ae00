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
 * Navigation events (mouse, keys) and custom "lf-view-request" events go upstream to the view's own `lfviewrequest`.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lfcameranode name=n rig=rig.json ! c.sink_0  r. ! queue ! c.request \
 *   lfcompositor name=c ! videoconvert ! pngenc ! multifilesink location=out_%02d.png
 * ]|
 *
 * ## Element messages
 * With `post-messages` an element message "lightfield-view" per picture: view-id, sequence (uint), pts (uint64),
 * complete (boolean), fragments, missing, damaged (uint), bytes, skew-ns, latency-ns (request to picture) and
 * composite-ns (uint64).
 */

#include "lfcompositor.h"

#include <gst/video/video.h>

#include "base/error.h"
#include "camera_image.h"
#include "common.h"
#include "composite/assembly.h"
#include "compositor_stats.h"
#include "gst_wire.h"
#include "output_caps.h"
#include "picture_pool.h"

GST_DEBUG_CATEGORY_STATIC(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

namespace {

constexpr GstClockTime kDefaultLatency = 60 * GST_MSECOND;  // a frame period at 15/s; only live pipelines wait for it

GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_ANSWER_MEDIA_TYPE));
GstStaticPadTemplate request_template =
    GST_STATIC_PAD_TEMPLATE("request", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_MEDIA_TYPE));
GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("{ " LF_RGB_FORMATS ", I420 }")));

}  // namespace

struct _LfCompositor {
  GstAggregator parent;
  GstPad* request;

  // Properties, under the object lock.
  guint view_id;
  gchar* rig_path;
  guint32 background;
  gboolean post_messages;

  struct State {
    lf::Assembly assembly;                   // streaming thread
    std::optional<lf::ViewRequest> current;  // the request at the head of the request pad; streaming thread
    GstVideoInfo info{};                     // negotiated; streaming thread
    bool renegotiate = true;                 // streaming thread
    bool warned_rig = false;                 // streaming thread
    uint64_t current_bytes = 0;              // of the answers added; streaming thread
    int64_t adding = 0;                      // time spent adding them, microseconds; streaming thread
    lf::PicturePool pool;                    // streaming thread
    lf::CompositorStats stats;
  } * state;
};

G_DEFINE_FINAL_TYPE(LfCompositor, lf_compositor, GST_TYPE_AGGREGATOR)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfcompositor, "lfcompositor", GST_RANK_NONE, LF_TYPE_COMPOSITOR,
                                      GST_DEBUG_CATEGORY_INIT(lf_compositor_debug, "lfcompositor", 0,
                                                              "view compositor"))

enum { PROP_0, PROP_VIEW_ID, PROP_RIG, PROP_BACKGROUND, PROP_POST_MESSAGES, PROP_STATS };

static void lf_compositor_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfCompositor* self = LF_COMPOSITOR(object);
  GST_OBJECT_LOCK(self);
  switch (id) {
    case PROP_VIEW_ID: self->view_id = g_value_get_uint(value); break;
    case PROP_RIG:
      g_free(self->rig_path);
      self->rig_path = g_value_dup_string(value);
      break;
    case PROP_BACKGROUND: self->background = g_value_get_uint(value); break;
    case PROP_POST_MESSAGES: self->post_messages = g_value_get_boolean(value); break;
    default: G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  }
  GST_OBJECT_UNLOCK(self);
}

static void lf_compositor_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfCompositor* self = LF_COMPOSITOR(object);
  GST_OBJECT_LOCK(self);
  switch (id) {
    case PROP_VIEW_ID: g_value_set_uint(value, self->view_id); break;
    case PROP_RIG: g_value_set_string(value, self->rig_path); break;
    case PROP_BACKGROUND: g_value_set_uint(value, self->background); break;
    case PROP_POST_MESSAGES: g_value_set_boolean(value, self->post_messages); break;
    case PROP_STATS: g_value_take_boxed(value, self->state->stats.structure()); break;
    default: G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  }
  GST_OBJECT_UNLOCK(self);
}

static guint lf_compositor_view_id(LfCompositor* self) {
  GST_OBJECT_LOCK(self);
  const guint view_id = self->view_id;
  GST_OBJECT_UNLOCK(self);
  return view_id;
}

// ---------------------------------------------------------------------------------------------------- negotiation

static GstFlowReturn lf_compositor_agree_on_output(LfCompositor* self, lf::PixelFamily family, int width, int height) {
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
  state.info = info;
  state.renegotiate = false;
  gst_aggregator_set_src_caps(GST_AGGREGATOR(self), caps);
  const bool ready = state.pool.configure(caps, info.size);
  gst_caps_unref(caps);
  return ready ? GST_FLOW_OK : GST_FLOW_ERROR;
}

// Output caps follow the requests and answers, not the sink caps: aggregate() sees to them.
static gboolean lf_compositor_negotiate(GstAggregator* agg) {
  LF_COMPOSITOR(agg)->state->renegotiate = true;
  return TRUE;
}

// ---------------------------------------------------------------------------------------------------- compositing

// Makes the first own request on the request pad the current one; it stays on the pad until it is answered, so that
// aggregation fires when the last answer arrives and not when the next request does.
static bool lf_compositor_find_request(LfCompositor* self, guint view_id) {
  auto& state = *self->state;
  if (state.current) return true;
  GstAggregatorPad* pad = GST_AGGREGATOR_PAD(self->request);
  while (GstBuffer* buffer = gst_aggregator_pad_peek_buffer(pad)) {
    std::string reason;
    std::optional<lf::ViewRequest> request = lf::decode_request_buffer(buffer, &reason);
    gst_buffer_unref(buffer);
    if (request && request->view_id == view_id) {
      try {
        state.assembly.begin(*request);
        state.current = std::move(request);
        state.current_bytes = 0;
        state.adding = 0;
        return true;
      } catch (const lf::Error& error) {
        reason = error.what();
        request.reset();
      }
    }
    if (!request) {
      GST_WARNING_OBJECT(self, "dropped a view request: %s", reason.c_str());
      self->state->stats.count(lf::CompositorStats::kBadRequests);
    }
    gst_aggregator_pad_drop_buffer(pad);
  }
  return false;
}

static void lf_compositor_add(LfCompositor* self, GstBuffer* buffer) {
  auto& state = *self->state;
  const auto mapped = std::make_shared<const lf::MappedBuffer>(buffer);
  std::string reason;
  const std::optional<lf::wire::AnswerView> answer = lf::wire::parse_answer(mapped->bytes(), &reason);
  if (!answer) {
    GST_WARNING_OBJECT(self, "dropped an answer: %s", reason.c_str());
    self->state->stats.count(lf::CompositorStats::kBadAnswers);
    return;
  }
  const int64_t begun = g_get_monotonic_time();
  state.current_bytes += mapped->bytes().size();
  const unsigned damaged_before = state.assembly.damaged();
  switch (state.assembly.add(*answer, mapped)) {
    case lf::Assembly::Verdict::kOtherRig:
      self->state->stats.count(lf::CompositorStats::kRigMismatches);
      if (!state.warned_rig)
        GST_ELEMENT_WARNING(self, STREAM, FAILED,
                            ("Node %u answers for another rig: its fragments are not composed.", answer->node),
                            ("view %u, request %u", answer->view_id, answer->sequence));
      state.warned_rig = true;
      break;
    case lf::Assembly::Verdict::kBadFragment:
      GST_WARNING_OBJECT(self, "node %u: fragments that don't fit the view or the other nodes'", answer->node);
      self->state->stats.count(lf::CompositorStats::kBadAnswers);
      break;
    default: break;
  }
  state.adding += g_get_monotonic_time() - begun;
  if (const unsigned damaged = state.assembly.damaged() - damaged_before)
    GST_WARNING_OBJECT(self, "node %u: %u fragments are damaged", answer->node, damaged);
}

// Brings the answer pad's head to the current request. True when this node has nothing more to wait for.
static bool lf_compositor_node_answered(LfCompositor* self, GstAggregatorPad* pad) {
  auto& state = *self->state;
  while (GstBuffer* buffer = gst_aggregator_pad_peek_buffer(pad)) {
    std::string reason;
    const std::optional<lf::wire::AnswerHeader> header = lf::parse_answer_buffer_header(buffer, &reason);
    // Sequence numbers wrap: the sign of the difference tells the order.
    const int32_t ahead = header ? static_cast<int32_t>(header->sequence - state.current->sequence) : 0;
    const bool own = header && header->view_id == state.current->view_id;
    const bool part = own && ahead == 0 && !header->last_of_node;
    if (part) lf_compositor_add(self, buffer);
    gst_buffer_unref(buffer);
    if (own && ahead > 0) return true;  // this request was skipped
    if (own && ahead == 0 && !part) return true;
    if (!header) {
      GST_WARNING_OBJECT(pad, "dropped an answer: %s", reason.c_str());
      self->state->stats.count(lf::CompositorStats::kBadAnswers);
    } else if (own && ahead < 0) {
      self->state->stats.count(lf::CompositorStats::kLateAnswers);
    }
    gst_aggregator_pad_drop_buffer(pad);
  }
  return gst_aggregator_pad_is_eos(pad);
}

static void lf_compositor_take_answer(LfCompositor* self, GstAggregatorPad* pad) {
  GstBuffer* buffer = gst_aggregator_pad_peek_buffer(pad);
  if (!buffer) return;
  const std::optional<lf::wire::AnswerHeader> header = lf::parse_answer_buffer_header(buffer);
  const lf::ViewRequest& current = *self->state->current;
  if (header && header->view_id == current.view_id && header->sequence == current.sequence) {
    lf_compositor_add(self, buffer);
    gst_aggregator_pad_drop_buffer(pad);
  }
  gst_buffer_unref(buffer);
}

static void lf_compositor_record(LfCompositor* self, int64_t answered, GstClockTime pts, bool post) {
  auto& state = *self->state;
  const lf::Assembly& assembly = state.assembly;
  GstStructure* description = state.stats.record(
      {state.current->view_id, state.current->sequence, pts, assembly.fragments(), assembly.missing(),
       assembly.damaged(), state.current_bytes, assembly.skew(), answered, state.adding, g_get_monotonic_time()},
      post);
  if (description) gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), description));
}

// `answered`: when the last answer was in.
static GstFlowReturn lf_compositor_finish_picture(LfCompositor* self, int64_t answered) {
  auto& state = *self->state;
  GstAggregator* agg = GST_AGGREGATOR(self);
  GST_OBJECT_LOCK(self);
  const guint32 argb = self->background;
  const bool post = self->post_messages;
  GST_OBJECT_UNLOCK(self);
  const lf::Background background{static_cast<uint8_t>(argb >> 16), static_cast<uint8_t>(argb >> 8),
                                  static_cast<uint8_t>(argb)};

  const lf::View& view = state.current->view;
  const GstFlowReturn agreed = lf_compositor_agree_on_output(self, state.assembly.family(), view.width, view.height);
  if (agreed != GST_FLOW_OK) return agreed;
  state.assembly.finish(lf::family_of(state.info), background != lf::Background{});

  GstBuffer* out = state.pool.take();
  if (!out) return GST_FLOW_ERROR;
  GstVideoFrame frame;
  if (!gst_video_frame_map(&frame, &state.info, out, GST_MAP_WRITE)) {
    gst_buffer_unref(out);
    return GST_FLOW_ERROR;
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
  gst_video_frame_unmap(&frame);

  GstAggregatorPad* request_pad = GST_AGGREGATOR_PAD(self->request);
  GstBuffer* request = gst_aggregator_pad_pop_buffer(request_pad);
  if (!request) {  // flushed meanwhile
    gst_buffer_unref(out);
    state.current.reset();
    return GST_FLOW_OK;
  }
  GST_BUFFER_PTS(out) = gst_segment_to_running_time(&request_pad->segment, GST_FORMAT_TIME, GST_BUFFER_PTS(request));
  GST_BUFFER_DURATION(out) = GST_BUFFER_DURATION(request);
  gst_buffer_unref(request);

  lf_compositor_record(self, answered, GST_BUFFER_PTS(out), post);
  state.assembly.release();
  state.current.reset();
  GstSegment& segment = GST_AGGREGATOR_PAD(agg->srcpad)->segment;
  if (GST_BUFFER_PTS_IS_VALID(out)) segment.position = GST_BUFFER_PTS(out);
  return gst_aggregator_finish_buffer(agg, out);
}

static GList* lf_compositor_answer_pads(LfCompositor* self) {
  GList* pads = nullptr;
  GST_OBJECT_LOCK(self);
  for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next)
    if (item->data != self->request) pads = g_list_prepend(pads, gst_object_ref(item->data));
  GST_OBJECT_UNLOCK(self);
  return g_list_reverse(pads);
}

static GstFlowReturn lf_compositor_aggregate(GstAggregator* agg, gboolean timeout) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  if (!lf_compositor_find_request(self, lf_compositor_view_id(self)))
    return gst_aggregator_pad_is_eos(GST_AGGREGATOR_PAD(self->request)) ? GST_FLOW_EOS : GST_AGGREGATOR_FLOW_NEED_DATA;

  GList* pads = lf_compositor_answer_pads(self);
  bool all_answered = true;
  for (GList* item = pads; item; item = item->next)
    all_answered = lf_compositor_node_answered(self, GST_AGGREGATOR_PAD(item->data)) && all_answered;
  GstFlowReturn result = GST_AGGREGATOR_FLOW_NEED_DATA;
  if (all_answered || timeout) {
    const int64_t answered = g_get_monotonic_time();
    for (GList* item = pads; item; item = item->next) lf_compositor_take_answer(self, GST_AGGREGATOR_PAD(item->data));
    result = lf_compositor_finish_picture(self, answered);
  }
  g_list_free_full(pads, gst_object_unref);
  return result;
}

// The deadline of a live pipeline is that of the request being answered; without one there is nothing to wait for.
static GstClockTime lf_compositor_next_time(GstAggregator* agg) {
  GstAggregatorPad* pad = GST_AGGREGATOR_PAD(LF_COMPOSITOR(agg)->request);
  GstBuffer* buffer = gst_aggregator_pad_peek_buffer(pad);
  if (!buffer) return GST_CLOCK_TIME_NONE;
  const GstClockTime time = gst_segment_to_running_time(&pad->segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
  gst_buffer_unref(buffer);
  return time;
}

// ------------------------------------------------------------------------------------------------- events and pads

// What a viewer does concerns its own requests alone. (GstAggregator 1.22.0 drops navigation events.)
static gboolean lf_compositor_src_event(GstAggregator* agg, GstEvent* event) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  const GstStructure* structure = gst_event_get_structure(event);
  const bool is_navigation = GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION;
  const bool is_view = GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && structure &&
                       gst_structure_has_name(structure, "lf-view-request");
  if (!is_navigation && !is_view) return GST_AGGREGATOR_CLASS(lf_compositor_parent_class)->src_event(agg, event);
  event = gst_event_make_writable(event);
  gst_structure_set(gst_event_writable_structure(event), "lf-view-id", G_TYPE_UINT, lf_compositor_view_id(self),
                    nullptr);
  return gst_pad_push_event(self->request, event);
}

// Events come here in the order of the data: at EOS of the requests all of them have been answered. That ends the
// output, whether or not the nodes ever end theirs (GstAggregator waits for all).
static gboolean lf_compositor_sink_event(GstAggregator* agg, GstAggregatorPad* pad, GstEvent* event) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  const bool ended = GST_PAD(pad) == self->request && GST_EVENT_TYPE(event) == GST_EVENT_EOS;
  const gboolean ok = GST_AGGREGATOR_CLASS(lf_compositor_parent_class)->sink_event(agg, pad, event);
  // Before the first picture the source pad has no segment to end yet.
  if (ended && self->state->info.finfo) gst_pad_push_event(GST_AGGREGATOR_SRC_PAD(agg), gst_event_new_eos());
  return ok;
}

static gboolean lf_compositor_sink_query(GstAggregator* agg, GstAggregatorPad* pad, GstQuery* query) {
  const GstStructure* structure = GST_QUERY_TYPE(query) == GST_QUERY_CUSTOM ? gst_query_get_structure(query) : nullptr;
  if (structure && gst_structure_has_name(structure, LF_IN_PROCESS_QUERY)) return TRUE;
  return GST_AGGREGATOR_CLASS(lf_compositor_parent_class)->sink_query(agg, pad, query);
}

static GstPadProbeReturn lf_compositor_request_arrives(GstPad*, GstPadProbeInfo* info, gpointer data) {
  LfCompositor* self = LF_COMPOSITOR(data);
  const std::optional<lf::ViewRequest> request = lf::decode_request_buffer(GST_PAD_PROBE_INFO_BUFFER(info));
  if (!request) return GST_PAD_PROBE_OK;
  if (request->view_id == lf_compositor_view_id(self))
    self->state->stats.request_arrived(request->sequence, g_get_monotonic_time());
  return GST_PAD_PROBE_OK;
}

static GstFlowReturn lf_compositor_flush(GstAggregator* agg) {
  LF_COMPOSITOR(agg)->state->assembly.release();
  LF_COMPOSITOR(agg)->state->current.reset();
  return GST_FLOW_OK;
}

static gboolean lf_compositor_stop(GstAggregator* agg) {
  LF_COMPOSITOR(agg)->state->pool.clear();
  return TRUE;
}

static gboolean lf_compositor_start(GstAggregator* agg) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  auto& state = *self->state;
  std::shared_ptr<const lf::Rig> rig;
  if (self->rig_path) {
    try {
      rig = lf::shared_rig(self->rig_path);
    } catch (const lf::Error& error) {
      GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
      return FALSE;
    }
  }
  state.assembly.set_rig(std::move(rig));
  state.current.reset();
  state.info = {};
  state.renegotiate = true;
  state.warned_rig = false;
  state.stats.reset();
  return TRUE;
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
  return static_cast<GstAggregatorPad*>(
      g_object_new(GST_TYPE_AGGREGATOR_PAD, "name", pad_name, "direction", GST_PAD_SINK, "template", templ, nullptr));
}

static void lf_compositor_finalize(GObject* object) {
  LfCompositor* self = LF_COMPOSITOR(object);
  delete self->state;
  g_free(self->rig_path);
  G_OBJECT_CLASS(lf_compositor_parent_class)->finalize(object);
}

static void lf_compositor_class_init(LfCompositorClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  object_class->set_property = lf_compositor_set_property;
  object_class->get_property = lf_compositor_get_property;
  object_class->finalize = lf_compositor_finalize;
  aggregator_class->start = lf_compositor_start;
  aggregator_class->stop = lf_compositor_stop;
  aggregator_class->flush = lf_compositor_flush;
  aggregator_class->aggregate = lf_compositor_aggregate;
  aggregator_class->negotiate = lf_compositor_negotiate;
  aggregator_class->get_next_time = lf_compositor_next_time;
  aggregator_class->src_event = lf_compositor_src_event;
  aggregator_class->sink_event = lf_compositor_sink_event;
  aggregator_class->sink_query = lf_compositor_sink_query;
  aggregator_class->create_new_pad = lf_compositor_create_pad;

  const auto flags = [](int more) { return GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | more); };
  g_object_class_install_property(
      object_class, PROP_VIEW_ID,
      g_param_spec_uint("view-id", "View id", "The view to compose: requests and answers of others are ignored", 0,
                        G_MAXUINT, 0, flags(GST_PARAM_MUTABLE_READY)));
  g_object_class_install_property(
      object_class, PROP_RIG,
      g_param_spec_string(
          "rig", "Rig",
          "Rig file (rig.json); optional: with it the weight of fragments that never came is known and made "
          "up for, and `background` shows outside the array's mesh",
          nullptr, flags(GST_PARAM_MUTABLE_READY)));
  g_object_class_install_property(
      object_class, PROP_BACKGROUND,
      g_param_spec_uint("background", "Background", "Colour where nothing contributes, 0xAARRGGBB (alpha is ignored)",
                        0, G_MAXUINT32, 0xff000000, flags(GST_PARAM_MUTABLE_PLAYING)));
  g_object_class_install_property(object_class, PROP_POST_MESSAGES,
                                  g_param_spec_boolean("post-messages", "Post messages",
                                                       "Post an element message \"lightfield-view\" for every picture",
                                                       FALSE, flags(GST_PARAM_MUTABLE_PLAYING)));
  g_object_class_install_property(
      object_class, PROP_STATS,
      g_param_spec_boxed(
          "stats", "Statistics",
          "Counts of pictures (complete, incomplete), fragments (missing, damaged), late and bad answers, bytes; the "
          "largest skew; latency per stage (p50, p95, p99 over the latest 1024 pictures, nanoseconds)",
          GST_TYPE_STRUCTURE, GParamFlags(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));

  gst_element_class_add_static_pad_template_with_gtype(element_class, &sink_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype(element_class, &request_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype(element_class, &src_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata(element_class, "Light field compositor", "Filter/Editor/Video/Compositor",
                                        "Adds the fragments that answer a view request up to its picture",
                                        "gst-lightfield developers");
}

static void lf_compositor_init(LfCompositor* self) {
  self->state = new _LfCompositor::State;
  self->background = 0xff000000;
  GstPadTemplate* templ = gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(self), "request");
  self->request = static_cast<GstPad*>(
      g_object_new(GST_TYPE_AGGREGATOR_PAD, "name", "request", "direction", GST_PAD_SINK, "template", templ, nullptr));
  gst_pad_add_probe(self->request, GST_PAD_PROBE_TYPE_BUFFER, lf_compositor_request_arrives, self, nullptr);
  gst_element_add_pad(GST_ELEMENT(self), self->request);
  g_object_set(self, "latency", kDefaultLatency, nullptr);
}
