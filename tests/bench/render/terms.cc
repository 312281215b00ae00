// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/collector.h"
#include "reference/reference_lens.h"
#include "reference/renderer.h"
#include "render/camera_projection.h"
#include "render/ownership.h"

namespace lf::bench {
namespace {

RenderJob job_of(const Scene& scene) { return {scene.rig(), scene.mesh(), scene.views().front(), scene.cameras()}; }

// Weights of the cameras in float, from edge functions in double.
Spread weights(const Scene& scene) {
  const RenderJob job = job_of(scene);
  const reference::Picture exact = reference::render(scene.rig(), scene.mesh(), scene.views().front(), {});
  Collector errors;
  for (const CameraIndex camera : job.cameras()) {
    const Rect rect = job.plan().camera_rect(camera);
    const std::vector<float> own = pixel_weights(job.plan(), job.owners(), camera, rect);
    size_t i = 0;
    for (int y = rect.y0; y < rect.y1; y++)
      for (int x = rect.x0; x < rect.x1; x++, i++)
        if (own[i] != 0) errors.add(own[i] - exact.weight_of(x, y, camera));
  }
  return errors.spread();
}

// Positions in the cameras' images, in double.
Spread positions(const Scene& scene) {
  using namespace reference;
  const RenderJob job = job_of(scene);
  const View& view = scene.views().front();
  const ReferenceLens view_lens(view.lens);
  const V3 normal = to_v3(view.focus.plane.normal), eye = to_v3(view.pose.position);
  Collector errors;
  for (const CameraIndex camera : job.cameras()) {
    const Camera& rig_camera = scene.rig().cameras[camera];
    const ReferenceLens lens(rig_camera.lens);
    const CameraProjection projection(job.plan(), camera, rig_camera);
    const Rect rect = job.plan().camera_rect(camera);
    for (int y = rect.y0; y < rect.y1; y++)
      for (int x = rect.x0; x < rect.x1; x++) {
        Vec2 position;
        if (!projection.project(job.plan().rays().at(x, y), 0, position)) continue;
        const auto ray = view_lens.line_of_sight({static_cast<Real>(x), static_cast<Real>(y)});
        const V3 d = rotate(view.pose.orientation, V3{ray->x, ray->y, 1});
        const V3 point = eye + (-(dot(normal, eye) + view.focus.plane.d) / dot(normal, d)) * d;
        const V3 in_camera =
            rotate(rig_camera.pose.orientation, point - to_v3(rig_camera.pose.position), /*inverse=*/true);
        const auto at = lens.project(in_camera);
        errors.add(static_cast<double>(position.x - at->x));
        errors.add(static_cast<double>(position.y - at->y));
      }
  }
  return errors.spread();
}

// Camera images with chroma at half resolution: to YCbCr 4:2:0 and back.
Spread chroma_subsampling(const Scene& scene) {
  Collector errors;
  for (const CameraIndex camera : {scene.cameras().front(), scene.cameras().back()}) {
    const Image& rgb = scene.source(camera, PixelFamily::kRgb);
    const Image back = to_rgb(to_i420(rgb));
    for (size_t i = 0; i < rgb.data().size(); i++) errors.add(back.data()[i] - rgb.data()[i]);
  }
  return errors.spread();
}

}  // namespace

std::vector<Term> plain_terms() {
  return {{"edge functions: weights in float", "of 1", 1e-6, weights},
          {"coordinates in double", "pixels", 1e-6, positions},
          {"chroma at half resolution", "of 255", 0, chroma_subsampling}};
}

}  // namespace lf::bench
