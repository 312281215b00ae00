// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/sum_renderer.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include "base/text.h"
#include "render/camera_weights.h"
#include "render/gl/card_sum.h"
#include "render/gl/sum_drawer.h"
#include "render/simd/sum_task.h"

namespace lf {

static size_t area(const Rect& rect) { return static_cast<size_t>(rect.width()) * rect.height(); }

struct SumRenderer::State : simd::PreparedTask {
  State(const ViewPlan& plan, const OwnerRuns& runs, std::span<const Source> sources, PixelFamily family,
        Coordinates coordinates)
      : PreparedTask(plan, runs, sources, family, coordinates), sources(sources), images(task, sources) {}
  // Before the CPU renders: it can't read what is on a card.
  void fetch(const ParallelFor& parallel) {
    std::call_once(fetched, [&] {
      const auto is_on_card = [](const simd::Slot& slot) { return slot.image.on_card.image != nullptr; };
      if (std::ranges::none_of(task.slots, is_on_card)) return;
      parallel(task.slots.size(), [&](size_t i) {
        simd::Slot& slot = task.slots[i];
        if (is_on_card(slot)) simd::place_image(task, slot, images.of(slot));
      });
    });
  }
  const std::span<const Source> sources;
  simd::FetchedImages images;
  std::once_flag fetched;
  bool may_stay = false;
  gl::DrawnSum drawn;
  std::shared_ptr<gl::CardSum> card_sum;  // in its place
  Drawing drawing;
};

SumRenderer::SumRenderer(const ViewPlan& plan, const OwnerRuns& runs, std::span<const Source> sources,
                         PixelFamily family, Coordinates coordinates, gl::SumDrawer* card, const ParallelFor& parallel,
                         bool may_stay)
    : state_(std::make_unique<State>(plan, runs, sources, family, coordinates)), rect_(state_->rect) {
  state_->may_stay = may_stay;
  SumRenderer* const self = this;
  if (card) draw({&self, 1}, *card, parallel);
}

void SumRenderer::draw(std::span<SumRenderer* const> renderers, gl::SumDrawer& card, const ParallelFor& parallel) {
  std::vector<SumRenderer*> drawn;
  std::vector<gl::SumOrder> orders;
  for (SumRenderer* const renderer : renderers) {
    const State& state = *renderer->state_;
    if (renderer->rect_.empty()) continue;
    drawn.push_back(renderer);
    // What may be added to others on the card begins at even pixels, as do cells.
    const bool is_even = state.may_stay || state.task.plan->blend();
    const Rect rect = is_even ? chroma_aligned(renderer->rect_, state.task.plan->view()) : renderer->rect_;
    orders.push_back({&state.task, state.sources, rect, state.may_stay});
  }
  card.draw(orders, parallel);
  for (size_t i = 0; i < orders.size(); i++) {
    State& state = *drawn[i]->state_;
    state.drawn = std::move(orders[i].drawn);
    state.card_sum = std::move(orders[i].stayed);
    state.drawing.drawn = orders[i].why_not.empty();
    // That a view of many cameras is too much says nothing about others.
    state.drawing.refused = !state.drawing.drawn && !state.task.plan->blend();
    state.drawing.why_not = std::move(orders[i].why_not);
  }
}

SumRenderer::~SumRenderer() = default;

void SumRenderer::fetch(const ParallelFor& parallel) {
  if (!state_->drawing.drawn) state_->fetch(parallel);
}

size_t SumRenderer::samples() const { return simd::samples_of(state_->task, rect_); }

const Drawing& SumRenderer::drawing() const { return state_->drawing; }

std::shared_ptr<gl::CardSum> SumRenderer::card_sum() const { return state_->card_sum; }

bool SumRenderer::render_rows(int y0, int y1, const SumPlanes& out) const {
  if (state_->drawing.drawn) return state_->drawn.copy_rows(y0, y1, out);
  state_->fetch(serial_for);
  const simd::SumTask& task = state_->task;
  const Rect& rect = out.rect;
  const bool i420 = task.family == PixelFamily::kI420;
  const int skip = rect.x0 % simd::kBlock, chroma_width = chroma_size(rect.width());
  simd::Scratch& scratch = simd::scratch_for(rect, task.slots.size());

  // Whole blocks are written right where they belong.
  const bool direct = skip == 0 && rect.width() % simd::kBlock == 0;
  bool any_lost = false;
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
      scratch.lost[r] = direct && out.lost && has(0, r) ? out.lost + (y - rect.y0 + r) * out.lost_stride
                                                        : scratch.lost_memory[r].data();
    }
    scratch.any_lost = false;
    simd::render_band(task, {rect.x0, y0, rect.x1, y1}, y, scratch);
    any_lost = any_lost || scratch.any_lost;
    if (direct) continue;
    for (int r = 0; r < simd::kBandRows; r++) {
      for (int c = 0; c < 3; c++)
        if (has(c, r))
          std::copy_n(scratch.sum[r][c] + (i420 && c > 0 ? skip / 2 : skip),
                      i420 && c > 0 ? chroma_width : rect.width(), row_of(c, r));
      if (out.lost && has(0, r))
        std::copy_n(scratch.lost[r] + skip, rect.width(), out.lost + (y - rect.y0 + r) * out.lost_stride);
    }
  }
  return any_lost;
}

const char* simd_target_name() { return simd::target_name(); }

namespace {

constexpr int kLeastGap = 16;  // pixels

// Rectangles of one row of tiles, from left to right.
class TileRow {
 public:
  // They are at least `gap` pixels apart: what is nearer becomes one.
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

// Which faces have one of the cameras at a corner.
std::vector<bool> own_faces(const ViewPlan& plan, std::span<const CameraIndex> cameras) {
  std::vector<bool> own;
  for (const FacePlan& face : plan.faces())
    own.push_back(std::ranges::any_of(face.camera, [&](CameraIndex camera) {
      return camera != MeshFace::kNone && std::ranges::binary_search(cameras, camera);
    }));
  return own;
}

// What is in rows [y, y + kTileRows) of a view that is blended by its mesh.
void add_faces(const OwnerRuns& runs, const std::vector<bool>& own, int y, TileRow& row_of_tiles) {
  const Rect& region = runs.region();
  for (int row = std::max(y, region.y0); row < std::min(y + kTileRows, region.y1); row++) {
    Rect together;  // neighbours
    for (const OwnerRun& run : runs.row(row)) {
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

// The same of one that is blended otherwise: the grid's cells are as high as the row.
static_assert(BlendGrid::kStep == kTileRows);
void add_cells(const BlendGrid& grid, std::span<const CameraIndex> cameras, const Rect& region, int y,
               TileRow& row_of_tiles) {
  for (int x = region.x0 / BlendGrid::kStep * BlendGrid::kStep; x < region.x1; x += BlendGrid::kStep) {
    BlendGrid::Cell cell;
    const auto has = [&](CameraIndex camera) {
      return grid.find(camera, x / BlendGrid::kStep, y / BlendGrid::kStep, cell);
    };
    if (std::ranges::any_of(cameras, has))
      row_of_tiles.add(intersect({x, y, x + BlendGrid::kStep, y + BlendGrid::kStep}, region));
  }
}

}  // namespace

void check_image(const Camera& camera, const ImageView& image) {
  if (image.width != camera.width || image.height != camera.height)
    throw Error("camera " + std::to_string(camera.id) + ": its image has " + size_text(image.width, image.height) +
                " pixels, the rig says " + size_text(camera.width, camera.height));
}

std::vector<Rect> sum_tiles(const ViewPlan& plan, const OwnerRuns& runs, std::span<const CameraIndex> cameras,
                            PixelFamily family, size_t spare_pixels) {
  const View& view = plan.view();
  const Rect& region = runs.region();
  const std::vector<bool> own = own_faces(plan, cameras);
  const int gap = std::clamp<int>(static_cast<int>(spare_pixels / kTileRows), kLeastGap, view.width);
  std::vector<Rect> tiles;
  for (int y = region.y0 / kTileRows * kTileRows; y < region.y1; y += kTileRows) {
    TileRow row_of_tiles(gap);
    if (plan.blend())
      add_cells(*plan.blend(), cameras, region, y, row_of_tiles);
    else
      add_faces(runs, own, y, row_of_tiles);
    const std::vector<Rect>& rects = row_of_tiles.rects();
    for (size_t i = 0; i < rects.size(); i++) {
      const Rect rect = family == PixelFamily::kI420 ? chroma_aligned(rects[i], view) : rects[i];
      // Those that end in the row above may grow.
      const auto may_grow = [&](const Rect& tile) {
        const Rect grown = unite(tile, rect);
        return tile.y1 <= y && tile.y1 > y - kTileRows && area(grown) <= area(tile) + area(rect) + spare_pixels &&
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
