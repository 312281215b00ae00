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

// A focal surface that a request has the cameras compare beside the one in use, of which every machine makes it by the
// same integers (focus/trial_levels.h).
struct Trial {
  enum class Kind : uint8_t {
    kBlurred = 0,  // the surface, smoothed: [1 6 1] / 8 along rows and columns
    kFarther = 1,  // the least level of a node and its eight neighbours, smoothed
    kNearer = 2,   // the largest level of a node and its eight neighbours, smoothed
    kShifted = 3,  // the surface, smoothed, `value` levels nearer
    kPlane = 4,    // the level `value` everywhere
    kFocused = 6,  // the viewer's plane
  };
  Kind kind = Kind::kBlurred;
  int16_t value = 0;  // levels
  bool operator==(const Trial&) const = default;
};

inline constexpr size_t kMaxTrials = 16;  // that one request may ask for

inline constexpr uint64_t kNoTime = UINT64_MAX;

// |a - b|, nanoseconds. Neither may be kNoTime.
inline uint64_t time_between(uint64_t a, uint64_t b) { return a > b ? a - b : b - a; }

// What requests of all kinds begin with: which picture is asked for, and when.
struct RequestHeader {
  uint32_t view_id = 0;
  uint32_t sequence = 0;       // grows by one with each request of the view, and wraps
  uint64_t target_time = 0;    // nanoseconds; capture time wanted, or kNoTime: the newest frame there is
  bool absolute_time = false;  // target_time is clock time (live), else running time from 0 (files)
  bool probe = false;          // the picture is measured, not shown
  bool rehearsal = false;      // no picture is made: only the answers to the trials count
  uint8_t quality = 0;         // how fragments are coded: 0: raw; 1..100: JPEG of this quality is allowed
  uint64_t rig_hash = 0;       // the rig that the view was made for; 0: any
  bool operator==(const RequestHeader&) const = default;
};

// How cameras match their brightness: each compares what it has seen with what all have seen, and divides its images by
// its gain. For requests with a focal map.
struct GainRequest {
  bool use = false;  // cameras divide their images by the gains that they know
  bool ask = false;  // cameras answer with what they see, for the mean: see WideLuma
  // The mean of what all cameras saw (mean_luma()) at the view's request with the sequence number `mean_of`; empty:
  // none.
  std::vector<uint8_t> mean;
  uint32_t mean_of = 0;
  bool operator==(const GainRequest&) const = default;
};

// The whole state of one view: no history is needed to answer it.
struct ViewRequest : RequestHeader {
  View view;
  PlaceInSet place;  // one of a set: the others are asked for beside it, of the same moment
  CameraSet out_of_service;
  bool on_plane = false;  // the picture is drawn through the viewer's plane: the focal map serves the trials alone
  // Surfaces to compare with the focal map, answered with moments; at most kMaxTrials, none without a map.
  std::vector<Trial> trials;
  GainRequest gains;
  bool operator==(const ViewRequest&) const = default;
};

// The view as its picture is drawn.
inline View shown_view(const ViewRequest& request) {
  View view = request.view;
  if (request.on_plane)
    view.focus.map = nullptr;
  else if (view.focus.map && view.focus.map->step > FocalMap::kFinestStep)
    view.focus.map = std::make_shared<FocalMap>(view.focus.map->refined(view.width, view.height));
  return view;
}

// Cameras that compositors announced as out of service, view by view. Thread-safe.
class OutOfService {
 public:
  // From now on these cameras are out of service for the view, in place of those announced before.
  void announce(uint32_t view_id, CameraSet cameras);
  // `cameras` and those announced for this view.
  CameraSet with_announced(uint32_t view_id, const CameraSet& cameras) const;
  void clear();

 private:
  static constexpr size_t kMostViews = 1024;  // viewers come and go: with more of them the lowest id is forgotten
  mutable std::mutex mutex_;
  std::map<uint32_t, CameraSet> views_;
};

// What a compositor asks for beside its pictures, which goes along with the next request of its view. Thread-safe.
class ExtraRequests {
 public:
  // Asks for these requests, in place of any that are still to be made.
  void ask(std::vector<ViewRequest> requests);
  // Takes away the requests that were asked for, made to go beside `request`: they have its view id and its moment,
  // leave out the cameras that either counts as out of service, and have numbers from `next_number` on, which is
  // raised. Those of another rig are left out.
  std::vector<ViewRequest> take_beside(const ViewRequest& request, uint32_t& next_number);
  void clear() { ask({}); }

 private:
  std::mutex mutex_;
  std::vector<ViewRequest> requests_;
};

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

// What a person is told: what was asked for and which limit, by its name in the property `limits`, is in the way.
std::string refusal_text(RequestGate::Refusal refusal, const RequestCost& cost, const RequestLimits& limits,
                         double extent);

}  // namespace lf
