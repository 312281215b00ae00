// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Requests in, answers out. Where requests come in real time the answer pad has a thread that answers them, one view
// beside the other (FairAnswers); else the requests' own thread does, one after the other.
#include "base/schedule.h"
#include "common/capture_delay.h"
#include "common/day_clock.h"
#include "fragment/lffragment_private.h"
#include "wire/request_codec.h"

using lf::Requester;
using Job = lf::FragmentJob;
using JobPtr = std::shared_ptr<Job>;

lf::ParallelFor lf_fragment_workers(LfFragment* self) {
  return [self](size_t count, const std::function<void(size_t)>& task) {
    const guint threads = lf_fragment_settings(self).threads;
    self->state->workers->run(threads > 0 ? threads : g_get_num_processors(), count, task);
  };
}

// Owned by the caller; null where there is none.
static GstEvent* segment_event(GstPad* pad, const GstSegment** segment) {
  GstEvent* event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (event) gst_event_parse_segment(event, segment);
  return event;
}

static void lf_fragment_follow_requests(LfFragment* self, GstPad* pad, const lf::RequestHeader& head) {
  if (head.target_time == lf::kNoTime) return;
  const GstSegment* segment = nullptr;
  g_autoptr(GstEvent) event = segment_event(pad, &segment);
  if (event && Requester::of(pad).place.moves(*segment, head.target_time))
    lf_fragment_seek_cameras(self, head.target_time, gst_event_get_seqnum(event));
}

// Viewers may leave the capture delay to the nodes.
static void lf_fragment_tell_delay(LfFragment* self, GstPad* pad) {
  Requester& requester = Requester::of(pad);
  if (!requester.place.is_live()) return;
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) return;
  const uint64_t now = gst_clock_get_time(clock);
  if (!requester.delay.is_due(now)) return;
  const uint64_t needed = lf_fragment_needed_delay(self, now);
  if (requester.delay.see(needed, now)) gst_pad_push_event(pad, lf::capture_delay_event(needed));
}

// Whether the picture would come too late to be shown, as it comes after so much work.
static bool lf_fragment_is_too_late(GstPad* pad, const Job& job, lf::WorkEstimate& estimate, double work) {
  if (job.due > 0 && lf::now_ns() + estimate.nanoseconds(work) > job.due) {
    estimate.skipped();
    return true;
  }
  const lf::RequestHeader& head = lf::wire::head_of(job.request);
  if (head.probe) return false;
  const GstSegment* segment = nullptr;
  g_autoptr(GstEvent) event = segment_event(pad, &segment);
  if (!event) return false;
  const GstClockTime time = gst_segment_to_running_time(segment, GST_FORMAT_TIME, job.pts);
  return Requester::of(pad).qos.late(head.view_id, time).has_value();
}

static void lf_fragment_post_answer(LfFragment* self, const Job& job, const lf::Node::Reply& reply, guint64 bytes) {
  const lf::RequestHeader& head = lf::wire::head_of(job.request);
  const lf::NodeStats::Stages& s = reply.stages;
  gst_element_post_message(
      GST_ELEMENT(self),
      gst_message_new_element(
          GST_OBJECT(self),
          gst_structure_new("lightfield-answer", "view-id", G_TYPE_UINT, head.view_id, "sequence", G_TYPE_UINT,
                            head.sequence, "pts", G_TYPE_UINT64, job.pts, "fragments", G_TYPE_UINT,
                            static_cast<guint>(reply.answer.fragments), "bytes", G_TYPE_UINT64, bytes, "wait-ns",
                            G_TYPE_UINT64, s.wait, "decode-ns", G_TYPE_UINT64, s.decode, "render-ns", G_TYPE_UINT64,
                            s.render, "encode-ns", G_TYPE_UINT64, s.encode, nullptr)));
}

static GstFlowReturn lf_fragment_push(LfFragment* self, GstPad* src, GstBuffer* unit, const Job& job) {
  GST_BUFFER_PTS(unit) = job.pts;
  GST_BUFFER_DURATION(unit) = job.duration;
  self->state->node.stats().bytes += gst_buffer_get_size(unit);
  return gst_pad_push(src, unit);
}

// Of frames in a card's memory; null where there are none.
static lf::GlContextPtr frames_context(LfFragment* self) {
  const lf::ObjectLock lock(self);
  return self->state->frames_context.get();
}

// What draws shares with the context. False if it does not, for now or ever.
static bool move_to(LfFragment* self, lf::RendererChoice choice, lf::gl::ShareGroup group, bool early,
                    const lf::GlContextPtr& context) {
  std::string why;
  const auto open = [&](std::string& reason) -> std::unique_ptr<lf::gl::SumDrawer> {
    if (!context) return nullptr;
    lf::gl::Context::Foreign foreign = lf::share(context.get(), reason);
    if (!foreign.call) return nullptr;
    return lf::gl::SumDrawer::create_in(std::move(foreign), lf::gl::Context::Drivers::kHardware, reason);
  };
  const bool is_there = self->state->card.move_to(choice, group, early, open, why);
  if (!why.empty()) GST_INFO_OBJECT(self, "frames or sums have to leave the card: %s", why.c_str());
  return is_there;
}

// Where the cameras' frames are on a card they need not leave it, else sums need not where the compositor's pictures
// are; mostly both are in the same contexts.
static void move_card(LfFragment* self, lf::RendererChoice choice, const lf::NearCompositor& compositor) {
  const lf::GlContextPtr frames = frames_context(self);
  if (frames && move_to(self, choice, lf::share_group(frames.get()), true, frames)) return;
  if (compositor.group != 0) move_to(self, choice, compositor.group, false, compositor.context.get());
}

static lf::Node::Options options_of(LfFragment* self, const lf::FragmentSettings& settings,
                                    const lf::NearCompositor& compositor) {
  lf::Node::Options options;
  options.codec = settings.codec;
  options.strip_pixels = settings.strip_pixels;
  options.max_skew = settings.max_skew;
  options.resampling = settings.resampling;
  options.base_time = gst_element_get_base_time(GST_ELEMENT(self));
  options.day_offset = lf::day_offset(GST_ELEMENT(self));
  options.in_process = compositor.is_there;
  options.group = compositor.group;
  if (settings.renderer != lf::RendererChoice::kCpu) move_card(self, settings.renderer, compositor);
  std::string news;
  options.card = self->state->card.open(settings.renderer, news);
  options.trial_card = self->state->card.open_for_trials(settings.renderer);
  // Another requester may have moved it meanwhile, and images are made ready for one.
  if (options.card && options.trial_card != options.card) options.trial_card.reset();
  if (!news.empty()) GST_ELEMENT_WARNING(self, RESOURCE, NOT_FOUND, ("%s.", news.c_str()), (nullptr));
  return options;
}

// What has been answered goes downstream.
static GstFlowReturn lf_fragment_send(LfFragment* self, GstPad* pad, GstPad* src, const Job& job,
                                      lf::Node::Reply reply) {
  Requester& requester = Requester::of(pad);
  lf::Node& node = self->state->node;
  const lf::RequestHeader& head = lf::wire::head_of(job.request);
  if (!reply.warning.empty())
    GST_ELEMENT_WARNING(self, STREAM, FAILED, ("View %u: %s.", head.view_id, reply.warning.c_str()), (nullptr));
  for (lf::ByteBuffer* before : {&reply.brightness, &reply.tried.unit}) {
    if (before->empty()) continue;
    const GstFlowReturn flow = lf_fragment_push(self, src, lf::wrap_bytes(std::move(*before)), job);
    if (flow != GST_FLOW_OK) return flow;
  }
  GstBuffer* out = lf::wrap_answer(std::move(reply.answer.bytes), requester.memory, std::move(reply.answer.payload));
  node.stats().answers++;
  node.stats().fragments += reply.answer.fragments;
  if (lf_fragment_settings(self).post_messages) lf_fragment_post_answer(self, job, reply, gst_buffer_get_size(out));
  GST_LOG_OBJECT(pad, "view %u, request %u: %zu fragments, %" G_GSIZE_FORMAT " bytes", head.view_id, head.sequence,
                 reply.answer.fragments, gst_buffer_get_size(out));
  return lf_fragment_push(self, src, out, job);
}

// Of several that may go together.
static GstFlowReturn lf_fragment_answer(LfFragment* self, GstPad* pad, GstPad* src, std::span<const JobPtr> jobs,
                                        lf::Node::Requester& kept, lf::ParallelFor parallel) {
  Requester& requester = Requester::of(pad);
  lf::Node& node = self->state->node;
  const lf::FragmentSettings settings = lf_fragment_settings(self);
  lf::Node::Options options = options_of(self, settings, jobs.front()->compositor);
  options.live = requester.place.is_live();
  options.parallel = std::move(parallel);
  std::vector<const lf::wire::AnyRequest*> requests;
  std::vector<JobPtr> answered;
  double work = 0;
  for (const JobPtr& job : jobs) work += job->work;
  for (const JobPtr& job : jobs) {
    if (lf_fragment_is_too_late(pad, *job, kept.estimate, work)) {
      const GstFlowReturn flow = lf_fragment_send(self, pad, src, *job, node.skip(job->request));
      if (flow != GST_FLOW_OK) return flow;
      continue;
    }
    requests.push_back(&job->request);
    answered.push_back(job);
  }
  if (requests.empty()) return GST_FLOW_OK;
  std::vector<lf::Node::Reply> replies = node.answer(requests, kept, options, [&] { return requester.memory->take(); });
  if (replies.size() > 1) node.stats().together += replies.size();
  // It was one pass, or one that was refused.
  const auto refused = std::ranges::find_if(replies, [](const auto& reply) { return reply.answer.drawing.refused; });
  const lf::Node::Reply& judged = refused == replies.end() ? replies.front() : *refused;
  self->state->card.rendered(settings.renderer, judged.answer, frames_context(self) ? judged.stages.decode : 0);
  self->state->card.tried(settings.renderer, replies.front().tried);
  GstFlowReturn flow = GST_FLOW_OK;
  for (size_t i = 0; i < replies.size() && flow == GST_FLOW_OK; i++) {
    const lf::NodeStats::Stages& stages = replies[i].stages;
    if (stages.render > 0) kept.estimate.done(answered[i]->work, stages.decode + stages.render + stages.encode);
    flow = lf_fragment_send(self, pad, src, *answered[i], std::move(replies[i]));
  }
  return flow;
}

// A live one whose turn it is. Where a card draws several at once those of its set that wait go with it.
static std::optional<GstFlowReturn> lf_fragment_answer_with_set(LfFragment* self, GstPad* pad, GstPad* src,
                                                                const JobPtr& job, lf::Node::Requester& kept,
                                                                lf::ParallelFor parallel) {
  const bool alone = !self->state->card.draws_several(lf_fragment_settings(self).renderer);
  const std::vector<JobPtr> jobs = Requester::of(pad).waiting.take_with(job, alone);
  if (jobs.empty()) return std::nullopt;
  return lf_fragment_answer(self, pad, src, jobs, kept, std::move(parallel));
}

static void lf_fragment_answer_loop(gpointer data) {
  GstPad* src = GST_PAD(data);
  lf::guarded_buffer(src, [=] { return Requester::of(src).live_answers.work(src), GST_FLOW_OK; });
}

// Behind each request its command comes: two requests without one have a viewer that sends none.
static void lf_fragment_note_unfit(LfFragment* self, Requester& requester, lf::Access access) {
  constexpr unsigned kEnough = 2;
  if (requester.any_fits || ++requester.unfit != kEnough) return;
  const char* nick = lf::access_nick(access);
  GST_ELEMENT_WARNING(
      self, STREAM, WRONG_TYPE,
      ("access=%s: no %s commands come with the requests, so that these cameras answer none of them: set "
       "access=%s at the viewer's lfviewrequest, too, or access=self here.",
       nick, nick, nick),
      (nullptr));
}

// What is not for cameras of this kind, or asks for too much, is not even decoded.
static bool lf_fragment_is_to_be_answered(LfFragment* self, Requester& requester, std::span<const uint8_t> request) {
  const std::optional<lf::wire::RequestPeek> peek = lf::wire::peek_request(request);
  const lf::Access access = lf_fragment_settings(self).access;
  if (peek && lf::wire::access_of_type(peek->type).value_or(access) != access) {
    lf_fragment_note_unfit(self, requester, access);
    return false;
  }
  if (peek) requester.any_fits = true;
  return self->state->guard.admits(GST_ELEMENT(self), request, self->state->node.inputs().array()->extent,
                                   requester.place.is_live(), requester.number);
}

// Hands the request over to the answer pad's thread.
static GstFlowReturn lf_fragment_answer_later(LfFragment* self, GstPad* pad, GstPad* src, const JobPtr& job) {
  Requester& requester = Requester::of(pad);
  const GstClockTime max_delay = lf_fragment_settings(self).max_delay;
  if (max_delay > 0) job->due = lf::now_ns() + max_delay;
  bool dropped = false;
  const auto* const view = std::get_if<lf::ViewRequest>(&job->request);
  requester.waiting.add(job);
  const GstFlowReturn flow = requester.live_answers.add(
      src, lf::wire::head_of(job->request).view_id, job->work,
      [self, pad, src, job](lf::Node::Requester& kept, const lf::ParallelFor& parallel) {
        return lf_fragment_answer_with_set(self, pad, src, job, kept, parallel);
      },
      &dropped, view ? lf::views_that_wait_together(*view) : 1);
  // What has gone with its set is dropped without loss.
  const size_t lost = requester.waiting.forget_dropped();
  if (dropped) self->state->node.stats().superseded += lost;
  if (flow != GST_FLOW_FLUSHING && gst_pad_get_task_state(src) != GST_TASK_STARTED)
    gst_pad_start_task(src, lf_fragment_answer_loop, src, nullptr);
  return flow;
}

// Of the answer to a request, see lf::planned_work().
static double lf_fragment_work(LfFragment* self, std::span<const uint8_t> bytes, const lf::wire::AnyRequest& request) {
  const auto array = self->state->node.inputs().array();
  const size_t cameras = array->rig ? array->rig->cameras.size() : 0;
  double work = lf::planned_work(lf::wire::peek_request_cost(bytes), cameras);
  if (const auto* const warp = std::get_if<lf::wire::WarpCommand>(&request))
    for (const lf::FacePlan& face : warp->warp.faces)
      work += static_cast<double>(face.rect.width()) * face.rect.height();
  // Another mesh takes about as long as so many pixels for each camera.
  constexpr double kMeshCamera = 512;
  const auto* const view = std::get_if<lf::ViewRequest>(&request);
  if (view && !view->out_of_service.empty()) work += kMeshCamera * static_cast<double>(cameras);
  return work;
}

static GstFlowReturn lf_fragment_take_request(LfFragment* self, GstPad* pad, GstPad* src, GstBuffer* buffer) {
  Requester& requester = Requester::of(pad);
  const lf::MappedBuffer mapped(buffer);
  if (!lf_fragment_is_to_be_answered(self, requester, mapped.bytes())) return GST_FLOW_OK;
  std::string reason;
  std::optional<lf::wire::AnyRequest> request = lf::wire::decode_any_request(mapped.bytes(), &reason);
  if (!request) {
    self->state->node.stats().bad_requests++;
    GST_WARNING_OBJECT(pad, "dropped a view request: %s", reason.c_str());
    return GST_FLOW_OK;
  }
  lf_fragment_follow_requests(self, pad, lf::wire::head_of(*request));
  lf_fragment_tell_delay(self, pad);
  const double work = lf::WorkEstimate::kAnyAnswer + lf_fragment_work(self, mapped.bytes(), *request);
  const auto job = std::make_shared<Job>(Job{std::move(*request), GST_BUFFER_PTS(buffer), GST_BUFFER_DURATION(buffer),
                                             requester.compositor.look(src), work});
  if (requester.place.is_live()) return lf_fragment_answer_later(self, pad, src, job);
  return lf_fragment_answer(self, pad, src, {&job, 1}, requester.kept, lf_fragment_workers(self));
}

GstFlowReturn lf_fragment_request_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  const lf::PadPtr src = Requester::of(pad).pads.src();
  const GstFlowReturn flow = !src ? GST_FLOW_FLUSHING : lf::guarded_buffer(parent, [&] {
    return lf_fragment_take_request(LF_FRAGMENT(parent), pad, src.get(), buffer);
  });
  gst_buffer_unref(buffer);
  return flow;
}
