// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <utility>
#include <vector>

#include "base/text.h"
#include "common/custom_events.h"
#include "compositor/lfcompositor.h"

#define GST_CAT_DEFAULT lf_compositor_debug

using lf::CompositorStats;
using Taken = lf::NodeInput::UnitResult;

// The control flow of lfcompositor: takes a request, adds the answers of the nodes, and outputs the picture.
//
// GstAggregator calls aggregate() when every pad has a buffer. Therefore the last part of each node's answer stays on
// its pad until the picture is done. Without further measures, a live pipeline would leave all the work to the deadline
// and wait for dead nodes. lf_compositor_next_time() avoids this: it reports a deadline in the past whenever there is
// work.

void lf_compositor_use_rig(LfCompositor* self, std::shared_ptr<const lf::Rig> rig) {
  auto& state = *self->state;
  state.rig = rig;
  state.focus.set_rig(rig);
  state.assembly.set_rig(rig);
  state.depths.set_rig(rig);
  state.corners = rig ? lf::hull_cameras(*rig) : lf::CameraSet();
  state.extent = rig ? lf::array_extent(*rig) : 0;
  state.coverage.clear();
  state.warned_rig = false;
}

void lf_compositor_forget_request(LfCompositor* self) {
  self->state->assembly.release();
  self->state->current.reset();
  for (lf::NodeInput* node : lf::NodeInputs(self->request)) node->forget();
}

static void drop_request(LfCompositor* self) {
  for (lf::NodeInput* node : lf::NodeInputs(self->request)) node->drop_answer();
  lf_compositor_forget_request(self);
  gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request));
}

static GstClockTime clock_time(LfCompositor* self) {
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  return clock ? gst_clock_get_time(clock) : GST_CLOCK_TIME_NONE;
}

static lf::BufferPtr peek_request(LfCompositor* self) {
  return lf::BufferPtr(gst_aggregator_pad_peek_buffer(GST_AGGREGATOR_PAD(self->request)));
}

// Returns the running time of the next request; GST_CLOCK_TIME_NONE if there is none.
static GstClockTime request_time(LfCompositor* self) {
  const lf::BufferPtr request = peek_request(self);
  if (!request) return GST_CLOCK_TIME_NONE;
  return gst_segment_to_running_time(&GST_AGGREGATOR_PAD(self->request)->segment, GST_FORMAT_TIME,
                                     GST_BUFFER_PTS(request.get()));
}

// Returns the due time of the next request's picture, in clock time; GST_CLOCK_TIME_NONE if unknown.
static GstClockTime deadline(LfCompositor* self) {
  const GstClockTime time = request_time(self);
  const GstClockTime latency = gst_aggregator_get_latency(GST_AGGREGATOR(self));
  if (!GST_CLOCK_TIME_IS_VALID(time) || !GST_CLOCK_TIME_IS_VALID(latency)) return GST_CLOCK_TIME_NONE;
  return gst_element_get_base_time(GST_ELEMENT(self)) + time + latency;
}

// Queries the latency again if the next request arrived later than the known latency allows.
static void refresh_latency(LfCompositor* self) {
  auto& state = *self->state;
  const GstClockTime latency = gst_aggregator_get_latency(GST_AGGREGATOR(self)), now = clock_time(self),
                     time = request_time(self);
  if (!GST_CLOCK_TIME_IS_VALID(latency) || !GST_CLOCK_TIME_IS_VALID(now) || !GST_CLOCK_TIME_IS_VALID(time)) return;
  GstClockTime own = 0;
  g_object_get(self, "latency", &own, nullptr);
  const GstClockTime expected = gst_element_get_base_time(GST_ELEMENT(self)) + time + latency - MIN(own, latency);
  const int64_t asked = g_get_monotonic_time();
  if (now <= expected + 2 * GST_MSECOND) return;
  if (state.latency_query_time != 0 && asked < state.latency_query_time + G_USEC_PER_SEC / 10) return;
  state.latency_query_time = asked;
  g_autoptr(GstQuery) query = gst_query_new_latency();
  gst_pad_query(GST_AGGREGATOR_SRC_PAD(self), query);
}

static void refuse_rig(LfCompositor* self, const lf::wire::AnswerHeader& answer) {
  auto& state = *self->state;
  state.stats.count(CompositorStats::kRigMismatches);
  if (!std::exchange(state.warned_rig, true))
    GST_ELEMENT_WARNING(self, STREAM, FAILED,
                        ("Node %u has another rig file than this view, so its cameras are missing in the picture. "
                         "Use the same rig file on all hosts.",
                         answer.node),
                        ("view %u, request %u", answer.view_id, answer.sequence));
}

static void add_answer(LfCompositor* self, GstBuffer* buffer) {
  auto& state = *self->state;
  const std::shared_ptr<lf::gl::GpuSum> gpu_sum = lf::gpu_sum_of(buffer);
  const auto mapped = std::make_shared<const lf::MappedBuffer>(buffer, lf::MappedBuffer::Part::kHead);
  std::string reason;
  std::optional<lf::wire::AnswerView> answer;
  if (!gpu_sum)
    answer = lf::wire::parse_answer(mapped->bytes(), &reason);
  else if (const auto head = lf::wire::parse_answer_header(mapped->bytes(), &reason))
    answer = lf::wire::AnswerView{*head, {}};
  if (!answer) {
    GST_WARNING_OBJECT(self, "dropped an answer: %s", reason.c_str());
    state.stats.count(CompositorStats::kBadAnswers);
    return;
  }
  const int64_t begun = g_get_monotonic_time();
  state.bytes += gst_buffer_get_size(buffer);
  const unsigned damaged_before = state.assembly.damaged();
  switch (gpu_sum ? state.assembly.add_on_gpu(*answer, gpu_sum) : state.assembly.add(*answer, mapped)) {
    case lf::Assembly::Verdict::kOtherRig: refuse_rig(self, *answer); break;
    case lf::Assembly::Verdict::kNeedsRig:
      state.stats.count(CompositorStats::kBadAnswers);
      if (!state.warned_rig)
        GST_ELEMENT_WARNING(
            self, RESOURCE, SETTINGS,
            ("Node %u sends unprocessed camera pixels (access=pixels), which only a compositor with a rig can use: "
             "set the property \"rig\" of this compositor.",
             answer->node),
            ("view %u, request %u", answer->view_id, answer->sequence));
      state.warned_rig = true;
      break;
    case lf::Assembly::Verdict::kBadFragment:
      GST_WARNING_OBJECT(self,
                         "node %u: fragments do not fit the view or the answers of earlier nodes, so its answer "
                         "is ignored",
                         answer->node);
      state.stats.count(CompositorStats::kBadAnswers);
      break;
    default: break;
  }
  state.adding += g_get_monotonic_time() - begun;
  if (const unsigned damaged = state.assembly.damaged() - damaged_before)
    GST_WARNING_OBJECT(self,
                       "node %u: %u fragments are damaged, so these parts of its answer "
                       "are ignored",
                       answer->node, damaged);
}

// Handles an answer to an earlier request, which is too late for its picture. The answer still proves that the node
// works, if it arrived before the deadline and the compositor did not wait for the node.
static void note_late_answer(LfCompositor* self, const lf::wire::AnswerPartHeader& answer, lf::NodeInput& node) {
  auto& state = *self->state;
  const lf::RequestHistory::Answer late = state.past.judge(answer.sequence, clock_time(self));
  if (late == lf::RequestHistory::Answer::kToSkipped) return;
  state.stats.count(CompositorStats::kLateAnswers);
  state.latency.add_late_answer();
  if (late != lf::RequestHistory::Answer::kInTime) return;
  node.was_in_time();
  lf::CameraRanges seeing = answer.cameras;
  seeing.remove(answer.blind);
  state.health.add_late(answer.rig_hash, seeing);
}

// Returns true if a live answer cannot belong to a request of this view, and must be dropped. The answer is then for a
// request far ahead of the current request, or has another capture time. It is either forged, or left over from before
// a restart of the viewer. Answers of file cameras are never dropped here.
static bool is_unexpected(LfCompositor* self, const lf::wire::AnswerHeader& answer, int32_t ahead) {
  if (!self->state->live) return false;
  return ahead > lf::EarlyAnswers::kMaxRequests ||
         (ahead == 0 && answer.target_time != self->state->current->target_time);
}

static Taken take_fragments(LfCompositor* self, lf::NodeInput& node, GstBuffer* buffer) {
  auto& state = *self->state;
  std::string reason;
  const std::optional<lf::wire::AnswerPartHeader> answer = lf::parse_answer_buffer_header(buffer, &reason);
  if (!answer) {
    GST_WARNING_OBJECT(self, "dropped an answer: %s", reason.c_str());
    state.stats.count(CompositorStats::kBadAnswers);
    return Taken::kDone;
  }
  if (answer->view_id != state.current->view_id) return Taken::kDone;
  if (state.assembly.has_unknown_cameras(*answer)) {
    GST_WARNING_OBJECT(self,
                       "node %u: its answer claims cameras that are not in the rig, so the answer is ignored; "
                       "use the same rig file on all hosts",
                       answer->node);
    state.stats.count(CompositorStats::kBadAnswers);
    return Taken::kDone;
  }
  // The sign of the difference gives the order, because sequence numbers wrap.
  const auto ahead = static_cast<int32_t>(answer->sequence - state.current->sequence);
  if (is_unexpected(self, *answer, ahead)) {
    state.stats.count(CompositorStats::kUnexpectedAnswers);
  } else if (ahead > 0) {
    return Taken::kEarly;
  } else if (ahead < 0) {
    note_late_answer(self, *answer, node);
  } else if (!node.add_part(answer->part)) {
    state.stats.count(CompositorStats::kRepeatedAnswers);
  } else {
    add_answer(self, buffer);
    return node.part_added(answer->last_of_node);
  }
  return Taken::kDone;
}

static Taken take_consistency(LfCompositor* self, GstBuffer* buffer) {
  auto& state = *self->state;
  const lf::MappedBuffer mapped(buffer);
  const lf::DepthLoop::Taken taken = state.focus.take(mapped.bytes(), *state.current);
  if (!taken.problem.empty()) {
    GST_WARNING_OBJECT(self, "dropped photo-consistency sums: %s", taken.problem.c_str());
    state.stats.count(CompositorStats::kBadAnswers);
  }
  const bool stray = taken.ahead > lf::EarlyAnswers::kMaxRequests && state.live;
  if (stray) state.stats.count(CompositorStats::kUnexpectedAnswers);
  return taken.ahead > 0 && !stray ? Taken::kEarly : Taken::kDone;
}

static void take_answers(LfCompositor* self, lf::NodeInput& node) {
  auto& state = *self->state;
  node.take(state.current->sequence, state.live, [&](GstBuffer* buffer) {
    return lf::is_consistency_buffer(buffer) ? take_consistency(self, buffer) : take_fragments(self, node, buffer);
  });
}

static bool tell(LfCompositor* self, lf::ViewFeedback feedback) {
  return gst_pad_push_event(self->request, lf::view_feedback_event(std::move(feedback)));
}

static void post(LfCompositor* self, GstStructure* structure) {
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), structure));
}

static void announce_out_of_service(LfCompositor* self) {
  auto& state = *self->state;
  const lf::CameraSet& cameras = state.health.out_of_service();
  const size_t known = state.rig ? state.rig->cameras.size() : 0;
  const lf::CameraSet out = lf::mesh_exclusions(cameras, state.corners, known);
  state.stats.set_out_of_service(cameras.size());
  const guint view_id = lf_compositor_view_id(self);
  GST_INFO_OBJECT(self, "%zu cameras are out of service", cameras.size());
  tell(self, {.view_id = view_id, .out_of_service = out});
  GstStructure* structure = gst_structure_new("lightfield-out-of-service", "view-id", G_TYPE_UINT, view_id, nullptr);
  lf::set_array(structure, "cameras", G_TYPE_UINT, cameras, g_value_set_uint);
  post(self, structure);
}

bool lf_compositor_announce_caps(LfCompositor* self) {
  if (lf_compositor_settings(self).partial) return false;
  const lf::SharedCaps accepted = lf_compositor_accepted_caps(self);
  return gst_pad_push_event(self->request, lf::picture_caps_event(lf_compositor_view_id(self), accepted.get()));
}

static void find_focus(LfCompositor* self) {
  auto& state = *self->state;
  lf::ViewRequest seen = *state.current;  // the request without the cameras that had no frame
  if (!state.cameras_without_frame.empty() && state.rig) {
    lf::CameraRanges out(
        lf::mesh_exclusions(state.cameras_without_frame.cameras(), state.corners, state.rig->cameras.size()));
    out.add(lf::CameraRanges(seen.out_of_service));
    seen.out_of_service = out.cameras();
  }
  std::optional<lf::DepthEstimate> found = state.focus.next(
      seen, state.settings.view_depths(), state.settings.match_gains(state.rig && state.rig->has_colour()));
  if (!found) return;
  state.stats.set_focus(state.focus.state(), state.focus.bytes());
  state.focus.set_accepted(tell(self, {.view_id = state.current->view_id, .focus = std::move(found)}));
}

// Call after composing a request. Requests the small extra view of the next camera check if the check is due.
static void monitor(LfCompositor* self) {
  auto& state = *self->state;
  if (state.settings.monitor_interval == 0 || !state.rig) return;
  const auto probe = state.turns.next(*state.rig, *state.current, state.settings.monitor_interval);
  if (!probe) return;
  GST_DEBUG_OBJECT(self, "camera %u is left out", probe->camera);
  tell(self, {.view_id = state.current->view_id, .extra_requests = {probe->seen, probe->predicted}});
}

// Returns true if a contributing camera had no frame of the requested time. The prediction error is then no evidence
// against the cameras.
static bool any_is_blind(const _LfCompositor::State& state) {
  lf::CameraRanges blind = state.assembly.blind();
  blind.remove(lf::CameraRanges(state.current->out_of_service));
  blind.remove(lf::CameraRanges(state.health.out_of_service()));
  return !blind.empty();
}

static void answer_sweep(LfCompositor* self) {
  auto& state = *self->state;
  state.assembly.finish(lf::PixelFamily::kRgb, false);
  state.stats.set_focus(state.focus.state(), state.focus.bytes() + state.bytes);
  if (!state.assembly.complete()) return;  // depths from only some of the cameras are unreliable
  tell(self, {.view_id = state.current->view_id, .focus = state.focus.sweep(*state.current)});
}

static void take_probe(LfCompositor* self) {
  auto& state = *self->state;
  const lf::ViewRequest& request = *state.current;
  if (!request.hypotheses.empty()) return answer_sweep(self);
  state.stats.count(CompositorStats::kMonitorBytes, state.bytes);
  if (!state.turns.expects(request)) return;
  state.assembly.finish(lf::PixelFamily::kRgb, true);
  if (!state.assembly.complete() || any_is_blind(state)) return state.turns.lose();
  const auto came = state.turns.take(request, lf::coverage_image(state.assembly.picture()));
  if (came == lf::ProbeScheduler::TurnResult::kFirstProbe) return;
  const lf::CameraMonitor& monitor = *state.turns.monitor();
  state.stats.set_monitor(monitor);
  if (came != lf::ProbeScheduler::TurnResult::kSuspectsChanged) return;
  GST_INFO_OBJECT(self, "%zu cameras are suspect", monitor.suspects().size());
  GstStructure* structure = gst_structure_new("lightfield-suspects", "view-id", G_TYPE_UINT, request.view_id, nullptr);
  lf::set_suspects(structure, "suspects", monitor.suspects());
  post(self, structure);
}

static uint64_t capture_time(LfCompositor* self) {
  const auto& state = *self->state;
  return state.current->target_time != lf::kNoTime ? state.current->target_time : state.assembly.actual_time();
}

static void record_skipped(LfCompositor* self, const lf::QosTracker::Late& late) {
  constexpr gint kFullQuality = 1'000'000;  // pictures are shown in full quality or not at all
  auto& state = *self->state;
  state.stats.request_skipped(state.current->sequence);
  if (!state.current->place.leads()) return;  // one message per set
  const lf::BufferPtr request = peek_request(self);
  if (!request) return;
  const GstSegment& segment = GST_AGGREGATOR_PAD(self->request)->segment;
  const GstClockTime pts = GST_BUFFER_PTS(request.get());
  GstMessage* message = gst_message_new_qos(
      GST_OBJECT(self), lf_compositor_is_live(self), gst_segment_to_running_time(&segment, GST_FORMAT_TIME, pts),
      gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, pts), pts, GST_BUFFER_DURATION(request.get()));
  const CompositorStats::Totals totals = state.stats.totals();
  gst_message_set_qos_values(message, late.jitter, late.proportion, kFullQuality);
  gst_message_set_qos_stats(message, GST_FORMAT_BUFFERS, totals.pictures, totals.skipped);
  gst_element_post_message(GST_ELEMENT(self), message);
}

// Warns if a view is black because it is outside the array, and if a view of a stereo pair or quilt has only
// extrapolated pixels. Does not warn while cameras are out of service, because these cameras may be the cause.
static void note_unseen(LfCompositor* self, const std::optional<lf::MeanCoverage>& coverage) {
  auto& state = *self->state;
  if (!coverage || !state.health.out_of_service().empty()) return;
  const bool of_set = state.current->place.count() > 1;
  if (coverage->seen > (of_set ? coverage->extrapolated : 0) || std::exchange(state.warned_unseen, true)) return;
  if (!state.current->out_of_service.empty()) {
    lf::ViewRequest with_all = *state.current;
    with_all.out_of_service.clear();
    if (lf::ViewCoverage().share(*state.rig, with_all, {}, true, g_get_monotonic_time()).seen > 0) {
      GST_ELEMENT_WARNING(
          self, STREAM, FAILED,
          ("No camera sees anything of view %u: %zu of %zu cameras are out of service, including all cameras "
           "near the view. Check the viewer's property out-of-service.",
           state.current->view_id, state.current->out_of_service.size(), state.rig->cameras.size()),
          (nullptr));
      return;
    }
  }
  const std::string across = lf::format_text("%.2f", state.extent.load());
  if (of_set) {
    GST_ELEMENT_WARNING(self, STREAM, FAILED,
                        ("Some of the %d views of view %u are outside the array, which is %s m wide: all their pixels "
                         "are extrapolated or black. Reduce eye-distance or view-cone.",
                         state.current->place.count(), state.current->view_id, across.c_str()),
                        (nullptr));
    return;
  }
  GST_ELEMENT_WARNING(self, STREAM, FAILED,
                      ("No camera sees anything of view %u: the eye, or its whole field of view, is outside the array, "
                       "which is %s m wide. The property stats counts these pictures as unseen.",
                       state.current->view_id, across.c_str()),
                      (nullptr));
}

// Returns the cameras without an image in the current picture, for LF_VIEW_META. Without a rig, only cameras in the
// received answers can be listed.
static lf::CameraSet cameras_without_picture(const _LfCompositor::State& state) {
  if (!state.rig) return state.assembly.blind().cameras();
  lf::CameraSet missing;
  for (lf::CameraIndex camera = 0; camera < state.rig->cameras.size(); camera++)
    if (!state.assembly.seeing().contains(camera)) missing.push_back(camera);
  return missing;
}

// Returns the confidence of the surface that the current view shows; null if it shows the viewer's plane.
static std::shared_ptr<const lf::FocalMap> confidence_of_surface(const _LfCompositor::State& state) {
  const lf::ViewRequest& request = *state.current;
  const std::shared_ptr<const lf::FocalMap>& map = request.view.focus.map;
  std::shared_ptr<const lf::FocalMap> confidence = state.focus.confidence();
  const bool is_shown = map && request.place.leads() && (!request.on_plane || state.focus.state().flat);
  const bool fits = is_shown && confidence && confidence->step == map->step && confidence->columns == map->columns &&
                    confidence->rows == map->rows;
  return fits ? confidence : nullptr;
}

static void note_view(LfCompositor* self, const lf::NodeInputs& nodes,
                      const std::optional<lf::MeanCoverage>& coverage) {
  auto& state = *self->state;
  const lf::Assembly& assembly = state.assembly;
  lf::ViewMetaEntry facts{.request = *state.current,
                          .capture_time = std::nullopt,
                          .coverage = coverage,
                          .fragments = assembly.fragments(),
                          .missing = assembly.missing(),
                          .damaged = assembly.damaged(),
                          .missing_cameras = cameras_without_picture(state),
                          .missing_nodes = {},
                          .confidence = confidence_of_surface(state)};
  const uint64_t captured = capture_time(self);
  if (captured != lf::kNoTime) facts.capture_time = captured;
  for (lf::NodeInput* node : nodes)
    if (!node->has_answered()) facts.missing_nodes.push_back(node->name());
  state.view_meta.add(std::move(facts));
}

static void record(LfCompositor* self, const lf::NodeInputs& nodes, int64_t answered, GstClockTime pts) {
  auto& state = *self->state;
  const lf::ViewRequest& request = *state.current;
  const lf::Assembly& assembly = state.assembly;
  const bool describe = state.settings.post_messages;
  // Measures each view of the first set, because the views differ.
  const uint32_t set = request.sequence - static_cast<uint32_t>(request.place.turn());
  if (!state.first_set) state.first_set = set;
  const bool exact = describe || (request.place.count() > 1 && set == *state.first_set);
  std::optional<lf::MeanCoverage> coverage;
  if (state.rig)
    coverage = state.coverage.share(*state.rig, request, state.health.out_of_service(), exact, g_get_monotonic_time());
  GstStructure* description = state.stats.record(
      {request.view_id, request.sequence, pts, assembly.fragments(), assembly.missing(), assembly.damaged(), coverage,
       state.bytes, state.focus.bytes(), assembly.skew(), answered, state.adding, g_get_monotonic_time()},
      describe);
  note_unseen(self, coverage);
  if (!state.settings.partial) note_view(self, nodes, coverage);
  if (description) post(self, description);
}

static void warn_of_silent(LfCompositor* self, const std::vector<lf::NodeInput*>& nodes) {
  for (lf::NodeInput* node : nodes) {
    const char* const hint =
        node->silence().ever_answered()
            ? "has stopped answering: check its host and the network."
            : "does not answer, unlike other nodes: check that requests reach the node, and its key-file.";
    GST_ELEMENT_WARNING(self, STREAM, FAILED, ("A node (%s) %s", node->name().c_str(), hint), (nullptr));
  }
}

static void note_silence(LfCompositor* self, const lf::NodeInputs& nodes) {
  if (!lf_compositor_is_live(self)) return;
  const gint64 now = g_get_monotonic_time();
  lf::SilenceDetector& silence = self->state->silence;
  std::vector<lf::NodeInput*> silent;
  for (lf::NodeInput* node : nodes)
    if (!node->has_ended() && node->silence().composed(now)) silent.push_back(node);
  if (!silence.composed(now)) {
    if (!silence.is_silent()) warn_of_silent(self, silent);
    return;
  }
  if (silence.ever_answered()) {
    GST_ELEMENT_WARNING(self, STREAM, FAILED,
                        ("No node answers view %u any more: check the hosts of the nodes and the network.",
                         self->state->current->view_id),
                        (nullptr));
    return;
  }
  GST_ELEMENT_WARNING(
      self, STREAM, FAILED,
      ("No node answers view %u: check that requests reach the nodes and that answers reach this compositor. Nodes "
       "on other hosts need the same key-file as this viewer, or none if the viewer has none.",
       self->state->current->view_id),
      (nullptr));
}

// Ends the current request, so that the next request can start. Nodes that have not answered count as having missed the
// picture. Probes (small extra views for the camera monitor) are not counted, because the pictures of the view already
// are.
static void close_request(LfCompositor* self, const lf::NodeInputs& nodes, GstClockTime due) {
  auto& state = *self->state;
  note_silence(self, nodes);
  // Counts only one view of a set, because all of them show the same time.
  const bool counts = !state.current->probe && state.current->place.leads();
  for (lf::NodeInput* node : nodes) node->close(counts);
  if (lf_compositor_is_live(self) && !state.current->probe) state.past.composed(state.current->sequence, due);
  state.cameras_without_frame = lf_compositor_is_live(self) ? lf::CameraRanges() : state.assembly.blind();
  if (lf_compositor_is_live(self) && counts) {
    const bool reset = state.health.use_rig(state.assembly.rig_hash());
    if (state.health.picture(state.assembly.seeing()) || reset) announce_out_of_service(self);
  }
  state.assembly.release();
  state.current.reset();
}

// Ends a request that gets no picture.
static GstFlowReturn drop_answered(LfCompositor* self, const lf::NodeInputs& nodes, GstClockTime due) {
  close_request(self, nodes, due);
  gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request));
  return GST_FLOW_OK;
}

static GstBuffer* make_output(LfCompositor* self, GstFlowReturn* flow) {
  auto& state = *self->state;
  const lf::CompositorSettings& settings = state.settings;
  if (settings.partial)
    return state.output.make_answer(state.assembly, *state.current, settings.node, settings.codec, flow);
  const guint32 argb = settings.background;
  const lf::Background background{static_cast<uint8_t>(argb >> 16), static_cast<uint8_t>(argb >> 8),
                                  static_cast<uint8_t>(argb)};
  bool dropped = false;
  state.output.show(settings.show, state.rig);
  GstBuffer* picture = state.output.make_picture(state.assembly, *state.current, background, flow, &dropped);
  if (dropped) state.stats.count(lf::CompositorStats::kDroppedPictures);
  if (picture && state.output.is_on_gpu()) state.stats.count(lf::CompositorStats::kGpuPictures);
  return picture;
}

static GstFlowReturn push_consistency(LfCompositor* self, GstClockTime pts) {
  auto& state = *self->state;
  for (lf::ByteBuffer& bytes : state.focus.units(*state.current, state.assembly.rig_hash(), state.settings.node)) {
    GstBuffer* unit = lf::wrap_bytes(std::move(bytes));
    GST_BUFFER_PTS(unit) = pts;
    const GstFlowReturn flow = gst_aggregator_finish_buffer(GST_AGGREGATOR(self), unit);
    if (flow != GST_FLOW_OK) return flow;
  }
  return GST_FLOW_OK;
}

static void replace_incomplete(LfCompositor* self, GstBuffer** picture) {
  auto& state = *self->state;
  switch (state.output.replace_incomplete(state.assembly, state.settings.incomplete, picture)) {
    case lf::PictureOutput::OutputAction::kRepeated: return state.stats.count(lf::CompositorStats::kRepeatedPictures);
    case lf::PictureOutput::OutputAction::kDropped: return state.stats.count(lf::CompositorStats::kDroppedPictures);
    default: return;
  }
}

static bool any_has_answered(const lf::NodeInputs& nodes) {
  return std::ranges::any_of(nodes, [](const lf::NodeInput* node) { return node->has_answered(); });
}

static bool any_is_awaited(LfCompositor* self, const lf::NodeInputs& nodes, bool live) {
  const unsigned max_missed = self->state->settings.max_missed;
  return std::ranges::any_of(nodes, [=](const lf::NodeInput* node) { return node->is_awaited(live, max_missed); });
}

// Returns true if the nodes have answered the current request in time. A node that has stopped answering does not count
// as long as others answer.
static bool is_in_time(LfCompositor* self, const lf::NodeInputs& nodes) {
  const auto& state = *self->state;
  return state.assembly.complete() && !any_is_awaited(self, nodes, state.live) && any_has_answered(nodes);
}

// Adapts the latency after a picture with the deadline `due`; see LatencyControl.
static void adapt_latency(LfCompositor* self, const lf::NodeInputs& nodes, GstClockTime due) {
  const GstClockTime now = clock_time(self);
  std::optional<uint64_t> spare;
  if (GST_CLOCK_TIME_IS_VALID(due) && GST_CLOCK_TIME_IS_VALID(now) && now <= due && is_in_time(self, nodes))
    spare = due - now;
  GstClockTime latency = 0;
  g_object_get(self, "latency", &latency, nullptr);
  const GstClockTime next = self->state->latency.next(latency, any_has_answered(nodes), spare);
  if (next == latency) return;
  if (next > latency)
    GST_WARNING_OBJECT(
        self, "all answers arrive after the deadline of their pictures: latency increases to %" GST_TIME_FORMAT,
        GST_TIME_ARGS(next));
  else
    GST_INFO_OBJECT(self, "answers arrive early: latency decreases to %" GST_TIME_FORMAT, GST_TIME_ARGS(next));
  g_object_set(self, "latency", next, nullptr);
}

static GstFlowReturn finish_request(LfCompositor* self, const lf::NodeInputs& nodes) {
  auto& state = *self->state;
  const bool partial = state.settings.partial;
  const int64_t answered = g_get_monotonic_time();
  const GstClockTime due = deadline(self);
  if (state.current->probe && !partial) {
    take_probe(self);
    return drop_answered(self, nodes, due);
  }
  const bool leads = state.current->place.leads();
  if (leads && !partial && lf_compositor_is_live(self)) adapt_latency(self, nodes, due);
  // Warm-up requests ignore the interval, because otherwise the first picture would appear before the focal surface is
  // found.
  const guint depth_interval = state.current->warmup ? 1 : state.settings.depth_interval;
  if (leads) state.focus.adapt_rate(is_in_time(self, nodes), depth_interval);
  // Updates the focus before making the picture, because the next request may wait for the focus.
  if (!partial && leads && state.current->view.focus.map) find_focus(self);
  if (!partial && state.current->warmup) return drop_answered(self, nodes, due);
  GstFlowReturn flow = GST_FLOW_OK;
  g_autoptr(GstBuffer) out = make_output(self, &flow);
  if (!out && flow != GST_FLOW_OK) return flow;
  g_autoptr(GstBuffer) request = gst_aggregator_pad_pop_buffer(GST_AGGREGATOR_PAD(self->request));
  if (!request) {  // flushed in the meantime
    lf_compositor_forget_request(self);
    return GST_FLOW_OK;
  }
  const GstClockTime pts = GST_BUFFER_PTS(request);
  state.output.follow_segment(GST_AGGREGATOR_PAD(self->request)->segment);
  record(self, nodes, answered, pts);
  if (partial)
    flow = push_consistency(self, pts);
  else if (leads)
    monitor(self);
  if (out) replace_incomplete(self, &out);
  const uint64_t captured = capture_time(self);
  close_request(self, nodes, due);
  if (!out) return GST_FLOW_OK;
  if (flow != GST_FLOW_OK) return flow;
  GST_BUFFER_PTS(out) = pts;
  GST_BUFFER_DURATION(out) = GST_BUFFER_DURATION(request);
  if (!partial) {
    if (captured != lf::kNoTime && !lf::find_capture_time(out)) lf::add_capture_time(out, captured);
    state.view_meta.attach(out);
  }
  // Pictures that are not live are never incomplete, so the output keeps no reference, and downstream may write into
  // the picture.
  std::vector<lf::DepthOutput::Output> depths;
  if (!partial) {
    const lf::DepthEstimator::Settings limits = state.settings.view_depths();
    state.depths.set_limits(limits.near, limits.far);
    depths = state.depths.make(out);
  }
  flow = state.output.push(g_steal_pointer(&out), pts, lf_compositor_is_live(self) && !partial);
  return state.depths.push(std::move(depths), GST_AGGREGATOR_SRC_PAD(self), flow);
}

static std::optional<lf::QosTracker::Late> is_too_late(LfCompositor* self) {
  auto& state = *self->state;
  if (state.current->probe || state.current->warmup || state.output.is_drawing(*state.current)) return std::nullopt;
  return state.qos.late(state.current->view_id, request_time(self));
}

// Skips the current request, so that the request gets no picture. The nodes skip the request, too, so the picture does
// not count as missed by the nodes.
static void skip_request(LfCompositor* self, const lf::QosTracker::Late& late) {
  auto& state = *self->state;
  record_skipped(self, late);
  if (!state.settings.partial && state.current->place.leads() && state.current->view.focus.map) find_focus(self);
  state.past.skipped(state.current->sequence);
  drop_request(self);
}

static void use_rig_for_health(LfCompositor* self, uint64_t hash) {
  if (self->state->health.use_rig(hash)) announce_out_of_service(self);
}

static void apply_new_rig(LfCompositor* self) {
  auto& state = *self->state;
  lf::ObjectLock lock(self);
  const std::unique_ptr<std::shared_ptr<const lf::Rig>> rig(std::exchange(self->new_rig, nullptr));
  lock.unlock();
  if (!rig) return;
  lf_compositor_use_rig(self, *rig);
  state.cameras_without_frame = {};
  if (!state.settings.partial) state.health.expect(*rig ? (*rig)->cameras.size() : 0);
  if (*rig) use_rig_for_health(self, (*rig)->hash());
}

// A lower sequence number means that the viewer has restarted. Drops the early answers of the previous run.
static void note_sequence(LfCompositor* self, uint32_t sequence) {
  if (!self->state->past.begin(sequence)) return;
  GST_INFO_OBJECT(self, "requests continue at %u: the viewer has restarted", sequence);
  for (lf::NodeInput* node : lf::NodeInputs(self->request)) node->drop_early();
}

// Makes the next request of this view the current request. It stays on the pad until it is answered, so that
// aggregation starts with the last answer and not with the next request.
static bool find_request(LfCompositor* self, guint view_id) {
  auto& state = *self->state;
  if (state.current) return true;
  apply_new_rig(self);
  while (const lf::BufferPtr buffer = peek_request(self)) {
    std::string reason;
    std::optional<lf::ViewRequest> request = lf::decode_request_buffer(buffer.get(), &reason);
    if (request && request->view_id == view_id) {
      try {
        lf_compositor_forget_request(self);
        state.focus.begin();
        state.assembly.begin(*request, state.health.out_of_service());
        note_sequence(self, request->sequence);
        use_rig_for_health(self, state.assembly.rig_hash());
        refresh_latency(self);
        state.current = std::move(request);
        state.bytes = 0;
        state.adding = 0;
        // Sends the next hypotheses immediately if the request had none, because no photo-consistency sums will arrive
        // then.
        if (!state.settings.partial && !state.current->probe && state.current->place.leads() &&
            !state.current->view.focus.map)
          find_focus(self);
        return true;
      } catch (const lf::Error& error) {
        reason = error.what();
        request.reset();
      }
    }
    if (!request) {
      GST_WARNING_OBJECT(self, "dropped a view request: %s", reason.c_str());
      state.stats.count(CompositorStats::kBadRequests);
    }
    gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request));
  }
  return false;
}

static GstFlowReturn compose(LfCompositor* self) {
  if (self->state->request_flushed.exchange(false)) lf_compositor_forget_request(self);
  const guint view_id = self->state->settings.view_id;
  bool found = find_request(self, view_id);
  while (found) {
    const std::optional<lf::QosTracker::Late> late = is_too_late(self);
    if (!late) break;
    skip_request(self, *late);
    found = find_request(self, view_id);
  }
  if (!found)
    return gst_aggregator_pad_is_eos(GST_AGGREGATOR_PAD(self->request)) ? GST_FLOW_EOS : GST_AGGREGATOR_FLOW_NEED_DATA;
  const bool live = self->state->live = lf_compositor_is_live(self);
  const lf::NodeInputs nodes(self->request);
  for (lf::NodeInput* node : nodes) take_answers(self, *node);
  const GstClockTime due = deadline(self);
  const bool late = GST_CLOCK_TIME_IS_VALID(due) && clock_time(self) >= due;
  return late || !any_is_awaited(self, nodes, live) ? finish_request(self, nodes) : GST_AGGREGATOR_FLOW_NEED_DATA;
}

static GstFlowReturn abandon_request(LfCompositor* self) {
  self->state->stats.count(CompositorStats::kFailedPictures);
  drop_request(self);
  return GST_FLOW_OK;
}

// Drops all input after the output has ended. Upstream must not see an error, because errors would end all views of the
// same tee. Returns EOS when all pads have ended, because otherwise the base class would keep calling aggregate().
static GstFlowReturn drop_all(LfCompositor* self) {
  lf_compositor_forget_request(self);
  const lf::NodeInputs nodes(self->request);
  for (lf::NodeInput* node : nodes) node->drop_all();
  while (gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(self->request))) {
  }
  const bool ended = gst_aggregator_pad_is_eos(GST_AGGREGATOR_PAD(self->request)) &&
                     std::ranges::all_of(nodes, [](lf::NodeInput* node) { return node->has_ended(); });
  return ended ? GST_FLOW_EOS : GST_AGGREGATOR_FLOW_NEED_DATA;
}

GstFlowReturn lf_compositor_aggregate(GstAggregator* agg, gboolean) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  auto& state = *self->state;
  if (state.over) return drop_all(self);
  GstFlowReturn flow = GST_FLOW_ERROR;
  try {
    state.settings = lf_compositor_settings(self);
    flow = compose(self);
  } catch (...) {
    lf::warn_of_current_exception(self);
    flow = lf::guarded(agg, GST_FLOW_ERROR, [self] { return abandon_request(self); });
  }
  switch (flow) {
    case GST_FLOW_OK: state.warned_unlinked = false; return flow;
    case GST_AGGREGATOR_FLOW_NEED_DATA: return flow;
    case GST_FLOW_FLUSHING: return GST_AGGREGATOR_FLOW_NEED_DATA;  // handled by the flushing element
    case GST_FLOW_NOT_LINKED:                                      // until the pad is linked again
      if (!std::exchange(state.warned_unlinked, true))
        GST_ELEMENT_WARNING(self, CORE, PAD,
                            ("The source pad is not linked: pictures are discarded. Link it with a "
                             "sink, for example videoconvert ! autovideosink."),
                            (nullptr));
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    case GST_FLOW_NOT_NEGOTIATED:  // elements post all other errors themselves
      if (!state.output.has_refused()) GST_ELEMENT_FLOW_ERROR(self, flow);
      break;
    default: break;
  }
  if (!state.output.has_begun()) return flow;  // the base class starts a stream before EOS
  GST_INFO_OBJECT(self, "the output has ended: %s", gst_flow_get_name(flow));
  state.over = true;
  gst_pad_push_event(GST_AGGREGATOR_SRC_PAD(self), gst_event_new_eos());
  return drop_all(self);
}

// Returns the running time (without the latency) for calling aggregate() even with empty pads, in live pipelines. The
// caller holds the lock of GstAggregator, so a latency query here would deadlock.
GstClockTime lf_compositor_next_time(GstAggregator* agg) {
  LfCompositor* self = LF_COMPOSITOR(agg);
  if (!peek_request(self)) return GST_CLOCK_TIME_NONE;
  const GstClockTime time = request_time(self);
  if (!self->state->current) return 0;
  const lf::NodeInputs nodes(self->request);
  const bool has_unread = std::ranges::any_of(nodes, [](const lf::NodeInput* node) { return node->has_unread(); });
  return !has_unread && any_is_awaited(self, nodes, true) ? time : 0;
}
