// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/colour_checker_finder.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>
#include <opencv2/mcc.hpp>

#include "image/colour_checker.h"

namespace lf {
namespace {

// Of a patch: its border is blurred, and the chart is not found to a pixel.
constexpr double kInner = 0.5;

// The chart's corners in the image, from beside the first patch on, clockwise as it is read; empty: not found.
std::vector<cv::Point2f> corners_of(const cv::Mat& bgr) {
  // What the module looks for is larger than charts are in small images.
  const double scale = std::max(1.0, 640.0 / std::min(bgr.cols, bgr.rows));
  cv::Mat large = bgr;
  if (scale > 1) cv::resize(bgr, large, {}, scale, scale, cv::INTER_LINEAR);
  const cv::Ptr<cv::mcc::CCheckerDetector> detector = cv::mcc::CCheckerDetector::create();
  if (!detector->process(large, cv::mcc::MCC24, 1)) return {};
  const cv::Ptr<cv::mcc::CChecker> chart = detector->getBestColorChecker();
  if (!chart) return {};
  std::vector<cv::Point2f> box = chart->getBox();
  if (box.size() != 4) return {};
  for (cv::Point2f& corner : box) {
    corner.x = static_cast<float>((corner.x + 0.5) / scale - 0.5);
    corner.y = static_cast<float>((corner.y + 0.5) / scale - 0.5);
  }
  return box;
}

// Whether the patches are those of the chart, in their order: a chart that is cut off by the image's edge is found
// turned by a quarter at times. A camera's levels follow those of the chart, whatever its colours (correlation 0.95 and
// more with the faults of scene/colour_faults.h); those of other patches do not.
bool is_read_right(const std::vector<ColourSample>& samples, uint32_t first_patch) {
  constexpr double kLeast = 0.8;
  double products = 0, squares = 0, nominal_squares = 0;
  for (int c = 0; c < 3; c++) {
    double mean = 0, nominal_mean = 0;
    const auto nominal = [&](const ColourSample& sample) { return checker::kSrgb[sample.patch - first_patch][c]; };
    for (const ColourSample& sample : samples) mean += sample.level[c], nominal_mean += nominal(sample);
    mean /= static_cast<double>(samples.size()), nominal_mean /= static_cast<double>(samples.size());
    for (const ColourSample& sample : samples) {
      const double a = sample.level[c] - mean, b = nominal(sample) - nominal_mean;
      products += a * b, squares += a * a, nominal_squares += b * b;
    }
  }
  return products > kLeast * std::sqrt(squares * nominal_squares);
}

}  // namespace

std::vector<ColourSample> find_colour_checker(const Image& rgb, CameraIndex camera, uint32_t first_patch) {
  const cv::Mat from(rgb.height(), rgb.width(), CV_8UC3, const_cast<uint8_t*>(rgb.data().data()));
  cv::Mat bgr;
  cv::cvtColor(from, bgr, cv::COLOR_RGB2BGR);
  std::vector<cv::Point2f> box;
  try {
    box = corners_of(bgr);
  } catch (const cv::Exception&) {
    return {};  // the module does not take every image
  }
  if (box.empty() || cv::norm(box[1] - box[0]) < 60 || cv::contourArea(box) < 60 * 40) return {};
  constexpr auto kWidth = static_cast<float>(checker::kWidth), kHeight = static_cast<float>(checker::kHeight);
  const std::vector<cv::Point2f> corners{{0, 0}, {kWidth, 0}, {kWidth, kHeight}, {0, kHeight}};
  const cv::Mat image_from_chart = cv::getPerspectiveTransform(corners, box);
  std::vector<ColourSample> samples;
  for (int patch = 0; patch < checker::kPatches; patch++) {
    const Vec2 middle = checker::middle(patch);
    std::vector<cv::Point2f> quad;
    for (const Vec2& side : {Vec2(-1, -1), Vec2(1, -1), Vec2(1, 1), Vec2(-1, 1)}) {
      const Vec2 corner = middle + side * (kInner * checker::kSide / 2);
      quad.emplace_back(static_cast<float>(corner.x), static_cast<float>(corner.y));
    }
    cv::perspectiveTransform(quad, quad, image_from_chart);
    std::array<Vec2, 4> at;
    for (size_t i = 0; i < 4; i++) at[i] = {quad[i].x, quad[i].y};
    if (auto sample = sample_quad(rgb, at)) {
      sample->camera = camera;
      sample->patch = first_patch + static_cast<uint32_t>(patch);
      samples.push_back(*sample);
    }
  }
  if (!is_read_right(samples, first_patch)) samples.clear();
  return samples;
}

}  // namespace lf
