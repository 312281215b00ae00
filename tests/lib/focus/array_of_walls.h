// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "focus/hypothesis_renderer.h"
#include "scene/scene.h"
#include "support/rigs.h"

namespace lf::test {

// `side` x `side` cameras in front of a textured wall at 3 m and, in its right half (x > 0), a wall at 1.5 m; all
// distances divided by `times_nearer`. The texture is smooth, so sampling errors do not matter.
struct ArrayOfWalls {
  explicit ArrayOfWalls(bool flat = false, double times_nearer = 1, int side = 3)
      : is_flat(flat), nearer(times_nearer), rig(scene_rig(side, side, 160, 120)), mesh(build_mesh(rig)) {
    for (const Camera& camera : rig.cameras) {
      Image image(PixelFamily::kRgb, camera.width, camera.height);
      for (int y = 0; y < camera.height; y++)
        for (int x = 0; x < camera.width; x++) {
          const Vec3 d(*camera.lens.unproject({x, y}), 1);
          const Vec3 near = camera.pose.position + 1.5 / nearer * d, far = camera.pose.position + 3 / nearer * d;
          const Vec3 at = !flat && near.x > 0 ? near : far;
          for (int c = 0; c < 3; c++)
            image.data()[3 * (static_cast<size_t>(y) * camera.width + x) + c] =
                static_cast<uint8_t>(std::lround(luma_at(at)));
        }
      images.push_back(std::move(image));
    }
    own = all_cameras(rig);
  }

  // The texture of the walls.
  static double luma_at(const Vec3& at) {
    return 128 + 50 * std::sin(31 * at.x + 7 * at.y) + 50 * std::sin(23 * at.y - 11 * at.x);
  }

  // A view between the cameras, with a focal map of one level. 1.5 m is level 170, 3 m is level 60.
  View view(uint8_t level) const {
    View view = view_from({0.013, -0.017, 0}, 160, 120, 25, 3);
    constexpr double kFarthest = 1 / 3. - 60 * kLevel;
    view.focus.map = level_surface(160, 120, kFarthest, kFarthest + 255 * kLevel, level);
    return view;
  }

  std::vector<Source> sources() const {
    std::vector<Source> all;
    for (CameraIndex i = 0; i < rig.cameras.size(); i++) all.push_back({i, &rig.cameras[i], images[i].view()});
    return all;
  }

  std::vector<PhotoConsistency> moments(const View& view, const std::vector<DepthHypothesis>& hypotheses,
                                        const std::vector<CameraIndex>& cameras,
                                        const CameraSet& out_of_service = {}) const {
    const std::vector<std::vector<uint8_t>> levels = hypothesis_levels(view, hypotheses);
    std::vector<PhotoConsistency> sums(levels.size());
    for (PhotoConsistency& sum : sums) sum.reset(view.focus.map->columns, view.focus.map->rows);
    const Mesh in_service = build_mesh(rig, out_of_service);
    const RenderJob job(rig, in_service, hypothesis_view(view), cameras);
    std::vector<Source> seeing;
    for (const CameraIndex camera : job.cameras()) seeing.push_back(sources()[camera]);
    add_consistency(job, seeing, levels, sums);
    return sums;
  }

  static constexpr double kLevel = (1 / 1.5 - 1 / 3.) / 110;
  bool is_flat;
  double nearer;
  Rig rig;
  Mesh mesh;
  std::vector<Image> images;
  std::vector<CameraIndex> own;
};

}  // namespace lf::test
