// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/reconstruction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "base/text.h"
#include "calibration/placement.h"

namespace lf {
namespace {

// Default lens: 50 degrees field of view, centred; with the variation between and within batches.
BatchPrior usual(int width, int height) {
  const double f = 1.1 * std::max(width, height);
  BatchPrior batch;
  batch.mean = {f, (width - 1) / 2.0, (height - 1) / 2.0, 0, 0, 0, 0};
  batch.width = {f, 0.05 * width, 0.05 * width, 0.5, 0.5, 0.01, 0.01};
  batch.spread = {0.05 * f, 0.03 * width, 0.03 * width, 0.05, 0.1, 0.005, 0.005};
  batch.tight = {1e-4 * f, 1e-4 * width, 1e-4 * width, 0.01, 0.02, 1e-4, 1e-4};
  return batch;
}

// Views of a board determine each lens, so lenses need not be alike. These sigmas only keep terms finite that no view
// determines.
void widen(BatchPrior& batch, int width) {
  const double f = batch.mean[kF];
  batch.width = {f, 0.2 * width, 0.2 * width, 1, 1, 0.1, 0.1};
  batch.spread = batch.width;
}

// Returns the square root of the information matrix (upper triangular) for the terms of `covariance` at `index`, with
// the sigmas `least` added. Rows and columns of missing terms are zero. Returns nullopt if all terms are missing, or if
// the covariance is singular.
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

// Terms with zero variance are practically fixed; missing terms have no prior.
std::optional<LensPrior> make_prior(const CameraState& camera, const CameraCovariance& covariance) {
  const std::array<double, kNumLensTerms> least = {1e-6 * camera.lens_terms()[kF], 1e-4, 1e-4, 1e-7, 1e-7, 1e-7, 1e-7};
  std::array<std::optional<size_t>, kNumLensTerms> index;
  for (int k = 0; k < kNumLensTerms; k++) index[k] = covariance.index_of(camera.term_name(k));
  if (!index[kF]) index[kF] = covariance.index_of("fx");
  const auto root = root_information<kNumLensTerms>(covariance, index, least);
  if (!root) return std::nullopt;
  LensPrior prior;
  std::copy(camera.lens_terms(), camera.lens_terms() + kNumLensTerms, prior.mean.begin());
  std::copy(root->data(), root->data() + root->size(), prior.root_information.begin());
  for (int k = 0; k < kNumLensTerms; k++) prior.known[k] = index[k].has_value();
  return prior;
}

}  // namespace

Reconstruction make_scene(const Tracks& tracks, const SolveOptions& options) {
  if (tracks.cameras.size() < 2)
    throw Error("at least two cameras are required, because one camera does not determine any position");
  Reconstruction scene;
  scene.cameras.resize(tracks.cameras.size());
  scene.lens_priors.resize(tracks.cameras.size());
  scene.targets.resize(tracks.num_positions);
  scene.batch = usual(tracks.cameras[0].width, tracks.cameras[0].height);
  std::array<double, kNumLensTerms> sum{};
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    CameraState& camera = scene.cameras[i];
    camera.width = tracks.cameras[i].width, camera.height = tracks.cameras[i].height;
    if (!options.prior) {
      const BatchPrior own = usual(camera.width, camera.height);
      std::copy(own.mean.begin(), own.mean.end(), camera.lens_terms());
      continue;
    }
    const std::string id = std::to_string(tracks.cameras[i].id);
    const auto index = options.prior->index_of_id(tracks.cameras[i].id);
    if (!index) throw Error("the prior rig has no camera with id " + id);
    const Camera& known = options.prior->cameras[*index];
    if (known.width != camera.width || known.height != camera.height)
      throw Error("camera " + id + " has " + std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                  " pixels in the tracks and " + std::to_string(known.width) + "x" + std::to_string(known.height) +
                  " in the prior rig; record with the image size of the rig");
    camera.set_lens(known.lens);
    for (int k = 0; k < kNumLensTerms; k++) sum[k] += camera.lens_terms()[k];
    if (*index < options.prior_covariances.size() && options.prior_covariances[*index])
      scene.lens_priors[i] = make_prior(camera, *options.prior_covariances[*index]);
  }
  if (options.prior) {
    // Lenses without measurements are near the nominal lenses, with a common error.
    for (int k = 0; k < kNumLensTerms; k++) scene.batch.mean[k] = sum[k] / static_cast<double>(tracks.cameras.size());
    scene.batch.width[kF] = 0.1 * scene.batch.mean[kF];
  }
  if (!tracks.board.empty()) widen(scene.batch, tracks.cameras[0].width);
  scene.batch_mean = scene.batch.mean;
  return scene;
}

namespace {

constexpr const char* kPoseTermNames[PosePrior::kNumTerms] = {"x", "y", "z", "rx", "ry", "rz"};
constexpr std::array<double, PosePrior::kNumTerms> kLeast = {1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6};  // metres, radians
constexpr double kGroupContradiction = 5;  // sigmas; far beyond chance
constexpr size_t kMinGroupCameras = 3;

struct PoseEstimate {
  size_t camera;
  PosePrior prior;
  std::array<double, PosePrior::kNumTerms> variance;  // infinite if unknown
};

std::vector<PoseEstimate> known_poses(const Reconstruction& scene, const Tracks& tracks, const SolveOptions& options) {
  std::vector<PoseEstimate> list;
  if (!options.prior) return list;
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    const size_t at = *options.prior->index_of_id(tracks.cameras[i].id);
    if (!scene.cameras[i].used || at >= options.prior_covariances.size() || !options.prior_covariances[at]) continue;
    const CameraCovariance& covariance = *options.prior_covariances[at];
    std::array<std::optional<size_t>, PosePrior::kNumTerms> index;
    PoseEstimate known{i, {options.prior->cameras[at].pose}, {}};
    known.prior.mean.position -= options.prior->cameras[0].pose.position;
    for (int k = 0; k < PosePrior::kNumTerms; k++) {
      index[k] = covariance.index_of(kPoseTermNames[k]);
      known.variance[k] = index[k] ? covariance.at(*index[k], *index[k]) : INFINITY;
    }
    const auto root = root_information<PosePrior::kNumTerms>(covariance, index, kLeast);
    if (!root) continue;
    std::copy(root->data(), root->data() + root->size(), known.prior.root_information.begin());
    list.push_back(known);
  }
  return list;
}

Similarity frame_of(const Reconstruction& scene, const std::vector<PoseEstimate>& list) {
  std::vector<Pose> found, expected;
  for (const PoseEstimate& known : list) {
    found.push_back(scene.cameras[known.camera].pose());
    expected.push_back(known.prior.mean);
  }
  return align(found, expected);
}

// Returns the largest difference between `pose` and its prior, in combined sigmas.
double contradiction(const PoseEstimate& known, const Pose& pose, const CameraCovariance& found) {
  const Vec3 shift = pose.position - known.prior.mean.position;
  Quat q = pose.orientation * glm::conjugate(known.prior.mean.orientation);
  if (q.w < 0) q = -q;
  const double off[] = {shift.x, shift.y, shift.z, 2 * q.x, 2 * q.y, 2 * q.z};
  double largest = 0;
  for (int k = 0; k < PosePrior::kNumTerms; k++) {
    const size_t at = *found.index_of(kPoseTermNames[k]);
    largest = std::max(largest, std::abs(off[k]) / std::sqrt(found.at(at, at) + known.variance[k]));
  }
  return largest;
}

// `unit` is the size of the scene's unit of length in the frame of the priors, metres.
void move_scene(Reconstruction& scene, const Similarity& s, double unit) {
  const Similarity moved{s.scale / unit, s.rotation, s.translation / unit};
  for (CameraState& camera : scene.cameras)
    if (camera.used) camera.set_pose(moved(camera.pose()));
  for (TargetState& target : scene.targets) {
    const Vec3 at = moved(Vec3(target.v[0], target.v[1], target.v[2]));
    if (target.kind == TargetState::Kind::kBoard) {
      target.set_board({at, moved.rotation * Quat(target.v[3], target.v[4], target.v[5], target.v[6])}, target.corners);
      continue;
    }
    const Vec3 along = moved.rotation * Vec3(target.v[3], target.v[4], target.v[5]);
    for (int i = 0; i < 3; i++) target.v[i] = at[i], target.v[3 + i] = along[i];
  }
  scene.metres = unit;
}

}  // namespace

bool has_known_poses(const SolveOptions& options) {
  for (const auto& covariance : options.prior_covariances)
    for (const char* name : kPoseTermNames)
      if (covariance && covariance->index_of(name)) return true;
  return false;
}

PosePriorResult use_pose_priors(Reconstruction& scene, const Tracks& tracks, const SolveOptions& options,
                                const Uncertainty& uncertainty) {
  PosePriorResult use;
  std::vector<PoseEstimate> list = known_poses(scene, tracks, options);
  // A wrong prior biases the frame and makes other priors look wrong, so they are removed one at a time.
  while (list.size() >= kMinGroupCameras) {
    const Similarity s = frame_of(scene, list);
    std::vector<double> sigmas;
    for (const PoseEstimate& known : list)
      sigmas.push_back(contradiction(known, s(scene.cameras[known.camera].pose()),
                                     covariance_in_rig(uncertainty, scene, known.camera, s)));
    const auto worst = std::max_element(sigmas.begin(), sigmas.end()) - sigmas.begin();
    if (!(sigmas[worst] > kGroupContradiction)) break;
    use.contradicted.push_back(list[worst].camera);
    list.erase(list.begin() + worst);
  }
  if (list.size() < kMinGroupCameras) return use;
  const Similarity s = frame_of(scene, list);
  move_scene(scene, s, tracks.rigid_targets() ? s.scale : 1);
  scene.pose_priors.assign(scene.cameras.size(), std::nullopt);
  for (const PoseEstimate& known : list) scene.pose_priors[known.camera] = known.prior;
  use.any = true;
  return use;
}

}  // namespace lf
