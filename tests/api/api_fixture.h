// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <lightfield/node.h>
#include <lightfield/renderer.h>

#include "lib/focus/array_of_walls.h"
#include "reference/generators.h"
#include "rig/rig_json.h"
#include "support/test.h"

namespace lightfield::test {

inline Rig public_rig(const lf::Rig& rig) { return parse_rig(lf::rig_to_json(rig)); }

inline Image public_image(lf::Image image) {
  return {static_cast<PixelFormat>(image.family()), image.width(), image.height(), std::move(image.data())};
}

inline std::vector<Image> public_images(const std::vector<lf::Image>& images) {
  std::vector<Image> out;
  for (const lf::Image& image : images) out.push_back(public_image(image));
  return out;
}

inline lf::View private_view(const View& view) {
  lf::View out;
  out.width = view.width;
  out.height = view.height;
  out.lens = lf::Lens::from_fov_y(view.fov_y, view.width, view.height);
  const auto& [p, q] = view.world_from_view;
  out.pose = {{p.x, p.y, p.z}, {q.w, q.x, q.y, q.z}};
  out.focus.plane = lf::focal_plane_at(out.pose, view.focus_distance);
  out.blending = lf::make_blending(view.aperture, 0);
  return out;
}

struct Array {
  explicit Array(PixelFormat format = PixelFormat::kRgb, uint64_t seed = 1)
      : inside(lf::reference::planar_grid(3, 4, 0.1)), rig(public_rig(inside)) {
    lf::reference::Random random(seed);
    originals = lf::reference::images_of(inside, random, &lf::reference::smooth_image);
    if (format == PixelFormat::kI420)
      for (lf::Image& image : originals) image = lf::to_i420(image);
    images = public_images(originals);
    view = home_view(rig, 96, 72);
    view.world_from_view.position.x += 0.013;
    view.world_from_view.position.y -= 0.02;
  }
  lf::Rig inside;
  Rig rig;
  std::vector<lf::Image> originals;
  std::vector<Image> images;
  View view;
};

// Two walls at different distances, a camera with less light, and a view from between the cameras that is focused on
// neither wall.
struct Walls {
  explicit Walls(double gain = 1) : rig(public_rig(walls.rig)), images(public_images(walls.images)) {
    for (uint8_t& value : images[4].pixels) value = static_cast<uint8_t>(value * gain);
    view.width = 160;
    view.height = 120;
    view.fov_y = 25;
    view.world_from_view.position = {0.013, -0.017, 0};
    view.focus_distance = 1.1;
  }
  // Returns the mean error, 0 to 255, without the border of the image.
  double mean_error(const Image& picture) const {
    const lf::View inside = private_view(view);
    double sum = 0;
    int count = 0;
    for (int y = 20; y < 100; y++)
      for (int x = 20; x < 140; x++, count++) {
        const lf::Vec3 d(*inside.lens.unproject({x, y}), 1);
        const lf::Vec3 near = inside.pose.position + 1.5 * d, far = inside.pose.position + 3. * d;
        const lf::Vec3 at = near.x > 0 ? near : far;
        sum += std::abs(picture.pixels[3 * (static_cast<size_t>(y) * 160 + x)] - walls.luma_at(at));
      }
    return sum / count;
  }
  lf::test::ArrayOfWalls walls;
  Rig rig;
  std::vector<Image> images;
  View view;
};

inline std::string error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "no lightfield::Error was thrown";
}

#define EXPECT_API_ERROR(statement, ...) \
  EXPECT_MENTIONS(lightfield::test::error_of([&] { (void)(statement); }), __VA_ARGS__)

}  // namespace lightfield::test
