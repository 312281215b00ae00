// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/colour_solve.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "base/percentiles.h"

namespace lf {
namespace {

constexpr size_t kLeastColourSamples = 12;                        // of a camera
constexpr size_t kFitSamples = 8000;                        // that terms are chosen by
constexpr double kLeastBetter = 0.03, kLeastLevels = 0.05;  // of the held-out differences, for one more term
constexpr double kStuck = 0.4;  // logarithm of light: a camera's exposure is another one from a half more on

std::string name_of(const Camera& camera) {
  return "camera " + std::to_string(camera.id) + (camera.name.empty() ? "" : " (" + camera.name + ")");
}

std::string number(double value, int digits) { return format_text("%.*f", digits, value); }

// The same patches on every machine: every fourth, but not in step with the rows of a chart.
bool is_held_out(uint32_t patch) { return (patch * 2654435761u >> 16) % 4 == 0; }

class ColourSolver {
 public:
  ColourSolver(const Rig& rig, const ColourSamples& samples, const ColourSolveOptions& options)
      : rig_(rig), samples_(samples), options_(options) {
    for (uint32_t i = 0; i < samples.patches; i++) {
      held_out_.push_back(is_held_out(i));
      training_.push_back(!held_out_.back());
    }
    // Where there are more samples than a choice needs some patches are left to the last fit.
    const size_t every = (samples.all.size() + kFitSamples - 1) / kFitSamples;
    for (uint32_t i = 0, n = 0; every > 1 && i < samples.patches; i++)
      if (training_[i] && n++ % every != 0) training_[i] = false;
  }

  ColourSolution run() {
    look_at_cameras();
    find_stuck();
    choose_terms();
    progress("fitting " + solution_.terms.name() + " to all");
    const ColourFit fit = fit_colours(rig_, samples_, solution_.terms, apart_, {}, &best_);
    for (size_t i = 0; i < rig_.cameras.size(); i++)
      solution_.models.push_back(enough_[i] ? std::optional(fit.models[i]) : std::nullopt);
    tell_of_cameras();
    tell_of_all();
    return std::move(solution_);
  }

 private:
  void progress(const std::string& step) const {
    if (options_.progress) options_.progress(step);
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
      enough_.push_back(camera.samples >= kLeastColourSamples);
      good += enough_.back();
      if (enough_.back()) continue;
      if (all[i] >= kLeastColourSamples)
        find(Finding::Severity::kWarning, brightest[i] < 20 ? "black-camera" : "clipped-camera",
             name_of(rig_.cameras[i]) +
                 (brightest[i] < 20 ? ": is black: is its lens covered, or its exposure far too short?"
                                    : ": is clipped wherever it was looked at: shorten its exposure") +
                 " It gets no colour");
      else
        find(Finding::Severity::kWarning, "few-samples",
             name_of(rig_.cameras[i]) + ": only " + std::to_string(camera.samples) +
                 " places are seen that others see, too: show it the chart at more places, nearer to where it looks. "
                 "It gets no colour");
    }
    if (good < 2)
      throw Error("colours can only be compared where two cameras or more see the same: " + std::to_string(good) +
                  " of " + std::to_string(rig_.cameras.size()) +
                  " cameras see enough. Show the chart where all of them see it, large, in even light");
  }

  // An exposure that is not the others' spoils the mean: it is found first, by brightness alone.
  void find_stuck() {
    progress("comparing brightness");
    const ColourFit fit = fit_colours(rig_, samples_, {}, {}, training_);
    std::vector<double> exposures, off;
    for (size_t i = 0; i < enough_.size(); i++)
      if (enough_[i]) exposures.push_back(fit.log_exposure[i]);
    const double middle = median(exposures);
    for (const double e : exposures) off.push_back(std::abs(e - middle));
    const double limit = std::max(kStuck, 4 * 1.4826 * median(off));
    apart_.assign(enough_.size(), false);
    others_ = enough_;
    for (size_t i = 0; i < enough_.size(); i++) {
      if (enough_[i]) solution_.cameras[i].gain = std::exp((fit.log_exposure[i] - middle) / kPictureGamma);
      if (!enough_[i] || std::abs(fit.log_exposure[i] - middle) <= limit) continue;
      solution_.cameras[i].is_stuck = apart_[i] = true;
      others_[i] = false;
    }
  }

  ColourDifferences held_out(const std::vector<ColourModel>& models, const std::vector<bool>& cameras) const {
    return colour_differences(rig_, samples_, models, held_out_, cameras);
  }

  void choose_terms() {
    const auto try_terms = [&](const ColourTerms& terms, const ColourFit* start) {
      progress("trying " + terms.name());
      ColourFit fit = fit_colours(rig_, samples_, terms, apart_, training_, start);
      solution_.trials.push_back({terms, held_out(fit.models, others_)});
      return fit;
    };
    solution_.before = held_out(std::vector<ColourModel>(rig_.cameras.size()), others_);
    best_ = try_terms({}, nullptr);
    ColourDifferences best = solution_.trials.back().held_out;
    constexpr bool ColourTerms::*kTerms[] = {&ColourTerms::balance, &ColourTerms::vignetting, &ColourTerms::black,
                                             &ColourTerms::gamma, &ColourTerms::crosstalk};
    for (bool better = true; better;) {
      better = false;
      ColourTerms next = solution_.terms;
      const ColourFit start = best_;
      const double limit = best.rms - std::max(kLeastBetter * best.rms, kLeastLevels);
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

  // Of a camera's held-out samples, from the mean of the others' that see the same.
  double rms_of(size_t camera, const std::vector<ColourModel>& models) const {
    std::vector<std::array<std::vector<double>, 3>> seen(samples_.patches);
    for (const ColourSample& sample : samples_.all) {
      if (!held_out_[sample.patch] || !others_[sample.camera] || sample.camera == camera) continue;
      const Vec3 level = corrected_level(rig_.cameras[sample.camera], models[sample.camera], sample);
      for (size_t c = 0; c < 3; c++)
        if (sample.usable[c]) seen[sample.patch][c].push_back(level[static_cast<int>(c)]);
    }
    double squares = 0;
    size_t count = 0;
    for (const ColourSample& sample : samples_.all) {
      if (sample.camera != camera || !held_out_[sample.patch]) continue;
      const Vec3 level = corrected_level(rig_.cameras[camera], models[camera], sample);
      // What is clipped counts here: it is shown.
      for (size_t c = 0; c < 3; c++)
        if (!seen[sample.patch][c].empty()) {
          const double d = level[static_cast<int>(c)] - median(seen[sample.patch][c]);
          squares += d * d;
          count++;
        }
    }
    return count == 0 ? 0 : std::sqrt(squares / static_cast<double>(count));
  }

  void tell_of_cameras() {
    std::vector<double> usual;
    for (size_t i = 0; i < others_.size(); i++)
      if (others_[i]) usual.push_back(solution_.cameras[i].rms);
    const double others = usual.empty() ? 0 : median(usual);
    for (size_t i = 0; i < rig_.cameras.size(); i++) {
      const ColourSolution::Camera& camera = solution_.cameras[i];
      if (!enough_[i]) continue;
      if (camera.is_stuck) {
        const double light = std::pow(camera.gain, kPictureGamma);
        find(Finding::Severity::kWarning, "stuck-exposure",
             name_of(rig_.cameras[i]) + ": its exposure is stuck: it takes " + number(light, 2) +
                 " times the light of the others. Corrected, its levels are " + number(camera.rms, 1) +
                 " off theirs (the others': " + number(others, 1) + "), " + number(100 * camera.clipped, 0) +
                 " % of what it sees is clipped and lost" +
                 (camera.gain < 1 ? ", and its noise is " + number(1 / camera.gain, 1) + " times as strong" : "") +
                 ". Set its exposure by hand, as the others', and measure again; or leave it out of service");
      } else if (camera.rms > std::max(3.0, 3 * others)) {
        find(Finding::Severity::kWarning, "other-colours",
             name_of(rig_.cameras[i]) + ": stays " + number(camera.rms, 1) + " levels off the others (theirs: " +
                 number(others, 1) + "): was something in its way, or is a control of it still automatic?");
      }
    }
  }

  void tell_of_all() {
    if (solution_.after.pairs < 50)
      find(Finding::Severity::kWarning, "few-patches",
           "only " + std::to_string(solution_.after.pairs) +
               " comparisons were held out: show the chart at more places for the figures to mean something");
    if (solution_.after.p95 > 3)
      find(Finding::Severity::kWarning, "differences",
           "cameras still differ by " + number(solution_.after.p95, 1) +
               " levels at one place of 20: is the light even and steady, and nothing but the chart moving?");
    if (solution_.after.rms > solution_.before.rms)
      find(Finding::Severity::kWarning, "no-gain", "the cameras were as alike before: leave them as they are");
  }

  const Rig& rig_;
  const ColourSamples& samples_;
  const ColourSolveOptions& options_;
  std::vector<bool> held_out_, training_;      // of patches
  std::vector<bool> enough_, others_, apart_;  // of cameras; others: enough is seen of them and they are not stuck
  ColourFit best_;                             // to the training patches, by the terms that were taken
  ColourSolution solution_;
};

}  // namespace

ColourSolution solve_colours(const Rig& rig, const ColourSamples& samples, const ColourSolveOptions& options) {
  return ColourSolver(rig, samples, options).run();
}

}  // namespace lf
