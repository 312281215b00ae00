// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/intrinsics.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "base/percentiles.h"

namespace lf {
namespace {

// A view is bad whose error is this many times the median: good ones differ by half (blur, distance), a wrong corner
// or a bent board shows as several times.
constexpr double kBadView = 3;
constexpr size_t kLeastViews = 3;
constexpr size_t kFolds = 4;     // views are held out a quarter at a time
constexpr double kModelGain = 0.995;  // of the held-out error that a larger model has to reach
// Above these standard deviations a lens is not calibrated, however small the residuals are.
constexpr double kMaxFocalDeviation = 0.01;   // of the focal length
constexpr double kMaxCentreDeviation = 0.01;  // of the image's width

// Every view is seen by a fit to views without it.
double cross_validate(const std::vector<BoardView>& views, const Checkerboard& board, int width, int height,
                      const ZhangModel& model) {
  const size_t folds = std::min(kFolds, views.size());
  if (views.size() - (views.size() + folds - 1) / folds < kLeastViews) return NAN;
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

// Both must speak for the other model: BIC guards against chance, held-out views against what BIC takes for noise.
bool is_better(const IntrinsicsResult::Model& a, const IntrinsicsResult::Model& than) {
  return a.bic < than.bic && !(a.held_out_rms > kModelGain * than.held_out_rms);
}

std::vector<std::string> names_of(LensModel model) {
  std::vector<std::string> names = {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"};
  if (lens_model_num_focal(model) == 1) names = {"f", "cx", "cy", "k1", "k2"};
  names.resize(lens_model_num_params(model));
  return names;
}

std::string percent(double part) { return format_text("%.2g %%", 100 * part); }

}  // namespace

IntrinsicsResult calibrate_intrinsics(const std::vector<BoardView>& views, const Checkerboard& board, int width,
                                      int height, const IntrinsicsOptions& options) {
  const auto step = [&](const std::string& what) {
    if (options.progress) options.progress(what);
  };
  IntrinsicsResult result;
  for (const BoardView& view : views) result.views.push_back({view.name});

  // Bad views first, with a lens that can bend: they would speak for any model that gives way to them.
  step("looking for bad views");
  const ZhangModel first{LensModel::kRadial, false};
  std::vector<size_t> used(views.size());
  for (size_t i = 0; i < used.size(); i++) used[i] = i;
  std::vector<BoardView> good = views;
  for (;;) {
    const ZhangFit fit = fit_zhang(good, board, width, height, first);
    const auto worst = std::max_element(fit.view_rms.begin(), fit.view_rms.end()) - fit.view_rms.begin();
    if (good.size() == kLeastViews || fit.view_rms[worst] <= kBadView * median(fit.view_rms)) break;
    result.views[used[worst]].used = false;
    result.views[used[worst]].rms = fit.view_rms[worst];
    good.erase(good.begin() + worst);
    used.erase(used.begin() + worst);
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
    } catch (const Error&) {  // this model needs more than the views have
    }
  };
  // The lens on the board as it should be, then the board: all pairs would take several times as long.
  const bool must_be_free = options.free_board.value_or(false);
  for (const LensModel lens : kLenses)
    if (!options.lens || *options.lens == lens) consider({lens, must_be_free});
  if (options.lens == LensModel::kPinhole) consider({*options.lens, must_be_free});
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
                              " of the width): show the "
                              "board upright and turned by 90 degrees, in all corners");
  return result;
}

}  // namespace lf
