// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "base/byte_buffer.h"
#include "base/parallel.h"
#include "focus/camera_gains.h"
#include "focus/mean_luma.h"
#include "render/sum_renderer.h"
#include "render/view_plan.h"
#include "rig/mesh.h"

namespace lf {

// The view in which cameras compare their brightness: a pixel for each node of a map that is its focal map, smoothed,
// with nodes twice as far apart. `view` has a map.
View mean_view(const View& view);

// What some cameras see of a view with wider weights than those of the mesh, so that many are compared: Gaussians of
// the distance, in the plane that the map counts from, of the camera from where the line of sight goes through it, of
// the camera mesh's median edge. Cut off at kWidest of these.
class WideLuma {
 public:
  static constexpr double kWidest = 2.5;
  static constexpr float kPeak = 0.125f;  // of the weights: over a grid they sum to 0.79

  // `view`: a mean_view(). `own`: cameras in service, ascending.
  WideLuma(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own);
  // Those of them that have a weight, ascending: whole images of them are looked at.
  const std::vector<CameraIndex>& cameras() const { return cameras_; }

  // What they saw, to be kept until there is a mean to compare with.
  struct Camera {
    CameraIndex camera = 0;
    std::vector<uint8_t> luma;  // divided by its gain, a value for each node
    std::vector<float> weight;  // 0 where it sees nothing
  };
  struct Seen {
    std::vector<Camera> cameras;
    Moments moments;  // of them all
    GainSum gains;
  };
  // `sources`: of cameras() and maybe others. The result does not depend on `parallel`. Throws Error for an image that
  // is not of its camera's size.
  Seen see(std::span<const Source> sources, const CameraGains& gains, const ParallelFor& parallel = serial_for) const;

  // How many times as bright as the mean a camera is, divided by its gain: the median over the nodes, nothing where
  // these are too few. `mean`: see mean_luma().
  static std::optional<float> ratio(const Camera& seen, std::span<const uint8_t> mean);

 private:
  Camera see(const Source& source, float gain) const;

  ViewPlan plan_;
  std::vector<CameraIndex> cameras_;
  Vec3 across_, down_;           // along the plane, in units of the pitch
  std::vector<Vec2> crossings_;  // of the lines of sight with the plane, a value for each node
  std::vector<float> u_, v_;     // of the nodes, and kTrialSpare values of no meaning, as of
  ByteBuffer levels_;            // their levels
};

}  // namespace lf
