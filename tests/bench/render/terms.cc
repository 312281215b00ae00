// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/collector.h"
#include "composite/accumulator.h"
#include "jpeg/fragment_decoder.h"
#include "jpeg/fragment_encoder.h"
#include "quality/quality.h"
#include "reference/float_renderer.h"
#include "reference/reference_lens.h"
#include "reference/renderer.h"
#include "render/camera_projection.h"
#include "render/fragment_renderer.h"
#include "render/render_job.h"

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
    const std::vector<float> hat = camera_hat(job.plan(), job.owners(), camera, rect);
    size_t i = 0;
    for (int y = rect.y0; y < rect.y1; y++)
      for (int x = rect.x0; x < rect.x1; x++, i++)
        if (hat[i] != 0) errors.add(hat[i] - exact.weight_of(x, y, camera));
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

// Colours in float, before anything is rounded to 8 bits: weights, positions and bilinear interpolation together.
Spread interpolation(const Scene& scene) {
  std::vector<Image> images;
  for (const CameraIndex camera : scene.cameras()) images.push_back(scene.source(camera, PixelFamily::kRgb));
  const reference::Picture exact = reference::render(scene.rig(), scene.mesh(), scene.views().front(), images);
  const FloatStill& still = scene.exact(PixelFamily::kRgb);
  Collector errors;
  for (size_t i = 0; i < still.colour.size(); i++)
    if (still.valid[i / 3] > 0.01) errors.add(still.colour[i] - exact.pixels[i / 3].colour[i % 3]);
  return errors.spread();
}

// One camera's weighted samples, rounded to the 8 bits of a fragment.
Spread fragment_rounding(const Scene& scene) {
  const RenderJob job = job_of(scene);
  const auto renderer = make_scalar_renderer();
  Collector errors;
  for (const CameraIndex camera : job.cameras()) {
    const Camera& rig_camera = scene.rig().cameras[camera];
    const ImageView image = scene.image(camera, Pixels::kI420);
    const auto rounded = renderer->render(job.plan(), job.owners(), camera, rig_camera, image);
    const auto exact = render_float(job.plan(), job.owners(), camera, rig_camera, image);
    if (!rounded || !exact) continue;
    const size_t luma = exact->valid.size();
    for (size_t i = 0; i < exact->colour.size(); i++) {
      const uint8_t byte = rounded->pixels[i];
      errors.add((i < luma ? byte : static_cast<int8_t>(byte)) - exact->colour[i]);
    }
  }
  return errors.spread();
}

// The sum of such fragments, as a compositor makes it.
Spread accumulation(const Scene& scene) {
  const RenderJob job = job_of(scene);
  const auto renderer = make_scalar_renderer();
  Accumulator sum;
  sum.reset(PixelFamily::kI420, scene.views().front().width, scene.views().front().height);
  for (const CameraIndex camera : job.cameras())
    if (const auto fragment = renderer->render(job.plan(), job.owners(), camera, scene.rig().cameras[camera],
                                               scene.image(camera, Pixels::kI420)))
      sum.add(*fragment);
  const Image picture = sum.resolve();
  const FloatStill& exact = scene.exact(PixelFamily::kI420);
  Collector errors;
  for (size_t i = 0; i < exact.valid.size(); i++)
    if (exact.valid[i] > kCovered) errors.add(picture.data()[i] - exact.colour[i]);
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

// Weighted fragments through JPEG and back: all samples of a plane (0: luma).
template <int kQuality, int kPlane>
Spread jpeg_error(const Scene& scene) {
  const RenderJob job = job_of(scene);
  const auto renderer = make_scalar_renderer();
  jpeg::FragmentEncoder encoder;
  jpeg::FragmentDecoder decoder;
  Collector errors;
  for (const CameraIndex camera : job.cameras()) {
    const auto fragment = renderer->render(job.plan(), job.owners(), camera, scene.rig().cameras[camera],
                                           scene.image(camera, Pixels::kI420));
    if (!fragment) continue;
    const FragmentPlanes before = planes_of(*fragment);
    FragmentPlanes after{.family = before.family, .rect = before.rect};
    ByteBuffer scan;
    encoder.encode_pixels({&before, 1}, kQuality, scan);
    decoder.decode_pixels(scan, kQuality, {&after, 1});
    const auto side = [](int luma) { return kPlane == 0 ? luma : chroma_size(luma); };
    const auto value = [](const FragmentPlanes& planes, int x, int y) -> int {
      const uint8_t byte = planes.plane[kPlane][y * planes.stride[kPlane] + x];
      return kPlane == 0 ? byte : static_cast<int8_t>(byte);
    };
    for (int y = 0; y < side(before.rect.height()); y++)
      for (int x = 0; x < side(before.rect.width()); x++) errors.add(value(after, x, y) - value(before, x, y));
  }
  return errors.spread();
}

}  // namespace

std::vector<Term> plain_terms() {
  return {{"edge functions: weights in float", "of 1", 1e-6, weights},
          {"coordinates in double", "pixels", 1e-6, positions},
          {"interpolation in float, with both of these", "of 255", 2e-3, interpolation},
          {"weighted samples rounded to 8 bits", "of 255", 0.5 + 1e-3, fragment_rounding},
          {"sum of three 8-bit samples", "of 255", 1.75, accumulation},
          {"chroma at half resolution", "of 255", 0, chroma_subsampling},
          {"JPEG 50, luma of a fragment", "of 255", 0, jpeg_error<50, 0>},
          {"JPEG 75, luma of a fragment", "of 255", 0, jpeg_error<75, 0>},
          {"JPEG 90, luma of a fragment", "of 255", 0, jpeg_error<90, 0>},
          {"JPEG 95, luma of a fragment", "of 255", 0, jpeg_error<95, 0>},
          {"JPEG 90, chroma of a fragment", "of 255", 0, jpeg_error<90, 1>}};
}

}  // namespace lf::bench
