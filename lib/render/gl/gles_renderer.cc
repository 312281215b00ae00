// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/gles_renderer.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "render/camera_projection.h"
#include "render/camera_weights.h"
#include "render/gl/gpu_sum.h"
#include "render/gl/objects.h"
#include "render/gl/passes.h"
#include "render/gl/sum_shader.h"
#include "render/gl/sums.h"
#include "render/ownership.h"
#include "render/simd/sum_task.h"

namespace lf::gl {

struct GlesRenderer::Objects {
  Passes passes;
  ViewTextures textures;
  Programs programs;
  BlockSums blocks;
  ConsistencySums consistency_sums;
  Buffer scratch{Buffer::Use::kComputed};
  GpuTimer stopwatch;
  GLint max_size = 0;

  explicit Objects(bool has_timer) : stopwatch(has_timer) {
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &max_size);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
  }
};

GlesRenderer::GlesRenderer(std::unique_ptr<Context> context) : context_(std::move(context)) {}

GlesRenderer::~GlesRenderer() {
  context_->run([this] { objects_.reset(); });
}

std::unique_ptr<GlesRenderer> GlesRenderer::create(Context::Drivers drivers, std::string& why) {
  return create_on(Context::create(drivers, why), why);
}

std::unique_ptr<GlesRenderer> GlesRenderer::create_in(Context::External foreign, Context::Drivers drivers,
                                                      std::string& why) {
  return create_on(Context::create_in(std::move(foreign), drivers, why), why);
}

// Runs a job while the context is current. Throws Error if the context is lost.
void GlesRenderer::in_context(const std::function<void()>& job) {
  try {
    if (context_->run(job)) return;
  } catch (const GpuTimeout&) {
    lost_ = true;
    throw;
  }
  lost_ = true;
  throw Error("the context is lost");
}

// Compiles one program to reject unsuitable drivers early.
std::unique_ptr<GlesRenderer> GlesRenderer::create_on(std::unique_ptr<Context> context, std::string& why) {
  if (!context) return nullptr;
  std::unique_ptr<GlesRenderer> renderer(new GlesRenderer(std::move(context)));
  const Context& in = *renderer->context_;
  // llvmpipe reports one second for every compute shader.
  const bool has_timer = !in.is_software() && in.has_extension("GL_EXT_disjoint_timer_query");
  try {
    renderer->in_context([&] {
      renderer->objects_ = std::make_unique<Objects>(has_timer);
      renderer->objects_->programs.use({.output = SumProgram::Output::kBlocksI420, .has_map = true});
    });
  } catch (const Error& error) {
    why = error.what();
    return nullptr;
  }
  return renderer;
}

// Maximum samples per dispatch for views that are blended by a WeightGrid: for several views, and for a single view.
// The driver of a slow GPU may assume a hang if there is more work.
static constexpr size_t kMaxSamples = 64'000'000, kMaxSamplesOfOne = 256'000'000;
// Maximum projections in double that one CPU thread computes for such a view.
static constexpr size_t kMaxFixedUp = 4'000'000;

// Throws Error if one pass cannot render the views.
void GlesRenderer::check_size(std::span<const GlesView> views) const {
  const Objects& o = *objects_;
  int level_rows = 0;
  size_t samples = 0;
  bool is_too_large = !o.blocks.fits(views);
  for (const GlesView& view : views) {
    if (view.task->plan->blend()) samples += simd::samples_of(*view.task, view.rect);
    if (const FocalMap* map = view.task->plan->view().focus.map.get()) level_rows += map->rows;
    is_too_large |= std::max({view.rect.width(), view.rect.height(), level_rows}) > o.max_size;
  }
  if (is_too_large) throw Error("the view is too large");
  if (samples > (views.size() > 1 ? kMaxSamples : kMaxSamplesOfOne))
    throw Error("too many cameras contribute to each pixel");
}

// `begin` starts rendering the views, with the images as `atlas` has laid them out. `read` waits for the result. Throws
// Error if the GPU cannot render the views.
void GlesRenderer::draw_now(std::span<const GlesView> views, ImageAtlas& atlas, const ParallelFor& parallel,
                            const std::function<void()>& begin, const std::function<void()>& read) {
  Objects& o = *objects_;
  if (!atlas.has_room()) in_context([&] { atlas.reserve(); });
  atlas.fill(parallel);
  in_context([&] {
    o.textures.upload(views, atlas, o.programs);
    o.stopwatch.reset();
    begin();
    read();
    drawn_ns_ += o.stopwatch.nanoseconds();
    if (const GLenum error = glGetError(); error != GL_NO_ERROR) {
      lost_ = error == GL_OUT_OF_MEMORY || lost_;
      throw Error("OpenGL error " + std::to_string(error));
    }
  });
}

// Returns how many of the first orders can share a pass. One program must render all these orders, so that a sum does
// not depend on the other sums of the pass.
size_t GlesRenderer::together(std::span<const GlesJob> orders) const {
  const simd::SumTask& first = *orders.front().task;
  const SumProgram program = program_of(first);
  if (program.has_rays) return 1;
  const auto end = std::ranges::find_if_not(orders, [&](const GlesJob& order) {
    return order.task->family == first.family && program_of(*order.task) == program;
  });
  return static_cast<size_t>(end - orders.begin());
}

// Computes the undecided samples on the CPU. Throws Error if these are too many, or if a sum cannot be written back.
void GlesRenderer::finish(std::span<GlesJob> orders, std::span<SumReadback> readings, const ParallelFor& parallel) {
  for (size_t i = 0; i < orders.size(); i++)
    if (orders[i].task->plan->blend() &&
        undecided_samples(*readings[i].out) * orders[i].task->slots.size() > kMaxFixedUp)
      throw Error("float precision leaves too many pixels to the CPU");
  std::vector<size_t> fixed_up(orders.size());
  parallel(orders.size(),
           [&](size_t i) { fixed_up[i] = cpu_fixup(*orders[i].task, orders[i].sources, *readings[i].out); });
  bool any = false;
  for (size_t i = 0; i < orders.size(); i++) {
    fixed_up_ += fixed_up[i];
    any = any || (orders[i].keep_on_gpu && fixed_up[i] > 0);
  }
  if (!any) return;
  // Another renderer may add these sums as soon as they are published.
  in_context([&] {
    for (size_t i = 0; i < orders.size(); i++)
      if (orders[i].keep_on_gpu && fixed_up[i] > 0) readings[i].sum->write_back(*readings[i].out);
    wait_for_gpu();
  });
}

// Renders all orders in one pass. If they do not fit, splits them into two halves.
void GlesRenderer::draw_pass(std::span<GlesJob> orders, const ParallelFor& parallel) {
  Objects& o = *objects_;
  const auto part = [](const GlesView& view, const Source& source) {
    return needed_pixels(*view.task->plan, source.camera, *source.rig_camera);
  };
  std::vector<GlesView> views;
  for (const GlesJob& order : orders) views.push_back({order.task, order.sources, order.rect});
  const std::shared_ptr<Pass> pass = o.passes.take();
  try {
    check_size(views);
    if (!pass->atlas.lay_out(views, {part}, o.max_size)) throw Error("the cameras' images are too large");
  } catch (const Error& error) {
    if (orders.size() == 1) {
      orders.front().why_not = error.what();
      return;
    }
    draw_pass(orders.first(orders.size() / 2), parallel);
    return draw_pass(orders.subspan(orders.size() / 2), parallel);
  }
  pass->numbers.make(views, pass->atlas, parallel);
  passes_++;
  std::vector<ReadbackBuffer> open(orders.size());  // undecided samples of the sums that stay on the GPU
  std::vector<SumReadback> readings(orders.size());
  std::vector<std::shared_ptr<BlockSum>> sums;
  const auto begin = [&] { return o.blocks.begin(views, pass->numbers, o.textures, o.programs, o.stopwatch); };
  for (size_t i = 0; i < orders.size(); i++) {
    GlesJob& order = orders[i];
    ReadbackBuffer* const out = order.keep_on_gpu ? &open[i] : &order.drawn;
    *out = {.family = order.task->family, .rect = order.rect};
    readings[i] = {.out = out, .only_undecided = order.keep_on_gpu};
  }
  const auto read_all = [&] {
    sums.assign(o.blocks.latest().begin(), o.blocks.latest().end());
    for (size_t i = 0; i < orders.size(); i++) readings[i].sum = sums[i].get();
    read_sums(readings);
  };
  try {
    draw_now(views, pass->atlas, parallel, begin, read_all);
    finish(orders, readings, parallel);
  } catch (const Error& error) {
    for (GlesJob& order : orders) order.why_not = error.what();
    return;
  }
  for (size_t i = 0; i < orders.size(); i++) {
    const View& view = orders[i].task->plan->view();
    if (orders[i].keep_on_gpu)
      orders[i].kept_sum = std::make_shared<GpuSum>(shared_from_this(), std::move(sums[i]),
                                                    Rect{0, 0, view.width, view.height}, readings[i].any_missing);
  }
}

void GlesRenderer::draw(std::span<GlesJob> orders, const ParallelFor& parallel) {
  passes_ = fixed_up_ = 0;
  drawn_ns_ = 0;
  while (!orders.empty()) {
    const size_t count = together(orders);
    draw_pass(orders.first(count), parallel);
    orders = orders.subspan(count);
  }
}

void GlesRenderer::work(const std::function<void(Programs& programs, Buffer& scratch)>& job) {
  in_context([&] {
    job(objects_->programs, objects_->scratch);
    if (glGetError() != GL_NO_ERROR) throw Error("OpenGL reports an error");
  });
}

std::shared_ptr<BlockSum> GlesRenderer::add(std::span<const std::shared_ptr<BlockSum>> sums, const Rect& view) {
  std::shared_ptr<BlockSum> sum;
  work([&](Programs& programs, Buffer&) { sum = objects_->blocks.add(sums, view, programs); });
  return sum;
}

bool GlesRenderer::draw_consistency(const ConsistencyTask& task, std::span<const Source> sources,
                                    const std::function<Rect(const Source&)>& part, const ParallelFor& parallel,
                                    ConsistencyReadback& out, std::string& why) {
  Objects& o = *objects_;
  for (const simd::Slot& slot : task.sums.slots) out.rect = unite(out.rect, slot.rect);
  const GlesView view{&task.sums, sources, out.rect};
  const std::shared_ptr<Pass> pass = o.passes.take();
  const auto part_of = [&part](const GlesView&, const Source& source) { return part(source); };
  const auto begin = [&] {
    o.consistency_sums.begin(task, out.rect, pass->numbers, o.textures, o.programs, o.stopwatch);
  };
  try {
    check_size({&view, 1});
    if (!pass->atlas.lay_out({&view, 1}, {part_of, false}, o.max_size))
      throw Error("the cameras' images are too large");
    pass->numbers.make({&view, 1}, pass->atlas, parallel, task.boxes);
    drawn_ns_ = 0;
    draw_now({&view, 1}, pass->atlas, parallel, begin, [&] { o.consistency_sums.read(out); });
  } catch (const Error& error) {
    why = error.what();
    return false;
  }
  return true;
}

namespace {

uint16_t bits(double levels) {
  return static_cast<uint16_t>(static_cast<int16_t>(std::lrint(levels * (1 << kSumFractionBits))));
}

struct Part {
  const simd::Slot* slot;
  float weight;
  bool seen;
  Vec2 position;
};

// The contributions to a pixel: at most three where the mesh blends.
class Parts {
 public:
  Parts(const simd::SumTask& task, int x, int y) {
    int32_t owner = FaceIdMap::kNone;
    for (const FaceRun& run : task.runs->row(y, x, x + 1)) owner = run.face;
    if (owner == FaceIdMap::kNone) return;
    const ViewPlan& plan = *task.plan;
    const FacePlan& face = plan.faces()[static_cast<size_t>(owner)];
    if (!face.has_corners()) {
      for (const simd::Slot& slot : task.slots)
        if (const int weight = is_in(slot.rect, x, y) ? plan.blend()->weight(slot.camera, x, y) : 0)
          add(plan, slot, static_cast<float>(weight) / WeightGrid::kOne, x, y);
      return;
    }
    const Vec2 ray = plan.rays().at(x, y);
    const FaceWeights weights = face_weights(face, ray);
    for (int k = 0; k < 3; k++) {
      if (face.camera[k] == MeshFace::kNone || weights.w[k] == 0) continue;
      const int32_t slot = task.slot_of_camera[face.camera[k]];
      if (slot >= 0) add(plan, task.slots[static_cast<size_t>(slot)], weights.w[k], x, y);
    }
  }
  auto begin() const { return parts_.begin(); }
  auto end() const { return parts_.end(); }

 private:
  static bool is_in(const Rect& rect, int x, int y) {
    return x >= rect.x0 && x < rect.x1 && y >= rect.y0 && y < rect.y1;
  }
  void add(const ViewPlan& plan, const simd::Slot& slot, float weight, int x, int y) {
    Part& part = parts_.emplace_back(Part{&slot, weight, false, {}});
    part.seen = slot.image.family != PixelFamily::kNone &&
                slot.projection->project(plan.rays().at(x, y), plan.inverse_at(x, y), part.position);
  }

  static std::vector<Part>& emptied() {
    thread_local std::vector<Part> parts;
    parts.clear();
    return parts;
  }
  std::vector<Part>& parts_ = emptied();  // thread-local, for one pixel at a time
};

void fix_up_pixel(const simd::SumTask& task, simd::FetchedImages& images, int x, int y, uint16_t* out,
                  uint16_t& out_lost) {
  double sum[3] = {}, lost = 0;
  const bool rgb = task.family == PixelFamily::kRgb;
  for (const Part& part : Parts(task, x, y)) {
    if (!part.seen || images.of(*part.slot).family == PixelFamily::kNone) {
      lost += part.weight;
      continue;
    }
    const ImageView& image = images.of(*part.slot);
    const plain::Sampler at(part.position, image.width, image.height);
    const int offset[3] = {rgb ? image.layout.r : 0, image.layout.g, image.layout.b};
    for (int c = 0; c < (rgb ? 3 : 1); c++)
      sum[c] +=
          part.weight * at.sample(image.plane[0] + offset[c], image.stride[0], rgb ? image.layout.pixel_stride : 1);
  }
  for (int c = 0; c < (rgb ? 3 : 1); c++) *out++ = bits(sum[c]);
  out_lost = static_cast<uint16_t>(std::lrint(lost * kMissingOne));
}

// (x, y) is the first pixel of a 2x2 block of `rect`.
void fix_up_chroma(const simd::SumTask& task, simd::FetchedImages& images, const Rect& rect, int x, int y,
                   uint16_t* out) {
  struct Share {
    const simd::Slot* slot;
    double weight;
    Vec2 position;  // in one of the pixels that the camera sees
  };
  std::vector<Share> shares;
  int pixels = 0;
  for (int j = y; j < std::min(y + 2, rect.y1); j++)
    for (int i = x; i < std::min(x + 2, rect.x1); i++) {
      pixels++;
      for (const Part& part : Parts(task, i, j)) {
        if (!part.seen) continue;
        auto share = std::ranges::find(shares, part.slot, &Share::slot);
        if (share == shares.end()) share = shares.insert(share, {part.slot, 0, {}});
        share->weight += part.weight;
        share->position = part.position;
      }
    }
  double sum[2] = {};
  const ViewPlan& plan = *task.plan;
  for (const Share& share : shares) {
    const ImageView& image = images.of(*share.slot);
    if (image.family == PixelFamily::kNone) continue;
    Vec2 position;
    if (!share.slot->projection->project_unbounded(plan.rays().at_centre_of_four(x, y),
                                                   plan.inverse_at(x + 0.5, y + 0.5), position))
      position = share.position;
    const plain::Sampler at((position - 0.5) / 2.0, chroma_size(image.width), chroma_size(image.height));
    for (int c = 0; c < 2; c++)
      sum[c] += share.weight / pixels * (at.sample(image.plane[1 + c], image.stride[1 + c], 1) - 128);
  }
  for (int c = 0; c < 2; c++) out[c] = bits(sum[c]);
}

}  // namespace

// Returns true if any value equals `value`. The loop has no branches, so that compilers can vectorize the code.
static bool has(const uint16_t* values, int count, int step, uint16_t value) {
  unsigned any = 0;
  for (int i = 0; i < count; i++) any |= values[i * step] == value;
  return any;
}

size_t undecided_samples(const ReadbackBuffer& sum) {
  const Rect &rect = sum.rect, &part = sum.missing_rect;
  size_t open = 0;
  for (int y = part.y0; y < part.y1; y++) {
    const uint16_t* const lost = &sum.lost[static_cast<size_t>(y - part.y0) * sum.missing_pitch];
    open += static_cast<size_t>(std::count(lost, lost + part.width(), uint16_t{kUndecided}));
    if (sum.family != PixelFamily::kI420 || y % 2) continue;
    const size_t row = static_cast<size_t>(y - rect.y0) / 2 * chroma_size(rect.width());
    const uint16_t* const chroma = &sum.chroma[2 * (row + (part.x0 - rect.x0) / 2)];
    for (int i = 0; i < chroma_size(part.width()); i++) open += 4 * (chroma[2 * i] == kChromaUndecided);
  }
  return open;
}

size_t cpu_fixup(const simd::SumTask& task, std::span<const Source> sources, ReadbackBuffer& sum) {
  simd::FetchedImages images(task, sources);
  const Rect &rect = sum.rect, &part = sum.missing_rect;
  const int values = sum.family == PixelFamily::kRgb ? 4 : 1;
  size_t fixed_up = 0;
  for (int y = part.y0; y < part.y1; y++) {
    uint16_t* lost = &sum.lost[static_cast<size_t>(y - part.y0) * sum.missing_pitch];
    if (!has(lost, part.width(), 1, kUndecided)) continue;
    for (int x = part.x0; x < part.x1; x++, lost++) {
      if (*lost != kUndecided) continue;
      const size_t pixel = static_cast<size_t>(y - rect.y0) * sum.pitch + (x - rect.x0);
      fix_up_pixel(task, images, x, y, &sum.pixels[pixel * values], *lost);
      fixed_up++;
    }
  }
  if (sum.family != PixelFamily::kI420) return fixed_up;
  for (int y = part.y0; y < part.y1; y += 2) {
    const size_t row = static_cast<size_t>(y - rect.y0) / 2 * chroma_size(rect.width());
    uint16_t* chroma = &sum.chroma[2 * (row + (part.x0 - rect.x0) / 2)];
    if (!has(chroma, chroma_size(part.width()), 2, kChromaUndecided)) continue;
    for (int x = part.x0; x < part.x1; x += 2, chroma += 2) {
      if (chroma[0] != kChromaUndecided) continue;
      fix_up_chroma(task, images, rect, x, y, chroma);
      fixed_up++;
    }
  }
  return fixed_up;
}

bool ReadbackBuffer::copy_rows(int y0, int y1, const SumPlanes& out) const {
  // Everything outside the sum's rectangle is 0.
  const bool rgb = family == PixelFamily::kRgb;
  const Rect part = intersect(rect, {out.rect.x0, y0, out.rect.x1, y1});
  bool any_missing = false;
  for (int y = y0; y < y1; y++) {
    const bool any = !part.empty() && y >= part.y0 && y < part.y1;
    const auto row_of = [&](auto* plane, ptrdiff_t stride) {
      auto* row = plane + (y - out.rect.y0) * stride;
      if (!any || part.width() < out.rect.width()) std::fill_n(row, out.rect.width(), 0);
      return row - out.rect.x0;
    };
    const size_t first = static_cast<size_t>(y - rect.y0) * pitch + (part.x0 - rect.x0);
    for (int c = 0; c < (rgb ? 3 : 1); c++) {
      int16_t* __restrict const to = row_of(out.plane[c], out.stride[c]) + part.x0;
      if (!any) continue;
      const uint16_t* const from = &pixels[rgb ? 4 * first + c : first];
      const int step = rgb ? 4 : 1;
      if (rgb)
        for (int i = 0; i < part.width(); i++) to[i] = static_cast<int16_t>(from[i * step]);
      else
        std::copy_n(from, part.width(), reinterpret_cast<uint16_t*>(to));
    }
    const Rect with_loss = intersect(missing_rect, {out.rect.x0, y, out.rect.x1, y + 1});
    if (out.lost) std::fill_n(out.lost + (y - out.rect.y0) * out.missing_stride, out.rect.width(), uint16_t{0});
    if (with_loss.empty()) continue;
    const uint16_t* from =
        &lost[static_cast<size_t>(y - missing_rect.y0) * missing_pitch + (with_loss.x0 - missing_rect.x0)];
    any_missing = any_missing || std::any_of(from, from + with_loss.width(), [](uint16_t v) { return v != 0; });
    if (out.lost)
      std::copy_n(from, with_loss.width(),
                  out.lost + (y - out.rect.y0) * out.missing_stride + (with_loss.x0 - out.rect.x0));
  }
  if (rgb) return any_missing;
  for (int y = y0; y < y1; y += 2) {
    int16_t* to[2];
    for (int c = 0; c < 2; c++) {
      to[c] = out.plane[1 + c] + (y - out.rect.y0) / 2 * out.stride[1 + c];
      if (part.width() < out.rect.width() || y < part.y0 || y >= part.y1)
        std::fill_n(to[c], chroma_size(out.rect.width()), int16_t{0});
      to[c] += (part.x0 - out.rect.x0) / 2;
    }
    if (part.empty() || y < part.y0 || y >= part.y1) continue;
    const size_t row = static_cast<size_t>(y - rect.y0) / 2 * chroma_size(rect.width());
    const uint16_t* from = &chroma[2 * (row + (part.x0 - rect.x0) / 2)];
    int16_t* __restrict const cb = to[0], * __restrict const cr = to[1];
    for (int i = 0; i < chroma_size(part.width()); i++) {
      cb[i] = static_cast<int16_t>(from[2 * i]);
      cr[i] = static_cast<int16_t>(from[2 * i + 1]);
    }
  }
  return any_missing;
}

}  // namespace lf::gl
