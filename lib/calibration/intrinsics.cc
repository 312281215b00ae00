// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/intrinsics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <numeric>

#include <Eigen/Dense>
#include <glm/gtc/type_ptr.hpp>
#include <opencv2/calib3d.hpp>

#include "base/maths.h"
#include "base/text.h"

namespace lf {
namespace {

constexpr double kStillBoard = 0.003;  // relative to the image width, per frame; 1 pixel of 320
constexpr double kOther = 0.05;        // minimum mean displacement of the corners, relative to the image width

double distance(const BoardView& a, const BoardView& b) {
  std::map<size_t, Vec2> corners;
  for (size_t i = 0; i < a.corners.size(); i++) corners.emplace(a.id(i), a.corners[i]);
  double sum = 0, count = 0;
  for (size_t i = 0; i < b.corners.size(); i++)
    if (const auto found = corners.find(b.id(i)); found != corners.end())
      sum += glm::length(found->second - b.corners[i]), count++;
  return count > 0 ? sum / count : std::numeric_limits<double>::infinity();
}

}  // namespace

bool KeyframeSelector::take(const BoardView& view) {
  const bool still = distance(last_, view) < kStillBoard * width_;
  last_ = view;
  if (!still) return false;
  if (std::any_of(kept_.begin(), kept_.end(), [&](const auto& k) { return distance(k, view) < kOther * width_; }))
    return false;
  kept_.push_back(view);
  return true;
}

namespace {

constexpr int kPoseParams = 6;
// Columns of the Jacobian of cv::projectPoints().
enum Column { kRotation = 0, kTranslation = 3, kFocalX = 6, kFocalY = 7, kCentreX = 8 };

struct OpenCvFit {
  cv::Mat matrix, distortion;
  std::vector<cv::Mat> rotations, translations;
  std::vector<cv::Point3f> corners;  // of the board
};

std::vector<cv::Point2f> points_of(const std::vector<Vec2>& corners) {
  std::vector<cv::Point2f> points;
  for (const Vec2& corner : corners) points.emplace_back(static_cast<float>(corner.x), static_cast<float>(corner.y));
  return points;
}

template <class T>
std::vector<T> shown_by(const BoardView& view, const std::vector<T>& board) {
  std::vector<T> shown;
  for (size_t i = 0; i < view.corners.size(); i++) shown.push_back(board[view.id(i)]);
  return shown;
}

int flags_of(LensModel lens) {
  if (lens == LensModel::kFullOpenCv) return cv::CALIB_RATIONAL_MODEL;
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
    case LensModel::kFullOpenCv: return Lens(model, {fx, fy, cx, cy, d(0), d(1), d(2), d(3), d(4), d(5), d(6), d(7)});
    default: return Lens(model, {fx, fy, cx, cy, d(0), d(1), d(2), d(3)});
  }
}

Eigen::MatrixXd lens_columns(LensModel model, const Eigen::MatrixXd& all) {
  Eigen::MatrixXd columns(all.rows(), lens_model_num_params(model));
  int n = 0;
  if (lens_model_num_focal(model) == 1) {
    columns.col(n++) = all.col(kFocalX) + all.col(kFocalY);
  } else {
    columns.col(n++) = all.col(kFocalX);
    columns.col(n++) = all.col(kFocalY);
  }
  for (int i = 0; n < columns.cols(); i++) columns.col(n++) = all.col(kCentreX + i);  // cx cy k1 k2 p1 p2 k3 k4 k5 k6
  return columns;
}

// True if cv::calibrateCameraRO() estimates this coordinate. The gauge fixes corner 0, the last corner of the first
// row, and the depth of the last corner.
bool is_free(size_t corner, int axis, const CalibrationBoard& board) {
  if (corner == 0 || corner == static_cast<size_t>(board.grid_columns()) - 1) return false;
  return !(axis == 2 && corner == board.num_corners() - 1);
}

double length_of(const cv::Point2f& p) { return std::hypot(p.x, p.y); }

OpenCvFit calibrate_views(const std::vector<BoardView>& views, const CalibrationBoard& board, int width, int height,
                          const ZhangModel& model) {
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
      throw Error(view.name + ": shows only part of the board; estimating the board's corners requires complete views");
  }

  OpenCvFit fit;
  fit.matrix = cv::Mat::eye(3, 3, CV_64F);
  fit.corners = nominal;
  try {
    // With its default, a singular value decomposition of all parameters in each iteration, OpenCV takes several times
    // as long.
    cv::calibrateCameraRO(objects, images, {width, height}, model.free_board ? board.grid_columns() - 1 : -1,
                          fit.matrix, fit.distortion, fit.rotations, fit.translations, fit.corners,
                          flags_of(model.lens) | cv::CALIB_USE_QR,
                          {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-12});
  } catch (const cv::Exception& e) {
    throw Error("the views do not determine a lens: " + e.err);
  }
  if (!model.free_board) fit.corners = nominal;
  return fit;
}

// Returns the covariance of the first `num_lens` parameters, row by row, from the normal equations of a fit.
std::vector<double> lens_covariance(const Eigen::MatrixXd& normal, int num_lens, double variance,
                                    const ZhangModel& model) {
  // Scaled to a unit diagonal, because focal lengths and distortion terms differ by six orders of magnitude.
  const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::LDLT<Eigen::MatrixXd> factors(scaled);
  if (factors.info() != Eigen::Success || !(factors.vectorD().minCoeff() > 1e-13))
    throw Error("the views do not determine " + model.name() + ": tilt the board more");
  const Eigen::MatrixXd inverse = factors.solve(Eigen::MatrixXd::Identity(normal.rows(), num_lens));
  std::vector<double> covariance;
  for (int r = 0; r < num_lens; r++)
    for (int c = 0; c < num_lens; c++)
      covariance.push_back(variance * scale[r] * scale[c] * (inverse(r, c) + inverse(c, r)) / 2);
  return covariance;
}

}  // namespace

namespace {

// One camera at the origin, and the boards of its views.
class OneCamera {
 public:
  OneCamera(const Lens& lens, const std::vector<BoardView>& views, const std::vector<Vec3>& board) {
    const auto corners = std::make_shared<const std::vector<Vec3>>(board);
    CameraState& camera = scene_.cameras.emplace_back();
    camera.set_lens(lens);
    camera.used = true;
    scene_.lens_priors.resize(1);
    std::copy_n(camera.lens_terms(), kNumLensTerms, scene_.batch_mean.begin());
    scene_.batch.mean = scene_.batch_mean;
    for (int k = 0; k < kNumLensTerms; k++) scene_.batch.width[k] = kWide * (k < kK1 ? lens.fx() : 1);
    scene_.batch.spread = scene_.batch.tight = scene_.batch.width;
    scene_.targets.resize(views.size());
    for (uint32_t v = 0; v < views.size(); v++) {
      const std::vector<Pose> poses = board_poses(lens, shown_by(views[v], board), views[v].corners);
      if (!poses.empty()) scene_.targets[v].set_board(poses.front(), corners);
      for (size_t i = 0; i < views[v].corners.size(); i++)
        observations_.push_back({0, v, static_cast<uint32_t>(views[v].id(i)), views[v].corners[i]});
    }
  }

  // Returns true if the pose of the board is known in all views.
  bool has_all_boards() const {
    return std::ranges::all_of(scene_.targets,
                               [](const TargetState& target) { return target.kind == TargetState::Kind::kBoard; });
  }

  // Moves the boards, and changes the lens if it is free, to minimise the reprojection errors.
  void adjust(bool free_lens, int max_iterations) {
    AdjustmentOptions options;
    options.free.fill(free_lens);
    options.free_poses = false;
    options.max_iterations = max_iterations;
    options.tolerance = 1e-12;
    lf::adjust(scene_, observations_, Inliers(observations_.size(), true), options);
  }

  Lens lens() const { return scene_.cameras[0].lens(); }
  // Returns the squared errors of the views, in pixels. The error of a corner that the lens cannot see is large.
  std::vector<double> squared_errors() const {
    std::vector<double> sums(scene_.targets.size());
    for (const Observation& o : observations_) {
      const auto off = scene_.residual_of(o);
      sums[o.position] += off ? glm::dot(*off, *off) : kUnseen * kUnseen;
    }
    return sums;
  }

  // Returns the normal equations: first the lens, then the pose of each board.
  Eigen::MatrixXd normal_equations() const {
    const auto rows = static_cast<Eigen::Index>(kNumLensTerms + kPoseParams * scene_.targets.size());
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(rows, rows);
    for (const Observation& o : observations_) {
      Eigen::Matrix<double, 2, kNumLensTerms + kPoseParams> slopes;
      for (int k = 0; k < slopes.cols(); k++) {
        const Vec2 slope = slope_of(o, k);
        slopes.col(k) << slope.x, slope.y;
      }
      const auto at = static_cast<Eigen::Index>(kNumLensTerms + kPoseParams * o.position);
      const Eigen::MatrixXd product = slopes.transpose() * slopes;
      normal.topLeftCorner<kNumLensTerms, kNumLensTerms>() += product.topLeftCorner<kNumLensTerms, kNumLensTerms>();
      normal.block<kPoseParams, kPoseParams>(at, at) += product.bottomRightCorner<kPoseParams, kPoseParams>();
      normal.block<kPoseParams, kNumLensTerms>(at, 0) += product.bottomLeftCorner<kPoseParams, kNumLensTerms>();
      normal.block<kNumLensTerms, kPoseParams>(0, at) += product.topRightCorner<kNumLensTerms, kPoseParams>();
    }
    return normal;
  }

 private:
  static constexpr double kWide = 1e4;    // a prior so wide that it has no effect
  static constexpr double kUnseen = 100;  // pixels

  // Returns the derivative of an observation by a term of the lens or, from kNumLensTerms on, by a position or rotation
  // of its board.
  Vec2 slope_of(const Observation& o, int k) const {
    Vec2 sum(0, 0);
    for (const double sign : {-1, 1}) {
      CameraState camera = scene_.cameras[0];
      TargetState target = scene_.targets[o.position];
      const double step = sign * (k == kF ? 1e-6 * camera.lens_terms()[kF] : 1e-6);
      if (k < kNumLensTerms) {
        camera.lens_terms()[k] += step;
      } else if (k < kNumLensTerms + 3) {
        target.v[static_cast<size_t>(k - kNumLensTerms)] += step;
      } else {
        Vec3 axis(0, 0, 0);
        axis[k - kNumLensTerms - 3] = 1;
        const Quat turned = glm::angleAxis(step, axis) * Quat(target.v[3], target.v[4], target.v[5], target.v[6]);
        target.set_board({{target.v[0], target.v[1], target.v[2]}, turned}, target.corners);
      }
      if (const auto off = residual(camera, target, o)) sum += *off / (2 * step);
    }
    return sum;
  }

  Reconstruction scene_;
  std::vector<Observation> observations_;
};

// OpenCV's module `fisheye` needs a good start and fails for corners far from the axis. Bundle adjustment of the boards
// starts from several fields of view and keeps the best result.
ZhangFit fit_fisheye(const std::vector<BoardView>& views, const CalibrationBoard& board, int width, int height,
                     const ZhangModel& model) {
  if (model.free_board) throw Error("the corners of the board cannot be estimated with the model OPENCV_FISHEYE");
  ZhangFit result;
  result.model = model;
  for (size_t i = 0; i < board.num_corners(); i++) result.board.emplace_back(board.corner(i), 0);
  constexpr int kFirstIterations = 15;
  constexpr size_t kFirstViews = 8;  // enough to choose the start
  std::vector<BoardView> some;
  const size_t first_views = std::min(kFirstViews, views.size());
  for (size_t i = 0; i < first_views; i++) some.push_back(views[i * views.size() / first_views]);
  std::optional<Lens> start;
  double least = INFINITY;
  for (const double field : {80, 120, 160, 200, 240}) {  // of the longer side, degrees
    const double f = std::max(width, height) / (field * M_PI / 180);
    OneCamera camera(Lens(LensModel::kOpenCvFisheye, {f, f, (width - 1) / 2.0, (height - 1) / 2.0}), some,
                     result.board);
    camera.adjust(true, kFirstIterations);
    const std::vector<double> errors = camera.squared_errors();
    const double sum = std::accumulate(errors.begin(), errors.end(), 0.0);
    if (sum < least) least = sum, start = camera.lens();
  }
  if (!start) throw Error("the views do not determine a lens");
  OneCamera best(*start, views, result.board);
  if (!best.has_all_boards()) throw Error("the views do not fit the model " + model.name());
  best.adjust(true, 100);
  const std::vector<double> errors = best.squared_errors();
  least = std::accumulate(errors.begin(), errors.end(), 0.0);
  double num_points = 0;
  for (size_t v = 0; v < views.size(); v++) {
    const auto points = static_cast<double>(views[v].corners.size());
    result.view_rms.push_back(std::sqrt(errors[v] / points));
    num_points += points;
  }
  const double num_residuals = 2 * num_points;
  result.lens = best.lens();
  result.rms = std::sqrt(least / num_points);
  const Eigen::MatrixXd normal = best.normal_equations();
  result.num_params = static_cast<size_t>(normal.rows());
  if (num_residuals <= static_cast<double>(normal.rows()))
    throw Error("there are too few views for the model " + model.name());
  result.bic = num_residuals * std::log(least / num_residuals) +
               static_cast<double>(result.num_params) * std::log(num_residuals);
  const std::vector<double> own =
      lens_covariance(normal, kNumLensTerms, least / (num_residuals - static_cast<double>(result.num_params)), model);
  // fx and fy are equal.
  constexpr size_t kTerms[] = {kF, kF, kCx, kCy, kK1, kK2, kP1, kP2};
  for (const size_t r : kTerms)
    for (const size_t c : kTerms) result.covariance.push_back(own[r * kNumLensTerms + c]);
  return result;
}

}  // namespace

std::vector<Pose> board_poses(const Lens& lens, const std::vector<Vec3>& board, const std::vector<Vec2>& corners) {
  constexpr size_t kMinCorners = 4;
  constexpr double kWidest = 0.2;  // cosine between a corner and the middle of the board
  std::vector<Vec3> directions, shown;
  Vec3 middle(0, 0, 0);
  for (size_t i = 0; i < corners.size(); i++) {
    const auto direction = lens.direction(corners[i]);
    if (!direction) continue;
    directions.push_back(*direction);
    shown.push_back(board[i]);
    middle += *direction;
  }
  if (directions.size() < kMinCorners) return {};
  // A virtual pinhole camera looks at the middle of the board, which may be anywhere in the field of the lens.
  middle = glm::normalize(middle);
  const Quat turn = lens.distortion().fisheye ? glm::normalize(Quat(1 + middle.z, glm::cross(middle, Vec3(0, 0, 1))))
                                              : Quat(1, 0, 0, 0);
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> rays;
  for (size_t i = 0; i < directions.size(); i++) {
    const Vec3 d = turn * directions[i];
    if (lens.distortion().fisheye && d.z < kWidest) continue;
    points.emplace_back(shown[i].x, shown[i].y, shown[i].z);
    rays.emplace_back(d.x / d.z, d.y / d.z);
  }
  if (points.size() < kMinCorners) return {};
  std::vector<cv::Mat> turns, shifts;
  try {
    cv::solvePnPGeneric(points, rays, cv::Matx33d::eye(), cv::noArray(), turns, shifts, false, cv::SOLVEPNP_IPPE);
  } catch (const cv::Exception&) {
    return {};  // corners on a line
  }
  std::vector<Pose> poses;
  for (size_t k = 0; k < turns.size(); k++) {
    cv::solvePnPRefineLM(points, rays, cv::Matx33d::eye(), cv::noArray(), turns[k], shifts[k]);
    cv::Matx33d r;
    cv::Rodrigues(turns[k], r);
    const Quat back = glm::conjugate(turn);
    poses.push_back({back * glm::make_vec3(shifts[k].ptr<double>()),
                     glm::normalize(back * glm::quat_cast(glm::transpose(glm::make_mat3(r.val))))});
  }
  return poses;
}

std::string ZhangModel::name() const { return std::string(lens_model_name(lens)) + (free_board ? ", board free" : ""); }

ZhangFit fit_zhang(const std::vector<BoardView>& views, const CalibrationBoard& board, int width, int height,
                   const ZhangModel& model) {
  if (views.size() < 3)
    throw Error("at least 3 views of the board are needed, there are " + std::to_string(views.size()));
  if (model.lens == LensModel::kOpenCvFisheye) return fit_fisheye(views, board, width, height, model);
  const OpenCvFit fit = calibrate_views(views, board, width, height, model);
  const std::vector<cv::Point3f>& corners = fit.corners;
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
    const std::vector<cv::Point2f> image = points_of(views[v].corners);
    double view_sum = 0;
    for (size_t i = 0; i < seen.size(); i++) view_sum += std::pow(length_of(seen[i] - image[i]), 2);
    result.view_rms.push_back(std::sqrt(view_sum / static_cast<double>(seen.size())));
    sum += view_sum;
    num_points += static_cast<double>(seen.size());

    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const Eigen::MatrixXd all = Eigen::Map<const RowMajor>(jacobian.ptr<double>(), jacobian.rows, jacobian.cols);
    Eigen::MatrixXd j = Eigen::MatrixXd::Zero(jacobian.rows, num_params);
    j.leftCols(num_lens) = lens_columns(model.lens, all);
    j.middleCols(num_lens + kPoseParams * static_cast<int>(v), kPoseParams) = all.leftCols(kPoseParams);
    for (size_t i = 0; i < seen.size(); i++) {
      // Derivative by the corner's position: d/dX = d/dt R.
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
  if (num_residuals <= num_params) throw Error("there are too few views for the model " + model.name());
  result.bic = num_residuals * std::log(sum / num_residuals) + num_params * std::log(num_residuals);

  result.covariance = lens_covariance(normal, num_lens, sum / (num_residuals - num_params), model);
  return result;
}

double held_out_rms(const ZhangFit& fit, const BoardView& view) {
  const Lens& lens = fit.lens;
  if (lens.distortion().fisheye) {
    OneCamera camera(lens, {view}, fit.board);
    camera.adjust(false, 50);
    return std::sqrt(camera.squared_errors()[0] / static_cast<double>(view.corners.size()));
  }
  const cv::Matx33d matrix(lens.fx(), 0, lens.cx(), 0, lens.fy(), lens.cy(), 0, 0, 1);
  const Distortion<double>& of = lens.distortion();
  const cv::Vec<double, 8> distortion(of.k[0], of.k[1], of.p1, of.p2, of.k[2], of.d[0], of.d[1], of.d[2]);
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

namespace {

// A view is bad if its error exceeds this multiple of the median.
constexpr double kBadView = 3;
constexpr size_t kMinViews = 3;
constexpr size_t kFolds = 4;          // cross-validation holds out a quarter of the views at a time
constexpr double kModelGain = 0.995;  // held-out error of a larger model, relative to the smaller model
// Larger standard deviations mean that the lens is not calibrated, however small the residuals are.
constexpr double kMaxFocalDeviation = 0.01;   // relative to the focal length
constexpr double kMaxCentreDeviation = 0.01;  // relative to the image width

double cross_validate(const std::vector<BoardView>& views, const CalibrationBoard& board, int width, int height,
                      const ZhangModel& model) {
  const size_t folds = std::min(kFolds, views.size());
  if (views.size() - (views.size() + folds - 1) / folds < kMinViews) return NAN;
  double sum = 0;
  for (size_t fold = 0; fold < folds; fold++) {
    std::vector<BoardView> rest;
    for (size_t i = 0; i < views.size(); i++)
      if (i % folds != fold) rest.push_back(views[i]);
    const ZhangFit fit = fit_zhang(rest, board, width, height, model);
    for (size_t i = fold; i < views.size(); i += folds) sum += std::pow(held_out_rms(fit, views[i]), 2);
  }
  return std::sqrt(sum / static_cast<double>(views.size()));
}

constexpr LensModel kLenses[] = {LensModel::kSimplePinhole, LensModel::kSimpleRadial, LensModel::kRadial,
                                 LensModel::kOpenCv};
// Models that are only tried if they are given; a fisheye lens is recognised before.
constexpr LensModel kGivenLenses[] = {LensModel::kPinhole, LensModel::kFullOpenCv, LensModel::kOpenCvFisheye};

// A better model must improve both criteria. BIC guards against chance, and held-out views guard against systematic
// errors that BIC would treat as noise.
bool is_better(const IntrinsicsResult::Model& a, const IntrinsicsResult::Model& than) {
  return a.bic < than.bic && !(a.held_out_rms > kModelGain * than.held_out_rms);
}

std::vector<std::string> names_of(LensModel model) {
  std::vector<std::string> names = {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  if (lens_model_num_focal(model) == 1) names = {"f", "cx", "cy", "k1", "k2"};
  if (model == LensModel::kOpenCvFisheye) names = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
  names.resize(lens_model_num_params(model));
  return names;
}

std::string percent(double part) { return format_text("%.2g %%", 100 * part); }

}  // namespace

GoodViews fit_good_views(const std::vector<BoardView>& views, const CalibrationBoard& board, int width, int height,
                         const ZhangModel& model) {
  GoodViews result;
  result.rms.resize(views.size());
  for (size_t i = 0; i < views.size(); i++) result.used.push_back(i);
  std::vector<BoardView> good = views;
  for (;;) {
    result.fit = fit_zhang(good, board, width, height, model);
    const std::vector<double>& rms = result.fit.view_rms;
    for (size_t i = 0; i < rms.size(); i++) result.rms[result.used[i]] = rms[i];
    const auto worst = std::max_element(rms.begin(), rms.end()) - rms.begin();
    if (good.size() == kMinViews || rms[worst] <= kBadView * median(rms)) return result;
    good.erase(good.begin() + worst);
    result.used.erase(result.used.begin() + worst);
  }
}

GoodViews fit_radial_or_fisheye(const std::vector<BoardView>& views, const CalibrationBoard& board, int width,
                                int height) {
  constexpr double kClearlyBetter = 0.8;
  const auto error_of = [&](LensModel lens) {
    try {
      return median(fit_zhang(views, board, width, height, {lens}).view_rms);
    } catch (const Error&) {
      return std::numeric_limits<double>::infinity();
    }
  };
  const bool fisheye = error_of(LensModel::kOpenCvFisheye) < kClearlyBetter * error_of(LensModel::kRadial);
  return fit_good_views(views, board, width, height, {fisheye ? LensModel::kOpenCvFisheye : LensModel::kRadial});
}

IntrinsicsResult calibrate_intrinsics(const std::vector<BoardView>& views, const CalibrationBoard& board, int width,
                                      int height, const IntrinsicsOptions& options) {
  const auto step = [&](const std::string& what) {
    if (options.progress) options.progress(what);
  };
  if (options.lens && std::ranges::find(kLenses, *options.lens) == std::end(kLenses) &&
      std::ranges::find(kGivenLenses, *options.lens) == std::end(kGivenLenses))
    throw Error("lens: cannot calibrate the model " + std::string(lens_model_name(*options.lens)) +
                "; use SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV or OPENCV_FISHEYE");
  IntrinsicsResult result;
  for (const BoardView& view : views) result.views.push_back({view.name});

  // Bad views would favour any model that adapts to their errors, so they are removed first.
  step("looking for bad views");
  const bool automatic = !options.lens, is_fisheye = options.lens == LensModel::kOpenCvFisheye;
  const ZhangModel first{is_fisheye ? LensModel::kOpenCvFisheye : LensModel::kRadial, false};
  const GoodViews robust = automatic ? fit_radial_or_fisheye(views, board, width, height)
                                     : fit_good_views(views, board, width, height, first);
  const bool found_fisheye = robust.fit.model.lens == LensModel::kOpenCvFisheye;
  const std::vector<size_t>& used = robust.used;
  std::vector<BoardView> good;
  for (size_t i = 0; i < views.size(); i++) {
    result.views[i].used = std::ranges::binary_search(used, i);
    result.views[i].rms = robust.rms[i];
    if (result.views[i].used) good.push_back(views[i]);
  }

  std::optional<IntrinsicsResult::Model> best;
  const auto consider = [&](const ZhangModel& model) {
    step("trying " + model.name());
    try {
      const ZhangFit fit = fit_zhang(good, board, width, height, model);
      result.models.push_back(
          {model, fit.rms, cross_validate(good, board, width, height, model), fit.num_params, fit.bic});
      if (best && !is_better(result.models.back(), *best)) return;
      best = result.models.back();
      result.fit = fit;
    } catch (const Error&) {
    }
  };
  // Selects the lens with the nominal board, then tests whether to estimate the board.
  const bool must_be_free = options.free_board.value_or(false);
  for (const LensModel lens : kLenses)
    if (automatic ? !found_fisheye : *options.lens == lens) consider({lens, must_be_free});
  for (const LensModel lens : kGivenLenses)
    if (options.lens == lens || (automatic && found_fisheye && lens == LensModel::kOpenCvFisheye))
      consider({lens, must_be_free});
  if (best && !options.free_board) consider({best->model.lens, true});
  if (!best) throw Error("the views do not determine a lens: tilt the board more, fill the image");
  result.held_out_rms = best->held_out_rms;
  for (size_t i = 0; i < used.size(); i++) result.views[used[i]].rms = result.fit.view_rms[i];

  result.covariance = {names_of(result.fit.model.lens), result.fit.covariance};
  const auto deviation = [&](const char* name) {
    const auto i = result.covariance.index_of(name);
    return i ? std::sqrt(result.covariance.at(*i, *i)) : 0;
  };
  const double focal = std::max(deviation("f"), deviation("fx")) / result.fit.lens.fx();
  if (focal > kMaxFocalDeviation)
    result.warnings.push_back("the focal length is not calibrated (+-" + percent(focal) +
                              "): tilt the board by 30 to 45 "
                              "degrees, to all sides");
  const double centre = std::max(deviation("cx"), deviation("cy")) / width;
  if (centre > kMaxCentreDeviation)
    result.warnings.push_back("the principal point is not calibrated (+-" + percent(centre) +
                              " of the width): show the board upright and turned by 90 degrees, in all corners");
  return result;
}

}  // namespace lf
