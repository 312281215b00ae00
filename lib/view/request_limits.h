// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// What one request may ask of whoever serves it, and how many may. The defaults are above what this project's viewers
// send. Elements and servers alike have them from here.
struct RequestLimits {
  uint64_t pixels = uint64_t{4096} * 2304;  // width x height of a view; of all views of a set together kOfSet as many
  double aperture = 0;                      // metres; 0: as wide as the array
  unsigned trials = kMaxTrials;             // trial surfaces of one request
  unsigned requests_per_second = 500;       // requests of one view a second; 0: any number
  unsigned views = 64;                      // views that are served at a time
  static constexpr uint64_t kOfSet = 4;
  // Steps per pixel that the lens of the largest view may take (Lens::mean_steps()). A calibrated lens takes 5 to 10.
  // The lens of a smaller view may take more.
  static constexpr double kLensSteps = 16;
  bool operator==(const RequestLimits&) const = default;
};

// What a request asks for, as its first bytes say.
struct RequestCost {
  int width = 0, height = 0;  // pixels
  double aperture = 0;        // metres; 0: the view is not blended by one
  unsigned trials = 0;
  int columns = 1, rows = 1;  // views of its set, whose pictures make one
  double lens_steps = 0;      // Lens::mean_steps() of the view's lens
  bool by_angle = false;      // blended by angle: each grid point of the view looks at all cameras
  bool operator==(const RequestCost&) const = default;
};

// How much work answering a request is, about, in a unit that is the same for all requests: the time that it takes is a
// multiple of this, which a node learns. `cameras`: of the array.
double planned_work(const RequestCost& cost, size_t cameras = 0);

// How wide an array is, metres: the diagonal of the box around its cameras, which no two of them are farther apart
// than.
double array_extent(const Rig& rig);

// Tells requests that are beyond the limits, before anything is done for them: by what they ask for, by how many of a
// view come in a second, and by how many views ask at a time. Its memory is that of as many views. Not thread-safe.
class RequestGate {
 public:
  enum Refusal { kPixels, kAperture, kTrials, kRate, kViews, kLens, kNumRefusals, kNone };
  static constexpr uint64_t kViewQuiet = 2'000'000'000;  // nanoseconds without a request, after which a view is gone

  // Whether a request of a view may be served that comes at `now` (nanoseconds of any clock). `extent`: of the array,
  // metres; 0: not known, an aperture is then held against a limit that is set alone. `view`: any number that is the
  // view's own. Requests that are refused count for the rate, too.
  Refusal check(uint64_t view, const RequestCost& cost, const RequestLimits& limits, double extent, uint64_t now);
  void clear() { views_.clear(); }
  // Forgets views that are known to be gone.
  template <typename F>
  void forget_if(const F& is_gone) {
    std::erase_if(views_, [&is_gone](const auto& entry) { return is_gone(entry.first); });
  }
  size_t views() const { return views_.size(); }

 private:
  struct View {
    uint64_t last = 0;  // request
    double spare = 1;   // seconds: the part of the latest one that its requests have left over; each takes its share
  };
  std::map<uint64_t, View> views_;
};

// What a person is told: what was asked for and which limit, by its property's name, is in the way.
std::string refusal_text(RequestGate::Refusal refusal, const RequestCost& cost, const RequestLimits& limits,
                         double extent);

}  // namespace lf
