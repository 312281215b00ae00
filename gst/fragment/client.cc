// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/client.h"

#include "common/guard.h"
#include "node/node.h"

namespace lf {

void AnswerJobQueue::add(const std::shared_ptr<AnswerJob>& job) {
  const std::lock_guard lock(mutex_);
  waiting_.push_back(job);
}

size_t AnswerJobQueue::forget_dropped() {
  const std::lock_guard lock(mutex_);
  return std::erase_if(waiting_, [](const auto& waiting) { return waiting.expired(); });
}

std::vector<std::shared_ptr<AnswerJob>> AnswerJobQueue::take_with(const std::shared_ptr<AnswerJob>& job, bool alone) {
  const auto pixels_of = [](const AnswerJob& of) {
    const auto [width, height] = wire::view_size(of.request);
    return static_cast<size_t>(width) * static_cast<size_t>(height);
  };
  const std::lock_guard lock(mutex_);
  if (std::erase_if(waiting_, [&](const auto& waiting) { return waiting.lock() == job; }) == 0) return {};
  std::vector<std::shared_ptr<AnswerJob>> taken{job};
  if (alone) return taken;
  size_t pixels = pixels_of(*job);
  std::erase_if(waiting_, [&](const auto& waiting) {
    const std::shared_ptr<AnswerJob> other = waiting.lock();
    if (!other) return true;
    if (!Node::can_batch_requests(job->request, other->request) || pixels + pixels_of(*other) > kMaxPixels)
      return false;
    pixels += pixels_of(*other);
    taken.push_back(other);
    return true;
  });
  return taken;
}

GstFlowReturn LiveAnswerQueue::add(GstPad* src, uint32_t view_id, double work, Answer answer, bool* dropped,
                                   size_t of_set) {
  const auto make = [this, src, view_id, answer = std::move(answer)](const ParallelFor& parallel) {
    flow_ = guard_buffer(src, [&] {
      const std::shared_ptr<Node::ClientState> kept = views_.of(view_id);
      return answer(*kept, parallel).value_or(flow_);
    });
  };
  if (!fair_.add(view_id, views_.nanoseconds(view_id, work), make, dropped, of_set)) return GST_FLOW_FLUSHING;
  return flow_;
}

void LiveAnswerQueue::work(GstPad* src) {
  if (!fair_.work()) gst_pad_pause_task(src);
}

void LiveAnswerQueue::start() {
  flow_ = GST_FLOW_OK;
  fair_.start();
}

bool LiveAnswerQueue::stop(GstPad* src) {
  fair_.stop();
  const bool stopped = gst_pad_stop_task(src);
  views_.clear();
  return stopped;
}

void LiveAnswerQueue::end_flush() {
  views_.clear();
  flow_ = GST_FLOW_OK;
}

}  // namespace lf
