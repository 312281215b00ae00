// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/hypothesis_levels.h"

#include <algorithm>
#include <optional>

namespace lf {

double plane_inverse(const View& view, const Plane& from, const Vec3& ray) {
  const Vec3 d = view.pose.rotation() * ray;
  const Plane& plane = view.focus.plane;
  const double t = -plane.signed_distance(view.pose.position) / glm::dot(plane.normal, d);
  const double distance = from.signed_distance(view.pose.position) + t * glm::dot(from.normal, d);
  return t > 0 && distance > 0 ? 1 / distance : 0;
}

FocalMap plane_map(const View& view, const Plane& from, double nearest, double farthest, int step) {
  FocalMap map =
      view.focus.map
          ? FocalMap{.step = view.focus.map->step, .columns = view.focus.map->columns, .rows = view.focus.map->rows}
          : FocalMap::for_view(view.width, view.height, step);
  map.from = from;
  map.nearest = nearest;
  map.farthest = farthest;
  const double middle = (map.step - 1) / 2.0, axis = plane_inverse(view, from, {0, 0, 1});
  map.levels.reserve(static_cast<size_t>(map.columns) * static_cast<size_t>(map.rows));
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++) {
      const std::optional<Vec2> ray = view.lens.unproject({map.step * i + middle, map.step * j + middle});
      map.levels.push_back(map.level_of(ray ? plane_inverse(view, from, {*ray, 1}) : axis));
    }
  return map;
}

namespace {

// Filters the levels with fn(value, value before, value after), first along the rows and then along the columns.
template <class Fn>
std::vector<uint8_t> along_both(std::vector<uint8_t> in, int columns, int rows, const Fn& fn) {
  std::vector<uint8_t> out(in.size());
  const auto pass = [&](int lines, int count, int line_step, int step) {
    for (int line = 0; line < lines; line++) {
      const uint8_t* from = in.data() + static_cast<ptrdiff_t>(line) * line_step;
      uint8_t* to = out.data() + static_cast<ptrdiff_t>(line) * line_step;
      for (int i = 0; i < count; i++)
        to[i * step] = fn(from[i * step], from[std::max(i - 1, 0) * step], from[std::min(i + 1, count - 1) * step]);
    }
    std::swap(in, out);
  };
  pass(rows, columns, columns, 1);
  pass(columns, rows, 1, columns);
  return in;
}

std::vector<uint8_t> blurred(const FocalMap& surface, std::vector<uint8_t> levels) {
  return along_both(std::move(levels), surface.columns, surface.rows, [](int at, int before, int after) {
    return static_cast<uint8_t>((before + 6 * at + after + 4) / 8);
  });
}

}  // namespace

std::vector<uint8_t> hypothesis_levels(const View& view, const DepthHypothesis& hypothesis) {
  const FocalMap& surface = *view.focus.map;
  if (hypothesis.kind != DepthHypothesis::Kind::kFocused) return hypothesis_levels(surface, hypothesis);
  return plane_map(view, surface.from, surface.nearest, surface.farthest).levels;
}

std::vector<uint8_t> hypothesis_levels(const FocalMap& surface, const DepthHypothesis& hypothesis) {
  const auto extreme = [&](const auto& pick) {
    return along_both(surface.levels, surface.columns, surface.rows,
                      [&](uint8_t a, uint8_t b, uint8_t c) { return pick(a, pick(b, c)); });
  };
  switch (hypothesis.kind) {
    case DepthHypothesis::Kind::kFarther:
      return blurred(surface, extreme([](uint8_t a, uint8_t b) { return std::min(a, b); }));
    case DepthHypothesis::Kind::kNearer:
      return blurred(surface, extreme([](uint8_t a, uint8_t b) { return std::max(a, b); }));
    case DepthHypothesis::Kind::kPlane:
      return std::vector<uint8_t>(surface.levels.size(),
                                  static_cast<uint8_t>(std::clamp<int>(hypothesis.value, 0, 255)));
    case DepthHypothesis::Kind::kBlurred:
    case DepthHypothesis::Kind::kFocused:
    case DepthHypothesis::Kind::kMeasured:
    case DepthHypothesis::Kind::kShifted: break;
  }
  std::vector<uint8_t> levels = blurred(surface, surface.levels);
  if (hypothesis.kind == DepthHypothesis::Kind::kShifted)
    for (uint8_t& level : levels) level = static_cast<uint8_t>(std::clamp(level + hypothesis.value, 0, 255));
  return levels;
}

std::vector<std::vector<uint8_t>> hypothesis_levels(const View& view, std::span<const DepthHypothesis> hypotheses) {
  std::vector<std::vector<uint8_t>> levels;
  for (const DepthHypothesis& hypothesis : hypotheses)
    if (hypothesis.kind != DepthHypothesis::Kind::kMeasured) levels.push_back(hypothesis_levels(view, hypothesis));
  return levels;
}

std::vector<DepthHypothesis> hypotheses_of_round(unsigned round, const LevelRange& scene) {
  // Returns the plane of a round. Consecutive planes should be far apart, so each round advances by 7 of 12 planes,
  // which is near the golden ratio. After 12 rounds, every plane has been tested.
  const auto plane_of = [](unsigned turn, const LevelRange& range) {
    const int plane = static_cast<int>(turn * 7 % kSweepPlanes);
    return DepthHypothesis{DepthHypothesis::Kind::kPlane,
                           static_cast<int16_t>(range.first + (range.last - range.first) * plane / (kSweepPlanes - 1))};
  };
  std::vector<DepthHypothesis> hypotheses{{DepthHypothesis::Kind::kBlurred, 0}};
  if (round % 2 == 0) {
    hypotheses.push_back({DepthHypothesis::Kind::kFarther, 0});
    hypotheses.push_back({DepthHypothesis::Kind::kNearer, 0});
  } else {
    const int step = std::max((scene.last - scene.first) / (kSweepPlanes - 1), 4);
    const auto shift = static_cast<int16_t>(round / 2 % 2 == 0 ? step / 2 : step / 3);
    hypotheses.push_back({DepthHypothesis::Kind::kShifted, static_cast<int16_t>(-shift)});
    hypotheses.push_back({DepthHypothesis::Kind::kShifted, shift});
  }
  const unsigned turn = round / kOutsideEvery;
  if (round % kOutsideEvery == kOutsideEvery - 1 && scene != LevelRange{}) {
    DepthHypothesis outside = plane_of(turn, {0, 254 - (scene.last - scene.first)});
    if (outside.value >= scene.first)
      outside.value = static_cast<int16_t>(outside.value + scene.last - scene.first + 1);
    hypotheses.push_back(outside);
  } else {
    hypotheses.push_back(plane_of(scene == LevelRange{} ? round : round - turn, scene));
  }
  return hypotheses;
}

View hypothesis_view(const View& view) {
  const FocalMap& map = *view.focus.map;
  const double step = map.step;
  View result = view;
  result.width = map.columns;
  result.height = map.rows;
  std::array<double, Lens::kMaxParams> params = view.lens.params();
  const int focal = lens_model_num_focal(view.lens.model());
  for (int i = 0; i < focal; i++) params[static_cast<size_t>(i)] /= step;
  for (int i = focal; i < focal + 2; i++) {
    double& c = params[static_cast<size_t>(i)];
    c = (c + 0.5) / step - 0.5;
  }
  result.lens = Lens(view.lens.model(), params);
  auto per_pixel = std::make_shared<FocalMap>(map);
  per_pixel->step = 1;
  result.focus.map = std::move(per_pixel);
  // More cameras than kHypothesisCameras would not improve the depths. Blending by the mesh is no alternative outside
  // the hull of the cameras, where only the nearest cameras by angle have weights, and hypotheses must use the same
  // cameras.
  if (result.blending.kind == Blending::Kind::kAngle)
    result.blending.nearest = std::min(result.blending.nearest, kHypothesisCameras);
  else
    result.blending = {.extrapolates = view.blending.extrapolates, .fills_gaps = false};
  return result;
}

}  // namespace lf
