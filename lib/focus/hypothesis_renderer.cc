// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/hypothesis_renderer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <numbers>

#include "focus/hypothesis_samples.h"
#include "image/image.h"
#include "render/camera_projection.h"
#include "render/gl/gles_renderer.h"
#include "render/simd/sum_task.h"

namespace lf {

HypothesisProjection hypothesis_projection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera) {
  HypothesisProjection projection;
  const CameraProjection exact(plan, camera, rig_camera);
  for (int k = 0; k < 3; k++)
    for (int column = 0; column < 3; column++) {
      projection.base[3 * k + column] = static_cast<float>(exact.camera_from_ray()[column][k]);
      projection.slope[3 * k + column] = static_cast<float>(exact.per_inverse()[column][k]);
    }
  const Lens& lens = rig_camera.lens;
  projection.fx = static_cast<float>(lens.fx());
  projection.fy = static_cast<float>(lens.fy());
  projection.cx = static_cast<float>(lens.cx());
  projection.cy = static_cast<float>(lens.cy());
  projection.distortion = lens.distortion().as<float>();
  projection.is_distorted = lens.has_distortion();
  projection.width = static_cast<float>(rig_camera.width);
  projection.height = static_cast<float>(rig_camera.height);
  const FocalMap& map = *plan.view().focus.map;
  projection.farthest = static_cast<float>(map.farthest);
  projection.per_level = static_cast<float>((map.nearest - map.farthest) / FocalMap::kLevels);
  projection.eye_distance = static_cast<float>(plan.eye_distance());
  return projection;
}

int hypothesis_box(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera) {
  const View& view = plan.view();
  if (view.width < 2 || view.height < 2) return kHypothesisBox;
  const Rect own = plan.camera_rect(camera), rect = own.empty() ? Rect{0, 0, view.width, view.height} : own;
  const CameraProjection projection(plan, camera, rig_camera);
  const int x = std::min((rect.x0 + rect.x1) / 2, view.width - 2),
            y = std::min((rect.y0 + rect.y1) / 2, view.height - 2);
  const double inverse = (view.focus.map->farthest + view.focus.map->nearest) / 2;
  Vec2 at, right, down;
  if (!projection.project_unbounded(plan.rays().at(x, y), inverse, at) ||
      !projection.project_unbounded(plan.rays().at(x + 1, y), inverse, right) ||
      !projection.project_unbounded(plan.rays().at(x, y + 1), inverse, down))
    return kHypothesisBox;
  const double apart = std::sqrt(glm::distance(at, right) * glm::distance(at, down));
  int box = kHypothesisBox;
  while (box < kMaxHypothesisBox && apart > box * std::numbers::sqrt2) box *= 2;
  return box;
}

Rect hypothesis_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera,
                       std::span<const std::vector<uint8_t>> hypotheses) {
  const Rect least = needed_pixels(plan, camera, rig_camera, hypotheses);
  if (least.empty()) return least;
  // twice the extra reach of the box: even numbers
  const int more = hypothesis_box(plan, camera, rig_camera) - kHypothesisBox;
  return intersect({least.x0 - more, least.y0 - more, least.x1 + more, least.y1 + more},
                   {0, 0, rig_camera.width, rig_camera.height});
}

namespace {

void weigh_by_grid(const WeightGrid& grid, CameraIndex camera, const FaceRun& run, int y, float* weights) {
  constexpr int kStep = WeightGrid::kStep;
  constexpr float kUnit = 1.f / WeightGrid::kOne;
  for (int x = run.x0; x < run.x1;) {
    WeightGrid::Cell cell;
    const bool any = grid.find(camera, x / kStep, y / kStep, cell);
    for (const int end = std::min((x / kStep + 1) * kStep, run.x1); x < end; x++)
      weights[x - run.x0] = any ? kUnit * static_cast<float>(cell.weight(x % kStep, y % kStep)) : 0;
  }
}

void weigh(const ViewPlan& plan, const FaceRun& run, int y, int corner, float* weights) {
  const FacePlan& face = plan.faces()[run.face];
  if (!plan.rays().separable()) {
    for (int x = run.x0; x < run.x1; x++) weights[x - run.x0] = face_weights(face, plan.rays().at(x, y)).w[corner];
    return;
  }
  const Vec2 ray = plan.rays().at(run.x0, y);
  const double spacing = plan.rays().at(run.x0 + 1, y).x - ray.x;
  double edge[3], step[3];
  for (int k = 0; k < 3; k++) {
    edge[k] = FacePlan::evaluate(face.edge[k], ray);
    step[k] = face.edge[k].x * spacing;
  }
  weigh_run(edge, step, corner, run.x1 - run.x0, weights);
}

}  // namespace

HypothesisCamera::HypothesisCamera(const RenderJob& job, CameraIndex index, const Camera& rig_camera)
    : projection(hypothesis_projection(job.plan(), index, rig_camera)) {
  projection.box = hypothesis_box(job.plan(), index, rig_camera);
  const CameraCorners corners(job.plan(), index);
  const Rect& region = job.plan().camera_rect(index);
  const auto most = static_cast<size_t>(region.width()) * region.height() + kHypothesisPadding;
  for (UninitializedVector<float>* values : {&u, &v, &weight}) values->reserve(most);
  rows.reserve(static_cast<size_t>(region.height()));
  for (int y = region.y0; y < region.y1; y++) add(job, index, corners, region, y);
  const size_t count = u.size();
  for (UninitializedVector<float>* values : {&u, &v, &weight}) {
    values->resize(count + kHypothesisPadding);
    std::fill(values->begin() + static_cast<ptrdiff_t>(count), values->end(), 0.f);
  }
}

void HypothesisCamera::add(const RenderJob& job, CameraIndex camera, const CameraCorners& corners, const Rect& region,
                           int y) {
  const ViewPlan& plan = job.plan();
  const size_t first = u.size();
  HypothesisRow row{y, 0, -1, static_cast<int>(first)};
  for (FaceRun run : job.runs().row(y, region.x0, region.x1)) {
    const int corner = corners.of_face(run.face);
    if (corner < 0) continue;
    const bool has_corners = plan.faces()[run.face].has_corners();
    if (!has_corners) {  // the face extends beyond the camera's region
      run.x0 = std::max(run.x0, region.x0);
      run.x1 = std::min(run.x1, region.x1);
      if (run.x0 >= run.x1) continue;
    }
    if (row.x1 < 0) row.x0 = row.x1 = run.x0;
    weight.resize(first + run.x1 - row.x0 + kHypothesisPadding);
    float* const weights = &weight[first];  // first element: the row's first node
    std::fill(weights + row.x1 - row.x0, weights + run.x0 - row.x0, 0.f);
    if (has_corners)
      weigh(plan, run, y, corner, weights + run.x0 - row.x0);
    else
      weigh_by_grid(*plan.blend(), camera, run, y, weights + run.x0 - row.x0);
    row.x1 = run.x1;
  }
  if (row.x1 < 0) return;
  rect = unite(rect, {std::max(row.x0, region.x0), y, std::min(row.x1, region.x1), y + 1});
  for (UninitializedVector<float>* values : {&u, &v, &weight}) values->resize(first + row.x1 - row.x0);
  if (plan.rays().separable() && !rows.empty() && rows.back().x0 <= row.x0 && rows.back().x1 >= row.x1) {
    std::copy_n(&u[static_cast<size_t>(rows.back().first + row.x0 - rows.back().x0)], row.x1 - row.x0, &u[first]);
    std::fill(&v[first], &v[first] + (row.x1 - row.x0), static_cast<float>(plan.rays().at(row.x0, y).y));
  } else {
    for (int x = row.x0; x < row.x1; x++) {
      const Vec2 ray = plan.rays().at(x, y);
      u[first + x - row.x0] = static_cast<float>(ray.x);
      v[first + x - row.x0] = static_cast<float>(ray.y);
    }
  }
  rows.push_back(row);
}

ByteBuffer HypothesisCamera::levels_of(std::span<const std::vector<uint8_t>> hypotheses, int columns) const {
  ByteBuffer out(hypotheses.size() * u.size());
  for (size_t t = 0; t < hypotheses.size(); t++)
    for (const HypothesisRow& row : rows) {
      const size_t begin = static_cast<size_t>(row.y) * columns + row.x0;
      const auto count = static_cast<size_t>(row.x1 - row.x0);
      uint8_t* const to = &out[t * u.size()] + row.first;
      // A copy of a constant number of bytes is faster. The excess bytes go to the next row, which is written later, or
      // to the padding.
      if (count <= kHypothesisPadding && begin + kHypothesisPadding <= hypotheses[t].size())
        std::memcpy(to, &hypotheses[t][begin], kHypothesisPadding);
      else
        std::memcpy(to, &hypotheses[t][begin], count);
    }
  return out;
}

namespace {

struct Seen {
  Seen(const RenderJob& job, const Source& source, std::span<const std::vector<uint8_t>> hypotheses)
      : where(job, source.camera, *source.rig_camera) {
    if (where.rows.empty()) return;
    const HypothesisValues values = sample_hypotheses(
        where.projection, where.rays(), where.levels_of(hypotheses, job.plan().view().width), source.image);
    stride = where.u.size();
    memory.resize(3 * stride * hypotheses.size());
    UninitializedVector<float> visible;
    if (source.visibility) visible = visible_weights(*source.visibility);
    for (size_t t = 0; t < hypotheses.size(); t++)
      weigh_hypothesis(t == 0 && source.visibility ? visible.data() : where.weight.data(), &values[t * stride],
                       where.rays().count, of_hypothesis(t));
  }
  // Returns the weights, reduced where the camera does not see the surface.
  UninitializedVector<float> visible_weights(const VisibilityMask& mask) const {
    UninitializedVector<float> weights = where.weight;
    for (const HypothesisRow& row : where.rows)
      for (int x = row.x0; x < row.x1; x++)
        weights[static_cast<size_t>(row.first) + x - row.x0] *=
            static_cast<float>(mask.nodes[static_cast<size_t>(row.y) * mask.columns + x]) / VisibilityMask::kVisible;
    return weights;
  }
  HypothesisSums of_hypothesis(size_t hypothesis) {
    uint16_t* const begin = memory.data() + 3 * stride * hypothesis;
    return {begin, begin + stride, begin + 2 * stride};
  }
  HypothesisCamera where;
  size_t stride = 0;
  UninitializedVector<uint16_t> memory;
};

void add_up(const uint16_t* __restrict from, int count, uint16_t* __restrict to) {
  for (int i = 0; i < count; i++) to[i] = static_cast<uint16_t>(std::min(to[i] + from[i], 0xffff));
}

// Computes the sums on a GPU. `seeing`: sources with images and weights.
bool draw(gl::GlesRenderer& gpu, const RenderJob& job, std::span<const Source> seeing,
          std::span<const std::vector<uint8_t>> hypotheses, std::span<PhotoConsistency> sums,
          const ParallelFor& parallel, std::string& why) {
  const ViewPlan& plan = job.plan();
  const simd::PreparedTask prepared(plan, job.runs(), seeing, seeing.front().image.family, Coordinates::kExact);
  std::vector<int> boxes;
  for (const Source& source : seeing) boxes.push_back(hypothesis_box(plan, source.camera, *source.rig_camera));
  const auto part = [&](const Source& source) {
    return hypothesis_pixels(plan, source.camera, *source.rig_camera, hypotheses);
  };
  gl::ConsistencyReadback drawn;
  if (!gpu.draw_consistency({prepared.task, hypotheses, boxes}, seeing, part, parallel, drawn, why)) return false;
  const Rect& rect = drawn.rect;
  parallel(hypotheses.size(), [&](size_t t) {
    uint16_t* const planes[3] = {sums[t].weight.data(), sums[t].luma.data(), sums[t].square.data()};
    for (int kind = 0; kind < 3; kind++)
      for (int y = rect.y0; y < rect.y1; y++)
        add_up(drawn.row(t, kind, y), rect.width(), planes[kind] + static_cast<size_t>(y) * sums[t].columns + rect.x0);
  });
  return true;
}

}  // namespace

GpuStatus add_consistency(const RenderJob& job, std::span<const Source> sources,
                          std::span<const std::vector<uint8_t>> hypotheses, std::span<PhotoConsistency> sums,
                          const ParallelFor& parallel, gl::GlesRenderer* gpu) {
  std::vector<Source> seeing;
  for (const Source& source : sources) {
    if (source.image.family == PixelFamily::kNone || job.plan().camera_rect(source.camera).empty()) continue;
    check_image(*source.rig_camera, source.image);
    seeing.push_back(source);
  }
  GpuStatus drawing;
  // GPUs only draw hypotheses of views that are blended by the mesh, without masks.
  const bool has_masks = std::ranges::any_of(seeing, [](const Source& source) { return source.visibility != nullptr; });
  if (gpu && !job.plan().blend() && !has_masks && !seeing.empty() && !hypotheses.empty()) {
    drawing.drawn = draw(*gpu, job, seeing, hypotheses, sums, parallel, drawing.why_not);
    drawing.refused = !drawing.drawn;
    if (drawing.drawn) return drawing;
  }
  std::vector<std::unique_ptr<Seen>> cameras(seeing.size());
  parallel(seeing.size(), [&](size_t i) {
    FetchBuffers memory;
    Source& source = seeing[i];
    if (source.image.on_gpu.image)
      source.image =
          fetched(source.image, hypothesis_pixels(job.plan(), source.camera, *source.rig_camera, hypotheses), memory);
    if (source.image.family != PixelFamily::kNone) cameras[i] = std::make_unique<Seen>(job, source, hypotheses);
  });
  std::erase(cameras, nullptr);
  // Saturating sums of non-negative values do not depend on the order.
  parallel(hypotheses.size(), [&](size_t t) {
    for (const std::unique_ptr<Seen>& camera : cameras)
      add_rows(camera->where.rows, camera->of_hypothesis(t), sums[t].columns, sums[t].weight.size(),
               {sums[t].weight.data(), sums[t].luma.data(), sums[t].square.data()});
  });
  return drawing;
}

}  // namespace lf
