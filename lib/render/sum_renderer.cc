// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/sum_renderer.h"

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "render/camera_projection.h"
#include "render/contribution.h"
#include "render/fragment_renderer.h"
#include "render/simd/band_data.h"

namespace lf {
namespace {

// Camera coordinates are homography * ray(x, y); for pinhole views the ray is linear in the pixel too.
Mat3 from_pixel(const Mat3& camera_from_ray, const Rays& rays) {
  const Vec2 origin = rays.at(0, 0);
  const double du = rays.at(1, 0).x - origin.x, dv = rays.at(0, 1).y - origin.y;
  return {camera_from_ray[0] * du, camera_from_ray[1] * dv, camera_from_ray * Vec3(origin, 1)};
}

simd::Slot make_slot(const ViewPlan& plan, const Camera& camera, const Source& source, PixelFamily family,
                     const CameraProjection& projection) {
  simd::Slot slot;
  slot.camera = source.camera;
  slot.image = source.image;
  slot.rect = plan.camera_rect(source.camera);
  if (family == PixelFamily::kI420) slot.rect = chroma_aligned(slot.rect, plan.view());
  slot.projection = &projection;
  if (plan.rays().separable()) slot.from_pixel = from_pixel(projection.camera_from_ray(), plan.rays());
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
  slot.calm = plan.rays().separable() && simd::is_calm(slot, family);
  return slot;
}

}  // namespace

struct SumRenderer::State {
  simd::SumTask task;
  std::vector<CameraProjection> projections;
};

SumRenderer::SumRenderer(const ViewPlan& plan, const OwnerRuns& runs, std::span<const Source> sources,
                         PixelFamily family, Coordinates coordinates)
    : state_(std::make_unique<State>()) {
  simd::SumTask& task = state_->task;
  task.plan = &plan;
  task.runs = &runs;
  task.family = family;
  task.exact = coordinates == Coordinates::kExact;
  task.slot_of_camera.assign(plan.num_cameras(), -1);
  state_->projections.reserve(sources.size());  // slots point at them
  for (const Source& source : sources) {
    const Camera& camera = *source.rig_camera;
    if (source.image.family != PixelFamily::kNone) {
      if (source.image.family != family) throw Error("camera " + std::to_string(camera.id) + ": another pixel family");
      plain::check_image(camera, source.image);
    }
    if (plan.camera_rect(source.camera).empty()) continue;
    state_->projections.emplace_back(plan, camera);
    task.slot_of_camera[source.camera] = static_cast<int32_t>(task.slots.size());
    task.slots.push_back(make_slot(plan, camera, source, family, state_->projections.back()));
    rect_ = unite(rect_, task.slots.back().rect);
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

SumRenderer::~SumRenderer() = default;

bool SumRenderer::render_rows(int y0, int y1, const SumPlanes& out) const {
  const simd::SumTask& task = state_->task;
  const Rect& rect = out.rect;
  const bool i420 = task.family == PixelFamily::kI420;
  const int first_block = rect.x0 / simd::kBlock;
  const size_t blocks = static_cast<size_t>((rect.x1 + simd::kBlock - 1) / simd::kBlock - first_block);
  const int skip = rect.x0 - first_block * simd::kBlock, chroma_width = chroma_size(rect.width());

  thread_local simd::Scratch scratch;
  scratch.head.resize(std::max(scratch.head.size(), blocks));
  for (auto& last : scratch.last_face) last.resize(std::max(last.size(), blocks));
  scratch.bands.resize(std::max(scratch.bands.size(), task.slots.size()));
  for (simd::SlotBand& band : scratch.bands) band.y = -1;
  for (int r = 0; r < simd::kBandRows; r++) {
    for (auto& sum : scratch.sum_memory[r]) sum.resize(std::max(sum.size(), blocks * simd::kBlock));
    scratch.lost_memory[r].resize(std::max(scratch.lost_memory[r].size(), blocks * simd::kBlock));
  }

  // Whole blocks are written right where they belong.
  const bool direct = skip == 0 && rect.width() % simd::kBlock == 0;
  bool any_lost = false;
  for (int y = y0; y < y1; y += simd::kBandRows) {
    const auto row_of = [&](int c, int r) {
      const int row = i420 && c > 0 ? (y - rect.y0) / 2 + r : y - rect.y0 + r;
      return out.plane[c] + row * out.stride[c];
    };
    const auto has = [&](int c, int r) { return y + (i420 && c > 0 ? 2 * r : r) < y1; };
    for (int r = 0; r < simd::kBandRows; r++) {
      for (int c = 0; c < 3; c++)
        scratch.sum[r][c] = direct && has(c, r) ? row_of(c, r) : scratch.sum_memory[r][c].data();
      scratch.lost[r] = direct && out.lost && y + r < y1 ? out.lost + (y - rect.y0 + r) * out.lost_stride
                                                         : scratch.lost_memory[r].data();
    }
    scratch.any_lost = false;
    simd::render_band(task, {rect.x0, rect.y0, rect.x1, y1}, y, scratch);
    any_lost = any_lost || scratch.any_lost;
    if (direct) continue;
    for (int r = 0; r < simd::kBandRows; r++) {
      for (int c = 0; c < 3; c++)
        if (has(c, r))
          std::copy_n(scratch.sum[r][c] + (i420 && c > 0 ? skip / 2 : skip),
                      i420 && c > 0 ? chroma_width : rect.width(), row_of(c, r));
      if (out.lost && y + r < y1)
        std::copy_n(scratch.lost[r] + skip, rect.width(), out.lost + (y - rect.y0 + r) * out.lost_stride);
    }
  }
  return any_lost;
}

const char* simd_target_name() { return simd::target_name(); }

}  // namespace lf
