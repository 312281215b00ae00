// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "bench/render/methods.h"

namespace lf::bench {

// One setting in one situation. Unknown values are NaN.
struct Row {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  Setting setting;
  SceneOptions scene;
  double ns_per_output_pixel = kUnknown;
  double bytes_per_view = kUnknown;
  double max_error = kUnknown, psnr_reference_db = kUnknown;  // against exact arithmetic on the same camera images
  double psnr_truth_db = kUnknown, ssim_truth = kUnknown;     // against a camera at the viewpoint
  double ratio_to_opencv = kUnknown;  // speed relative to the fastest baseline with the same codec and quality
  bool pareto = false;                // see mark_pareto()

  int width() const { return scene.array.width; }
  int height() const { return scene.array.height; }
  double pixels() const { return static_cast<double>(width()) * height(); }
  double fps() const { return 1e9 / (ns_per_output_pixel * pixels()); }
  bool is_ours() const { return setting.renderer.rfind("opencv", 0) != 0; }
};

// "simd i420 jpeg 90": only values that differ from the defaults.
std::string label(const Setting& setting);
// "natural, 64 cameras, 640x480, ..."
std::string label(const SceneOptions& scene);

// Marks the rows that no row of the same situation and number of threads beats in time, error against the reference and
// bytes together. Times within the measurement precision (1 %) count as equal.
void mark_pareto(std::vector<Row>& rows);

void print_table(const std::vector<Row>& rows);
// Prints the default settings, and non-default Pareto points.
void print_pareto(const std::vector<Row>& rows);
std::string to_json(const std::vector<Row>& rows);

// Prints the ratios with stated goals for the default settings, if `rows` contain the data.
void print_acceptance(const std::vector<Row>& rows);

// Throws Error with the package to install if gnuplot is missing.
void require_gnuplot();

// Writes time-error.png, bytes-error.png and scaling.png with their gnuplot scripts to `folder`. Omits charts without
// data (a sweep of one value).
void write_plots(const std::vector<Row>& rows, const std::string& folder);

}  // namespace lf::bench
