// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "base/worker_pool.h"
#include "depth/camera_depth.h"
#include "rig/mesh.h"
#include "rig/still_image_cache.h"
#include "view/view.h"

namespace lf {

// The depths that the cameras of an array see at one time, and the surface of the scene for any view. Each camera has a
// depth map of its own, matched against the cameras around it, so that the surface has sharp edges where the images
// have, and irregular arrays work like grids. Immutable.
class ArrayDepth {
 public:
  // Cameras that a camera is matched with, cameras that its depths are checked with, and cameras that determine the
  // surface of a view.
  static constexpr int kMatched = 6, kChecked = 6, kCameras = 8;

  // Estimates the depths of `cameras` (ascending) from their images, which must have the rig's sizes. `nearest` and
  // `farthest` limit the search, as inverse distances from the cameras in 1/m. The scene's own range is found first, at
  // a quarter of the resolution. The time is proportional to the number of pixels: about 1.5 s for each camera of
  // 1008x756 pixels in one thread. `parallel` distributes the cameras.
  ArrayDepth(const Rig& rig, const CameraSet& cameras, const CameraImages& images, double farthest, double nearest,
             const ParallelFor& parallel = serial_for);

  // The range of the scene that was found.
  const DepthSweep& range() const { return range_; }

  // Returns the surface of a view, as distances from the plane through the eye that faces along the view's axis. At
  // each node of the map, it is the nearest depth at which the depth maps of the kCameras cameras around the view
  // agree, weighted by their confidence. A camera that sees something nearer does not count. Nodes that no camera sees
  // have the depth `range().farthest`.
  FocalMap surface(const View& view, const ParallelFor& parallel = serial_for) const;

 private:
  struct Camera {
    MatchingImage image;
    CameraDepth depth;
  };
  struct WeightedCamera {
    const Camera* camera;
    float weight;
  };
  void estimate(const Rig& rig, const CameraSet& cameras, const CameraImages& images, int divisor,
                const ParallelFor& parallel);
  // Returns the range that most of the confident depths are in.
  DepthSweep confident_range() const;
  std::vector<WeightedCamera> cameras_around(const Vec3& eye) const;
  float inverse_at(const std::vector<WeightedCamera>& cameras, const View& view, const Vec2& pixel) const;

  std::vector<Camera> cameras_;
  DepthSweep range_;
};

}  // namespace lf
