// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/view_weights.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "composite/resolve.h"
#include "image/image.h"
#include "render/camera_projection.h"
#include "render/contribution_map.h"

namespace lf {

MeanCoverage ViewCoverage::share(const Rig& rig, const ViewRequest& request, const CameraSet& lost, bool exact,
                                 int64_t now) {
  const bool known = share_.has_value();
  const bool same = known && view_ == request.view && out_of_service_ == request.out_of_service && lost_ == lost;
  if (same || (known && !exact && now < known_at_ + kInterval)) return *share_;
  const Mesh& mesh = mesh_.get(rig, request.out_of_service);
  share_ = mean_coverage(rig, ViewPlan(rig, mesh, request.view), kColumns, kRows, lost);
  view_ = request.view;
  out_of_service_ = request.out_of_service;
  lost_ = lost;
  known_at_ = now;
  return *share_;
}

namespace {

struct Colour {
  float r = 0, g = 0, b = 0;
};

float luma(const Colour& c) { return ycbcr_of(c.r, c.g, c.b).y; }

uint8_t byte(float value) { return static_cast<uint8_t>(std::clamp(value + 0.5f, 0.f, 255.f)); }

template <typename F>
void repaint(const WeightOverlay::Picture& picture, int width, int height, const F& colour) {
  const auto row = [&](int plane, int y) { return picture.plane[plane] + y * picture.stride[plane]; };
  if (picture.family == PixelFamily::kRgb) {
    const RgbLayout& at = picture.layout;
    for (int y = 0; y < height; y++) {
      uint8_t* pixel = row(0, y);
      for (int x = 0; x < width; x++, pixel += at.pixel_stride) {
        const Colour before{float(pixel[at.r]), float(pixel[at.g]), float(pixel[at.b])};
        const Colour now = colour(x, y, luma(before));
        pixel[at.r] = byte(now.r);
        pixel[at.g] = byte(now.g);
        pixel[at.b] = byte(now.b);
      }
    }
    return;
  }
  const Levels& levels = picture.levels;
  const int step = chroma_step(picture.plane);
  for (int y = 0; y < height; y += 2)
    for (int x = 0; x < width; x += 2) {
      Colour sum;
      float count = 0;
      for (int j = y; j < std::min(y + 2, height); j++)
        for (int i = x; i < std::min(x + 2, width); i++, count++) {
          uint8_t& pixel = row(0, j)[i];
          const Colour now = colour(i, j, (pixel - levels.offset) / levels.gain);
          pixel = byte(levels.gain * luma(now) + levels.offset);
          sum = {sum.r + now.r, sum.g + now.g, sum.b + now.b};
        }
      const ptrdiff_t at = x / 2 * step;
      const YCbCr mean = ycbcr_of(sum.r / count, sum.g / count, sum.b / count);
      row(1, y / 2)[at] = byte(128 + levels.chroma_gain * mean.cb);
      row(2, y / 2)[at] = byte(128 + levels.chroma_gain * mean.cr);
    }
}

}  // namespace

void WeightOverlay::find_nodes(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners,
                               const CameraRanges& seeing) {
  const View& view = plan.view();
  // Nodes beyond the right and bottom border repeat the border.
  columns_ = (view.width - 1) / kStep + 2;
  const int rows = (view.height - 1) / kStep + 2;
  nodes_.assign(static_cast<size_t>(columns_) * rows, {});
  const auto place = [](int node, int size) { return std::min(node * kStep, size - 1); };
  for (int j = 0; j < rows; j++)
    for (int i = 0; i < columns_; i++)
      nodes_[static_cast<size_t>(j) * columns_ + i].owned =
          owners.at(place(i, view.width), place(j, view.height)) != FaceIdMap::kNone;
  for (const CameraIndex camera : plan.contributors()) {
    if (!seeing.contains(camera)) continue;
    const Rect& rect = plan.camera_rect(camera);
    const CameraCorners corners(plan, camera);
    const CameraProjection projection(plan, camera, rig.cameras[camera]);
    const CameraColour& colour = colours_[camera];
    for (int j = rect.y0 / kStep; j < rows && place(j, view.height) < rect.y1; j++)
      for (int i = rect.x0 / kStep; i < columns_ && place(i, view.width) < rect.x1; i++) {
        const int x = place(i, view.width), y = place(j, view.height);
        if (x < rect.x0 || y < rect.y0) continue;
        const float weight = corners.weight_at(plan, owners, x, y);
        Vec2 pixel;
        if (!(weight > 0) || !projection.project(plan.rays().at(x, y), plan.inverse_at(x, y), pixel)) continue;
        Node& node = nodes_[static_cast<size_t>(j) * columns_ + i];
        node.r += weight * colour.r;
        node.g += weight * colour.g;
        node.b += weight * colour.b;
        node.seen += weight;
      }
  }
}

// Interpolates over covered nodes only, so that the border of the array does not darken.
WeightOverlay::Node WeightOverlay::at(int x, int y) const {
  const int i = x / kStep, j = y / kStep;
  const float across = static_cast<float>(x % kStep) / kStep, down = static_cast<float>(y % kStep) / kStep;
  Node sum;
  for (int n = 0; n < 4; n++) {
    const Node& node = nodes_[static_cast<size_t>(j + (n >> 1)) * columns_ + i + (n & 1)];
    const float part = node.owned * (n & 1 ? across : 1 - across) * (n >> 1 ? down : 1 - down);
    sum.r += part * node.r;
    sum.g += part * node.g;
    sum.b += part * node.b;
    sum.seen += part * node.seen;
    sum.owned += part;
  }
  const float scale = sum.owned > 0 ? 1 / sum.owned : 0;
  return {sum.r * scale, sum.g * scale, sum.b * scale, sum.seen * scale, sum.owned};
}

void WeightOverlay::draw(WeightOverlayMode what, const Rig& rig, const ViewRequest& request, const CameraRanges& seeing,
                         const Picture& picture) {
  if (what == WeightOverlayMode::kNone) return;
  const View& view = request.view;
  const Mesh& mesh = mesh_.get(rig, request.out_of_service);
  const ViewPlan plan(rig, mesh, view);
  const FaceIdMap owners(plan, {0, 0, view.width, view.height});
  colours_ = camera_colours(mesh, rig.cameras.size());
  find_nodes(rig, plan, owners, seeing);
  if (what == WeightOverlayMode::kCoverage) {
    constexpr int kShades = 256;
    std::array<std::array<uint8_t, 3>, kShades> heats;
    for (int i = 0; i < kShades; i++) heats[i] = heat_colour(i / (kShades - 1.0));
    repaint(picture, view.width, view.height, [&](int x, int y, float light) {
      if (owners.at(x, y) == FaceIdMap::kNone) return Colour{kNoValueGrey, kNoValueGrey, kNoValueGrey};
      const float lost = std::clamp(1 - at(x, y).seen, 0.f, 1.f), through = kUnderlayOpacity * (1 - lost) * light;
      const std::array<uint8_t, 3>& heat = heats[static_cast<size_t>(lost * (kShades - 1) + 0.5f)];
      return Colour{heat[0] + through, heat[1] + through, heat[2] + through};
    });
    return;
  }
  repaint(picture, view.width, view.height, [&](int x, int y, float light) {
    const int32_t owner = owners.at(x, y);
    if (owner == FaceIdMap::kNone) return Colour();
    const bool is_line = plan.faces().front().has_corners() &&
                         ((x > 0 && owners.at(x - 1, y) != owner) || (y > 0 && owners.at(x, y - 1) != owner));
    if (is_line) return Colour{kMapLine, kMapLine, kMapLine};
    const Node node = at(x, y);
    const float scale = map_brightness(light);
    return Colour{scale * node.r, scale * node.g, scale * node.b};
  });
}

}  // namespace lf
