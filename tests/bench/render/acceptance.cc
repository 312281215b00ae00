// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/acceptance.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

namespace lf::bench {
namespace {

constexpr int kSizes = 4, kWidths[kSizes] = {320, 640, 1280, 1920};

// Rows of ours that can stand for a promise: one thread, one view.
struct Which {
  std::string codec;  // raw or jpeg
  int cameras = 64;
  bool distortion = true;
  std::string content = "natural";
};

bool matches(const Row& row, const Which& which, int width) {
  const Setting& s = row.setting;
  return row.is_ours() && row.width() == width && row.scene.content == which.content && row.scene.views == 1 &&
         row.scene.array.cameras == which.cameras && row.scene.array.distortion == which.distortion && s.threads == 1 &&
         s.codec.rfind(which.codec, 0) == 0 && (which.codec == "raw" || s.quality == 90);
}

// The fastest of the defaults that match; of all that match where none is a default.
const Row* find(const std::vector<Row>& rows, const Which& which, int width) {
  const Row* best = nullptr;
  for (const Row& row : rows) {
    if (!matches(row, which, width)) continue;
    const auto rank = [](const Row& r) { return std::pair(!r.setting.is_default, r.ns_per_output_pixel); };
    if (!best || rank(row) < rank(*best)) best = &row;
  }
  return best;
}

using Figure = std::function<double(int width)>;

// `goal`: one each size; `at_least`: else at most.
void print_line(const char* what, const Figure& figure, const double (&goal)[kSizes], bool at_least) {
  std::printf("%-58s", what);
  bool met = true, known = true;
  for (int i = 0; i < kSizes; i++) {
    const double value = figure(kWidths[i]);
    if (std::isnan(value)) {
      std::printf("       - / %-4g", goal[i]);
      known = false;
      continue;
    }
    met &= at_least ? value >= goal[i] : value <= goal[i];
    std::printf(" %7.2f / %-4g", value, goal[i]);
  }
  std::printf(" %s\n", !met ? "NOT met" : known ? "met" : "-");
}

// What that costs in errors: the worst of the rows that match any of `all`.
void print_errors(const std::vector<Row>& rows, const std::vector<Which>& all) {
  std::printf("%-58s", "  max error of 255, PSNR in dB");
  for (const int width : kWidths) {
    double error = Row::kUnknown, psnr = Row::kUnknown;
    for (const Which& which : all)
      if (const Row* row = find(rows, which, width)) {
        error = std::fmax(error, row->max_error);  // both ignore NaN
        psnr = std::fmin(psnr, row->psnr_reference_db);
      }
    if (std::isnan(error))
      std::printf(" %6s, %-6s", "-", "-");
    else
      std::printf(" %6.2f, %-6.2f", error, psnr);
  }
  std::printf("\n");
}

}  // namespace

void print_acceptance(const std::vector<Row>& rows) {
  const auto value = [&](const Which& which, double Row::*field) {
    return [&rows, which, field](int width) {
      const Row* row = find(rows, which, width);
      return row ? row->*field : Row::kUnknown;
    };
  };
  const auto quotient = [&](const Which& a, const Which& b) {
    return [&rows, a, b](int width) {
      const Row *over = find(rows, a, width), *under = find(rows, b, width);
      return over && under ? over->ns_per_output_pixel / under->ns_per_output_pixel : Row::kUnknown;
    };
  };
  // The worst of what was drawn for errors and of the natural scene.
  const auto worst = [&](double Row::*field, bool least) {
    return [&rows, field, least](int width) {
      double result = Row::kUnknown;
      for (const char* content : {"natural", "checkerboard"})
        if (const Row* row = find(rows, {"raw", 64, true, content}, width))
          result = std::isnan(result) ? row->*field
                   : least            ? std::min(result, row->*field)
                                      : std::max(result, row->*field);
      return result;
    };
  };
  std::printf("\n%-58s  320x240        640x480        1280x720       1920x1080\n", "promised (shown / goal)");
  print_line("64 cameras, raw: times faster than OpenCV", value({"raw"}, &Row::ratio_to_opencv), {6, 7, 8, 8}, true);
  print_line("  max error of 255, natural and checkerboard", worst(&Row::max_error, false), {2, 2, 2, 2}, false);
  print_line("  PSNR against exact arithmetic, dB", worst(&Row::psnr_reference_db, true), {50, 50, 50, 50}, true);
  const Which raw{"raw"}, jpeg{"jpeg"};
  const auto with = [](Which which, int cameras) {
    which.cameras = cameras;
    return which;
  };
  print_line("JPEG both ways", value(jpeg, &Row::ratio_to_opencv), {4, 4, 4, 4}, true);
  print_errors(rows, {jpeg});
  print_line("cost of 256 against 16 cameras, JPEG", quotient(with(jpeg, 256), with(jpeg, 16)),
             {1.25, 1.25, 1.25, 1.25}, false);
  print_errors(rows, {with(jpeg, 256), with(jpeg, 16)});
  const Which undistorted{"raw", 64, false};
  print_line("distortion on against off, raw", quotient(raw, undistorted), {1.05, 1.05, 1.05, 1.05}, false);
  print_errors(rows, {raw, undistorted});
}

}  // namespace lf::bench
