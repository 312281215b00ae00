// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/colour_views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/number_text.h"
#include "render/focus_range.h"

namespace lf {
namespace {

constexpr int kRadius = 4, kPatchPixels = (2 * kRadius + 1) * (2 * kRadius + 1);
constexpr int kViewDepths = 64;
constexpr size_t kSearched = 6;      // cameras that a distance is looked for with
constexpr double kLeastTexture = 3;  // standard deviation of a window, levels: above the noise of cameras
constexpr double kAgrees = 0.9;      // correlation of windows
constexpr double kMostOff = 5;       // levels that pixels of windows differ by that agree, but for brightness
constexpr size_t kLeastViewCameras = 3;
constexpr size_t kReferences = 16;  // cameras whose images places are taken from
constexpr int kAcross = 16;         // places along a row of such an image

// A window of luma, of zero mean and unit length.
struct Window {
  std::array<float, kPatchPixels> of;
  double texture;  // standard deviation before, levels
};

class Luma {
 public:
  Luma() = default;
  explicit Luma(const Image& rgb) : width_(rgb.width()), height_(rgb.height()) {
    for (int y = 0; y < height_; y++)
      for (int x = 0; x < width_; x++) {
        const uint8_t* p = rgb.pixel(x, y);
        values_.push_back(0.299f * p[0] + 0.587f * p[1] + 0.114f * p[2]);
      }
  }
  // False where the window leaves the image, or has less texture than `least`.
  bool window(const Vec2& middle, double least, Window& out) const {
    const int x0 = static_cast<int>(std::floor(middle.x)), y0 = static_cast<int>(std::floor(middle.y));
    if (!(middle.x >= kRadius && middle.y >= kRadius) || x0 + kRadius + 1 >= width_ || y0 + kRadius + 1 >= height_)
      return false;
    const auto u = static_cast<float>(middle.x - x0), v = static_cast<float>(middle.y - y0);
    float sum = 0, squares = 0;
    size_t i = 0;
    for (int y = y0 - kRadius; y <= y0 + kRadius; y++)
      for (int x = x0 - kRadius; x <= x0 + kRadius; x++) {
        const float* p = &values_[static_cast<size_t>(y) * width_ + x];
        const float upper = p[0] + u * (p[1] - p[0]), lower = p[width_] + u * (p[width_ + 1] - p[width_]);
        out.of[i] = upper + v * (lower - upper);
        sum += out.of[i];
        squares += out.of[i] * out.of[i];
        i++;
      }
    const float mean = sum / kPatchPixels, variance = squares / kPatchPixels - mean * mean;
    if (!(variance > least * least)) return false;
    out.texture = std::sqrt(variance);
    const float scale = 1 / std::sqrt(variance * kPatchPixels);
    for (float& value : out.of) value = (value - mean) * scale;
    return true;
  }

 private:
  int width_ = 0, height_ = 0;
  std::vector<float> values_;
};

// What a camera shows around a place: pixels count less towards the edge of a window, and where they are between
// pixels' middles, so that a place that is a little off is of nearly the same colour.
std::optional<ColourSample> sample_around(const Image& rgb, const Vec2& at) {
  constexpr int kReach = 6;
  const int x0 = static_cast<int>(std::lround(at.x)), y0 = static_cast<int>(std::lround(at.y));
  if (x0 < kReach || y0 < kReach || x0 + kReach >= rgb.width() || y0 + kReach >= rgb.height()) return std::nullopt;
  double weights = 0, square_weights = 0;
  Vec3 sum(0), squares(0), clipped(0);
  for (int y = y0 - kReach; y <= y0 + kReach; y++)
    for (int x = x0 - kReach; x <= x0 + kReach; x++) {
      const double r2 = ((x - at.x) * (x - at.x) + (y - at.y) * (y - at.y)) / (kReach * kReach);
      if (r2 >= 1) continue;
      const double weight = (1 - r2) * (1 - r2);
      weights += weight;
      square_weights += weight * weight;
      for (int c = 0; c < 3; c++) {
        const int level = rgb.pixel(x, y)[c];
        sum[c] += weight * level;
        squares[c] += weight * level * level;
        if (level <= 2 || level >= 253) clipped[c] += weight;
      }
    }
  ColourSample sample;
  sample.place = at;
  sample.level = sum / weights;
  double variance = 0;
  for (int c = 0; c < 3; c++) {
    sample.usable[static_cast<size_t>(c)] = clipped[c] <= 0.01 * weights;
    variance = std::max(variance, squares[c] / weights - sample.level[c] * sample.level[c]);
  }
  sample.sigma = std::sqrt(0.1 + variance * square_weights / (weights * weights) + 0.003 * variance);
  return sample;
}

double correlation(const Window& a, const Window& b) {
  return std::inner_product(a.of.begin(), a.of.end(), b.of.begin(), 0.f);
}

// Whether windows show the same. What has little texture hides in noise, and strong edges do not bear to be off.
bool agree(const Window& a, const Window& b) {
  const double like = correlation(a, b), texture = std::max(a.texture, b.texture);
  return like >= kAgrees && texture * std::sqrt(2 * (1 - std::min(like, 1.0))) <= kMostOff;
}

std::optional<Vec2> seen_at(const Camera& camera, const Vec3& x_world) {
  return camera.lens.project(camera.pose.camera_from_world(x_world));
}

class Sampler {
 public:
  Sampler(const Rig& rig, std::span<const Image> images) : rig_(rig), images_(images) {
    for (size_t i = 0; i < images.size(); i++) {
      const Camera& camera = rig.cameras[i];
      if (images[i].width() > 0 && (images[i].width() != camera.width || images[i].height() != camera.height))
        throw Error("camera " + std::to_string(camera.id) + ": its image has " +
                    size_text(images[i].width(), images[i].height()) + " pixels, the rig says " +
                    size_text(camera.width, camera.height));
      luma_.push_back(images[i].width() > 0 ? Luma(images[i]) : Luma());
    }
    find_range();
  }

  ColourSamples run() {
    ColourSamples samples;
    samples.cameras = rig_.cameras.size();
    const size_t n = rig_.cameras.size(), references = std::min(n, kReferences);
    for (size_t k = 0; k < references; k++) {
      const auto reference = static_cast<CameraIndex>((2 * k + 1) * n / (2 * references));
      if (images_[reference].width() == 0) continue;
      const Camera& camera = rig_.cameras[reference];
      const std::vector<CameraIndex> near = nearest_to(reference);
      const double step = static_cast<double>(camera.width) / kAcross;
      for (double y = step / 2; y < camera.height; y += step)
        for (double x = step / 2; x < camera.width; x += step) add({x, y}, reference, near, samples);
    }
    return samples;
  }

 private:
  void find_range() {
    const auto range = estimate_focus_range(rig_, [this](CameraIndex i) -> const Image& {
      if (images_[i].width() > 0) return images_[i];
      black_ = Image(PixelFamily::kRgb, rig_.cameras[i].width, rig_.cameras[i].height);
      return black_;
    });
    if (!range) throw Error("the views have too little in common, or too little texture, to be compared");
    nearest_ = 0.6 * range->near;
    farthest_ = 2 * range->far;
  }
  std::vector<CameraIndex> nearest_to(CameraIndex reference) const {
    std::vector<CameraIndex> near;
    for (CameraIndex i = 0; i < rig_.cameras.size(); i++)
      if (i != reference && images_[i].width() > 0) near.push_back(i);
    const Vec3 from = rig_.cameras[reference].pose.position;
    std::ranges::sort(near, {}, [&](CameraIndex i) { return glm::length(rig_.cameras[i].pose.position - from); });
    if (near.size() > kSearched) near.resize(kSearched);
    return near;
  }
  Vec3 place(CameraIndex reference, const Vec2& ray, double inverse) const {
    return rig_.cameras[reference].pose.world_from_camera(Vec3(ray, 1) / inverse);
  }

  void add(const Vec2& pixel, CameraIndex reference, const std::vector<CameraIndex>& near, ColourSamples& samples) {
    Window window;
    if (!luma_[reference].window(pixel, kLeastTexture, window)) return;
    const std::optional<Vec2> ray = rig_.cameras[reference].lens.unproject(pixel);
    if (!ray) return;
    const double first = 1 / farthest_, last = 1 / nearest_;
    std::array<double, kViewDepths> like;
    for (int k = 0; k < kViewDepths; k++) {
      const Vec3 x = place(reference, *ray, first + (last - first) * k / (kViewDepths - 1));
      double sum = 0;
      size_t count = 0;
      for (const CameraIndex other : near) {
        Window there;
        const std::optional<Vec2> at = seen_at(rig_.cameras[other], x);
        if (!at || !luma_[other].window(*at, kLeastTexture / 2, there)) continue;
        sum += correlation(window, there);
        count++;
      }
      like[static_cast<size_t>(k)] = count >= 2 ? sum / static_cast<double>(count) : -1;
    }
    const auto best = static_cast<int>(std::ranges::max_element(like) - like.begin());
    if (like[static_cast<size_t>(best)] < kAgrees - 0.1) return;
    // Between the depths that were tried, where a parabola through three has its top.
    double k = best;
    if (best > 0 && best + 1 < kViewDepths) {
      const double a = like[static_cast<size_t>(best - 1)], b = like[static_cast<size_t>(best)],
                   c = like[static_cast<size_t>(best + 1)];
      if (const double bend = a - 2 * b + c; bend < -1e-9) k += std::clamp((a - c) / (2 * bend), -0.5, 0.5);
    }
    add_patch(window, place(reference, *ray, first + (last - first) * k / (kViewDepths - 1)), samples);
  }

  void add_patch(const Window& window, const Vec3& x, ColourSamples& samples) {
    std::vector<ColourSample> seen;
    for (CameraIndex i = 0; i < rig_.cameras.size(); i++) {
      if (images_[i].width() == 0) continue;
      const std::optional<Vec2> at = seen_at(rig_.cameras[i], x);
      Window there;
      if (!at || !luma_[i].window(*at, kLeastTexture / 2, there) || !agree(window, there)) continue;
      auto sample = sample_around(images_[i], *at);
      if (!sample) continue;
      sample->camera = i;
      sample->patch = samples.patches;
      seen.push_back(*sample);
    }
    if (seen.size() < kLeastViewCameras) return;
    samples.all.insert(samples.all.end(), seen.begin(), seen.end());
    samples.patches++;
  }

  const Rig& rig_;
  const std::span<const Image> images_;
  double nearest_ = 0, farthest_ = 0;  // metres from the cameras: where places are looked for
  std::vector<Luma> luma_;
  Image black_;
};

}  // namespace

ColourSamples sample_views(const Rig& rig, std::span<const Image> images) {
  if (images.size() != rig.cameras.size()) throw Error("there must be an image for each camera of the rig");
  return Sampler(rig, images).run();
}

}  // namespace lf
