// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/surface/planes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/percentiles.h"

namespace lf::focus {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kLeastCover = 0.5;  // of what the plane that covers most covers

int squared_error(const Image& a, const Image& b, size_t pixel) {
  int sum = 0;
  for (size_t i = 3 * pixel; i < 3 * pixel + 3; i++) sum += (a.data()[i] - b.data()[i]) * (a.data()[i] - b.data()[i]);
  return sum;
}

// Sum of squared errors of the pixels that are covered, and how many these are.
struct Error2 {
  double sum = 0;
  size_t pixels = 0;
  void add(int squared) {
    sum += squared;
    pixels++;
  }
  double mean() const { return pixels > 0 ? sum / static_cast<double>(pixels) : kInfinite; }
};

Error2 error_of(const Picture& picture, const Image& truth) {
  Error2 error;
  for (size_t i = 0; i < picture.coverage.size(); i++)
    if (picture.coverage[i] > kCovered) error.add(squared_error(picture.image, truth, i));
  return error;
}

// The least mean error of the planes that cover enough; none if none covers anything.
std::optional<size_t> best_of(std::span<const Error2> errors) {
  size_t most = 0;
  for (const Error2& error : errors) most = std::max(most, error.pixels);
  std::optional<size_t> best;
  for (size_t k = 0; k < errors.size(); k++) {
    if (errors[k].pixels == 0 || static_cast<double>(errors[k].pixels) < kLeastCover * static_cast<double>(most))
      continue;
    if (!best || errors[k].mean() < errors[*best].mean()) best = k;
  }
  return best;
}

// Every nth pixel of a view and of its truth, itself a view: what planes are worth can be told from it as well.
struct Thinned {
  View view;
  Image truth;
};

Thinned thinned(const View& view, const Image& truth, int n) {
  const int first = n / 2;
  Thinned out{view, {}};
  out.view.width = (view.width - 1 - first) / n + 1;
  out.view.height = (view.height - 1 - first) / n + 1;
  std::array<double, Lens::kMaxParams> params = view.lens.params();
  const int focal = lens_model_num_focal(view.lens.model());
  for (int i = 0; i < focal; i++) params[i] /= n;
  for (int i = focal; i < focal + 2; i++) params[i] = (params[i] - first) / n;
  out.view.lens = Lens(view.lens.model(), params);
  out.truth = Image(PixelFamily::kRgb, out.view.width, out.view.height);
  for (int y = 0; y < out.view.height; y++)
    for (int x = 0; x < out.view.width; x++)
      std::copy_n(truth.pixel(first + n * x, first + n * y), 3, out.truth.pixel(x, y));
  return out;
}

double median_edge(const Rig& rig, const Mesh& mesh) {
  std::vector<double> lengths;
  for (const MeshFace& face : mesh.faces)
    for (int i = 1; i < face.corners(); i++)
      for (int j = 0; j < i; j++)
        lengths.push_back(
            glm::length(rig.cameras[face.camera[i]].pose.position - rig.cameras[face.camera[j]].pose.position));
  if (lengths.empty()) return 0;
  const auto middle = lengths.begin() + static_cast<ptrdiff_t>(lengths.size() / 2);
  std::ranges::nth_element(lengths, middle);
  return *middle;
}

// Planes, the farthest first, with the mean error of each block of each picture; infinite where less than half of a
// block is covered.
class Survey {
 public:
  Survey(const Thinned& thin, const Plane& from, const Draw& draw) : thin_(thin), from_(from), draw_(draw) {}

  Error2 look(double inverse) { return error_of(drawn(inverse), thin_.truth); }

  // False where fewer pixels are covered than are worth looking at.
  bool add(double inverse) {
    const Picture picture = drawn(inverse);
    errors.push_back(error_of(picture, thin_.truth));
    inverses.push_back(inverse);
    most_ = std::max(most_, errors.back().pixels);
    std::vector<float>& of_blocks = blocks_.emplace_back();
    for (int y = 0; y + kBlock <= thin_.view.height; y += kNext)
      for (int x = 0; x + kBlock <= thin_.view.width; x += kNext) of_blocks.push_back(block(picture, x, y));
    return static_cast<double>(errors.back().pixels) >= kLeastCover * static_cast<double>(most_);
  }

  // The plane that a part of the blocks is not nearer than. A block counts by how much less its error is at its best
  // plane than at most planes: one without texture does not, nor one that is nowhere distinct.
  double inverse_at(double part) const {
    const double all = std::accumulate(evidence_.begin(), evidence_.end(), 0.0);
    size_t k = 0;
    for (double so_far = evidence_[0]; k + 1 < evidence_.size() && so_far <= part * all; so_far += evidence_[++k]) {
    }
    return inverses[k];
  }
  void weigh() {
    evidence_.assign(blocks_.size(), 0);
    for (size_t i = 0; i < blocks_[0].size(); i++) {
      std::vector<float> seen;
      size_t best = 0;
      for (size_t k = 0; k < blocks_.size(); k++) {
        if (blocks_[k][i] < kNotSeen) seen.push_back(blocks_[k][i]);
        if (blocks_[k][i] < blocks_[best][i]) best = k;
      }
      if (seen.empty()) continue;
      const double usual = std::sqrt(median(std::move(seen))), least = std::sqrt(blocks_[best][i]);
      if (least < kDistinct * usual) evidence_[best] += usual - least;
    }
  }

  std::vector<double> inverses;
  std::vector<Error2> errors;

 private:
  static constexpr int kBlock = 8;                  // pixels
  static constexpr int kNext = 4;                   // from one block to the next
  static constexpr double kDistinct = 0.5;          // the best plane's error, of the middle one's
  static constexpr float kNotSeen = 3 * 255 * 255;  // error of a block that no plane covers

  Picture drawn(double inverse) const { return draw_(on_plane(thin_.view, from_, 1 / inverse)); }

  float block(const Picture& picture, int x0, int y0) const {
    Error2 error;
    for (int y = y0; y < y0 + kBlock; y++)
      for (int x = x0; x < x0 + kBlock; x++) {
        const size_t i = static_cast<size_t>(y) * thin_.view.width + x;
        if (picture.coverage[i] > kCovered) error.add(squared_error(picture.image, thin_.truth, i));
      }
    return 2 * error.pixels >= kBlock * kBlock ? static_cast<float>(error.mean()) : kNotSeen;
  }

  const Thinned& thin_;
  const Plane& from_;
  const Draw& draw_;
  size_t most_ = 0;
  std::vector<std::vector<float>> blocks_;  // of each plane
  std::vector<double> evidence_;            // that the scene is there, of each plane
};

}  // namespace

View on_plane(const View& view, const Plane& from, double distance) {
  View out = view;
  out.focus.plane = {from.normal, from.d - distance};
  return out;
}

std::optional<Depths> find_depths(const Rig& rig, const Mesh& mesh, const View& view, const Image& truth,
                                  const Plane& from, const Draw& draw) {
  constexpr int kColumns = 160;       // about, of the thinned view
  constexpr double kFarthest = 0.25;  // pixels of disparity between neighbours
  constexpr double kApart = 0.5;      // of a view of 320 columns: in larger ones textures are coarser, too
  constexpr double kFinest = 0.05;
  constexpr double kOutliers = 0.02;  // of what tells the range, to each side
  constexpr double kMargin = 0.05;    // of the range, to each side
  const double edge = median_edge(rig, mesh);
  if (!(edge > 0)) throw Error("all cameras are at one place: nothing is nearer or farther to them");
  const double pixel = 1 / (view.lens.fx() * edge);  // of disparity, as inverse distance

  const Thinned thin = thinned(view, truth, std::max(1, view.width / kColumns));
  Survey survey(thin, from, draw);
  const double apart = kApart * std::max(1.0, view.width / 320.0) * pixel;
  const auto apart_at = [&](double inverse) { return std::clamp(inverse / 8, pixel / 8, apart); };
  double inverse = kFarthest * pixel;
  while (survey.add(inverse) && inverse < view.width * pixel) inverse += apart_at(inverse);
  const std::optional<size_t> best = best_of(survey.errors);
  if (!best) return std::nullopt;

  double at = survey.inverses[*best], least = survey.errors[*best].mean();
  for (double step = apart_at(at) / 2; step > kFinest * pixel; step /= 2)
    for (const double tried : {at - step, at + step}) {
      if (!(tried > 0)) continue;
      const double error = survey.look(tried).mean();
      if (!(error < least)) continue;
      least = error;
      at = tried;
    }
  survey.weigh();
  const double farthest = survey.inverse_at(kOutliers), nearest = survey.inverse_at(1 - kOutliers);
  const double margin = std::max(kMargin * (nearest - farthest), apart_at(nearest));
  return Depths{.range = {std::max(farthest - margin, kFarthest * pixel), nearest + margin},
                .middle = survey.inverse_at(0.5),
                .best = at};
}

JudgedPlanes judge_planes(const View& view, const Image& truth, const Plane& from, std::span<const double> distances,
                          const Draw& draw) {
  JudgedPlanes judged;
  std::vector<Error2> errors;
  std::vector<int> least;
  for (const double distance : distances) {
    const Picture plane = draw(on_plane(view, from, distance));
    errors.push_back(error_of(plane, truth));
    if (least.empty()) {
      judged.bound = plane;
      least.assign(plane.coverage.size(), std::numeric_limits<int>::max());
    }
    for (size_t i = 0; i < least.size(); i++) {
      // Less than all of its cameras make a pixel, too; whether it counts is told by the plane that covers it most.
      judged.bound.coverage[i] = std::max(judged.bound.coverage[i], plane.coverage[i]);
      if (!(plane.coverage[i] > 0)) continue;
      const int error = squared_error(plane.image, truth, i);
      if (error >= least[i]) continue;
      least[i] = error;
      std::copy_n(plane.image.data().begin() + static_cast<ptrdiff_t>(3 * i), 3,
                  judged.bound.image.data().begin() + static_cast<ptrdiff_t>(3 * i));
    }
  }
  judged.bound.quality = compare(judged.bound.image, truth, judged.bound.coverage);
  judged.best_distance = distances[best_of(errors).value_or(0)];
  judged.best = draw(on_plane(view, from, judged.best_distance));
  judged.best.quality = compare(judged.best.image, truth, judged.best.coverage);
  return judged;
}

}  // namespace lf::focus
