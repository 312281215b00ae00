// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/measure.h"

#include <algorithm>
#include <cmath>

#include "quality/quality.h"
#include "reference/exact_quality.h"

namespace lf::bench {

double seconds(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

namespace {

// One method for every view of the scene.
class Runner {
 public:
  Runner(const Scene& scene, const MethodKind& kind)
      : clock_(kind.setting.threads > 1 ? CLOCK_MONOTONIC : CLOCK_THREAD_CPUTIME_ID) {
    for (const View& view : scene.views()) methods_.push_back(kind.make(scene, view));
  }
  // A turn is a few renderings in a row, so that what others left in the caches counts once.
  void take_turn() {
    constexpr int kInARow = 3;
    constexpr double kLong = 0.05;  // seconds: caches don't matter to it
    for (int i = 0; i < kInARow; i++) {
      const double start = seconds(clock_);
      for (const auto& method : methods_) method->render();
      const double taken = seconds(clock_) - start;
      best_ = std::min(best_, taken);
      if (taken > kLong) break;
    }
  }
  double best() const { return best_; }
  double bytes_per_view() const {
    double sum = 0;
    for (const auto& method : methods_) sum += static_cast<double>(method->bytes());
    return sum / static_cast<double>(methods_.size());
  }
  Image picture() const { return methods_.front()->picture(); }

 private:
  const clockid_t clock_;
  std::vector<std::unique_ptr<Method>> methods_;
  double best_ = INFINITY;
};

void judge(const Scene& scene, const Image& picture, Row& row) {
  if (scene.options().array.distortion && !row.setting.any_lens) return;
  const FloatStill& exact = scene.exact(picture.family());
  const ExactQuality error = compare(picture, exact);
  row.max_error = error.max_error;
  row.psnr_reference_db = error.psnr_db;
  if (!scene.truth()) return;
  const bool i420 = picture.family() == PixelFamily::kI420;
  const Quality quality = compare(i420 ? to_rgb(picture) : picture, *scene.truth(), exact.coverage());
  row.psnr_truth_db = quality.psnr_db;
  row.ssim_truth = quality.ssim;
}

void compare_with_baselines(std::vector<Row>& rows) {
  for (Row& row : rows) {
    double baseline = INFINITY;
    for (const Row& other : rows)
      if (other.setting.is_baseline && other.setting.quality == row.setting.quality)
        baseline = std::min(baseline, other.ns_per_output_pixel);
    if (std::isfinite(baseline)) row.ratio_to_opencv = baseline / row.ns_per_output_pixel;
  }
}

}  // namespace

std::vector<Row> measure(const Scene& scene, const std::vector<MethodKind>& kinds, const Timing& timing) {
  std::vector<Row> rows;
  std::vector<Runner> runners;
  for (const MethodKind& kind : kinds) {
    runners.emplace_back(scene, kind);
    runners.back().take_turn();
    rows.push_back({kind.setting, scene.options()});
    judge(scene, runners.back().picture(), rows.back());
  }
  const double start = seconds(CLOCK_MONOTONIC);
  for (int turn = 1;
       timing.repeats > 0 ? turn < timing.repeats : turn < 3 || seconds(CLOCK_MONOTONIC) - start < timing.seconds;
       turn++)
    for (Runner& runner : runners) runner.take_turn();
  for (size_t i = 0; i < rows.size(); i++) {
    rows[i].ns_per_output_pixel = 1e9 * runners[i].best() / (rows[i].pixels() * scene.options().views);
    rows[i].bytes_per_view = runners[i].bytes_per_view();
  }
  compare_with_baselines(rows);
  mark_pareto(rows);
  return rows;
}

}  // namespace lf::bench
