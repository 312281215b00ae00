// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <thread>
#include <vector>

#include "base/worker_pool.h"
#include "composite/accumulator.h"
#include "render/gl/sum_drawer.h"
#include "render/sum_renderer.h"

namespace lf::bench {

// A picture made of one node's sums in 16 bits, and how many bytes these are, uncompressed.
struct SumPicture {
  Image image;
  size_t bytes = 0;
};

// RGB, of `width` x `height` pixels; in the calling thread.
inline SumPicture picture_of_sums(const SumRenderer& renderer, int width, int height) {
  const Rect rect = renderer.rect();
  const size_t area = static_cast<size_t>(rect.width()) * rect.height();
  std::vector<int16_t> samples(3 * area);
  std::vector<uint16_t> lost(area);
  const bool any_lost =
      renderer.render_rows(rect.y0, rect.y1, packed_sums(PixelFamily::kRgb, rect, samples.data(), lost.data()));
  Accumulator sum;
  sum.reset(PixelFamily::kRgb, width, height);
  sum.add(packed_sums<const int16_t, const uint16_t>(PixelFamily::kRgb, rect, samples.data(),
                                                     any_lost ? lost.data() : nullptr));
  return {sum.resolve(), 2 * (samples.size() + (any_lost ? area : 0))};
}

// What goes to a card and comes from it is copied by all processors, as by a node; where those draw, too, by one.
inline ParallelFor copying_for(const gl::SumDrawer* card) {
  if (!card || card->is_software()) return serial_for;
  return [pool = WorkerPool::shared()](size_t count, const std::function<void(size_t)>& task) {
    pool->run(std::thread::hardware_concurrency(), count, task);
  };
}

}  // namespace lf::bench
