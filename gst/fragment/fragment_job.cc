// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/fragment_job.h"

#include "node/node.h"

namespace lf {

void WaitingJobs::add(const std::shared_ptr<FragmentJob>& job) {
  const std::lock_guard lock(mutex_);
  waiting_.push_back(job);
}

size_t WaitingJobs::forget_dropped() {
  const std::lock_guard lock(mutex_);
  return std::erase_if(waiting_, [](const auto& waiting) { return waiting.expired(); });
}

std::vector<std::shared_ptr<FragmentJob>> WaitingJobs::take_with(const std::shared_ptr<FragmentJob>& job, bool alone) {
  const auto pixels_of = [](const FragmentJob& of) {
    const auto [width, height] = wire::view_size(of.request);
    return static_cast<size_t>(width) * static_cast<size_t>(height);
  };
  const std::lock_guard lock(mutex_);
  if (std::erase_if(waiting_, [&](const auto& waiting) { return waiting.lock() == job; }) == 0) return {};
  std::vector<std::shared_ptr<FragmentJob>> taken{job};
  if (alone) return taken;
  size_t pixels = pixels_of(*job);
  std::erase_if(waiting_, [&](const auto& waiting) {
    const std::shared_ptr<FragmentJob> other = waiting.lock();
    if (!other) return true;
    if (!Node::may_go_together(job->request, other->request) || pixels + pixels_of(*other) > kMostPixels) return false;
    pixels += pixels_of(*other);
    taken.push_back(other);
    return true;
  });
  return taken;
}

}  // namespace lf
