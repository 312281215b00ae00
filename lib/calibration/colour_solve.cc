// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/colour_solve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <thread>

#include <ceres/ceres.h>
#include <Eigen/LU>

#include "base/maths.h"
#include "base/text.h"
#include "calibration/costs.h"

namespace lf {
namespace {

// The parameters of a camera. All are 0 for a camera without faults.
enum CameraParameter {
  kExposure = 0,
  kRed = 1,
  kBlue = 2,
  kBlack = 3,
  kGamma = 6,
  kCrosstalk = 7,
  kVignetting = 13,
  kCount = 15
};
using Parameters = std::array<double, kCount>;

constexpr double kBlackUnit = 10;  // levels
// Prior sigmas of the parameters; weak compared with the samples.
constexpr std::array<double, kCount> kPrior{1.0, 0.5, 0.5, 1.0, 1.0, 1.0, 0.2, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5};

// The matrix from scene light to camera light: a gain per row, and crosstalk that preserves greys.
template <typename T>
void own_from_scene(const T* p, T (&out)[3][3]) {
  using std::exp;
  const T gain[3] = {exp(p[kExposure] + p[kRed]), exp(p[kExposure]), exp(p[kExposure] + p[kBlue])};
  for (int row = 0, k = kCrosstalk; row < 3; row++) {
    T others(0);
    for (int column = 0; column < 3; column++)
      if (column != row) {
        out[row][column] = gain[row] * p[k];
        others += p[k++];
      }
    out[row][row] = gain[row] * (1.0 - others);
  }
}

// Versions of decode_gamma() and encode_gamma() for automatic differentiation.
template <typename T>
T power_light(const T& level, const T& gamma) {
  using std::pow;
  const bool below = level < T(0);
  const T v = below ? -level : level;
  const T light = v >= T(kToe) ? pow(v / 255.0, gamma) : v / kToe * pow(T(kToe / 255), gamma);
  return below ? -light : light;
}
template <typename T>
T power_level(const T& light, const T& gamma) {
  using std::pow;
  const bool below = light < T(0);
  const T v = below ? -light : light, toe = pow(T(kToe / 255), gamma);
  const T level = v >= toe ? 255.0 * pow(v, 1.0 / gamma) : v / toe * kToe;
  return below ? -level : level;
}

struct SampleCost {
  ColourSample sample;
  double r2;

  template <typename T>
  bool operator()(const T* camera, const T* patch, T* residual) const {
    using std::exp;
    using std::pow;
    const T share = 1.0 + r2 * (camera[kVignetting] + r2 * camera[kVignetting + 1]);
    if (share < T(0.05)) return false;
    const T factor = pow(share, 1 / kPictureGamma);
    T light[3], own[3][3];
    for (int c = 0; c < 3; c++) light[c] = power_light(T(255.0 * patch[c] * factor), T(kPictureGamma));
    own_from_scene(camera, own);
    const T gamma = kPictureGamma * exp(camera[kGamma]);
    for (int c = 0; c < 3; c++) {
      if (!sample.usable[static_cast<size_t>(c)]) {
        residual[c] = T(0);
        continue;
      }
      // The darkest levels are less certain.
      const double dark = 1.5 * std::max(0.0, 1 - sample.level[c] / 45), sigma = std::hypot(sample.sigma, dark);
      const T sum = own[c][0] * light[0] + own[c][1] * light[1] + own[c][2] * light[2];
      residual[c] = (power_level(sum, gamma) + kBlackUnit * camera[kBlack + c] - sample.level[c]) / sigma;
    }
    return true;
  }
};

// Light of a chart position: brightness, and gradients to the right and downwards.
constexpr int kLight = 3;
constexpr double kSlope = 0.05;
constexpr double kChartSigma = 1;  // levels; charts are neither fully matt nor fully flat

struct ChartCost {
  double u, v;  // -1 to 1 along the chart

  template <typename T>
  bool operator()(const T* patch, const T* light, const T* reflectance, T* residual) const {
    const T factor = light[0] * (1.0 + u * light[1] + v * light[2]);
    for (int c = 0; c < 3; c++) residual[c] = (patch[c] - factor * reflectance[c]) * (255 / kChartSigma);
    return true;
  }
};

struct LightPrior {
  template <typename T>
  bool operator()(const T* light, T* residual) const {
    residual[0] = light[0] - 1.0;  // fixes the ambiguity between a lighter chart and more light
    for (int i = 1; i < kLight; i++) residual[i] = light[i] / kSlope;
    return true;
  }
};

struct PriorCost {
  template <typename T>
  bool operator()(const T* camera, T* residual) const {
    for (int i = 0; i < kCount; i++) residual[i] = camera[i] / kPrior[static_cast<size_t>(i)];
    return true;
  }
};

// Constrains the mean of the cameras to a camera without faults. Vignetting is absolute, and therefore left out.
class MeanCost : public ceres::CostFunction {
 public:
  explicit MeanCost(int cameras) : weight_(1 / (kSigma * cameras)) {
    set_num_residuals(kVignetting);
    mutable_parameter_block_sizes()->assign(static_cast<size_t>(cameras), kCount);
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const size_t n = parameter_block_sizes().size();
    for (int k = 0; k < kVignetting; k++) {
      residuals[k] = 0;
      for (size_t i = 0; i < n; i++) residuals[k] += weight_ * parameters[i][k];
    }
    for (size_t i = 0; jacobians && i < n; i++) {
      if (!jacobians[i]) continue;
      std::fill_n(jacobians[i], kVignetting * kCount, 0.0);
      for (int k = 0; k < kVignetting; k++) jacobians[i][k * kCount + k] = weight_;
    }
    return true;
  }

 private:
  static constexpr double kSigma = 1e-4;
  double weight_;
};

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

ColourModel sound_model(Parameters p, const Camera& camera) {
  const double most = field_of(camera).most();
  ColourModel model = model_of(p);
  for (int i = 0; i < 60 && model_error(model, most); i++) {
    for (double& value : p) value *= 0.9;
    model = model_of(p);
  }
  return model_error(model, most) ? ColourModel() : model;
}

struct ColourFit {
  // One model per camera; cameras without samples have the default model.
  std::vector<ColourModel> models;
  // Logarithm of a camera's exposure relative to the mean. For example, 0.69 is twice the mean exposure.
  std::vector<double> log_exposure;
  std::vector<Parameters> parameters;  // per camera, to start another fit
};

bool is_in(const std::vector<bool>& list, size_t i) { return list.empty() || list[i]; }

// The elimination order, with one group for each vector. Ceres sorts the blocks of a group by address, which would make
// the result differ between runs.
enum EliminationGroup { kColourGroup, kCameraGroup, kLightGroup, kReflectanceGroup };

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
    problem.AddResidualBlock(auto_diff<3, 3, kLight, 3>(ChartCost{(column - wide) / wide, (row - high) / high}),
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
      problem.AddResidualBlock(auto_diff<kLight, kLight>(LightPrior()), nullptr, light.data());
}

// Fits the parameters of all cameras and the colours of all patches in one least-squares problem. Residuals are the
// differences between samples and predicted levels in sigmas, under a Cauchy loss of 2. The patches of a chart have the
// same colours at all positions of the chart, except for one brightness and one linear gradient per position. This
// constrains vignetting.
//
// Colours are relative, so the mean camera is defined to be without faults, except for vignetting. Weak priors fix the
// remaining freedom. The resulting models are valid (model_error()); parameters are reduced if necessary.
//
// `apart` marks cameras that are left out of this mean (may be empty). `patches` marks the patches to use (empty: all).
// `start` is a fit with fewer terms, or null.
ColourFit fit_colours(const Rig& rig, const ColourSamples& samples, const ColourTerms& terms,
                      const std::vector<bool>& apart = {}, const std::vector<bool>& patches = {},
                      const ColourFit* start = nullptr) {
  std::vector<Parameters> cameras(samples.cameras, Parameters{});
  if (start) cameras = start->parameters;
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
  const auto order = std::make_shared<ceres::ParameterBlockOrdering>();
  std::set<CameraIndex> in_use;
  for (const ColourSample& sample : samples.all) {
    if (!is_in(patches, sample.patch) || !known[sample.patch]) continue;
    const double r2 = field_of(rig.cameras[sample.camera]).square(sample.place.x, sample.place.y);
    problem.AddResidualBlock(auto_diff<3, kCount, 3>(SampleCost{sample, r2}), &loss, cameras[sample.camera].data(),
                             colours[sample.patch].data());
    order->AddElementToGroup(colours[sample.patch].data(), kColourGroup);
    in_use.insert(sample.camera);
  }
  const std::vector<int> constant = constant_places(terms);
  std::vector<double*> of_mean;
  for (const CameraIndex camera : in_use) {
    order->AddElementToGroup(cameras[camera].data(), kCameraGroup);
    if (!constant.empty()) problem.SetManifold(cameras[camera].data(), new ceres::SubsetManifold(kCount, constant));
    if (!apart.empty() && apart[camera]) continue;
    problem.AddResidualBlock(auto_diff<kCount, kCount>(PriorCost()), nullptr, cameras[camera].data());
    of_mean.push_back(cameras[camera].data());
  }
  if (!of_mean.empty()) problem.AddResidualBlock(new MeanCost(static_cast<int>(of_mean.size())), nullptr, of_mean);
  const auto on_chart = static_cast<size_t>(samples.chart_columns * samples.chart_rows);
  std::vector<std::array<double, kLight>> lights(on_chart > 0 ? samples.patches / on_chart + 1 : 0, {1, 0, 0});
  std::vector<std::array<double, 3>> reflectances(on_chart);
  if (on_chart > 0) add_chart(samples, problem, *order, colours, lights, reflectances);
  if (!in_use.empty()) {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.linear_solver_ordering = order;
    options.max_num_iterations = 40;
    options.function_tolerance = 1e-6;
    options.num_threads = 1;  // reproducible results: the order of sums depends on the number of threads
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
  }
  ColourFit fit;
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
  return corrected(model, sample.level) * level_factor(vignetting_factor(model, r2));
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

ColourDifferences colour_differences(const Rig& rig, const ColourSamples& samples,
                                     const std::vector<ColourModel>& models, const std::vector<bool>& patches,
                                     const std::vector<bool>& cameras) {
  constexpr double kMost = 12;
  constexpr size_t kPartners = 12;
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

namespace {

constexpr size_t kMinColourSamples = 12;
constexpr size_t kFitSamples = 8000;
// minimum reduction of the RMS on left-out patches for one more term: share, and levels
constexpr double kMinImprovement = 0.03, kMinLevels = 0.05;
constexpr double kStuck = 0.4;  // logarithm of light; an exposure that differs by about half or more

std::string number(double value, int digits) { return format_text("%.*f", digits, value); }

// Every fourth patch is left out, in a fixed selection that is not aligned with the rows of a chart.
bool is_held_out(uint32_t patch) { return (patch * 2654435761u >> 16) % 4 == 0; }

class ColourSolver {
 public:
  ColourSolver(const Rig& rig, const ColourSamples& samples, const std::function<void(const std::string&)>& progress)
      : rig_(rig), samples_(samples), progress_(progress) {
    for (uint32_t i = 0; i < samples.patches; i++) {
      held_out_.push_back(is_held_out(i));
      training_.push_back(!held_out_.back());
    }
    const size_t every = (samples.all.size() + kFitSamples - 1) / kFitSamples;
    for (uint32_t i = 0, n = 0; every > 1 && i < samples.patches; i++)
      if (training_[i] && n++ % every != 0) training_[i] = false;
  }

  ColourSolution run() {
    look_at_cameras();
    find_stuck();
    choose_terms();
    progress("fitting " + solution_.terms.name() + " to all patches");
    const ColourFit fit = fit_colours(rig_, samples_, solution_.terms, stuck_, {}, &best_);
    for (size_t i = 0; i < rig_.cameras.size(); i++)
      solution_.models.push_back(has_samples_[i] ? std::optional(fit.models[i]) : std::nullopt);
    report_cameras();
    report_array();
    return std::move(solution_);
  }

 private:
  void progress(const std::string& step) const {
    if (progress_) progress_(step);
  }

  void find(Finding::Severity severity, const std::string& code, const std::string& text) {
    solution_.findings.push_back({severity, code, text});
  }

  void look_at_cameras() {
    solution_.cameras.resize(rig_.cameras.size());
    std::vector<double> brightest(rig_.cameras.size());
    std::vector<size_t> all(rig_.cameras.size()), clipped(rig_.cameras.size());
    for (const ColourSample& sample : samples_.all) {
      ColourSolution::Camera& camera = solution_.cameras[sample.camera];
      const auto usable = std::ranges::count(sample.usable, true);
      camera.samples += usable > 0;
      all[sample.camera]++;
      clipped[sample.camera] += usable < 3;
      for (int c = 0; c < 3; c++) brightest[sample.camera] = std::max(brightest[sample.camera], sample.level[c]);
    }
    size_t good = 0;
    for (size_t i = 0; i < rig_.cameras.size(); i++) {
      ColourSolution::Camera& camera = solution_.cameras[i];
      if (all[i] > 0) camera.clipped = static_cast<double>(clipped[i]) / static_cast<double>(all[i]);
      has_samples_.push_back(camera.samples >= kMinColourSamples);
      good += has_samples_.back();
      if (has_samples_.back()) continue;
      if (all[i] >= kMinColourSamples)
        find(Finding::Severity::kWarning, brightest[i] < 20 ? "black-camera" : "clipped-camera",
             rig_.cameras[i].label() +
                 (brightest[i] < 20 ? ": is black: is the lens covered, or the exposure far too short?"
                                    : ": all of its samples are clipped: shorten its exposure.") +
                 " No colour model was estimated");
      else
        find(
            Finding::Severity::kWarning, "few-samples",
            rig_.cameras[i].label() + ": only " + std::to_string(camera.samples) +
                " places are also seen by other cameras: show it the chart at more places, closer to the middle of its "
                "image. No colour model was estimated");
    }
    if (good < 2)
      throw Error("comparing colours requires two cameras with common samples: " + std::to_string(good) + " of " +
                  std::to_string(rig_.cameras.size()) +
                  " cameras have enough. Hold the chart close to the cameras, in even light, where all of them see it");
  }

  // A camera with a wrong exposure would bias the mean, so exposures are compared first, by brightness alone.
  void find_stuck() {
    progress("comparing brightness");
    const ColourFit fit = fit_colours(rig_, samples_, {}, {}, training_);
    std::vector<double> exposures, off;
    for (size_t i = 0; i < has_samples_.size(); i++)
      if (has_samples_[i]) exposures.push_back(fit.log_exposure[i]);
    const double middle = median(exposures);
    for (const double e : exposures) off.push_back(std::abs(e - middle));
    const double limit = std::max(kStuck, 4 * 1.4826 * median(off));
    stuck_.assign(has_samples_.size(), false);
    usable_ = has_samples_;
    for (size_t i = 0; i < has_samples_.size(); i++) {
      if (has_samples_[i]) solution_.cameras[i].gain = std::exp((fit.log_exposure[i] - middle) / kPictureGamma);
      if (!has_samples_[i] || std::abs(fit.log_exposure[i] - middle) <= limit) continue;
      solution_.cameras[i].is_stuck = stuck_[i] = true;
      usable_[i] = false;
    }
  }

  ColourDifferences held_out(const std::vector<ColourModel>& models, const std::vector<bool>& cameras) const {
    return colour_differences(rig_, samples_, models, held_out_, cameras);
  }

  void choose_terms() {
    const auto try_terms = [&](const ColourTerms& terms, const ColourFit* start) {
      progress("trying " + terms.name());
      ColourFit fit = fit_colours(rig_, samples_, terms, stuck_, training_, start);
      solution_.trials.push_back({terms, held_out(fit.models, usable_)});
      return fit;
    };
    solution_.before = held_out(std::vector<ColourModel>(rig_.cameras.size()), usable_);
    best_ = try_terms({}, nullptr);
    ColourDifferences best = solution_.trials.back().held_out;
    constexpr bool ColourTerms::*kTerms[] = {&ColourTerms::balance, &ColourTerms::vignetting, &ColourTerms::black,
                                             &ColourTerms::gamma, &ColourTerms::crosstalk};
    for (bool better = true; better;) {
      better = false;
      ColourTerms next = solution_.terms;
      const ColourFit start = best_;
      const double limit = best.rms - std::max(kMinImprovement * best.rms, kMinLevels);
      for (const auto term : kTerms) {
        ColourTerms terms = solution_.terms;
        if (terms.*term) continue;
        terms.*term = true;
        ColourFit fit = try_terms(terms, &start);
        const ColourDifferences& now = solution_.trials.back().held_out;
        if (now.rms >= limit || now.rms >= best.rms) continue;
        better = true;
        best = now;
        next = terms;
        best_ = std::move(fit);
      }
      solution_.terms = next;
    }
    solution_.after = best;
    for (size_t i = 0; i < rig_.cameras.size(); i++) solution_.cameras[i].rms = rms_of(i, best_.models);
  }

  double rms_of(size_t camera, const std::vector<ColourModel>& models) const {
    std::vector<std::array<std::vector<double>, 3>> seen(samples_.patches);
    for (const ColourSample& sample : samples_.all) {
      if (!held_out_[sample.patch] || !usable_[sample.camera] || sample.camera == camera) continue;
      const Vec3 level = corrected_level(rig_.cameras[sample.camera], models[sample.camera], sample);
      for (size_t c = 0; c < 3; c++)
        if (sample.usable[c]) seen[sample.patch][c].push_back(level[static_cast<int>(c)]);
    }
    double squares = 0;
    size_t count = 0;
    for (const ColourSample& sample : samples_.all) {
      if (sample.camera != camera || !held_out_[sample.patch]) continue;
      const Vec3 level = corrected_level(rig_.cameras[camera], models[camera], sample);
      // Clipped samples count here, because clipping is visible in views.
      for (size_t c = 0; c < 3; c++)
        if (!seen[sample.patch][c].empty()) {
          const double d = level[static_cast<int>(c)] - median(seen[sample.patch][c]);
          squares += d * d;
          count++;
        }
    }
    return count == 0 ? 0 : std::sqrt(squares / static_cast<double>(count));
  }

  void report_cameras() {
    std::vector<double> usual;
    for (size_t i = 0; i < usable_.size(); i++)
      if (usable_[i]) usual.push_back(solution_.cameras[i].rms);
    const double others = usual.empty() ? 0 : median(usual);
    for (size_t i = 0; i < rig_.cameras.size(); i++) {
      const ColourSolution::Camera& camera = solution_.cameras[i];
      if (!has_samples_[i]) continue;
      if (camera.is_stuck) {
        const double light = std::pow(camera.gain, kPictureGamma);
        find(Finding::Severity::kWarning, "stuck-exposure",
             rig_.cameras[i].label() + ": its exposure is stuck: it takes " + number(light, 2) +
                 " times the light of the median camera. After correction its levels differ by " +
                 number(camera.rms, 1) + " (typical: " + number(others, 1) + "), " + number(100 * camera.clipped, 0) +
                 " % of its samples are clipped" +
                 (camera.gain < 1 ? ", and its noise is " + number(1 / camera.gain, 1) + " times as strong" : "") +
                 ". Set its exposure to that of the other cameras and calibrate again, or exclude the camera");
      } else if (camera.rms > std::max(3.0, 3 * others)) {
        find(Finding::Severity::kWarning, "other-colours",
             rig_.cameras[i].label() + ": differs by " + number(camera.rms, 1) + " levels after correction (typical: " +
                 number(others, 1) + "): was its view blocked, or is one of its controls still automatic?");
      }
    }
  }

  void report_array() {
    if (solution_.after.pairs < 50)
      find(Finding::Severity::kWarning, "few-patches",
           "only " + std::to_string(solution_.after.pairs) +
               " comparisons were left for testing, so the figures are unreliable: show the chart at more places");
    if (solution_.after.p95 > 3)
      find(Finding::Severity::kWarning, "differences",
           "cameras still differ by " + number(solution_.after.p95, 1) +
               " levels (95th percentile): the light must be even and steady, and only the chart may move");
    if (solution_.after.rms > solution_.before.rms)
      find(Finding::Severity::kWarning, "no-gain",
           "the correction does not reduce the differences: keep the rig without it");
  }

  const Rig& rig_;
  const ColourSamples& samples_;
  const std::function<void(const std::string&)>& progress_;
  std::vector<bool> held_out_, training_;      // per patch
  std::vector<bool> has_samples_, usable_, stuck_;  // per camera; usable_: enough samples, and not stuck
  ColourFit best_;
  ColourSolution solution_;
};

}  // namespace

ColourSolution solve_colours(const Rig& rig, const ColourSamples& samples,
                             const std::function<void(const std::string& step)>& progress) {
  return ColourSolver(rig, samples, progress).run();
}

}  // namespace lf
