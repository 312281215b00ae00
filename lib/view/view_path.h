// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "view/views_json.h"

namespace lf {

// A smooth camera path through key views: at each key's time it is at that key, in between it moves along cubic Hermite
// curves whose velocity at a key is (next - previous) / (their times' difference) (Catmull-Rom with times), so velocity
// is continuous everywhere. Orientations: the same curve through sign-aligned quaternions, normalised. Where every
// key's focal plane faces its view, the logarithm of its distance moves so and the plane keeps facing; otherwise the
// planes' [a, b, c, d] do. The lens' numbers move like the position. Immutable; thread-safe.
class ViewPath {
 public:
  // At least one key; times strictly increasing; one size and one lens model for all. Throws Error naming the key.
  explicit ViewPath(std::vector<NamedView> keys);

  double begin() const { return keys_.front().time; }  // seconds
  double end() const { return keys_.back().time; }
  // Before begin() the first key, after end() the last.
  View at(double time) const;
  // At begin(), begin() + 1/rate, ... up to and including end() (to a thousandth of a period); named "view_000000", ...
  std::vector<NamedView> sample(double rate_hz) const;

 private:
  std::vector<NamedView> keys_;
  bool planes_face_ = true;
};

}  // namespace lf
