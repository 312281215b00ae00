// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/colour_checker_finder.h"

#include <algorithm>
#include <cmath>
#include <span>

#include <opencv2/imgproc.hpp>
#include <opencv2/mcc.hpp>

#include "base/percentiles.h"
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

// How well levels follow those of the chart, patch by patch: the correlation of the channel where it is the least,
// since each may have a gain of its own.
double likeness(std::span<const ColourSample> chart) {
  const auto n = static_cast<double>(chart.size());
  double least = 1;
  for (int c = 0; c < 3; c++) {
    const auto nominal = [&](const ColourSample& sample) {
      return checker::kSrgb[sample.patch % checker::kPatches][c];
    };
    double mean = 0, nominal_mean = 0, products = 0, squares = 0, nominal_squares = 0;
    for (const ColourSample& sample : chart) mean += sample.level[c] / n, nominal_mean += nominal(sample) / n;
    for (const ColourSample& sample : chart) {
      const double a = sample.level[c] - mean, b = nominal(sample) - nominal_mean;
      products += a * b, squares += a * a, nominal_squares += b * b;
    }
    least = std::min(least, squares > 0 ? products / std::sqrt(squares * nominal_squares) : 0);
  }
  return least;
}

// A chart that the image's edge cuts off is found turned by a quarter at times, or a part of a patch beside its place.
constexpr double kLeastLikeness = 0.8;

}  // namespace

std::vector<ColourSample> find_colour_checker(const Image& rgb, CameraIndex camera, uint32_t first_patch) {
  const cv::Mat from(rgb.height(), rgb.width(), CV_8UC3, const_cast<uint8_t*>(rgb.data().data()));
  cv::Mat bgr;
  cv::cvtColor(from, bgr, cv::COLOR_RGB2BGR);
  // The search draws random numbers. Without a seed the result would depend on the images before this one.
  cv::setRNGSeed(1);
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
  if (likeness(samples) < kLeastLikeness) samples.clear();
  return samples;
}

void leave_out_misread_charts(std::vector<ColourSample>& samples) {
  // With the faults of scene/colour_faults.h charts of one camera are alike to 0.01, and those that are read beside
  // their places are less alike by 0.03 and more.
  constexpr double kLess = 0.02;
  const auto chart_of = [](const ColourSample& sample) { return sample.patch / checker::kPatches; };
  std::vector<double> all, likenesses;  // of each chart; of the chart that each sample is of
  for (auto begin = samples.begin(), end = begin; begin != samples.end(); begin = end) {
    end = std::find_if(begin, samples.end(), [&](const ColourSample& s) { return chart_of(s) != chart_of(*begin); });
    all.push_back(likeness({begin, end}));
    likenesses.resize(static_cast<size_t>(end - samples.begin()), all.back());
  }
  if (all.size() < 3) return;
  const double usual = median(all);
  size_t i = 0;
  std::erase_if(samples, [&](const ColourSample&) { return likenesses[i++] < usual - kLess; });
}

}  // namespace lf
