// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include <Eigen/Core>

#include "calibration/adjustment.h"

namespace lf {

// How well the cameras of an adjusted scene are known: the inverse of the information in the observations and the
// priors, targets and batch means eliminated, so that it is also the bound (Cramer, Rao) for any unbiased method when
// taken at the truth. In the gauge of a scene that has been aligned by a similarity with the true centres (align()).
//
// Steps of a used camera: rotation about the world's axes (radians), position (units of the scene), free lens terms.
struct Uncertainty {
  std::vector<int> camera_row;  // first row of each camera; -1: not used
  int camera_size = 0;          // rows of each
  std::vector<int> lens_terms;  // lens terms that a camera's rows from the seventh on are of
  Eigen::MatrixXd covariance;   // covariance of the steps of all cameras
  Eigen::MatrixXd
      prior_covariance;  // covariance of the lens terms as known before, lens_terms.size() rows for each camera

  // A functional of all steps: its standard deviation.
  double sigma_of(const Eigen::VectorXd& weights) const { return std::sqrt(weights.dot(covariance * weights)); }
};

Uncertainty estimate_uncertainty(const Reconstruction& scene, const std::vector<Observation>& observations,
                                 const Inliers& use, const AdjustmentOptions& options);

}  // namespace lf
