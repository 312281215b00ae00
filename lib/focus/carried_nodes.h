// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "view/view.h"

namespace lf {

// Where the nodes of a view's focal map are in the map of another view of the same scene, in vectors. The same to the
// bit with every instruction set. Not thread-safe.
class CarriedNodes {
 public:
  // `from` has a map; `columns`, `rows`: of the other's, of the same step.
  CarriedNodes(const View& from, const View& to, int columns, int rows);

  // For each node of a row those that it covers, [left, right) x [top, bottom): none where the other view does not see
  // it. Those whose middles it reaches over, as large as it is seen from there so that what comes nearer has no holes,
  // and the one that its own middle lies in. Valid until the next call.
  struct Row {
    const int32_t *left, *right, *top, *bottom;
  };
  Row row(int j);

  // From a line of sight (u, v, 1) of `from` and a level to a position among the other's nodes.
  struct Geometry {
    double to_from_view[9];                         // row-major
    double offset[3], normal[3];                    // in coordinates of `to`, of `from`
    double eye, farthest, range;                    // inverse distance = farthest + range x (level / 255)
    double fx, fy, cx, cy, k1, k2, p1, p2, max_r2;  // of the lens of `to`
    bool distorted;
    double zoom, per_step, columns, rows;
  };

 private:
  const View& from_;
  Geometry geometry_;
  std::vector<double> u_, v_;  // of a row
  std::vector<int32_t> left_, right_, top_, bottom_;
};

}  // namespace lf
