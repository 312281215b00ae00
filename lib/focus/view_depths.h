// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "focus/depth_estimator.h"
#include "focus/exposure_compensation.h"

namespace lf {

// The result of the depth estimation, for the view's next request: its focal surface, hypotheses and exposure
// measurement. The compositor sends the result back to the source of the requests.
struct DepthEstimate {
  uint32_t sequence = 0;  // number of the request that the estimate is based on
  DepthEstimator::Plan plan;
  GainRequest gains;  // measurement of brightness in the next request
};

// Adds the focal surface of a plan to a request of the same view. The viewpoint may have moved, so the surface is
// warped to the request's view. The request must not have a map, and must already have its hypotheses and gains.
void apply_plan(const DepthEstimator::Plan& plan, ViewRequest& request);

// Adds the focal surface of the leading view of a set, such as a stereo pair, to the request of another view of the
// set. The surface is warped to this view. The request uses gains if the leader's does, and gets no hypotheses.
void apply_reference_view(const ViewRequest& leader, ViewRequest& beside);

// Returns the brightness measurement for the next request of a view. `use`: exposure gains are in use.
// `has_hypotheses`: the next request has hypotheses. `brightness` and `gains` are the sums that answer the measurement
// in request `sequence`; `brightness` has no size if there was no measurement.
GainRequest next_gains(ExposureSchedule& turns, bool use, bool has_hypotheses, const PhotoConsistency& brightness,
                       const GainSum& gains, uint32_t sequence);

// Keeps one view in focus and its cameras equally bright, for callers that wait for each answer before the next
// request. Call apply() before each request, and take() with the answers. A plain value without locks.
class ViewDepths {
 public:
  // If `match_gains` is true, exposure gains match the brightness of the cameras wherever several cameras contribute to
  // the picture.
  explicit ViewDepths(const DepthEstimator::Settings& settings = {}, bool match_gains = false)
      : settings_(settings), match_gains_(match_gains), control_(settings) {}

  const DepthEstimator::Settings& settings() const { return settings_; }
  bool matches_gains() const { return match_gains_; }
  // Returns the confidence of the latest surface: see DepthEstimator::confidence().
  std::shared_ptr<const FocalMap> confidence() const { return control_.confidence(); }
  // Adds the focal surface, warped to the request's view, and the next hypotheses to a request without a map.
  void apply(ViewRequest& request);
  // The answers to a request that apply() has prepared. `moments` are the sums of its hypotheses, in their order; empty
  // if it has none. `complete` is true if its picture was complete.
  struct Answers {
    std::vector<PhotoConsistency> moments;
    PhotoConsistency brightness;  // without size if there is none
    GainSum gains;
    bool complete = true;
  };
  void take(const ViewRequest& request, const Answers& answers, const FocusArray& array);

 private:
  DepthEstimator::Settings settings_;
  bool match_gains_;
  DepthEstimator control_;
  ExposureSchedule turns_;
  std::optional<DepthEstimator::Plan> plan_;
  GainRequest gains_;  // brightness matching in the next request
};

}  // namespace lf
