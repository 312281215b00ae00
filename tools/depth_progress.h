// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>
#include <span>

#include "base/worker_pool.h"
#include "focus/still_focus.h"
#include "progress.h"

// Calls lf::estimate_depths() on all processors, and shows the progress.
inline std::optional<lf::ArrayDepth> estimate_depths_with_progress(const lf::Rig& rig, const lf::CameraSet& cameras,
                                                                   std::span<const lf::View> views,
                                                                   const lf::CameraImages& images,
                                                                   const lf::DepthEstimator::Settings& settings) {
  // Each resolution has two calls, an estimate and a quick check. The number of pixels increases by a factor of four
  // from each resolution to the next. Wide images have three resolutions, others two.
  constexpr int kWide = 640;
  const bool is_wide = std::ranges::any_of(rig.cameras, [](const lf::Camera& camera) { return camera.width >= kWide; });
  const double total = static_cast<double>(cameras.size()) * (is_wide ? 1 + 4 + 16 : 1 + 4);
  Progress progress("estimating depths", 0);
  std::mutex mutex;
  int calls = 0;
  double done = 0;
  const lf::ParallelFor all_processors = lf::parallel_for_all_processors();
  const lf::ParallelFor parallel = [&](size_t count, const std::function<void(size_t)>& task) {
    const double weight = calls % 2 == 0 ? std::pow(4, calls / 2) : 0;
    calls++;
    all_processors(count, [&](size_t i) {
      task(i);
      const std::lock_guard lock(mutex);
      progress.reach((done += weight) / total);
    });
  };
  return lf::estimate_depths(rig, cameras, views, images, settings, parallel);
}
