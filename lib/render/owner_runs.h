// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/view_plan.h"

namespace lf {

// Pixels [x0, x1) of one row with the same owner.
struct OwnerRun {
  int x0, x1;
  int32_t face;  // index into plan.faces()
  bool operator==(const OwnerRun&) const = default;
};

// Tells which face owns each pixel of a part of a view, row by row. The owner is the lowest-numbered facing face that
// contains the pixel's line of sight; a pixel whose line of sight does not meet the focal surface at t > 0 has none.
// Where meshes fold, several faces contain a pixel and cameras far apart must agree on its owner: looking it up among
// all faces is both the exact rule and cheaper than testing each camera's ring per fragment.
//
// Along a row the edge functions are linear, so a face's pixels are one run (two where the triangle straddles the eye's
// plane), and finding them costs the number of rows, not of pixels. Ends are where evaluating the edge functions at the
// pixels says, to the last bit: the result for a pixel does not depend on the region.
class OwnerRuns {
 public:
  // `parallel`: looks at the pixels of distorted views, one by one.
  OwnerRuns(const ViewPlan& plan, const Rect& region, const ParallelFor& parallel = serial_for);

  const Rect& region() const { return region_; }
  // The runs of a row, ascending and disjoint; pixels between them have no owner. y inside region().
  std::span<const OwnerRun> row(int y) const {
    const Row& r = rows_[static_cast<size_t>(y - region_.y0)];
    return {runs_.data() + r.begin, r.count};
  }
  // The part of row(y) that meets [x0, x1); its first and last runs may reach beyond.
  std::span<const OwnerRun> row(int y, int x0, int x1) const;

 private:
  struct Row {
    uint32_t begin = 0, count = 0;
  };
  struct Found {
    int y, x0, x1;
    int32_t face;
  };
  std::vector<Found> find(const ViewPlan& plan, const Rect& band) const;
  void insert(Row& row, int x0, int x1, int32_t face);

  Rect region_;
  std::vector<Row> rows_;
  std::vector<OwnerRun> runs_;
};

}  // namespace lf
