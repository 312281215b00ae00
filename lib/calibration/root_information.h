// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "calibration/camera_covariance.h"

namespace lf {

// The square root of the information (upper rows) in the terms of `covariance` at `index`, each with `least` (a sigma)
// added; zero rows and columns for those that it lacks. Nothing where it lacks all, or is singular.
template <int N>
std::optional<Eigen::Matrix<double, N, N, Eigen::RowMajor>> root_information(
    const CameraCovariance& covariance, const std::array<std::optional<size_t>, N>& index,
    const std::array<double, N>& least) {
  std::vector<int> known;
  for (int k = 0; k < N; k++)
    if (index[k]) known.push_back(k);
  const auto n = static_cast<Eigen::Index>(known.size());
  if (n == 0) return std::nullopt;
  Eigen::MatrixXd m(n, n);
  for (Eigen::Index r = 0; r < n; r++) {
    for (Eigen::Index c = 0; c < n; c++) m(r, c) = covariance.at(*index[known[r]], *index[known[c]]);
    m(r, r) += least[known[r]] * least[known[r]];
  }
  const Eigen::LLT<Eigen::MatrixXd> information(m.inverse());
  if (information.info() != Eigen::Success) return std::nullopt;
  const Eigen::MatrixXd root = information.matrixU();
  Eigen::Matrix<double, N, N, Eigen::RowMajor> padded = Eigen::Matrix<double, N, N, Eigen::RowMajor>::Zero();
  for (Eigen::Index r = 0; r < n; r++)
    for (Eigen::Index c = 0; c < n; c++) padded(known[r], known[c]) = root(r, c);
  return padded;
}

}  // namespace lf
