// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "rig/rig.h"
#include "view/view.h"

namespace lf {

// A depth hypothesis: a focal surface that cameras compare with the current surface, to find out which one fits the
// images better. All machines compute the hypothesis with the same integer arithmetic (focus/hypothesis_levels.h).
// Depths are in levels, the quantised inverse distances of the focal map; a higher level is nearer.
struct DepthHypothesis {
  enum class Kind : uint8_t {
    kBlurred = 0,  // the current surface, smoothed with [1 6 1] / 8 along rows and columns
    kFarther = 1,  // the minimum over each node of the map and its eight neighbours, smoothed
    kNearer = 2,   // the maximum over each node of the map and its eight neighbours, smoothed
    kShifted = 3,  // the current surface, smoothed, and moved nearer by `value` levels
    kPlane = 4,
    // The surface that the depth maps of the cameras show (see ArrayDepth). It can only be the last hypothesis of a
    // request. Its sums are not photo-consistency sums: they contain the agreement of the cameras as `weight`, and the
    // level of the surface in place of luma. Nodes without depth maps answer with 0.
    kMeasured = 5,
    kFocused = 6,
  };
  Kind kind = Kind::kBlurred;
  int16_t value = 0;  // levels
  bool operator==(const DepthHypothesis&) const = default;
};

inline constexpr size_t kMaxHypotheses = 16;

inline constexpr uint64_t kNoTime = UINT64_MAX;

// Returns the absolute difference in nanoseconds. Neither time may be kNoTime.
inline uint64_t time_between(uint64_t a, uint64_t b) { return a > b ? a - b : b - a; }

struct RequestHeader {
  uint32_t view_id = 0;
  uint32_t sequence = 0;       // increases by one with each request of the view; wraps around
  uint64_t target_time = 0;    // requested capture time, nanoseconds; kNoTime: the newest frames
  bool absolute_time = false;  // true: target_time is clock time (live cameras); false: running time from 0 (files)
  bool probe = false;          // the picture is only measured and never shown
  bool warmup = false;         // only the depth hypotheses are evaluated; no picture is made
  uint8_t quality = 0;         // 1 to 100: answers may be JPEG of this quality; 0: answers must be uncompressed
  uint64_t rig_hash = 0;       // hash of the rig that the view was made for; 0: any rig
  bool operator==(const RequestHeader&) const = default;
};

// Exposure compensation, which makes the brightness of all cameras equal. Each camera compares its own luma with the
// mean of all cameras, and divides its images by the resulting gain. Only for requests with a focal map (a depth for
// each part of the view).
struct GainRequest {
  bool use = false;  // cameras divide their images by the gains that they know
  bool ask = false;  // cameras measure their luma for the next mean and send it with the answer; see WideLuma
  // The mean luma over all cameras (mean_luma()), measured for the view's request with sequence number `mean_of`. Empty
  // if there is no mean yet.
  std::vector<uint8_t> mean;
  uint32_t mean_of = 0;
  bool operator==(const GainRequest&) const = default;
};

// The complete state of one view: everything that nodes need to answer a request without knowing earlier requests.
struct ViewRequest : RequestHeader {
  View view;
  ViewSetPosition place;  // position in a set of views; all views of a set show the same time
  CameraSet out_of_service;
  bool on_plane = false;  // render the picture on the focal plane; the focal map is only used for the depth hypotheses
  // The depth hypotheses to compare with the focal map, at most kMaxHypotheses; empty without a map. Answers then
  // contain photo-consistency sums, which measure how well the cameras agree on each hypothesis.
  std::vector<DepthHypothesis> hypotheses;
  GainRequest gains;
  bool operator==(const ViewRequest&) const = default;
};

// Returns true if the last hypothesis of a request is the measured surface.
inline bool measures_depth(const std::vector<DepthHypothesis>& hypotheses) {
  return !hypotheses.empty() && hypotheses.back().kind == DepthHypothesis::Kind::kMeasured;
}

// Returns the view with the focal surface that its picture is rendered on.
inline View displayed_view(const ViewRequest& request) {
  View view = request.view;
  if (request.on_plane)
    view.focus.map = nullptr;
  else if (view.focus.map && view.focus.map->step > FocalMap::kMinStep)
    view.focus.map = std::make_shared<FocalMap>(view.focus.map->refined(view.width, view.height));
  return view;
}

// Remembers for each view which cameras its compositor has reported as out of service, because other requests of the
// view must exclude them as well. Thread-safe.
class OutOfServiceRegistry {
 public:
  void announce(uint32_t view_id, CameraSet cameras);
  CameraSet with_announced(uint32_t view_id, const CameraSet& cameras) const;
  void clear();

 private:
  static constexpr size_t kMaxViews = 1024;  // if there are more views, the lowest id is dropped
  mutable std::mutex mutex_;
  std::map<uint32_t, CameraSet> views_;
};

// Additional requests of a compositor, for example for depth hypotheses. They accompany the next request of the view.
// Thread-safe.
class ExtraRequests {
 public:
  void ask(std::vector<ViewRequest> requests);
  // Returns the pending requests once, adapted to the next request of the view, `request`. They get the view id, time
  // and quality of `request`, and sequence numbers from `next_number`, which is advanced. Their out-of-service cameras
  // are combined with the cameras in `request`. Requests for other rigs are dropped.
  std::vector<ViewRequest> take_for(const ViewRequest& request, uint32_t& next_number);
  void clear() { ask({}); }

 private:
  std::mutex mutex_;
  std::vector<ViewRequest> requests_;
};

struct RequestLimits {
  // width x height of a view; the views of a set may together have kSetFactor times as many pixels
  uint64_t pixels = uint64_t{4096} * 2304;
  double aperture = 0;  // metres; 0: the width of the array
  unsigned hypotheses = kMaxHypotheses;
  unsigned requests_per_second = 500;  // per view; 0: unlimited
  unsigned views = 64;
  static constexpr uint64_t kSetFactor = 4;
  // Maximum number of iterations per pixel that undistortion takes for the lens of the largest allowed view
  // (Lens::mean_iterations()). A calibrated lens takes 5 to 10. Smaller views may take more.
  static constexpr double kMaxLensIterations = 16;
  bool operator==(const RequestLimits&) const = default;
};

// The properties of a request that determine how long its answer takes.
struct RequestCost {
  int width = 0, height = 0;  // pixels
  double aperture = 0;        // metres; 0: the view does not use aperture blending
  unsigned hypotheses = 0;
  int columns = 1, rows = 1;  // size of the set that the view belongs to, in views
  double lens_steps = 0;
  bool by_angle = false;  // blending by angle: each grid point of the view visits all cameras
  bool operator==(const RequestCost&) const = default;
};

// Returns the approximate work of a request in an arbitrary unit; nodes measure how long a unit takes. `cameras` is the
// number of cameras of the array.
double estimated_work(const RequestCost& cost, size_t cameras = 0);

// Returns the size of an array in metres: the diagonal of the bounding box of its cameras.
double array_extent(const Rig& rig);

// Rejects requests that exceed the limits, before any other work. Checks the cost of each request, the request rate of
// each view, and the number of views, which also bounds the memory of this class. Not thread-safe.
class RequestLimiter {
 public:
  enum Refusal { kPixels, kAperture, kHypotheses, kRate, kViews, kLens, kNumRefusals, kNone };
  // a view is forgotten after this time without a request, nanoseconds
  static constexpr uint64_t kViewTimeout = 2'000'000'000;

  // Checks a request of a view at time `now` (nanoseconds of any clock). `view` is a unique number. `extent` is the
  // size of the array in metres (see array_extent()), or 0 if unknown; the aperture is then only checked against an
  // explicit limit. Requests that are refused for their cost count towards the rate, too.
  Refusal check(uint64_t view, const RequestCost& cost, const RequestLimits& limits, double extent, uint64_t now);
  void clear() { views_.clear(); }
  template <typename F>
  void forget_if(const F& is_gone) {
    std::erase_if(views_, [&is_gone](const auto& entry) { return is_gone(entry.first); });
  }
  size_t views() const { return views_.size(); }

 private:
  struct View {
    uint64_t last = 0;
    double credit = 1;  // refilled to 1 within a second; each request uses a part
  };
  std::map<uint64_t, View> views_;
};

// Returns a message for users that contains the requested value and the name of the limit, as in the property `limits`.
std::string refusal_text(RequestLimiter::Refusal refusal, const RequestCost& cost, const RequestLimits& limits,
                         double extent);

}  // namespace lf
