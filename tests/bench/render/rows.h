// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "bench/render/methods.h"

namespace lf::bench {

// One setting in one situation. What is not known is NaN.
struct Row {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  Setting setting;
  SceneOptions scene;
  double ns_per_output_pixel = kUnknown;
  double bytes_per_view = kUnknown;
  double max_error = kUnknown, psnr_reference_db = kUnknown;  // against exact arithmetic on the same camera images
  double psnr_truth_db = kUnknown, ssim_truth = kUnknown;     // against what a camera in the view's place would see
  double ratio_to_opencv = kUnknown;  // how many times faster than the fastest baseline with the same codec and quality
  bool pareto = false;                // see mark_pareto()

  int width() const { return scene.array.width; }
  int height() const { return scene.array.height; }
  double pixels() const { return static_cast<double>(width()) * height(); }
  double fps() const { return 1e9 / (ns_per_output_pixel * pixels()); }
  bool is_ours() const { return setting.renderer.rfind("opencv", 0) != 0; }
};

// "simd i420 jpeg 90": what differs from what goes without saying.
std::string label(const Setting& setting);
// "natural, 64 cameras, 640x480, ..."
std::string label(const SceneOptions& scene);

// Rows of one situation with as many threads: marks those that no other beats in time, error against the reference and
// bytes at once. Times that are nearer to each other than they can be measured (1 %) count as equal.
void mark_pareto(std::vector<Row>& rows);

void print_table(const std::vector<Row>& rows);
// The default settings, and the rows that are Pareto points but not default.
void print_pareto(const std::vector<Row>& rows);
std::string to_json(const std::vector<Row>& rows);

// The ratios that are promised of the default settings, beside their goals, as far as `rows` tell.
void print_acceptance(const std::vector<Row>& rows);

// Throws Error, saying what to install, if there is no gnuplot.
void require_gnuplot();

// time-error.png, bytes-error.png and scaling.png in `folder`, each with the script that draws it beside it. What the
// rows don't tell (a sweep of one value) is left out.
void write_plots(const std::vector<Row>& rows, const std::string& folder);

}  // namespace lf::bench
