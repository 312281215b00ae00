// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/reconstruction.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "calibration/root_information.h"

namespace lf {
namespace {

constexpr const char* kTermNames[kNumLensTerms] = {"f", "cx", "cy", "k1", "k2"};

// A lens as usual: 50 degrees across, centred. How far batches differ from it, and lenses within a batch.
BatchPrior usual(int width, int height) {
  const double f = 1.1 * std::max(width, height);
  BatchPrior batch;
  batch.mean = {f, (width - 1) / 2.0, (height - 1) / 2.0, 0, 0};
  batch.width = {f, 0.05 * width, 0.05 * width, 0.5, 0.5};
  batch.spread = {0.05 * f, 0.03 * width, 0.03 * width, 0.05, 0.1};
  batch.tight = {1e-4 * f, 1e-4 * width, 1e-4 * width, 0.01, 0.02};
  return batch;
}

// Of the terms that the covariance has: what it says to be exact is held fast, of what it lacks nothing is known.
std::optional<LensPrior> make_prior(const CameraState& camera, const CameraCovariance& covariance) {
  const std::array<double, kNumLensTerms> least = {1e-6 * camera.lens_terms()[kF], 1e-4, 1e-4, 1e-7, 1e-7};
  std::array<std::optional<size_t>, kNumLensTerms> index;
  for (int k = 0; k < kNumLensTerms; k++) index[k] = covariance.index_of(kTermNames[k]);
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
  if (tracks.cameras.size() < 2) throw Error("two cameras are needed at least");
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
                  " in the prior rig");
    camera.set_lens(known.lens);
    for (int k = 0; k < kNumLensTerms; k++) sum[k] += camera.lens_terms()[k];
    if (*index < options.prior_covariances.size() && options.prior_covariances[*index])
      scene.lens_priors[i] = make_prior(camera, *options.prior_covariances[*index]);
  }
  if (options.prior) {
    // Lenses that nobody measured: near the nominal ones, all of them off alike.
    for (int k = 0; k < kNumLensTerms; k++) scene.batch.mean[k] = sum[k] / static_cast<double>(tracks.cameras.size());
    scene.batch.width[kF] = 0.1 * scene.batch.mean[kF];
  }
  scene.batch_mean = scene.batch.mean;
  return scene;
}

}  // namespace lf
