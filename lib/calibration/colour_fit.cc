// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/colour_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <thread>

#include <ceres/ceres.h>
#include <Eigen/LU>

#include "base/percentiles.h"
#include "calibration/colour_costs.h"

namespace lf {
namespace {

using namespace colour;

std::vector<int> constant_places(const ColourTerms& terms) {
  std::vector<int> constant;
  const auto fix = [&constant](bool is_free, int first, int count) {
    for (int i = 0; !is_free && i < count; i++) constant.push_back(first + i);
  };
  fix(terms.balance, kRed, 2);
  fix(terms.black, kBlack, 3);
  fix(terms.gamma, kGamma, 1);
  fix(terms.crosstalk, kCrosstalk, 6);
  fix(terms.vignetting, kVignetting, 2);
  return constant;
}

ColourModel model_of(const Parameters& p) {
  ColourModel model;
  double own[3][3];
  own_from_scene(p.data(), own);
  Eigen::Matrix3d matrix;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) matrix(i, j) = own[i][j];
  const Eigen::Matrix3d inverse = matrix.inverse();
  for (int i = 0; i < 3; i++) {
    model.black[i] = kBlackUnit * p[static_cast<size_t>(kBlack + i)];
    for (int j = 0; j < 3; j++) model.matrix[static_cast<size_t>(3 * i + j)] = inverse(i, j);
  }
  model.gamma = kPictureGamma * std::exp(p[kGamma]);
  model.vignetting = {p[kVignetting], p[kVignetting + 1]};
  return model;
}

VignettingField field_of(const Camera& camera) { return {camera.width, camera.height, camera.principal_point()}; }

// The nearest model without a fault on the way from the parameters to none.
ColourModel sound_model(Parameters p, const Camera& camera) {
  const double most = field_of(camera).most();
  ColourModel model = model_of(p);
  for (int i = 0; i < 60 && fault_of(model, most); i++) {
    for (double& value : p) value *= 0.9;
    model = model_of(p);
  }
  return fault_of(model, most) ? ColourModel() : model;
}

bool is_in(const std::vector<bool>& list, size_t i) { return list.empty() || list[i]; }

// Order of elimination. Ceres sorts a group by address, which differs between runs for blocks of several vectors: then
// the last digits of the result differ, too. So each vector has a group of its own.
enum EliminationGroup { kColourGroup, kCameraGroup, kLightGroup, kReflectanceGroup };

// What the places of a chart have in common, for patches that the problem has.
void add_chart(const ColourSamples& samples, ceres::Problem& problem, ceres::ParameterBlockOrdering& order,
               std::vector<std::array<double, 3>>& colours, std::vector<std::array<double, kLight>>& lights,
               std::vector<std::array<double, 3>>& reflectances) {
  const size_t n = reflectances.size();
  const double wide = (samples.chart_columns - 1) / 2.0, high = (samples.chart_rows - 1) / 2.0;
  std::vector<size_t> seen(n);
  for (size_t i = 0; i < colours.size(); i++) {
    if (!problem.HasParameterBlock(colours[i].data())) continue;
    const size_t patch = i % n;
    const auto column = static_cast<double>(patch % static_cast<size_t>(samples.chart_columns)),
               row = static_cast<double>(patch / static_cast<size_t>(samples.chart_columns));
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ChartCost, 3, 3, kLight, 3>(
                                 new ChartCost{(column - wide) / wide, (row - high) / high}),
                             nullptr, colours[i].data(), lights[i / n].data(), reflectances[patch].data());
    order.AddElementToGroup(lights[i / n].data(), kLightGroup);
    order.AddElementToGroup(reflectances[patch].data(), kReflectanceGroup);
    for (size_t c = 0; c < 3; c++) reflectances[patch][c] += colours[i][c];
    seen[patch]++;
  }
  for (size_t i = 0; i < n; i++)
    for (double& value : reflectances[i]) value /= static_cast<double>(std::max<size_t>(seen[i], 1));
  for (std::array<double, kLight>& light : lights)
    if (problem.HasParameterBlock(light.data()))
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<LightPrior, kLight, kLight>(new LightPrior), nullptr,
                               light.data());
}

}  // namespace

std::string ColourTerms::name() const {
  std::vector<std::string> parts{"brightness"};
  if (balance) parts.emplace_back("white balance");
  if (black) parts.emplace_back("black level");
  if (gamma) parts.emplace_back("gamma");
  if (crosstalk) parts.emplace_back("crosstalk");
  if (vignetting) parts.emplace_back("vignetting");
  std::string text = parts[0];
  for (size_t i = 1; i < parts.size(); i++) text += (i + 1 < parts.size() ? ", " : " and ") + parts[i];
  return text;
}

ColourFit fit_colours(const Rig& rig, const ColourSamples& samples, const ColourTerms& terms,
                      const std::vector<bool>& apart, const std::vector<bool>& patches, const ColourFit* start) {
  std::vector<Parameters> cameras(samples.cameras, Parameters{});
  if (start) cameras = start->parameters;
  // A patch begins as what the camera in the middle of those that see it shows.
  std::vector<std::array<std::vector<double>, 3>> seen(samples.patches);
  for (const ColourSample& sample : samples.all)
    for (size_t c = 0; c < 3; c++)
      if (is_in(patches, sample.patch) && sample.usable[c])
        seen[sample.patch][c].push_back(sample.level[static_cast<int>(c)]);
  std::vector<std::array<double, 3>> colours(samples.patches);
  std::vector<bool> known(samples.patches);
  for (size_t i = 0; i < seen.size(); i++) {
    known[i] = true;
    for (size_t c = 0; c < 3; c++) {
      known[i] = known[i] && seen[i][c].size() >= 2;
      colours[i][c] = seen[i][c].empty() ? 0.5 : std::max(median(seen[i][c]), 1.0) / 255;
    }
  }

  ceres::Problem::Options owner;
  owner.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::CauchyLoss loss(2);
  ceres::Problem problem(owner);
  auto* const order = new ceres::ParameterBlockOrdering;
  std::set<CameraIndex> in_use;
  for (const ColourSample& sample : samples.all) {
    if (!is_in(patches, sample.patch) || !known[sample.patch]) continue;
    const double r2 = field_of(rig.cameras[sample.camera]).square(sample.place.x, sample.place.y);
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SampleCost, 3, kCount, 3>(new SampleCost{sample, r2}),
                             &loss, cameras[sample.camera].data(), colours[sample.patch].data());
    order->AddElementToGroup(colours[sample.patch].data(), kColourGroup);
    in_use.insert(sample.camera);
  }
  const std::vector<int> constant = constant_places(terms);
  for (const CameraIndex camera : in_use) {
    order->AddElementToGroup(cameras[camera].data(), kCameraGroup);
    if (!constant.empty()) problem.SetManifold(cameras[camera].data(), new ceres::SubsetManifold(kCount, constant));
    if (apart.empty() || !apart[camera])
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PriorCost, kCount, kCount>(new PriorCost), nullptr,
                               cameras[camera].data());
  }
  std::vector<double*> of_mean;
  for (const CameraIndex camera : in_use)
    if (apart.empty() || !apart[camera]) of_mean.push_back(cameras[camera].data());
  if (!of_mean.empty()) problem.AddResidualBlock(new MeanCost(static_cast<int>(of_mean.size())), nullptr, of_mean);
  const auto on_chart = static_cast<size_t>(samples.chart_columns * samples.chart_rows);
  std::vector<std::array<double, kLight>> lights(on_chart > 0 ? samples.patches / on_chart + 1 : 0, {1, 0, 0});
  std::vector<std::array<double, 3>> reflectances(on_chart);
  if (on_chart > 0) add_chart(samples, problem, *order, colours, lights, reflectances);
  ColourFit fit;
  if (!in_use.empty()) {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.linear_solver_ordering.reset(order);
    options.max_num_iterations = 40;
    options.function_tolerance = 1e-6;
    options.num_threads = 1;  // more threads add in another order each time: the last digits would differ
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
  } else {
    delete order;
  }
  for (size_t i = 0; i < cameras.size(); i++) {
    fit.models.push_back(in_use.contains(static_cast<CameraIndex>(i)) ? sound_model(cameras[i], rig.cameras[i])
                                                                      : ColourModel());
    fit.log_exposure.push_back(cameras[i][kExposure]);
  }
  fit.parameters = std::move(cameras);
  return fit;
}

Vec3 corrected_level(const Camera& camera, const ColourModel& model, const ColourSample& sample) {
  const double r2 = field_of(camera).square(sample.place.x, sample.place.y);
  return corrected(model, sample.level) * level_factor(light_share(model, r2));
}

ColourDifferences colour_differences(const Rig& rig, const ColourSamples& samples,
                                     const std::vector<ColourModel>& models, const std::vector<bool>& patches,
                                     const std::vector<bool>& cameras) {
  constexpr double kMost = 12;
  constexpr size_t kPartners = 12;  // that a sample is compared with
  std::vector<std::vector<std::pair<Vec3, std::array<bool, 3>>>> of_patch(samples.patches);
  for (const ColourSample& sample : samples.all)
    if (is_in(patches, sample.patch) && is_in(cameras, sample.camera))
      of_patch[sample.patch].emplace_back(corrected_level(rig.cameras[sample.camera], models[sample.camera], sample),
                                          sample.usable);
  std::vector<double> differences;
  double squares = 0;
  for (const auto& seen : of_patch)
    for (size_t i = 0; i < seen.size(); i++)
      for (size_t k = 1; k <= std::min(kPartners, seen.size() - 1); k++) {
        const size_t j = (i + 1 + (k - 1) * (seen.size() - 1) / std::min(kPartners, seen.size() - 1)) % seen.size();
        for (size_t c = 0; c < 3; c++) {
          if (j == i || !seen[i].second[c] || !seen[j].second[c]) continue;
          const double d = std::abs(seen[i].first[static_cast<int>(c)] - seen[j].first[static_cast<int>(c)]);
          differences.push_back(d);
          squares += std::min(d, kMost) * std::min(d, kMost);
        }
      }
  ColourDifferences out;
  out.pairs = differences.size();
  if (differences.empty()) return out;
  out.rms = std::sqrt(squares / static_cast<double>(differences.size()));
  std::ranges::sort(differences);
  out.median = differences[differences.size() / 2];
  out.p95 = differences[differences.size() * 95 / 100];
  return out;
}

}  // namespace lf
