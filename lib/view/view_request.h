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

// A focal surface that cameras compare with the current surface. All machines compute it with the same integer
// arithmetic (focus/hypothesis_levels.h).
struct DepthHypothesis {
  enum class Kind : uint8_t {
    kBlurred = 0,  // the current surface, smoothed: [1 6 1] / 8 along rows and columns
    kFarther = 1,  // minimum over a node and its eight neighbours, smoothed
    kNearer = 2,   // maximum over a node and its eight neighbours, smoothed
    kShifted = 3,  // the current surface, smoothed, `value` levels nearer
    kPlane = 4,    // the level `value` everywhere
    kFocused = 6,  // the viewer's plane
  };
  Kind kind = Kind::kBlurred;
  int16_t value = 0;  // levels
  bool operator==(const DepthHypothesis&) const = default;
};

inline constexpr size_t kMaxHypotheses = 16;

inline constexpr uint64_t kNoTime = UINT64_MAX;

// |a - b|, nanoseconds. Neither may be kNoTime.
inline uint64_t time_between(uint64_t a, uint64_t b) { return a > b ? a - b : b - a; }

struct RequestHeader {
  uint32_t view_id = 0;
  uint32_t sequence = 0;       // increases by one with each request of the view; wraps around
  uint64_t target_time = 0;    // requested capture time, nanoseconds; kNoTime: newest frame
  bool absolute_time = false;  // true: clock time (live); false: running time from 0 (files)
  bool probe = false;          // the picture is measured, not shown
  bool warmup = false;         // no picture is made; only the depth hypotheses are evaluated
  uint8_t quality = 0;         // 0: raw fragments; 1..100: JPEG of this quality is allowed
  uint64_t rig_hash = 0;       // rig of the view; 0: any
  bool operator==(const RequestHeader&) const = default;
};

// Exposure compensation: each camera compares its own luma with the mean of all cameras and divides its images by its
// gain. For requests with a focal map.
struct GainRequest {
  bool use = false;  // cameras divide their images by their known gains
  bool ask = false;  // cameras answer with their luma, for the mean: see WideLuma
  // Mean over all cameras (mean_luma()) for the view's request with sequence number `mean_of`; empty: none.
  std::vector<uint8_t> mean;
  uint32_t mean_of = 0;
  bool operator==(const GainRequest&) const = default;
};

// The complete state of one view; an answer needs no earlier requests.
struct ViewRequest : RequestHeader {
  View view;
  ViewSetPosition place;  // position in a set; all views of a set have the same time
  CameraSet out_of_service;
  bool on_plane = false;  // draw the picture through the viewer's plane; the focal map is only for the depth hypotheses
  // Depth hypotheses to compare with the focal map; answers contain photo-consistency sums. At most kMaxHypotheses;
  // empty without a map.
  std::vector<DepthHypothesis> trials;
  GainRequest gains;
  bool operator==(const ViewRequest&) const = default;
};

// Returns the view with the focal surface of its picture.
inline View displayed_view(const ViewRequest& request) {
  View view = request.view;
  if (request.on_plane)
    view.focus.map = nullptr;
  else if (view.focus.map && view.focus.map->step > FocalMap::kMinStep)
    view.focus.map = std::make_shared<FocalMap>(view.focus.map->refined(view.width, view.height));
  return view;
}

// Cameras that compositors announced as out of service, for each view. Thread-safe.
class OutOfServiceRegistry {
 public:
  // Replaces the announced cameras of the view.
  void announce(uint32_t view_id, CameraSet cameras);
  CameraSet with_announced(uint32_t view_id, const CameraSet& cameras) const;
  void clear();

 private:
  static constexpr size_t kMaxViews = 1024;  // the lowest id is dropped if there are more views
  mutable std::mutex mutex_;
  std::map<uint32_t, CameraSet> views_;
};

// Additional requests of a compositor, which accompany the next request of its view. Thread-safe.
class ExtraRequests {
 public:
  // Replaces all pending requests.
  void ask(std::vector<ViewRequest> requests);
  // Removes and returns the pending requests, adapted to accompany `request`: same view id, time and quality, and the
  // union of the out-of-service cameras. Sequence numbers start at `next_number`, which is advanced. Drops requests for
  // other rigs.
  std::vector<ViewRequest> take_for(const ViewRequest& request, uint32_t& next_number);
  void clear() { ask({}); }

 private:
  std::mutex mutex_;
  std::vector<ViewRequest> requests_;
};

// Limits of requests. The defaults exceed what this project's viewers send. Shared by elements and servers.
struct RequestLimits {
  // width x height of a view; all views of a set together: kSetFactor times as many
  uint64_t pixels = uint64_t{4096} * 2304;
  double aperture = 0;                 // metres; 0: width of the array
  unsigned trials = kMaxHypotheses;    // depth hypotheses of one request
  unsigned requests_per_second = 500;  // per view; 0: unlimited
  unsigned views = 64;                 // views at the same time
  static constexpr uint64_t kSetFactor = 4;
  // Maximum iterations per pixel for the lens of the largest view (Lens::mean_iterations()). A calibrated lens takes 5
  // to 10. Smaller views may take more.
  static constexpr double kMaxLensIterations = 16;
  bool operator==(const RequestLimits&) const = default;
};

struct RequestCost {
  int width = 0, height = 0;  // pixels
  double aperture = 0;        // metres; 0: no aperture blending
  unsigned trials = 0;
  int columns = 1, rows = 1;  // views of its set
  double lens_steps = 0;      // Lens::mean_iterations() of the view's lens
  bool by_angle = false;      // angle blending: each grid point of the view visits all cameras
  bool operator==(const RequestCost&) const = default;
};

// Returns the approximate work of a request, in an arbitrary unit. Nodes measure the time per unit. `cameras`: number
// of cameras of the array.
double estimated_work(const RequestCost& cost, size_t cameras = 0);

// Returns the extent of an array in metres: the diagonal of the bounding box of its cameras, an upper bound for the
// distance of any two cameras.
double array_extent(const Rig& rig);

// Rejects requests beyond the limits before any other work, by their cost, their rate per view, and the number of
// views. Memory is bounded by the maximum number of views. Not thread-safe.
class RequestLimiter {
 public:
  enum Refusal { kPixels, kAperture, kHypotheses, kRate, kViews, kLens, kNumRefusals, kNone };
  static constexpr uint64_t kViewTimeout = 2'000'000'000;  // nanoseconds without a request until a view is dropped

  // Checks a request of a view at time `now` (nanoseconds of any clock). `extent`: of the array, metres; 0: unknown,
  // the aperture is then compared with an explicit limit only. `view`: unique number of the view. Requests refused for
  // their cost count for the rate, too.
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
    double spare = 1;  // unused part of the latest second; each request takes its share
  };
  std::map<uint64_t, View> views_;
};

// Returns a message for users with the requested value and the name of the limit, as in the property `limits`.
std::string refusal_text(RequestLimiter::Refusal refusal, const RequestCost& cost, const RequestLimits& limits,
                         double extent);

}  // namespace lf
