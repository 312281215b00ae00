// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <thread>
#include <vector>

#include "base/worker_pool.h"
#include "composite/accumulator.h"
#include "render/gl/gles_renderer.h"
#include "render/sum_renderer.h"

namespace lf::bench {

// A picture made from one node's 16-bit sums, and the uncompressed size of the sums in bytes.
struct SumPicture {
  Image image;
  size_t bytes = 0;
};

// Returns an RGB picture of `width` x `height` pixels. Runs in the calling thread.
inline SumPicture picture_of_sums(const SumRenderer& renderer, int width, int height) {
  const Rect rect = renderer.rect();
  const size_t area = static_cast<size_t>(rect.width()) * rect.height();
  std::vector<int16_t> samples(3 * area);
  std::vector<uint16_t> lost(area);
  const bool any_missing =
      renderer.render_rows(rect.y0, rect.y1, packed_sums(PixelFamily::kRgb, rect, samples.data(), lost.data()));
  Accumulator sum;
  sum.reset(PixelFamily::kRgb, width, height);
  sum.add(packed_sums<const int16_t, const uint16_t>(PixelFamily::kRgb, rect, samples.data(),
                                                     any_missing ? lost.data() : nullptr));
  return {sum.resolve(), 2 * (samples.size() + (any_missing ? area : 0))};
}

// Transfers to and from a GPU use all cores, as in a node; with a software renderer, one core.
inline ParallelFor copying_for(const gl::GlesRenderer* gpu) {
  if (!gpu || gpu->is_software()) return serial_for;
  return [pool = WorkerPool::shared()](size_t count, const std::function<void(size_t)>& task) {
    pool->run(std::thread::hardware_concurrency(), count, task);
  };
}

}  // namespace lf::bench
