// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/pose_priors.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "calibration/adjustment.h"
#include "calibration/placement.h"
#include "calibration/root_information.h"

namespace lf {
namespace {

constexpr const char* kTermNames[PosePrior::kNumTerms] = {"x", "y", "z", "rx", "ry", "rz"};
constexpr std::array<double, PosePrior::kNumTerms> kLeast = {1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6};  // metres, radians
constexpr double kContradiction = 5;  // sigmas: far beyond chance
constexpr size_t kLeastCameras = 3;

struct Known {
  size_t camera;
  PosePrior prior;
  std::array<double, PosePrior::kNumTerms> variance;  // infinite where nothing is known
};

std::vector<Known> known_poses(const Reconstruction& scene, const Tracks& tracks, const SolveOptions& options) {
  std::vector<Known> list;
  if (!options.prior) return list;
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    const size_t at = *options.prior->index_of_id(tracks.cameras[i].id);
    if (!scene.cameras[i].used || at >= options.prior_covariances.size() || !options.prior_covariances[at]) continue;
    const CameraCovariance& covariance = *options.prior_covariances[at];
    std::array<std::optional<size_t>, PosePrior::kNumTerms> index;
    Known known{i, {options.prior->cameras[at].pose}, {}};
    known.prior.mean.position -= options.prior->cameras[0].pose.position;
    for (int k = 0; k < PosePrior::kNumTerms; k++) {
      index[k] = covariance.index_of(kTermNames[k]);
      known.variance[k] = index[k] ? covariance.at(*index[k], *index[k]) : INFINITY;
    }
    const auto root = root_information<PosePrior::kNumTerms>(covariance, index, kLeast);
    if (!root) continue;
    std::copy(root->data(), root->data() + root->size(), known.prior.root_information.begin());
    list.push_back(known);
  }
  return list;
}

Similarity frame_of(const Reconstruction& scene, const std::vector<Known>& list) {
  std::vector<Pose> found, expected;
  for (const Known& known : list) {
    found.push_back(scene.cameras[known.camera].pose());
    expected.push_back(known.prior.mean);
  }
  return align(found, expected);
}

// The largest of the differences of `pose` from what was known, in sigmas of both.
double contradiction(const Known& known, const Pose& pose, const CameraCovariance& found) {
  const Vec3 shift = pose.position - known.prior.mean.position;
  Quat q = pose.orientation * glm::conjugate(known.prior.mean.orientation);
  if (q.w < 0) q = -q;
  const double off[] = {shift.x, shift.y, shift.z, 2 * q.x, 2 * q.y, 2 * q.z};
  double largest = 0;
  for (int k = 0; k < PosePrior::kNumTerms; k++) {
    const size_t at = *found.index_of(kTermNames[k]);
    largest = std::max(largest, std::abs(off[k]) / std::sqrt(found.at(at, at) + known.variance[k]));
  }
  return largest;
}

void move_scene(Reconstruction& scene, const Similarity& s, double bar) {
  const double scale = s.scale / bar;
  const Similarity moved{scale, s.rotation, s.translation / bar};
  for (CameraState& camera : scene.cameras)
    if (camera.used) camera.set_pose(moved(camera.pose()));
  for (TargetState& target : scene.targets) {
    const Vec3 at = moved(Vec3(target.v[0], target.v[1], target.v[2]));
    const Vec3 along = moved.rotation * Vec3(target.v[3], target.v[4], target.v[5]);
    for (int i = 0; i < 3; i++) target.v[i] = at[i], target.v[3 + i] = along[i];
  }
  scene.metres = bar;
}

}  // namespace

bool knows_poses(const SolveOptions& options) {
  for (const auto& covariance : options.prior_covariances)
    for (const char* name : kTermNames)
      if (covariance && covariance->index_of(name)) return true;
  return false;
}

PosePriorUse use_pose_priors(Reconstruction& scene, const Tracks& tracks, const SolveOptions& options,
                             const Uncertainty& uncertainty) {
  PosePriorUse use;
  std::vector<Known> list = known_poses(scene, tracks, options);
  // One that is far off turns the frame, so that others seem wrong: one after the other.
  while (list.size() >= kLeastCameras) {
    const Similarity s = frame_of(scene, list);
    std::vector<double> sigmas;
    for (const Known& known : list)
      sigmas.push_back(
          contradiction(known, s(scene.cameras[known.camera].pose()), covariance_in_rig(uncertainty, known.camera, s)));
    const auto worst = std::max_element(sigmas.begin(), sigmas.end()) - sigmas.begin();
    if (!(sigmas[worst] > kContradiction)) break;
    use.contradicted.push_back(list[worst].camera);
    list.erase(list.begin() + worst);
  }
  if (list.size() < kLeastCameras) return use;
  const Similarity s = frame_of(scene, list);
  move_scene(scene, s, tracks.bar ? s.scale : 1);
  scene.pose_priors.assign(scene.cameras.size(), std::nullopt);
  for (const Known& known : list) scene.pose_priors[known.camera] = known.prior;
  use.any = true;
  return use;
}

}  // namespace lf
