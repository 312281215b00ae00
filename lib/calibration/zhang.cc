// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/zhang.h"

#include <cmath>

#include <Eigen/Dense>
#include <opencv2/calib3d.hpp>

#include "base/error.h"

namespace lf {
namespace {

constexpr int kPoseParams = 6;
// Columns of cv::projectPoints()'s Jacobian.
enum Column { kRotation = 0, kTranslation = 3, kFocalX = 6, kFocalY = 7, kCentreX = 8, kK1 = 10, kP1 = 12, kP2 = 13 };

struct OpenCvFit {
  cv::Mat matrix, distortion;
  std::vector<cv::Mat> rotations, translations;
};

std::vector<cv::Point2f> points_of(const std::vector<Vec2>& corners) {
  std::vector<cv::Point2f> points;
  for (const Vec2& corner : corners) points.emplace_back(static_cast<float>(corner.x), static_cast<float>(corner.y));
  return points;
}

// Those of `board`, which has all corners, that a view shows.
template <class T>
std::vector<T> shown_by(const BoardView& view, const std::vector<T>& board) {
  std::vector<T> shown;
  for (size_t i = 0; i < view.corners.size(); i++) shown.push_back(board[view.id(i)]);
  return shown;
}

int flags_of(LensModel lens) {
  int flags = cv::CALIB_FIX_K3;
  if (lens_model_num_focal(lens) == 1) flags |= cv::CALIB_FIX_ASPECT_RATIO;
  const bool tangential = lens == LensModel::kOpenCv,
             k1 = lens != LensModel::kSimplePinhole && lens != LensModel::kPinhole;
  if (!tangential) flags |= cv::CALIB_ZERO_TANGENT_DIST;
  if (!k1) flags |= cv::CALIB_FIX_K1;
  if (!k1 || lens == LensModel::kSimpleRadial) flags |= cv::CALIB_FIX_K2;
  return flags;
}

Lens lens_of(LensModel model, const cv::Mat& k, const cv::Mat& distortion) {
  const double fx = k.at<double>(0, 0), fy = k.at<double>(1, 1), cx = k.at<double>(0, 2), cy = k.at<double>(1, 2);
  const auto d = [&](int i) { return distortion.at<double>(i); };
  switch (model) {
    case LensModel::kSimplePinhole: return Lens(model, {fx, cx, cy});
    case LensModel::kPinhole: return Lens(model, {fx, fy, cx, cy});
    case LensModel::kSimpleRadial: return Lens(model, {fx, cx, cy, d(0)});
    case LensModel::kRadial: return Lens(model, {fx, cx, cy, d(0), d(1)});
    case LensModel::kOpenCv: break;
  }
  return Lens(model, {fx, fy, cx, cy, d(0), d(1), d(2), d(3)});
}

// d(pixel) / d(lens.params()) out of OpenCV's columns.
Eigen::MatrixXd lens_columns(LensModel model, const Eigen::MatrixXd& all) {
  Eigen::MatrixXd columns(all.rows(), lens_model_num_params(model));
  int n = 0;
  if (lens_model_num_focal(model) == 1) {
    columns.col(n++) = all.col(kFocalX) + all.col(kFocalY);
  } else {
    columns.col(n++) = all.col(kFocalX);
    columns.col(n++) = all.col(kFocalY);
  }
  for (int i = 0; n < columns.cols(); i++) columns.col(n++) = all.col(kCentreX + i);  // cx cy k1 k2 p1 p2
  return columns;
}

// Which coordinates of the board are unknown: what cv::calibrateCameraRO() leaves free. Corner 0 and the last of the
// first row are fixed, and the depth of the last one, so that board and poses can't move against each other.
bool is_free(size_t corner, int axis, const Checkerboard& board) {
  if (corner == 0 || corner == static_cast<size_t>(board.columns) - 1) return false;
  return !(axis == 2 && corner == board.num_corners() - 1);
}

double length_of(const cv::Point2f& p) { return std::hypot(p.x, p.y); }

}  // namespace

std::string ZhangModel::name() const { return std::string(lens_model_name(lens)) + (free_board ? ", board free" : ""); }

ZhangFit fit_zhang(const std::vector<BoardView>& views, const Checkerboard& board, int width, int height,
                   const ZhangModel& model) {
  if (views.size() < 3)
    throw Error("at least 3 views of the board are needed, there are " + std::to_string(views.size()));
  std::vector<cv::Point3f> nominal;
  for (size_t i = 0; i < board.num_corners(); i++) {
    const Vec2 corner = board.corner(i);
    nominal.emplace_back(static_cast<float>(corner.x), static_cast<float>(corner.y), 0.0F);
  }
  std::vector<std::vector<cv::Point3f>> objects;
  std::vector<std::vector<cv::Point2f>> images;
  for (const BoardView& view : views) {
    objects.push_back(shown_by(view, nominal));
    images.push_back(points_of(view.corners));
    if (model.free_board && objects.back().size() != nominal.size())
      throw Error(view.name + ": shows a part of the board, whose corners can't be free then");
  }

  OpenCvFit fit;
  fit.matrix = cv::Mat::eye(3, 3, CV_64F);
  std::vector<cv::Point3f> corners = nominal;
  try {
    cv::calibrateCameraRO(objects, images, {width, height}, model.free_board ? board.columns - 1 : -1, fit.matrix,
                          fit.distortion, fit.rotations, fit.translations, corners, flags_of(model.lens),
                          {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-12});
  } catch (const cv::Exception& e) {
    throw Error("the views do not determine a lens: " + e.err);
  }
  if (!model.free_board) corners = nominal;

  ZhangFit result;
  result.model = model;
  result.lens = lens_of(model.lens, fit.matrix, fit.distortion);
  for (const cv::Point3f& p : corners) result.board.emplace_back(p.x, p.y, p.z);

  const int num_lens = result.lens.num_params(), first_board = num_lens + kPoseParams * static_cast<int>(views.size());
  std::vector<std::array<int, 3>> board_column(corners.size(), {-1, -1, -1});
  int num_params = first_board;
  if (model.free_board)
    for (size_t i = 0; i < corners.size(); i++)
      for (int axis = 0; axis < 3; axis++)
        if (is_free(i, axis, board)) board_column[i][axis] = num_params++;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(num_params, num_params);
  double sum = 0, num_points = 0;
  for (size_t v = 0; v < views.size(); v++) {
    std::vector<cv::Point2f> seen;
    cv::Mat jacobian, rotation;
    cv::projectPoints(shown_by(views[v], corners), fit.rotations[v], fit.translations[v], fit.matrix, fit.distortion,
                      seen, jacobian);
    cv::Rodrigues(fit.rotations[v], rotation);
    Eigen::Matrix3d r;
    for (int i = 0; i < 9; i++) r(i / 3, i % 3) = rotation.at<double>(i / 3, i % 3);
    double view_sum = 0;
    for (size_t i = 0; i < seen.size(); i++) view_sum += std::pow(length_of(seen[i] - images[v][i]), 2);
    result.view_rms.push_back(std::sqrt(view_sum / static_cast<double>(seen.size())));
    sum += view_sum;
    num_points += static_cast<double>(seen.size());

    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const Eigen::MatrixXd all = Eigen::Map<const RowMajor>(jacobian.ptr<double>(), jacobian.rows, jacobian.cols);
    Eigen::MatrixXd j = Eigen::MatrixXd::Zero(jacobian.rows, num_params);
    j.leftCols(num_lens) = lens_columns(model.lens, all);
    j.middleCols(num_lens + kPoseParams * static_cast<int>(v), kPoseParams) = all.leftCols(kPoseParams);
    for (size_t i = 0; i < seen.size(); i++) {
      // A corner moves as the board would: d/dX = d/dt R.
      const auto row = static_cast<int>(2 * i);
      const Eigen::Matrix<double, 2, 3> moved = all.block<2, 3>(row, kTranslation) * r;
      for (int axis = 0; axis < 3; axis++)
        if (const int column = board_column[views[v].id(i)][axis]; column >= 0)
          j.block<2, 1>(row, column) = moved.col(axis);
    }
    normal += j.transpose() * j;
  }
  const double num_residuals = 2 * num_points;
  result.rms = std::sqrt(sum / num_points);
  result.num_params = num_params;
  if (num_residuals <= num_params) throw Error("too few views for " + model.name());
  result.bic = num_residuals * std::log(sum / num_residuals) + num_params * std::log(num_residuals);

  // Scaled to a unit diagonal: focal lengths and distortion terms differ by six orders of magnitude.
  const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::LDLT<Eigen::MatrixXd> factors(scaled);
  if (factors.info() != Eigen::Success || !(factors.vectorD().minCoeff() > 1e-13))
    throw Error("the views do not determine " + model.name() + ": tilt the board more");
  const Eigen::MatrixXd inverse = factors.solve(Eigen::MatrixXd::Identity(num_params, num_lens));
  const double variance = sum / (num_residuals - num_params);
  for (int r = 0; r < num_lens; r++)
    for (int c = 0; c < num_lens; c++)
      result.covariance.push_back(variance * scale[r] * scale[c] * (inverse(r, c) + inverse(c, r)) / 2);
  return result;
}

double held_out_rms(const ZhangFit& fit, const BoardView& view) {
  const Lens& lens = fit.lens;
  const cv::Matx33d matrix(lens.fx(), 0, lens.cx(), 0, lens.fy(), lens.cy(), 0, 0, 1);
  const cv::Vec4d distortion(lens.k1(), lens.k2(), lens.p1(), lens.p2());
  std::vector<cv::Point3f> corners;
  for (const Vec3& p : shown_by(view, fit.board))
    corners.emplace_back(static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z));
  const std::vector<cv::Point2f> image = points_of(view.corners);
  cv::Vec3d rotation, translation;
  cv::solvePnP(corners, image, matrix, distortion, rotation, translation);
  cv::solvePnPRefineLM(corners, image, matrix, distortion, rotation, translation);
  std::vector<cv::Point2f> seen;
  cv::projectPoints(corners, rotation, translation, matrix, distortion, seen);
  double sum = 0;
  for (size_t i = 0; i < seen.size(); i++) sum += std::pow(length_of(seen[i] - image[i]), 2);
  return std::sqrt(sum / static_cast<double>(seen.size()));
}

}  // namespace lf
