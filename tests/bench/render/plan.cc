// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/plan.h"

#include <thread>

namespace lf::bench {
namespace {

using Size = std::pair<int, int>;

class Plan {
 public:
  explicit Plan(const PlanOptions& options) : options_(options) {
    methods_.qualities = {90};
    methods_.threads = {1};
    if (options.full) {
      methods_.qualities = {50, 60, 70, 80, 85, 90, 95};
      methods_.all = true;
    }
    if (options.full || options.acceptance) methods_.threads = {1, 2};
    if (options.full)
      for (int n = 4; n <= static_cast<int>(std::thread::hardware_concurrency()); n *= 2) methods_.threads.push_back(n);
    if (!options.qualities.empty()) methods_.qualities = options.qualities;
    if (!options.threads.empty()) methods_.threads = options.threads;
    plain_ = methods_;
    plain_.qualities = {methods_.qualities.size() > 1 ? 90 : methods_.qualities.front()};
    plain_.threads = {methods_.threads.front()};
    plain_.all = false;
  }

  std::vector<Configuration> make() {
    const std::vector<int> cameras = options_.cameras.empty() ? std::vector<int>{64} : options_.cameras;
    for (const int n : cameras)
      for (const Size& size : options_.sizes) {
        add(size, n, methods_);
        if (size == errors_at() || options_.acceptance || options_.full)
          add(size, n, on_one_thread(options_.full || size == errors_at() ? methods_ : plain_)).array.distortion =
              false;
        add_errors(size, n);
      }
    const auto also = [&](std::vector<int> counts, const std::vector<Size>& sizes) {
      if (!options_.cameras.empty()) return;
      for (const int n : counts)
        for (const Size& size : sizes) add(size, n, plain_).most_filmed_pixels = kFewPixels;
    };
    if (options_.full) {
      also({4, 16, 256, 1024}, options_.sizes);
      for (const int views : {2, 4, 8}) {
        SceneOptions& scene = add(errors_at(), cameras.front(), plain_);
        scene.views = views;
        scene.most_filmed_pixels = kFewPixels;
      }
    } else if (options_.acceptance) {
      also({16, 256}, options_.sizes);
    }
    return std::move(plan_);
  }

 private:
  // Where only time counts.
  static constexpr double kFewPixels = 8e6;

  // OpenCV's baseline has no distortion: one size without shows its errors.
  Size errors_at() const { return options_.sizes.size() > 1 ? options_.sizes[1] : options_.sizes[0]; }

  SceneOptions& add(const Size& size, int cameras, const MethodOptions& methods) {
    SceneOptions scene;
    scene.array.cameras = cameras;
    scene.array.width = size.first;
    scene.array.height = size.second;
    plan_.push_back({scene, methods, {options_.repeats, options_.full ? 10.0 : 6.0}});
    return plan_.back().scene;
  }

  // Where threads change nothing that is shown.
  static MethodOptions on_one_thread(MethodOptions methods) {
    methods.threads.resize(1);
    return methods;
  }

  void add_errors(const Size& size, int cameras) {
    for (const bool distortion : {true, false}) {
      if (!distortion && size != errors_at()) continue;
      SceneOptions& scene = add(size, cameras, on_one_thread(methods_));
      scene.content = "checkerboard";
      scene.array.distortion = distortion;
      plan_.back().timing.repeats = 1;
    }
  }

  const PlanOptions& options_;
  MethodOptions methods_, plain_;
  std::vector<Configuration> plan_;
};

}  // namespace

std::vector<Configuration> make_plan(const PlanOptions& options) { return Plan(options).make(); }

}  // namespace lf::bench
