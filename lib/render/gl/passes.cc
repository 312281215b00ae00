// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/passes.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "render/camera_projection.h"
#include "render/camera_weights.h"

namespace lf::gl {
namespace {

// The scale of a focal map: distance between nodes in pixels, inverse distance at level 0, its increment per level, and
// distance of the eye from the origin of distances. Meaningless without a map.
struct MapScale {
  float step = 0, farthest = 0, of_level = 0, eye_distance = 0;
};
MapScale scale_of(const ViewPlan& plan) {
  const FocalMap* map = plan.view().focus.map.get();
  if (!map) return {};
  return {static_cast<float>(map->step), static_cast<float>(map->farthest),
          static_cast<float>((map->nearest - map->farthest) / FocalMap::kLevels),
          static_cast<float>(plan.eye_distance())};
}

// Returns the middle of a rectangle. Pixels are counted from this point.
Vec2 anchor_of(const Rect& rect) { return Vec2((rect.x0 + rect.x1) / 2, (rect.y0 + rect.y1) / 2); }

class Tables {
 public:
  explicit Tables(std::vector<float>& values) : values_(values) { values_.clear(); }
  void add(double x, double y, double z, double w) {
    for (const double v : {x, y, z, w}) values_.push_back(static_cast<float>(v));
  }
  void add(const float* v, double w) { add(v[0], v[1], v[2], w); }

 private:
  std::vector<float>& values_;
};

// Terms for lines of sight that come from a texture. A common factor scales the largest element to 1.
simd::ProjectionTerms terms_of_rays(const CameraProjection& projection, double near) {
  simd::ProjectionTerms terms{.near = near};
  const Mat3& per = projection.per_inverse();
  const Mat3 from = projection.has_map() ? projection.camera_from_ray() + near * per : projection.camera_from_ray();
  double largest = 1e-300;
  for (int c = 0; c < 3; c++)
    for (int r = 0; r < 3; r++) largest = std::max(largest, std::abs(from[c][r]));
  for (int r = 0; r < 3; r++) {
    const auto scaled = [&](double v) { return static_cast<float>(v / largest); };
    terms.along[r] = scaled(from[0][r]);
    terms.down[r] = scaled(from[1][r]);
    terms.from[r] = scaled(from[2][r]);
    terms.per_along[r] = projection.has_map() ? scaled(per[0][r]) : 0;
    terms.per_down[r] = projection.has_map() ? scaled(per[1][r]) : 0;
    terms.per_from[r] = projection.has_map() ? scaled(per[2][r]) : 0;
  }
  return terms;
}

// Edge functions are linear in the pixel, and small where they are near 0. If the lines of sight come from a texture,
// they are linear in the ray.
void add_edges(Tables& tables, const simd::SumTask& task, const FacePlan& face, uint8_t ours) {
  const Rays& rays = task.plan->rays();
  Vec3 edge[3] = {face.edge[0], face.edge[1], face.edge[2]};
  if (rays.separable()) {
    const Vec2 first = rays.at(0, 0), anchor = anchor_of(face.rect);
    const Vec2 step(rays.at(1, 0).x - first.x, rays.at(0, 1).y - first.y);
    const Vec2 ray = rays.at(static_cast<int>(anchor.x), static_cast<int>(anchor.y));
    for (Vec3& e : edge) e = Vec3(e.x * step.x, e.y * step.y, FacePlan::evaluate(e, ray));
  }
  double largest = 0;
  for (const Vec3& e : edge)
    largest = std::max({largest, std::abs(e.x) * face.rect.width(), std::abs(e.y) * face.rect.height(), std::abs(e.z)});
  for (int k = 0; k < 3; k++) {
    const Vec3 e = largest > 0 ? edge[k] / largest : edge[k];
    tables.add(e.x, e.y, e.z, ours >> k & 1);
  }
}

void add_corner(Tables& tables, const simd::SumTask& task, const simd::Slot& slot, const ImageAtlas::Offset& place,
                const Vec2& anchor, double near, int box) {
  const ViewPlan& plan = *task.plan;
  const bool has_map = plan.view().focus.map != nullptr;
  const simd::ProjectionTerms terms = !plan.rays().separable() ? terms_of_rays(*slot.projection, near)
                                      : has_map                ? simd::terms_at(slot, anchor.x, anchor.y, near)
                                                               : simd::terms_at(slot, anchor.x, anchor.y);
  const int flags = slot.image.family != PixelFamily::kNone ? kHasImage : 0;
  const RgbLayout& layout = slot.image.layout;
  tables.add(terms.from, place.x);
  tables.add(terms.along, flags);
  tables.add(terms.down, layout.r + 4 * layout.g + 16 * layout.b);
  tables.add(slot.fx, slot.fy, slot.cx, slot.cy);
  const Distortion<float>& lens = slot.distortion;
  tables.add(lens.k[0], lens.k[1], lens.p1, lens.p2);
  tables.add(lens.k[2], lens.k[3], lens.d[0], lens.d[1]);
  tables.add(lens.d[2], lens.s1, lens.s2, lens.fisheye);
  tables.add(std::min(slot.steepness.first, 1e9), std::min(slot.steepness.rounding, 1e9), lens.is_general, 0);
  tables.add(slot.image.width, slot.image.height, lens.limit, place.y);
  if (!has_map) return;
  tables.add(terms.per_from, box);
  tables.add(terms.per_along, 0);
  tables.add(terms.per_down, 0);
}

// Placeholder for a missing or remote camera. All values that are computed from it are finite and have weight 0.
void add_no_corner(Tables& tables, bool has_map) {
  for (int i = 0; i < corner_texels(has_map); i++) {
    const bool one = i == kCornerImage;
    tables.add(one, one, i == kCornerFrom, 0);
  }
}

struct RowAnchor {
  Vec2 at;
  double near;  // at that pixel
};

// Adds the row's kFaceAnchor for the pixels in `rect`.
RowAnchor add_anchor(Tables& tables, const ViewPlan& plan, const Rect& rect) {
  const FocalMap* map = plan.view().focus.map.get();
  const bool separable = plan.rays().separable();
  const Vec2 at = separable ? anchor_of(rect) : Vec2(plan.view().width / 2.0, plan.view().height / 2.0);
  const double near = map ? plan.inverse_at(at.x, at.y) : 0;
  const double level = map && map->nearest != map->farthest
                           ? (near - map->farthest) / (map->nearest - map->farthest) * FocalMap::kLevels
                           : 0;
  tables.add(separable ? at.x : 0, separable ? at.y : 0, 0, level);
  return {at, near};
}

void add_slots(Tables& tables, const simd::SumTask& task, std::span<const ImageAtlas::Offset> places) {
  const bool has_map = task.plan->view().focus.map != nullptr;
  for (size_t i = 0; i < task.slots.size(); i++) {
    const RowAnchor anchor = add_anchor(tables, *task.plan, task.slots[i].rect);
    for (int k = 0; k < 3; k++) tables.add(0, 0, 0, k == 0);
    add_corner(tables, task, task.slots[i], places[i], anchor.at, anchor.near, 0);
    for (int k = 1; k < 3; k++) add_no_corner(tables, has_map);
  }
}

// Makes table_rows() rows of face_texels() with four values per texel; see sum_shader.h. The rows of the faces come
// first, then the rows of the slots if the view has a WeightGrid. `places` are the offsets of the slots' images in the
// atlas. `boxes` are as for kCornerPerFrom, for each slot.
void make_tables(const simd::SumTask& task, std::span<const ImageAtlas::Offset> places, std::vector<float>& values,
                 std::span<const int> boxes) {
  Tables tables(values);
  const ViewPlan& plan = *task.plan;
  const FocalMap* map = plan.view().focus.map.get();
  for (size_t i = 0; i < plan.faces().size(); i++) {
    const FacePlan& face = plan.faces()[i];
    const auto [anchor, near] = add_anchor(tables, plan, face.rect);
    add_edges(tables, task, face, task.face_corners[i]);
    for (int k = 0; k < 3; k++) {
      if (!(task.face_corners[i] >> k & 1)) {
        add_no_corner(tables, map != nullptr);
        continue;
      }
      const auto slot = static_cast<size_t>(task.slot_of_camera[face.camera[k]]);
      add_corner(tables, task, task.slots[slot], places[slot], anchor, near, boxes.empty() ? 0 : boxes[slot]);
    }
  }
  if (plan.blend()) add_slots(tables, task, places);
}

void make_runs(const simd::SumTask& task, const Rect& rect, std::vector<uint32_t>& values) {
  values.assign(static_cast<size_t>(rect.height()) + 1, 0);
  const size_t rows = values.size();
  for (int y = rect.y0; y < rect.y1; y++) {
    for (const FaceRun& run : task.runs->row(y, rect.x0, rect.x1)) {
      // Skips faces of the mesh without local cameras.
      const auto face = static_cast<size_t>(run.face);
      if (task.plan->faces()[face].has_corners() && !task.face_corners[face]) continue;
      const int x0 = std::max(run.x0, rect.x0) - rect.x0, x1 = std::min(run.x1, rect.x1) - rect.x0;
      values.push_back(static_cast<uint32_t>(x0) | static_cast<uint32_t>(x1) << 16);
      values.push_back(static_cast<uint32_t>(run.face));
    }
    values[static_cast<size_t>(y - rect.y0) + 1] = static_cast<uint32_t>((values.size() - rows) / 2);
  }
}

Rect cells_of(const Rect& rect) {
  if (rect.empty()) return {};
  constexpr int kStep = WeightGrid::kStep;
  return {rect.x0 / kStep, rect.y0 / kStep, (rect.x1 - 1) / kStep + 1, (rect.y1 - 1) / kStep + 1};
}

size_t area(const Rect& rect) { return static_cast<size_t>(rect.width()) * rect.height(); }

// Encodes the WeightGrid cells in `rect` as words for the shaders; does nothing for views without a WeightGrid. First
// comes one word for each cell, row by row: the index of its first camera. The next word is the end of the last cell.
// Then come kCellWords words for each camera of each cell.
void make_cells(const simd::SumTask& task, const Rect& rect, const ParallelFor& parallel,
                std::vector<uint32_t>& values) {
  values.clear();
  const WeightGrid* const grid = task.plan->blend();
  if (!grid || rect.empty()) return;
  const Rect cells = cells_of(rect);
  struct Row {
    std::vector<uint32_t> ends, cameras;
  };
  std::vector<Row> rows(static_cast<size_t>(cells.height()));
  parallel(rows.size(), [&](size_t j) {
    const int y = cells.y0 + static_cast<int>(j);
    std::vector<size_t> slots;
    for (size_t slot = 0; slot < task.slots.size(); slot++) {
      const Rect of_slot = cells_of(task.slots[slot].rect);
      if (y >= of_slot.y0 && y < of_slot.y1) slots.push_back(slot);
    }
    for (int x = cells.x0; x < cells.x1; x++) {
      for (const size_t slot : slots) {
        const Rect of_slot = cells_of(task.slots[slot].rect);
        WeightGrid::Cell cell;
        if (x < of_slot.x0 || x >= of_slot.x1 || !grid->find(task.slots[slot].camera, x, y, cell)) continue;
        rows[j].cameras.push_back(static_cast<uint32_t>(slot));
        for (int p = 0; p < 4; p++)
          rows[j].cameras.push_back(static_cast<uint32_t>(cell.before[p]) | static_cast<uint32_t>(cell.with[p]) << 16);
      }
      rows[j].ends.push_back(static_cast<uint32_t>(rows[j].cameras.size() / kCellWords));
    }
  });
  values.push_back(0);
  for (uint32_t before = 0; const Row& row : rows) {
    for (const uint32_t end : row.ends) values.push_back(before + end);
    before = values.back();
  }
  for (const Row& row : rows) values.insert(values.end(), row.cameras.begin(), row.cameras.end());
}

const FocalMap* map_of(const GlesView& view) { return view.task->plan->view().focus.map.get(); }

}  // namespace

SumProgram program_of(const simd::SumTask& task) {
  SumProgram program;
  program.has_map = task.plan->view().focus.map != nullptr;
  program.has_rays = !task.plan->rays().separable();
  program.has_cells = task.plan->blend() != nullptr;
  using enum SumProgram::Distortion;
  for (const simd::Slot& slot : task.slots)
    program.distortion = std::max(program.distortion, slot.distortion.is_general ? kGeneral
                                                      : slot.is_distorted        ? kOpenCv
                                                                                 : kNone);
  return program;
}

size_t table_rows(const simd::SumTask& task) {
  return task.plan->faces().size() + (task.plan->blend() ? task.slots.size() : 0);
}

size_t most_of_cells(const simd::SumTask& task, const Rect& rect) {
  if (!task.plan->blend() || rect.empty()) return 0;
  size_t numbers = area(cells_of(rect)) + 1;
  for (const simd::Slot& slot : task.slots) numbers += kCellWords * area(cells_of(intersect(slot.rect, rect)));
  return numbers;
}

void PassTables::make(std::span<const GlesView> views, const ImageAtlas& atlas, const ParallelFor& parallel,
                      std::span<const int> boxes) {
  views_.resize(views.size());
  parallel(views.size(), [&](size_t i) {
    make_runs(*views[i].task, views[i].rect, views_[i].runs);
    make_tables(*views[i].task, atlas.offsets(i), views_[i].tables, boxes);
  });
  for (size_t i = 0; i < views.size(); i++) make_cells(*views[i].task, views[i].rect, parallel, views_[i].cells);
  heads_.assign(kViewWords * views.size(), 0);
  size_t runs = heads_.size(), faces = 0;
  int levels = 0;
  for (size_t i = 0; i < views.size(); i++) {
    uint32_t* const head = &heads_[kViewWords * i];
    const auto put = [head](ViewWord word, auto... values) {
      size_t at = word;
      ((head[at++] = static_cast<uint32_t>(values)), ...);
    };
    const ViewPlan& plan = *views[i].task->plan;
    const Rect& rect = views[i].rect;
    put(kViewOrigin, rect.x0, rect.y0);
    put(kViewSize, rect.width(), rect.height());
    put(kViewRuns, runs);
    put(kViewFaces, faces);
    put(kViewSlots, faces + plan.faces().size());
    put(kViewLevels, levels);
    if (const FocalMap* map = plan.view().focus.map.get()) {
      put(kViewNodes, map->columns, map->rows);
      levels += map->rows;
    }
    const MapScale scale = scale_of(plan);
    const auto bits = [](float value) { return std::bit_cast<uint32_t>(value); };
    put(kViewScale, bits(scale.step), bits(scale.farthest), bits(scale.of_level), bits(scale.eye_distance));
    runs += views_[i].runs.size();
    put(kViewCells, runs);
    runs += views_[i].cells.size();
    faces += table_rows(*views[i].task);
  }
}

void PassTables::set_result(size_t view, const std::array<uint32_t, 6>& words) {
  std::ranges::copy(words, &heads_[kViewWords * view + kViewResult]);
}

void PassTables::send(Buffers& to) const {
  size_t runs = heads_.size(), tables = 0;
  for (const View& view : views_) {
    runs += view.runs.size() + view.cells.size();
    tables += view.tables.size();
  }
  to.runs.reserve(sizeof(uint32_t) * runs);
  to.tables.reserve(sizeof(float) * tables);
  to.runs.put(0, heads_.data(), sizeof(uint32_t) * heads_.size());
  runs = heads_.size();
  tables = 0;
  for (const View& view : views_) {
    to.tables.put(sizeof(float) * tables, view.tables.data(), sizeof(float) * view.tables.size());
    for (const std::vector<uint32_t>* const words : {&view.runs, &view.cells}) {
      to.runs.put(sizeof(uint32_t) * runs, words->data(), sizeof(uint32_t) * words->size());
      runs += words->size();
    }
    tables += view.tables.size();
  }
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kRunsBinding, to.runs.name());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kTablesBinding, to.tables.name());
}

void ViewTextures::upload_rays(const Rays& view_rays, const Rect& rect, bool centres) {
  const int step = centres ? 2 : 1, width = centres ? chroma_size(rect.width()) : rect.width(),
            height = centres ? chroma_size(rect.height()) : rect.height();
  ray_memory_.clear();
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      const int i = rect.x0 + step * x, j = rect.y0 + step * y;
      const Vec2 ray = centres ? view_rays.at_centre_of_four(i, j) : view_rays.at(i, j);
      ray_memory_.push_back(static_cast<float>(ray.x));
      ray_memory_.push_back(static_cast<float>(ray.y));
    }
  (centres ? centre_rays_ : rays_).bind(centres ? kCentreRays : kRays, GL_RG32F, width, height);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RG, GL_FLOAT, ray_memory_.data());
}

// The maps of all views are stacked vertically.
void ViewTextures::upload_levels(std::span<const GlesView> views) {
  int columns = 0, rows = 0;
  for (const GlesView& view : views)
    if (const FocalMap* map = map_of(view)) {
      columns = std::max(columns, map->columns);
      rows += map->rows;
    }
  if (rows == 0) return;
  levels_.reserve(static_cast<size_t>(columns) * rows);
  uint8_t* to = levels_.room();
  for (const GlesView& view : views)
    if (const FocalMap* map = map_of(view))
      for (int y = 0; y < map->rows; y++, to += columns)
        std::copy_n(&map->levels[static_cast<size_t>(y) * map->columns], map->columns, to);
  levels_.send(kLevels, GL_R8UI, GL_RED_INTEGER, columns, rows, true);
}

void ViewTextures::upload(std::span<const GlesView> views, ImageAtlas& atlas, Programs& programs) {
  const GlesView& first = views.front();
  if (const Rays& rays = first.task->plan->rays(); !rays.separable()) {
    upload_rays(rays, first.rect, false);
    if (first.task->family == PixelFamily::kI420) upload_rays(rays, first.rect, true);
  }
  upload_levels(views);
  atlas_ = &atlas;
  atlas.send(pieces_, programs);
}

void ViewTextures::describe_images(const Program& program) const {
  const ImageAtlas::Offset cb = atlas_->chroma_offset(1), cr = atlas_->chroma_offset(2);
  glUniform4i(program.chroma_places, cb.x, cb.y, cr.x, cr.y);
}

}  // namespace lf::gl
