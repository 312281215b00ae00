// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/simd/sum_task.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "render/camera_projection.h"

namespace lf::simd {

void PlanePositions::resize(size_t n) {
  node_x.resize(n);
  node_y.resize(n);
  window.resize(n);
  corner.resize(n);
  fetch.resize(n);
}

void CellNodes::resize(size_t n) {
  for (auto& row : even) row.resize(std::max(row.size(), n));
  for (auto& row : odd) row.resize(std::max(row.size(), n));
}

void CellWork::resize(size_t n) {
  if (error_bound.even[0].size() >= n) return;
  for (CellNodes* nodes : {&along_x, &along_y, &down_x, &down_y, &error_bound}) nodes->resize(n);
}

void SurfaceBand::resize(int blocks) {
  constexpr int kLanes = 2 * kBlock;  // twice the lanes of any vector: nodes to the right of the last half are read
  const int wanted = (2 * blocks + kLanes - 1) / kLanes * kLanes + kLanes;
  if (pitch >= wanted) return;
  pitch = wanted;
  const size_t halves = pitch, cells = halves * kCellRows, rows = halves * kBandRows;
  for (CellNodes* of : {&x, &y, &z, &per_z}) of->resize(halves);
  for (auto* of : {&low_x, &high_x, &low_y, &high_y, &slack_x, &slack_y}) of->resize(cells);
  for (auto* of : {&nodes, &along, &down}) of->resize(8 * cells);
  luma_corner.resize(rows);
  luma_origin.resize(rows);
  chroma_corner.resize(rows / 4);
  chroma_origin.resize(rows / 4);
  interior_pairs.resize(halves / 2);
}

namespace {

// Returns the factor that makes the depth 1, or for a fisheye lens the distance: its points may have any depth.
double scale_of(const Slot& slot, const Vec3& start) {
  return 1 / std::max(slot.distortion.fisheye ? glm::length(start) : std::abs(start.z), 1e-300);
}

}  // namespace

ProjectionTerms terms_at(const Slot& slot, double x, double y) {
  const Vec3 start = slot.from_pixel * Vec3(x, y, 1);
  const double scale = scale_of(slot, start);
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
  const double scale = scale_of(slot, start);
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

// Camera coordinates are homography * ray(x, y). For pinhole views the ray is linear in the pixel.
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

}  // namespace

Bends::Bends(const Lens::Steepness& of, bool fisheye, double angle)
    : first(static_cast<float>(of.first)), second(static_cast<float>(of.second)), third(static_cast<float>(of.third)) {
  if (!fisheye) return;
  // The derivatives of (a, b) along a great circle at these angles, in the worst direction.
  constexpr struct {
    double degrees, first, second, third;
  } kRings[] = {{0, 1, 0, 0},
                {20, 1.0207, 0.2366, 0.0387},
                {40, 1.0862, 0.4980, 0.1693},
                {60, 1.2093, 0.8190, 0.4478},
                {80, 1.4179, 1.2634, 1.0252},
                {95, 1.665, 1.759, 1.967}};
  size_t i = 1;
  const double degrees = angle * 180 / M_PI;
  while (i + 1 < std::size(kRings) && kRings[i].degrees < degrees) i++;
  const auto &low = kRings[i - 1], &high = kRings[i];
  const double share = (degrees - low.degrees) / (high.degrees - low.degrees);
  const auto between = [share](double a, double b) { return static_cast<float>(a + share * (b - a)); };
  const float by = between(low.first, high.first), by2 = between(low.second, high.second),
              by3 = between(low.third, high.third);
  third = by * (by * by * third + 3 * by2 * second) + (by3 + 2 * by) * first;
  second = by * by * second + by2 * first;
  first *= by;
}

namespace {

// Call again when the image memory changes: the result depends on its layout.
void search_interior_rows(const ViewPlan& plan, PixelFamily family, Slot& slot) {
  slot.flat = slot.sloped = {};
  const bool is_here = slot.image.plane[0] || slot.image.family == PixelFamily::kNone;
  if (is_here && plan.rays().separable() && !slot.projection->has_map() && !slot.needs_double)
    find_interior_rows(family, slot);
}

// Returns the longest block for the lens of a slot; see Slot. The next term of Bessel's formula is at most 0.0234 times
// the fourth difference. Fourth derivatives are about twice the third derivatives.
float longest_block(const Lens& lens, const Lens::Steepness& steepness, double third) {
  const double focal = std::max(lens.fx(), lens.fy()), least = steepness.least * std::min(lens.fx(), lens.fy());
  return static_cast<float>(least * std::pow(kGridError / std::max(0.0234 * 2 * focal * third, 1e-30), 0.25));
}

void measure_steepness(const Camera& camera, Slot& slot) {
  const Lens& lens = camera.lens;
  const double half_x = std::max(lens.cx(), camera.width - lens.cx()) + 1,
               half_y = std::max(lens.cy(), camera.height - lens.cy()) + 1;
  slot.steepness = lens.steepness(std::hypot(half_x / lens.fx(), half_y / lens.fy()));
  const bool fisheye = slot.distortion.fisheye;
  slot.longest_block = longest_block(lens, slot.steepness, Bends(slot.steepness, fisheye).third);
  constexpr double kInner = M_PI / 4, kMargin = 0.9;  // rays at a smaller angle are in the inner part of the image
  if (fisheye && kInner < lens.max_length()) {
    slot.longest_inner_block = longest_block(lens, slot.steepness, Bends(slot.steepness, fisheye, kInner).third);
    slot.inner_radius =
        static_cast<float>(kMargin * std::min(lens.fx(), lens.fy()) * std::abs(lens.bend(Vec2(kInner, 0)).x));
  }
  constexpr double kFloat = 1.0 / (1 << 24), kLargestError = 1.0 / 256;  // pixels
  slot.needs_double = !(kFloat * slot.steepness.rounding * std::hypot(half_x, half_y) < kLargestError);
}

Slot make_slot(const ViewPlan& plan, const Camera& camera, const Source& source, PixelFamily family,
               const CameraProjection& projection) {
  Slot slot;
  slot.camera = source.camera;
  slot.image = source.image;
  const FocalMap* const map = plan.view().focus.map.get();
  if (map && map->step == kCell) {
    if (source.visibility && source.visibility->nodes.size() == map->levels.size()) slot.visibility = source.visibility;
    slot.edges = source.edges;
  }
  if (family == PixelFamily::kRgb) pick_pixels(source.image.layout, slot);
  slot.rect = plan.camera_rect(source.camera);
  if (family == PixelFamily::kI420) slot.rect = chroma_aligned(slot.rect, plan.view());
  slot.projection = &projection;
  const Lens& lens = camera.lens;
  slot.distortion = lens.distortion().as<float>();
  slot.distortion.limit = static_cast<float>(std::min(lens.distortion().limit * (1 - 1e-6), 1e30));
  if (plan.rays().separable()) {
    slot.from_pixel = from_pixel(projection.camera_from_ray(), plan.rays());
    if (projection.has_map()) slot.per_inverse = from_pixel(projection.per_inverse(), plan.rays());
  }
  if (projection.has_map()) {
    const int x = slot.rect.x0 / kBlock * kBlock, y = slot.rect.y0 / kBandRows * kBandRows;
    slot.terms = terms_at(slot, x, y, plan.inverse_at(x, y));
  }
  slot.eye_distance = static_cast<float>(plan.eye_distance());
  slot.fx = static_cast<float>(lens.fx());
  slot.fy = static_cast<float>(lens.fy());
  slot.cx = static_cast<float>(lens.cx());
  slot.cy = static_cast<float>(lens.cy());
  slot.is_distorted = lens.has_distortion();
  if (slot.distortion.is_general) measure_steepness(camera, slot);
  search_interior_rows(plan, family, slot);
  return slot;
}

}  // namespace

void place_image(const SumTask& task, Slot& slot, const ImageView& image) {
  slot.image = image;
  search_interior_rows(*task.plan, task.family, slot);
}

size_t samples_of(const SumTask& task, const Rect& rect) {
  size_t samples = 0;
  for (const Slot& slot : task.slots) {
    const Rect part = intersect(slot.rect, rect);
    if (!part.empty()) samples += static_cast<size_t>(part.width()) * part.height();
  }
  return samples;
}

PreparedTask::PreparedTask(const ViewPlan& plan, const FaceRuns& runs, std::span<const Source> sources,
                           PixelFamily family, Coordinates coordinates) {
  task.plan = &plan;
  task.runs = &runs;
  task.family = family;
  task.exact = coordinates == Coordinates::kExact;
  task.slot_of_camera.assign(plan.num_cameras(), -1);
  projections.reserve(sources.size());  // slots point to the elements
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
    task.has_visibility = task.has_visibility || task.slots.back().visibility || task.slots.back().edges;
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
    auto& lost = scratch.missing_memory[r];
    lost.resize(std::max(lost.size(), blocks * kBlock));
    scratch.lost[r] = lost.data();
  }
  return scratch;
}

namespace {

constexpr float kWeightOne = 32768, kLevel = 1 << 7;

int16_t to_sum(float levels) { return static_cast<int16_t>(std::lrintf(levels * kLevel)); }

// Returns the inverse distance of the focal surface at a pixel or, for chroma, between four pixels; a chroma sample
// takes the depth of the upper left pixel at a depth edge. `edges` may be null.
double inverse_at(const ViewPlan& plan, const DepthEdges* edges, double x, double y) {
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const float* const depth = edges ? edges->depth_at(column, row) : nullptr;
  return depth ? *depth : plan.inverse_at(x, y);
}

void add(int16_t& sum, float levels) { sum = static_cast<int16_t>(sum + to_sum(levels)); }

}  // namespace

void add_mixed_block(const SumTask& task, const BlockWeights& weights, int pair, int x, int out, int y_end, int y,
                     Scratch& scratch) {
  const Slot& slot = task.slots[weights.slot];
  const ImageView& image = slot.image;
  const Rays& rays = task.plan->rays();
  const int x_end = std::min(x + kBlock, task.plan->view().width);
  struct Chroma {
    float weight = 0;
    Vec2 position;
  } chroma[kChromaBlock];
  const int r_end = std::min(2 * pair + 2, y_end - y);
  for (int r = 2 * pair; r < r_end; r++)
    for (int i = 0; x + i < x_end; i++) {
      const int16_t w = weights.w[r][i];
      if (w == 0) continue;
      Vec2 position;
      if (!slot.projection->project(rays.at(x + i, y + r), inverse_at(*task.plan, slot.edges, x + i, y + r),
                                    position)) {
        uint16_t& lost = scratch.lost[r][out * kBlock + i];
        lost = static_cast<uint16_t>(std::min(lost + w, 65535));
        scratch.any_missing = true;
        continue;
      }
      const float weight = static_cast<float>(w) / kWeightOne;
      const plain::Sampler at(position, image.width, image.height);
      if (image.family == PixelFamily::kI420) {
        add(scratch.sum[r][0][out * kBlock + i], weight * at.sample(image.plane[0], image.stride[0], 1));
        chroma[i / 2].weight += weight;
        chroma[i / 2].position = position;
      } else {
        const int offset[3] = {image.layout.r, image.layout.g, image.layout.b};
        for (int c = 0; c < 3; c++)
          add(scratch.sum[r][c][out * kBlock + i],
              weight * at.sample(image.plane[0] + offset[c], image.stride[0], image.layout.pixel_stride));
      }
    }
  if (image.family != PixelFamily::kI420) return;
  for (int k = 0; k < kChromaBlock && x + 2 * k < x_end; k++) {
    if (chroma[k].weight == 0) continue;
    const int pixels = (x + 2 * k + 1 < x_end ? 2 : 1) * (r_end - 2 * pair);
    const float weight = chroma[k].weight / static_cast<float>(pixels);
    Vec2 position;
    if (!slot.projection->project_unbounded(rays.at_centre_of_four(x + 2 * k, y + 2 * pair),
                                            inverse_at(*task.plan, slot.edges, x + 2 * k + 0.5, y + 2 * pair + 0.5),
                                            position))
      position = chroma[k].position;
    const plain::Sampler at((position - 0.5) / 2.0, chroma_size(image.width), chroma_size(image.height));
    for (int c = 1; c <= 2; c++)
      add(scratch.sum[pair][c][out * kChromaBlock + k], weight * (at.sample(image.plane[c], image.stride[c], 1) - 128));
  }
}

}  // namespace lf::simd
