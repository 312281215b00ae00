// SPDX-License-Identifier: LGPL-2.1-or-later
#include "depth/camera_depth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "depth/matching_cost.h"

namespace lf {

namespace {

// Depths agree if they differ by less than this number of steps of the range.
constexpr double kAgreement = 1.5;
// The guided filter: radius of its windows, pixels, and the variance of luma that counts as an edge.
constexpr int kRadius = 2;
constexpr float kEdgeVariance = 10;
constexpr int kRefinements = 16, kUpdateRefinements = 8;

using Values = std::vector<float>;

// Averages over (2 kRadius + 1)^2 pixels. Pixels beyond the border repeat the border.
class BoxFilter {
 public:
  BoxFilter(int width, int height) : width_(width), height_(height), rows_(size()), row_(width + 2 * kRadius) {}
  size_t size() const { return static_cast<size_t>(width_) * height_; }

  void apply(const Values& in, Values& out) {
    static_assert(kRadius == 2);
    constexpr float kNorm = 1.f / ((2 * kRadius + 1) * (2 * kRadius + 1));

    for (int y = 0; y < height_; y++) {
      const float* const from = &in[static_cast<size_t>(y) * width_];
      std::copy_n(from, width_, row_.begin() + kRadius);
      std::fill_n(row_.begin(), kRadius, from[0]);
      std::fill_n(row_.end() - kRadius, kRadius, from[width_ - 1]);
      const float* const row = row_.data();
      float* const to = &rows_[static_cast<size_t>(y) * width_];
      for (int x = 0; x < width_; x++) to[x] = row[x] + row[x + 1] + row[x + 2] + row[x + 3] + row[x + 4];
    }
    for (int y = 0; y < height_; y++) {
      const float* rows[2 * kRadius + 1];
      for (int i = -kRadius; i <= kRadius; i++)
        rows[i + kRadius] = &rows_[static_cast<size_t>(std::clamp(y + i, 0, height_ - 1)) * width_];
      float* const to = &out[static_cast<size_t>(y) * width_];
      for (int x = 0; x < width_; x++) to[x] = kNorm * (rows[0][x] + rows[1][x] + rows[2][x] + rows[3][x] + rows[4][x]);
    }
  }

 private:
  int width_, height_;
  Values rows_, row_;
};

// Smooths an image along the edges of another image, the guide.
class GuidedFilter {
 public:
  explicit GuidedFilter(const MatchingImage& guide)
      : box_(guide.width, guide.height), guide_(guide.size()), mean_(guide.size()), variance_(guide.size()) {
    for (Values* plane : {&product_, &slope_, &offset_}) plane->resize(guide.size());
    for (size_t i = 0; i < guide.size(); i++) guide_[i] = static_cast<float>(guide.pixels[i][0]) / MatchingImage::kUnit;
    box_.apply(guide_, mean_);
    for (size_t i = 0; i < guide.size(); i++) product_[i] = guide_[i] * guide_[i];
    box_.apply(product_, variance_);
    for (size_t i = 0; i < guide.size(); i++) variance_[i] -= mean_[i] * mean_[i];
  }

  void apply(Values& image) {
    const size_t n = image.size();
    for (size_t i = 0; i < n; i++) product_[i] = guide_[i] * image[i];
    box_.apply(product_, slope_);
    box_.apply(image, offset_);
    for (size_t i = 0; i < n; i++) {
      slope_[i] = (slope_[i] - mean_[i] * offset_[i]) / (std::max(variance_[i], 0.f) + kEdgeVariance);
      offset_[i] -= slope_[i] * mean_[i];
    }
    box_.apply(slope_, product_);
    box_.apply(offset_, slope_);
    for (size_t i = 0; i < n; i++) image[i] = product_[i] * guide_[i] + slope_[i];
  }

 private:
  BoxFilter box_;
  Values guide_, mean_, variance_, product_, slope_, offset_;
};

enum class Choice { kLeast, kMedian, kLargest };

// Returns the least, median or largest value among the 3 x 3 pixels around each pixel. Pixels beyond the border repeat
// the border.
void select_of_nine(const Values& in, int width, int height, Choice choice, Values& out) {
  const auto median = [](float a, float b, float c) { return std::max(std::min(a, b), std::min(std::max(a, b), c)); };
  // The values of each column of three pixels in ascending order, with a repeated column at both ends.
  Values least(width + 2), middle(width + 2), largest(width + 2);
  for (int y = 0; y < height; y++) {
    const float* const here = &in[static_cast<size_t>(y) * width];
    const float* const above = y > 0 ? here - width : here;
    const float* const below = y < height - 1 ? here + width : here;
    for (int x = 0; x < width; x++) {
      least[x + 1] = std::min(std::min(above[x], here[x]), below[x]);
      middle[x + 1] = median(above[x], here[x], below[x]);
      largest[x + 1] = std::max(std::max(above[x], here[x]), below[x]);
    }
    for (Values* const values : {&least, &middle, &largest}) {
      values->front() = (*values)[1];
      values->back() = (*values)[width];
    }
    const float *const low = least.data(), *const mid = middle.data(), *const high = largest.data();
    float* const to = &out[static_cast<size_t>(y) * width];
    switch (choice) {
      case Choice::kLeast:
        for (int x = 0; x < width; x++) to[x] = std::min(std::min(low[x], low[x + 1]), low[x + 2]);
        break;
      case Choice::kLargest:
        for (int x = 0; x < width; x++) to[x] = std::max(std::max(high[x], high[x + 1]), high[x + 2]);
        break;
      case Choice::kMedian:
        for (int x = 0; x < width; x++)
          to[x] = median(std::max(std::max(low[x], low[x + 1]), low[x + 2]), median(mid[x], mid[x + 1], mid[x + 2]),
                         std::min(std::min(high[x], high[x + 1]), high[x + 2]));
    }
  }
}

// The search for the depths of one camera.
class DepthSearch {
 public:
  DepthSearch(const MatchingImage& image, std::span<const MatchingImage* const> neighbours, const DepthSweep& range)
      : image_(image),
        range_(range),
        cost_(image, neighbours),
        filter_(image),
        inverse_(image.size(), static_cast<float>(range.farthest)),
        hypothesis_(image.size()),
        costs_(image.size()),
        least_(image.size(), std::numeric_limits<float>::infinity()) {}

  void start_with(const Values& inverse) {
    hypothesis_ = inverse;
    test();
  }

  void test_planes(int first, int every) {
    for (int i = first; i < range_.planes; i += every) {
      std::ranges::fill(hypothesis_, static_cast<float>(range_.farthest + i * range_.step()));
      test();
    }
  }

  // Tests depths between the least and the largest one that the pixels around each pixel have.
  void test_between() {
    constexpr int kDepths = 8, kReach = 3;  // kReach: largest distance of these pixels, along rows and columns
    Values least = inverse_, largest = inverse_;
    for (int i = 0; i < kReach; i++) {
      select_of_nine(least, image_.width, image_.height, Choice::kLeast, hypothesis_);
      least.swap(hypothesis_);
      select_of_nine(largest, image_.width, image_.height, Choice::kLargest, hypothesis_);
      largest.swap(hypothesis_);
    }
    for (int k = 0; k < kDepths; k++) {
      const float part = static_cast<float>(k) / (kDepths - 1);
      for (size_t i = 0; i < hypothesis_.size(); i++) hypothesis_[i] = least[i] + part * (largest[i] - least[i]);
      test();
    }
  }

  Values refined(int refinements) {
    for (int round = 0; round < refinements; round++) refine(round);
    return without_outliers(inverse_, image_.width, image_.height, range_.step());
  }

 private:
  // Tests depths of neighbouring pixels, and depths a part of a step away, in turn.
  void refine(int round) {
    switch (round % 4) {
      case 0:
        test_neighbours(Choice::kMedian);
        test_neighbours(Choice::kLeast);
        break;
      case 1: test_neighbours(Choice::kLargest); break;
      case 2:
        for (const double steps : round % 8 < 4 ? std::array{0.5, -0.5} : std::array{0.25, -0.25}) {
          for (size_t i = 0; i < inverse_.size(); i++)
            hypothesis_[i] = std::clamp(inverse_[i] + static_cast<float>(steps * range_.step()),
                                        static_cast<float>(range_.farthest), static_cast<float>(range_.nearest));
          test();
        }
        break;
      default: test_neighbours(Choice::kMedian);
    }
  }

  void test_neighbours(Choice choice) {
    select_of_nine(inverse_, image_.width, image_.height, choice, hypothesis_);
    test();
  }

  // Takes hypothesis_ where its cost is lower than all before.
  void test() {
    cost_.compute(hypothesis_, costs_);
    filter_.apply(costs_);
    for (size_t i = 0; i < inverse_.size(); i++) {
      const bool is_better = costs_[i] < least_[i];
      least_[i] = is_better ? costs_[i] : least_[i];
      inverse_[i] = is_better ? hypothesis_[i] : inverse_[i];
    }
  }

  const MatchingImage& image_;
  const DepthSweep range_;
  MatchingCost cost_;
  GuidedFilter filter_;
  Values inverse_, hypothesis_, costs_, least_;
};

}  // namespace

std::vector<float> without_outliers(const std::vector<float>& inverse, int width, int height, double step) {
  constexpr int kAgreeing = 2;
  const double tolerance = kAgreement * step;
  Values out(inverse.size());
  select_of_nine(inverse, width, height, Choice::kMedian, out);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      const size_t i = static_cast<size_t>(y) * width + x;
      int agreeing = -1;  // the value agrees with itself
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height - 1); v++)
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width - 1); u++)
          agreeing += std::abs(inverse[static_cast<size_t>(v) * width + u] - inverse[i]) < tolerance;
      if (agreeing >= kAgreeing) out[i] = inverse[i];
    }
  return out;
}

CameraDepth estimate_depth(const MatchingImage& image, std::span<const MatchingImage* const> neighbours,
                           const DepthSweep& range) {
  if (neighbours.empty()) return {Values(image.size(), static_cast<float>(range.farthest)), {}};
  DepthSearch search(image, neighbours, range);
  search.test_planes(0, 1);
  return {search.refined(kRefinements), {}};
}

CameraDepth update_depth(const MatchingImage& image, std::span<const MatchingImage* const> neighbours,
                         const DepthSweep& range, const std::vector<float>& before, int turns, int turn) {
  if (neighbours.empty()) return {before, {}};
  DepthSearch search(image, neighbours, range);
  search.start_with(before);
  search.test_planes(turn, turns);
  return {search.refined(kUpdateRefinements), {}};
}

CameraDepth refine_depth(const MatchingImage& image, std::span<const MatchingImage* const> neighbours,
                         const DepthSweep& range, const std::vector<float>& before) {
  if (neighbours.empty()) return {before, {}};
  DepthSearch search(image, neighbours, range);
  search.start_with(before);
  search.test_between();
  return {search.refined(kUpdateRefinements), {}};
}

std::vector<float> check_consistency(const MatchingImage& image, const CameraDepth& depth,
                                     std::span<const DepthNeighbour> neighbours, double step) {
  const float tolerance = static_cast<float>(kAgreement * step);
  std::vector<int> agreeing(image.size()), seeing(image.size());
  for (const DepthNeighbour& neighbour : neighbours) {
    const PixelMapping map(image, *neighbour.image);
    const MatchingImage& to = *neighbour.image;
    for (int y = 0; y < image.height; y++)
      for (int x = 0; x < image.width; x++) {
        const size_t i = static_cast<size_t>(y) * image.width + x;
        const float inverse = depth.inverse[i];
        const std::array<float, 3> far = map.at(static_cast<float>(x), static_cast<float>(y));
        const float z = far[2] + inverse * map.parallax[2];
        if (z <= 0) continue;
        const float u = (far[0] + inverse * map.parallax[0]) / z, v = (far[1] + inverse * map.parallax[1]) / z;
        if (!(u >= 0 && v >= 0 && u < static_cast<float>(to.width - 1) && v < static_cast<float>(to.height - 1)))
          continue;
        const size_t at = static_cast<size_t>(v + 0.5f) * to.width + static_cast<size_t>(u + 0.5f);
        const float nearer = neighbour.depth->inverse[at] - inverse / z;
        const bool agrees = std::abs(nearer) < tolerance;
        agreeing[i] += agrees;
        seeing[i] += agrees || nearer < 0;
      }
  }
  std::vector<float> confidence(image.size());
  for (size_t i = 0; i < confidence.size(); i++)
    confidence[i] = agreeing[i] > 0 ? static_cast<float>(agreeing[i]) / static_cast<float>(seeing[i]) : 0;
  return confidence;
}

}  // namespace lf
