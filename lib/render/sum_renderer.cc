// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/sum_renderer.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include "base/text.h"
#include "render/camera_weights.h"
#include "render/gl/gles_renderer.h"
#include "render/gl/gpu_sum.h"
#include "render/simd/sum_task.h"

namespace lf {

static size_t area(const Rect& rect) { return static_cast<size_t>(rect.width()) * rect.height(); }

struct SumRenderer::State : simd::PreparedTask {
  State(const ViewPlan& plan, const FaceRuns& runs, std::span<const Source> sources, PixelFamily family,
        Coordinates coordinates)
      : PreparedTask(plan, runs, sources, family, coordinates), sources(sources), images(task, sources) {}
  // Downloads images once. Must be called before the CPU renders.
  void fetch(const ParallelFor& parallel) {
    std::call_once(fetched, [&] {
      const auto is_on_gpu = [](const simd::Slot& slot) { return slot.image.on_gpu.image != nullptr; };
      if (std::ranges::none_of(task.slots, is_on_gpu)) return;
      parallel(task.slots.size(), [&](size_t i) {
        simd::Slot& slot = task.slots[i];
        if (is_on_gpu(slot)) simd::place_image(task, slot, images.of(slot));
      });
    });
  }
  const std::span<const Source> sources;
  simd::FetchedImages images;
  std::once_flag fetched;
  bool keep_on_gpu = false;
  gl::ReadbackBuffer drawn;
  std::shared_ptr<gl::GpuSum> gpu_sum;  // used instead of `drawn` with keep_on_gpu
  GpuStatus drawing;
};

SumRenderer::SumRenderer(const ViewPlan& plan, const FaceRuns& runs, std::span<const Source> sources,
                         PixelFamily family, Coordinates coordinates, gl::GlesRenderer* gpu,
                         const ParallelFor& parallel, bool keep_on_gpu)
    : state_(std::make_unique<State>(plan, runs, sources, family, coordinates)), rect_(state_->rect) {
  state_->keep_on_gpu = keep_on_gpu;
  SumRenderer* const self = this;
  if (gpu) draw({&self, 1}, *gpu, parallel);
}

void SumRenderer::draw(std::span<SumRenderer* const> renderers, gl::GlesRenderer& gpu, const ParallelFor& parallel) {
  std::vector<SumRenderer*> drawn;
  std::vector<gl::GlesJob> orders;
  for (SumRenderer* const renderer : renderers) {
    State& state = *renderer->state_;
    if (renderer->rect_.empty()) continue;
    if (state.task.has_visibility) {
      state.drawing.why_not = "something hides parts of the surface from some cameras";
      continue;
    }
    drawn.push_back(renderer);
    // Sums that may be added on the GPU must begin at even pixels, like cells.
    const bool is_even = state.keep_on_gpu || state.task.plan->blend();
    const Rect rect = is_even ? chroma_aligned(renderer->rect_, state.task.plan->view()) : renderer->rect_;
    orders.push_back({&state.task, state.sources, rect, state.keep_on_gpu});
  }
  gpu.draw(orders, parallel);
  for (size_t i = 0; i < orders.size(); i++) {
    State& state = *drawn[i]->state_;
    state.drawn = std::move(orders[i].drawn);
    state.gpu_sum = std::move(orders[i].kept_sum);
    state.drawing.drawn = orders[i].why_not.empty();
    // If a view has too many cameras per pixel, the GPU may still render other views.
    state.drawing.refused = !state.drawing.drawn && state.task.plan->view().blending.is_mesh();
    state.drawing.why_not = std::move(orders[i].why_not);
  }
}

SumRenderer::~SumRenderer() = default;

void SumRenderer::fetch(const ParallelFor& parallel) {
  if (!state_->drawing.drawn) state_->fetch(parallel);
}

size_t SumRenderer::samples() const { return simd::samples_of(state_->task, rect_); }

const GpuStatus& SumRenderer::drawing() const { return state_->drawing; }

std::shared_ptr<gl::GpuSum> SumRenderer::gpu_sum() const { return state_->gpu_sum; }

bool SumRenderer::render_rows(int y0, int y1, const SumPlanes& out) const {
  if (state_->drawing.drawn) return state_->drawn.copy_rows(y0, y1, out);
  state_->fetch(serial_for);
  const simd::SumTask& task = state_->task;
  const Rect& rect = out.rect;
  const bool i420 = task.family == PixelFamily::kI420;
  const int skip = rect.x0 % simd::kBlock, chroma_width = chroma_size(rect.width());
  simd::Scratch& scratch = simd::scratch_for(rect, task.slots.size());

  const bool direct = skip == 0 && rect.width() % simd::kBlock == 0;
  bool any_missing = false;
  for (int y = y0 / simd::kBandRows * simd::kBandRows; y < y1; y += simd::kBandRows) {
    const auto row_of = [&](int c, int r) {
      const int row = i420 && c > 0 ? (y - rect.y0) / 2 + r : y - rect.y0 + r;
      return out.plane[c] + row * out.stride[c];
    };
    const auto has = [&](int c, int r) {
      const int row = y + (i420 && c > 0 ? 2 * r : r);
      return row >= y0 && row < y1 && (c == 0 || !i420 || r < simd::kBandPairs);
    };
    for (int r = 0; r < simd::kBandRows; r++) {
      for (int c = 0; c < 3; c++)
        scratch.sum[r][c] = direct && has(c, r) ? row_of(c, r) : scratch.sum_memory[r][c].data();
      scratch.lost[r] = direct && out.lost && has(0, r) ? out.lost + (y - rect.y0 + r) * out.missing_stride
                                                        : scratch.missing_memory[r].data();
    }
    scratch.any_missing = false;
    simd::render_band(task, {rect.x0, y0, rect.x1, y1}, y, scratch);
    any_missing = any_missing || scratch.any_missing;
    if (direct) continue;
    for (int r = 0; r < simd::kBandRows; r++) {
      for (int c = 0; c < 3; c++)
        if (has(c, r))
          std::copy_n(scratch.sum[r][c] + (i420 && c > 0 ? skip / 2 : skip),
                      i420 && c > 0 ? chroma_width : rect.width(), row_of(c, r));
      if (out.lost && has(0, r))
        std::copy_n(scratch.lost[r] + skip, rect.width(), out.lost + (y - rect.y0 + r) * out.missing_stride);
    }
  }
  return any_missing;
}

const char* simd_target_name() { return simd::target_name(); }

namespace {

constexpr int kMinGap = 16;

// The rectangles of one row of tiles, from left to right. Rectangles that are less than `gap` pixels apart are merged.
class TileRow {
 public:
  explicit TileRow(int gap) : gap_(gap) {}
  void add(Rect rect) {
    if (rect.empty()) return;
    const auto first = std::ranges::find_if(rects_, [&](const Rect& r) { return r.x1 + gap_ > rect.x0; });
    auto last = first;
    for (; last != rects_.end() && last->x0 < rect.x1 + gap_; ++last) rect = unite(rect, *last);
    rects_.insert(rects_.erase(first, last), rect);
  }
  const std::vector<Rect>& rects() const { return rects_; }

 private:
  int gap_;
  std::vector<Rect> rects_;
};

std::vector<bool> own_faces(const ViewPlan& plan, std::span<const CameraIndex> cameras) {
  std::vector<bool> own;
  for (const FacePlan& face : plan.faces())
    own.push_back(std::ranges::any_of(face.camera, [&](CameraIndex camera) {
      return camera != MeshFace::kNone && std::ranges::binary_search(cameras, camera);
    }));
  return own;
}

void add_faces(const FaceRuns& runs, const std::vector<bool>& own, int y, TileRow& row_of_tiles) {
  const Rect& region = runs.region();
  for (int row = std::max(y, region.y0); row < std::min(y + kTileRows, region.y1); row++) {
    Rect together;
    for (const FaceRun& run : runs.row(row)) {
      if (!own[static_cast<size_t>(run.face)]) continue;
      if (together.empty() || run.x0 != together.x1) {
        row_of_tiles.add(together);
        together = {run.x0, row, run.x0, row + 1};
      }
      together.x1 = run.x1;
    }
    row_of_tiles.add(together);
  }
}

// Does the same as add_faces(), for a view that is blended by a WeightGrid. Its cells are as high as a row of tiles.
static_assert(WeightGrid::kStep == kTileRows);
void add_cells(const WeightGrid& grid, std::span<const CameraIndex> cameras, const Rect& region, int y,
               TileRow& row_of_tiles) {
  for (int x = region.x0 / WeightGrid::kStep * WeightGrid::kStep; x < region.x1; x += WeightGrid::kStep) {
    WeightGrid::Cell cell;
    const auto has = [&](CameraIndex camera) {
      return grid.find(camera, x / WeightGrid::kStep, y / WeightGrid::kStep, cell);
    };
    if (std::ranges::any_of(cameras, has))
      row_of_tiles.add(intersect({x, y, x + WeightGrid::kStep, y + WeightGrid::kStep}, region));
  }
}

}  // namespace

void check_image(const Camera& camera, const ImageView& image) {
  if (image.width != camera.width || image.height != camera.height)
    throw Error("camera " + std::to_string(camera.id) + ": its image has " + size_text(image.width, image.height) +
                " pixels, the rig says " + size_text(camera.width, camera.height));
}

std::vector<Rect> sum_tiles(const ViewPlan& plan, const FaceRuns& runs, std::span<const CameraIndex> cameras,
                            PixelFamily family, size_t max_extra_pixels) {
  const View& view = plan.view();
  const Rect& region = runs.region();
  const std::vector<bool> own = own_faces(plan, cameras);
  const int gap = std::clamp<int>(static_cast<int>(max_extra_pixels / kTileRows), kMinGap, view.width);
  std::vector<Rect> tiles;
  for (int y = region.y0 / kTileRows * kTileRows; y < region.y1; y += kTileRows) {
    TileRow row_of_tiles(gap);
    add_faces(runs, own, y, row_of_tiles);
    if (plan.blend()) add_cells(*plan.blend(), cameras, region, y, row_of_tiles);
    const std::vector<Rect>& rects = row_of_tiles.rects();
    for (size_t i = 0; i < rects.size(); i++) {
      const Rect rect = family == PixelFamily::kI420 ? chroma_aligned(rects[i], view) : rects[i];
      const auto may_grow = [&](const Rect& tile) {
        const Rect grown = unite(tile, rect);
        return tile.y1 <= y && tile.y1 > y - kTileRows && area(grown) <= area(tile) + area(rect) + max_extra_pixels &&
               (i + 1 == rects.size() || grown.x1 < rects[i + 1].x0) &&
               std::ranges::none_of(
                   tiles, [&](const Rect& other) { return other != tile && !intersect(other, grown).empty(); });
      };
      const auto tile = std::ranges::find_if(tiles, may_grow);
      if (tile != tiles.end())
        *tile = unite(*tile, rect);
      else
        tiles.push_back(rect);
    }
  }
  std::ranges::stable_sort(tiles, {}, &Rect::y0);
  return tiles;
}

}  // namespace lf
