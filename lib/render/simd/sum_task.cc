// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/simd/sum_task.h"

#include <algorithm>

#include "base/error.h"

namespace lf::simd {

ProjectionTerms terms_at(const Slot& slot, double x, double y) {
  const Vec3 start = slot.from_pixel * Vec3(x, y, 1);
  const double scale = 1 / std::max(std::abs(start.z), 1e-300);
  ProjectionTerms terms;
  for (int k = 0; k < 3; k++) {
    terms.from[k] = static_cast<float>(start[k] * scale);
    terms.along[k] = static_cast<float>(slot.from_pixel[0][k] * scale);
    terms.down[k] = static_cast<float>(slot.from_pixel[1][k] * scale);
  }
  return terms;
}

ProjectionTerms terms_at(const Slot& slot, double x, double y, double inverse) {
  const Vec3 per = slot.per_inverse * Vec3(x, y, 1);
  const Vec3 start = slot.from_pixel * Vec3(x, y, 1) + inverse * per;
  const double scale = 1 / std::max(std::abs(start.z), 1e-300);
  ProjectionTerms terms{.near = inverse};
  for (int k = 0; k < 3; k++) {
    terms.from[k] = static_cast<float>(start[k] * scale);
    terms.along[k] = static_cast<float>((slot.from_pixel[0][k] + inverse * slot.per_inverse[0][k]) * scale);
    terms.down[k] = static_cast<float>((slot.from_pixel[1][k] + inverse * slot.per_inverse[1][k]) * scale);
    terms.per_from[k] = static_cast<float>(per[k] * scale);
    terms.per_along[k] = static_cast<float>(slot.per_inverse[0][k] * scale);
    terms.per_down[k] = static_cast<float>(slot.per_inverse[1][k] * scale);
  }
  return terms;
}

namespace {

// Camera coordinates are homography * ray(x, y); for pinhole views the ray is linear in the pixel too.
Mat3 from_pixel(const Mat3& camera_from_ray, const Rays& rays) {
  const Vec2 origin = rays.at(0, 0);
  const double du = rays.at(1, 0).x - origin.x, dv = rays.at(0, 1).y - origin.y;
  return {camera_from_ray[0] * du, camera_from_ray[1] * dv, camera_from_ray * Vec3(origin, 1)};
}

void pick_pixels(const RgbLayout& layout, Slot& slot) {
  constexpr int kNothing = 0x80;
  const int offset[4] = {layout.r, layout.g, layout.b, 0};
  for (int i = 0; i < 16; i++) {
    const int c = i % 8 / 2;
    slot.pixel_pairs[i] = static_cast<uint8_t>(c == 3 ? kNothing : i / 8 * 8 + offset[c] + i % 2 * layout.pixel_stride);
    slot.pixel_taps[i] = static_cast<uint8_t>(offset[i / 4] + i % 4 * layout.pixel_stride);
  }
}

// They depend on how the image lies in memory, too.
void look_for_calm_rows(const ViewPlan& plan, PixelFamily family, Slot& slot) {
  slot.calm_y0 = slot.calm_y1 = 0;
  const bool is_here = slot.image.plane[0] || slot.image.family == PixelFamily::kNone;
  if (is_here && plan.rays().separable() && !slot.projection->has_map()) find_calm_rows(family, slot);
}

Slot make_slot(const ViewPlan& plan, const Camera& camera, const Source& source, PixelFamily family,
               const CameraProjection& projection) {
  Slot slot;
  slot.camera = source.camera;
  slot.image = source.image;
  if (family == PixelFamily::kRgb) pick_pixels(source.image.layout, slot);
  slot.rect = plan.camera_rect(source.camera);
  if (family == PixelFamily::kI420) slot.rect = chroma_aligned(slot.rect, plan.view());
  slot.projection = &projection;
  if (plan.rays().separable()) {
    slot.from_pixel = from_pixel(projection.camera_from_ray(), plan.rays());
    if (projection.has_map()) slot.per_inverse = from_pixel(projection.per_inverse(), plan.rays());
  }
  if (projection.has_map()) {
    const int x = slot.rect.x0 / kBlock * kBlock, y = slot.rect.y0 / kBandRows * kBandRows;
    slot.terms = terms_at(slot, x, y, plan.inverse_at(x, y));
  }
  slot.eye_distance = static_cast<float>(plan.eye_distance());
  const Lens& lens = camera.lens;
  slot.fx = static_cast<float>(lens.fx());
  slot.fy = static_cast<float>(lens.fy());
  slot.cx = static_cast<float>(lens.cx());
  slot.cy = static_cast<float>(lens.cy());
  slot.k1 = static_cast<float>(lens.k1());
  slot.k2 = static_cast<float>(lens.k2());
  slot.p1 = static_cast<float>(lens.p1());
  slot.p2 = static_cast<float>(lens.p2());
  slot.tangential = lens.p1() != 0 || lens.p2() != 0;
  slot.radial = lens.has_distortion();
  // Slightly less than the fold: rounding must not see beyond it.
  slot.max_r2 = static_cast<float>(std::min(lens.max_radius() * lens.max_radius() * (1 - 1e-6), 1e30));
  look_for_calm_rows(plan, family, slot);
  return slot;
}

}  // namespace

void place_image(const SumTask& task, Slot& slot, const ImageView& image) {
  slot.image = image;
  look_for_calm_rows(*task.plan, task.family, slot);
}

size_t samples_of(const SumTask& task, const Rect& rect) {
  size_t samples = 0;
  for (const Slot& slot : task.slots) {
    const Rect part = intersect(slot.rect, rect);
    if (!part.empty()) samples += static_cast<size_t>(part.width()) * part.height();
  }
  return samples;
}

PreparedTask::PreparedTask(const ViewPlan& plan, const OwnerRuns& runs, std::span<const Source> sources,
                           PixelFamily family, Coordinates coordinates) {
  task.plan = &plan;
  task.runs = &runs;
  task.family = family;
  task.exact = coordinates == Coordinates::kExact;
  task.slot_of_camera.assign(plan.num_cameras(), -1);
  projections.reserve(sources.size());  // slots point at them
  for (const Source& source : sources) {
    const Camera& camera = *source.rig_camera;
    if (source.image.family != PixelFamily::kNone) {
      if (source.image.family != family) throw Error("camera " + std::to_string(camera.id) + ": another pixel family");
      check_image(camera, source.image);
    }
    if (plan.camera_rect(source.camera).empty()) continue;
    projections.emplace_back(plan, source.camera, camera);
    task.slot_of_camera[source.camera] = static_cast<int32_t>(task.slots.size());
    task.slots.push_back(make_slot(plan, camera, source, family, projections.back()));
    rect = unite(rect, task.slots.back().rect);
  }
  task.face_corners.reserve(plan.faces().size());
  for (const FacePlan& face : plan.faces()) {
    uint8_t corners = 0;
    for (int k = 0; k < 3; k++)
      if (face.camera[k] != MeshFace::kNone && task.slot_of_camera[face.camera[k]] >= 0)
        corners |= static_cast<uint8_t>(1 << k);
    task.face_corners.push_back(corners);
  }
}

Scratch& scratch_for(const Rect& rect, size_t slots) {
  thread_local Scratch scratch;
  const size_t blocks = static_cast<size_t>((rect.x1 + kBlock - 1) / kBlock - rect.x0 / kBlock);
  scratch.head.resize(std::max(scratch.head.size(), blocks));
  scratch.last_faces.resize(std::max(scratch.last_faces.size(), blocks));
  scratch.bands.resize(std::max(scratch.bands.size(), slots));
  for (SlotBand& band : scratch.bands) band.y = -1;
  for (int r = 0; r < kBandRows; r++) {
    for (int c = 0; c < 3; c++) {
      auto& sum = scratch.sum_memory[r][c];
      sum.resize(std::max(sum.size(), blocks * kBlock));
      scratch.sum[r][c] = sum.data();
    }
    auto& lost = scratch.lost_memory[r];
    lost.resize(std::max(lost.size(), blocks * kBlock));
    scratch.lost[r] = lost.data();
  }
  return scratch;
}

}  // namespace lf::simd
