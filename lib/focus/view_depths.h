// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "focus/depth_estimator.h"
#include "focus/exposure_compensation.h"

namespace lf {

// The focal surface and the depth hypotheses for the next request of a view.
struct DepthEstimate {
  uint32_t sequence = 0;  // number of the request that the estimate is based on
  DepthEstimator::Plan plan;
  GainRequest gains;  // brightness matching in the next request
};

// Adds the surface of a plan to a request of the same view, warped to the request's own view. The request has no map,
// and already has its hypotheses and gains.
void apply_plan(const DepthEstimator::Plan& plan, ViewRequest& request);

// Adds the surface of the leading view to a request for another view of a set, warped to that view. The request uses
// gains if the leader does, and gets no hypotheses.
void apply_reference_view(const ViewRequest& leader, ViewRequest& beside);

// Returns the brightness matching for the next request of a view. `use`: gains are in use. `has_hypotheses`: the
// request has hypotheses. `brightness`, `gains`: the mean for request `sequence`; it has no size if there is no
// mean.
GainRequest next_gains(ExposureSchedule& turns, bool use, bool has_hypotheses, const PhotoConsistency& brightness,
                       const GainSum& gains, uint32_t sequence);

// Focal surface and brightness of one view, for callers that wait for each answer before the next request. A plain
// value without locks.
class ViewDepths {
 public:
  // `match_gains`: matches the brightness of cameras where several contribute to the picture.
  explicit ViewDepths(const DepthEstimator::Settings& settings = {}, bool match_gains = false)
      : settings_(settings), match_gains_(match_gains), control_(settings) {}

  const DepthEstimator::Settings& settings() const { return settings_; }
  bool matches_gains() const { return match_gains_; }
  // Adds the surface, warped to the request's view, and the hypotheses. The view has no map.
  void apply(ViewRequest& request);
  // Answers to a request prepared by apply(). `moments`: the sums of its hypotheses, in their order; empty if there are
  // none. `complete`: its picture was complete.
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
