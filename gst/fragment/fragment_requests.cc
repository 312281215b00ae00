// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Requests in, answers out. Where requests come in real time the answer pad has a thread that answers them, one view
// beside the other (FairAnswers); else the requests' own thread does, one after the other.
#include <algorithm>

#include "base/schedule.h"
#include "common/capture_delay.h"
#include "common/common.h"
#include "common/gst_wire.h"
#include "fragment/lffragment_private.h"
#include "wire/request_codec.h"

GST_DEBUG_CATEGORY_EXTERN(lf_fragment_debug);
#define GST_CAT_DEFAULT lf_fragment_debug

namespace {

// A request that is to be answered, and what is known of it when it comes.
struct Job {
  lf::wire::AnyRequest request;
  GstClockTime pts, duration;
  bool in_process;
  double work = 0;   // planned_work()
  uint64_t due = 0;  // live: when its answer is of no use any more, now_ns(); 0: never
};

guint threads_of(LfFragment* self) {
  const guint threads = lf_fragment_settings(self).threads;
  return threads > 0 ? threads : g_get_num_processors();
}

lf::ParallelFor workers_of(LfFragment* self) {
  return [self](size_t count, const std::function<void(size_t)>& task) {
    (*self->workers)->run(threads_of(self), count, task);
  };
}

}  // namespace

PadPair::PadPair(LfFragment* element, GstPad* request_pad, GstPad* src_pad)
    : request(request_pad), src(src_pad), live_answers(workers_of(element), g_get_num_processors()) {}

// Whether answers stay in this process up to the compositor. Asked once and when downstream has changed.
static bool lf_fragment_compositor_is_near(PadPair* pair, GstPad* src) {
  if (!pair->downstream_is_new.exchange(false)) return pair->in_process;
  pair->in_process = lf::compositor_is_near(src);
  GST_INFO_OBJECT(src, "the compositor is %s", pair->in_process ? "in this process" : "behind a link");
  return pair->in_process;
}

// After a flush, and where a new segment goes back, cameras that are read from files have to follow.
static void lf_fragment_follow_requests(LfFragment* self, GstPad* pad, PadPair* pair, const lf::RequestHeader& head) {
  if (head.target_time == lf::kNoTime) return;
  GstEvent* event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (event) {
    const GstSegment* segment = nullptr;
    gst_event_parse_segment(event, &segment);
    const bool moved = !gst_segment_is_equal(segment, &pair->segment) && head.target_time < pair->last_time;
    if (!pair->live && (pair->flushed || moved))
      lf_fragment_seek_cameras(self, head.target_time, gst_event_get_seqnum(event));
    gst_segment_copy_into(segment, &pair->segment);
    gst_event_unref(event);
  }
  pair->flushed = false;
  pair->last_time = head.target_time;
}

// Viewers that leave the capture delay to the nodes hear of it soon when it grows, else once a second.
static void lf_fragment_tell_delay(LfFragment* self, GstPad* pad, PadPair* pair) {
  if (!pair->live) return;
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) return;
  const uint64_t now = gst_clock_get_time(clock);
  if (now < pair->looked_at + GST_SECOND / 10) return;
  const uint64_t needed = lf_fragment_needed_delay(self, now);
  if (needed == 0) return;
  pair->looked_at = now;
  if (needed <= pair->told_delay && now < pair->told_at + GST_SECOND) return;
  pair->told_delay = needed;
  pair->told_at = now;
  gst_pad_push_event(pad, lf::capture_delay_event(needed));
}

// Whether the picture would come too late to be shown.
static bool lf_fragment_is_too_late(GstPad* pad, PadPair* pair, const Job& job) {
  if (job.due > 0 && lf::now_ns() + pair->estimate.nanoseconds(job.work) > job.due) {
    pair->estimate.skipped();
    return true;
  }
  const lf::RequestHeader& head = lf::wire::head_of(job.request);
  GstEvent* event = head.probe ? nullptr : gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (!event) return false;
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  const GstClockTime time = gst_segment_to_running_time(segment, GST_FORMAT_TIME, job.pts);
  gst_event_unref(event);
  return pair->qos.late(head.view_id, time).has_value();
}

static void lf_fragment_post_answer(LfFragment* self, const Job& job, const lf::FragmentNode::Reply& reply,
                                    guint64 bytes) {
  const lf::RequestHeader& head = lf::wire::head_of(job.request);
  const lf::NodeStats::Stages& s = reply.stages;
  gst_element_post_message(
      GST_ELEMENT(self),
      gst_message_new_element(
          GST_OBJECT(self),
          gst_structure_new("lightfield-answer", "view-id", G_TYPE_UINT, head.view_id, "sequence", G_TYPE_UINT,
                            head.sequence, "pts", G_TYPE_UINT64, job.pts, "fragments", G_TYPE_UINT,
                            static_cast<guint>(reply.fragments), "bytes", G_TYPE_UINT64, bytes, "wait-ns",
                            G_TYPE_UINT64, s.wait, "decode-ns", G_TYPE_UINT64, s.decode, "render-ns", G_TYPE_UINT64,
                            s.render, "encode-ns", G_TYPE_UINT64, s.encode, nullptr)));
}

static GstFlowReturn lf_fragment_push(LfFragment* self, GstPad* src, GstBuffer* unit, const Job& job) {
  GST_BUFFER_PTS(unit) = job.pts;
  GST_BUFFER_DURATION(unit) = job.duration;
  self->node->stats().bytes += gst_buffer_get_size(unit);
  return gst_pad_push(src, unit);
}

static GstFlowReturn lf_fragment_answer(LfFragment* self, GstPad* pad, GstPad* src, const Job& job,
                                        lf::FragmentNode::Requester& requester, lf::ParallelFor parallel) {
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  const lf::RequestHeader& head = lf::wire::head_of(job.request);
  lf::FragmentNode::Options options;
  const lf::FragmentSettings settings = lf_fragment_settings(self);
  options.codec = settings.codec;
  options.strip_pixels = settings.strip_pixels;
  options.max_skew = settings.max_skew;
  options.resampling = settings.resampling;
  if (settings.renderer == lf::RendererChoice::kGl) {
    std::string news;
    options.card = self->card->open(news);
    if (!news.empty()) GST_ELEMENT_WARNING(self, RESOURCE, NOT_FOUND, ("%s.", news.c_str()), (nullptr));
  }
  options.in_process = job.in_process;
  options.live = pair->live;
  options.parallel = std::move(parallel);
  options.base_time = gst_element_get_base_time(GST_ELEMENT(self));
  lf::FragmentNode::Reply reply = lf_fragment_is_too_late(pad, pair, job)
                                      ? self->node->skip(job.request)
                                      : self->node->answer(job.request, requester, options, pair->memory->take());
  const lf::NodeStats::Stages& stages = reply.stages;
  if (stages.render > 0) pair->estimate.done(job.work, stages.decode + stages.render + stages.encode);
  if (!reply.warning.empty())
    GST_ELEMENT_WARNING(self, STREAM, FAILED, ("View %u: %s.", head.view_id, reply.warning.c_str()), (nullptr));
  for (lf::ByteBuffer* before : {&reply.brightness, &reply.moments}) {
    if (before->empty()) continue;
    const GstFlowReturn flow = lf_fragment_push(self, src, lf::wrap_bytes(std::move(*before)), job);
    if (flow != GST_FLOW_OK) return flow;
  }
  GstBuffer* out = lf::wrap_answer(std::move(reply.bytes), pair->memory);
  self->node->stats().answers++;
  self->node->stats().fragments += reply.fragments;
  if (settings.post_messages) lf_fragment_post_answer(self, job, reply, gst_buffer_get_size(out));
  GST_LOG_OBJECT(pad, "view %u, request %u: %zu fragments, %" G_GSIZE_FORMAT " bytes", head.view_id, head.sequence,
                 reply.fragments, gst_buffer_get_size(out));
  return lf_fragment_push(self, src, out, job);
}

// What is kept of a view that is asked for in real time. Answering thread.
static lf::FragmentNode::Requester& lf_fragment_requester_of(PadPair* pair, uint32_t view_id) {
  constexpr size_t kMostViews = 64;
  auto& views = pair->view_requesters;
  auto found = views.find(view_id);
  if (found != views.end()) return *found->second;
  // One that is in use, in an answer that was left for this one's, is among those asked for last.
  if (views.size() >= 2 * kMostViews)
    views.erase(std::ranges::min_element(views, {}, [](const auto& view) { return view.second->used; }));
  auto requester = std::make_unique<lf::FragmentNode::Requester>();
  requester->cancelled = pair->requester.cancelled;
  const auto latest = std::ranges::max_element(views, {}, [](const auto& view) { return view.second->used; });
  if (latest != views.end()) requester->maker.begin_like(latest->second->maker);
  return *views.emplace(view_id, std::move(requester)).first->second;
}

static void lf_fragment_answer_live(LfFragment* self, GstPad* pad, GstPad* src, const Job& job,
                                    const lf::ParallelFor& parallel) {
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  pair->live_flow = lf::guarded_buffer(self, [&] {
    lf::FragmentNode::Requester& requester = lf_fragment_requester_of(pair, lf::wire::head_of(job.request).view_id);
    requester.used = lf::now_ns();
    return lf_fragment_answer(self, pad, src, job, requester, parallel);
  });
}

static void lf_fragment_answer_loop(gpointer data) {
  GstPad* src = GST_PAD(data);
  PadPair* pair = lf_fragment_pad_pair_of(src);
  lf::guarded_buffer(src, [=] {
    if (!pair->live_answers.work()) gst_pad_pause_task(src);
    return GST_FLOW_OK;
  });
}

// What is not for cameras of this kind, or asks for too much, is not even decoded.
static bool lf_fragment_is_to_be_answered(LfFragment* self, PadPair* pair, std::span<const uint8_t> request) {
  const std::optional<lf::wire::RequestPeek> peek = lf::wire::peek_request(request);
  const lf::Access access = lf_fragment_settings(self).access;
  if (peek && lf::wire::access_of_type(peek->type).value_or(access) != access) return false;
  return self->guard->admits(GST_ELEMENT(self), request, self->node->inputs().array()->extent, pair->live,
                             pair->number);
}

// Hands the request over to the answer pad's thread.
static GstFlowReturn lf_fragment_answer_later(LfFragment* self, GstPad* pad, GstPad* src, Job job) {
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  const GstClockTime max_delay = lf_fragment_settings(self).max_delay;
  if (max_delay > 0) job.due = lf::now_ns() + max_delay;
  const uint32_t view_id = lf::wire::head_of(job.request).view_id;
  bool dropped = false;
  const auto shared = std::make_shared<const Job>(std::move(job));
  const bool added = pair->live_answers.add(
      view_id, pair->estimate.nanoseconds(shared->work),
      [self, pad, src, shared](const lf::ParallelFor& parallel) {
        lf_fragment_answer_live(self, pad, src, *shared, parallel);
      },
      &dropped);
  if (!added) return GST_FLOW_FLUSHING;
  self->node->stats().superseded += dropped;
  if (gst_pad_get_task_state(src) != GST_TASK_STARTED) gst_pad_start_task(src, lf_fragment_answer_loop, src, nullptr);
  return pair->live_flow;
}

static GstFlowReturn lf_fragment_take_request(LfFragment* self, GstPad* pad, GstPad* src, GstBuffer* buffer) {
  PadPair* pair = lf_fragment_pad_pair_of(pad);
  const lf::MappedBuffer mapped(buffer);
  if (!lf_fragment_is_to_be_answered(self, pair, mapped.bytes())) return GST_FLOW_OK;
  std::string reason;
  std::optional<lf::wire::AnyRequest> request = lf::wire::decode_any_request(mapped.bytes(), &reason);
  if (!request) {
    self->node->stats().bad_requests++;
    GST_WARNING_OBJECT(pad, "dropped a view request: %s", reason.c_str());
    return GST_FLOW_OK;
  }
  lf_fragment_follow_requests(self, pad, pair, lf::wire::head_of(*request));
  lf_fragment_tell_delay(self, pad, pair);
  Job job{std::move(*request), GST_BUFFER_PTS(buffer), GST_BUFFER_DURATION(buffer),
          lf_fragment_compositor_is_near(pair, src), lf::planned_work(lf::wire::peek_request_cost(mapped.bytes()))};
  if (pair->live) return lf_fragment_answer_later(self, pad, src, std::move(job));
  return lf_fragment_answer(self, pad, src, job, pair->requester, workers_of(self));
}

GstFlowReturn lf_fragment_request_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  const PadPtr src = lf_fragment_other_pad(pad);
  const GstFlowReturn flow = !src ? GST_FLOW_FLUSHING : lf::guarded_buffer(parent, [&] {
    return lf_fragment_take_request(LF_FRAGMENT(parent), pad, src.get(), buffer);
  });
  gst_buffer_unref(buffer);
  return flow;
}
