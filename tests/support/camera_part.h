// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include "render/ownership.h"
#include "render/sum_planes.h"
#include "render/sum_renderer.h"

namespace lf::test {

// What a node of one camera gives for a view, in 8 bits and one rectangle; nothing if it has no weight there. `runs`
// hold the camera's chroma-aligned rectangle.
inline std::optional<Fragment> camera_part(const ViewPlan& plan, const OwnerRuns& runs, const Source& source,
                                           Coordinates coordinates = Coordinates::kGrid) {
  const PixelFamily family = source.image.family;
  const SumRenderer renderer(plan, runs, {&source, 1}, family, coordinates);
  Rect rect = CameraCorners(plan, source.camera).owned(runs, plan.camera_rect(source.camera));
  if (rect.empty()) return std::nullopt;
  if (family == PixelFamily::kI420) rect = chroma_aligned(rect, plan.view());
  const size_t area = static_cast<size_t>(rect.width()) * rect.height();
  std::vector<int16_t> samples(3 * area);
  std::vector<uint16_t> lost(area);
  const bool any_lost = renderer.render_rows(rect.y0, rect.y1, packed_sums(family, rect, samples.data(), lost.data()));
  return rounded_fragment(
      packed_sums<const int16_t, const uint16_t>(family, rect, samples.data(), any_lost ? lost.data() : nullptr));
}

}  // namespace lf::test
