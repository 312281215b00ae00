// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "lib/render/production.h"
#include "lib/render/sum_arrays.h"
#include "render/sum_renderer.h"

namespace lf::test {

// A view of an array, its images, and their sum.
struct Eye {
  Eye(const Rig& rig, const Mesh& mesh, const View& view, const std::vector<Image>& images, PixelFamily family)
      : production(rig, mesh, view), sources(sources_of(rig, production.plan, images)), family(family) {}
  std::unique_ptr<SumRenderer> renderer(gl::SumDrawer* card = nullptr, bool may_stay = false) const {
    return std::make_unique<SumRenderer>(production.plan, production.owners.runs(), sources, family,
                                         Coordinates::kExact, card, serial_for, may_stay);
  }
  Sum sum_of(const SumRenderer& renderer) const {
    const View& view = production.plan.view();
    Sum sum(family, whole(view));
    renderer.render_rows(0, view.height, sum.planes);
    return sum;
  }

  Production production;
  std::vector<Source> sources;
  PixelFamily family;
};

// What two sums of a view differ by: the largest of all samples, levels of 255, and of all pixels' lost weight.
struct SumDifference {
  double level = 0, lost = 0;
  void add(const SumDifference& other) {
    level = std::max(level, other.level);
    lost = std::max(lost, other.lost);
  }
};
inline SumDifference difference_of(const Sum& a, const Sum& b) {
  SumDifference worst;
  for (int c = 0; c < 3; c++)
    for (size_t i = 0; i < a.memory[c].size(); i++)
      worst.level = std::max(worst.level, std::abs(a.memory[c][i] - b.memory[c][i]) / 128.0);
  for (size_t i = 0; i < a.lost.size(); i++)
    worst.lost = std::max(worst.lost, std::abs(a.lost[i] - b.lost[i]) / double{kLostOne});
  return worst;
}

}  // namespace lf::test
