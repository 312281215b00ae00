// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/sum_drawer.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "render/camera_projection.h"
#include "render/gl/block_sums.h"
#include "render/gl/card_sum.h"
#include "render/gl/moment_sums.h"
#include "render/gl/objects.h"
#include "render/gl/passes.h"
#include "render/gl/sum_tables.h"
#include "render/gl/view_textures.h"
#include "render/simd/sum_task.h"

namespace lf::gl {

struct SumDrawer::Objects {
  Passes passes;
  ViewTextures textures;
  Programs programs;
  BlockSums blocks;
  MomentSums moments;
  Buffer scratch{Buffer::Use::kComputed};
  Stopwatch stopwatch;
  GLint max_size = 0;

  explicit Objects(bool has_timer) : stopwatch(has_timer) {
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &max_size);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
  }
};

SumDrawer::SumDrawer(std::unique_ptr<Context> context) : context_(std::move(context)) {}

SumDrawer::~SumDrawer() {
  context_->run([this] { objects_.reset(); });
}

std::unique_ptr<SumDrawer> SumDrawer::create(Context::Drivers drivers, std::string& why) {
  return create_on(Context::create(drivers, why), why);
}

std::unique_ptr<SumDrawer> SumDrawer::create_in(Context::Foreign foreign, Context::Drivers drivers, std::string& why) {
  return create_on(Context::create_in(std::move(foreign), drivers, why), why);
}

std::unique_ptr<SumDrawer> SumDrawer::create_on(std::unique_ptr<Context> context, std::string& why) {
  if (!context) return nullptr;
  std::unique_ptr<SumDrawer> drawer(new SumDrawer(std::move(context)));
  bool is_fit = false;
  drawer->context_->run([&] { is_fit = drawer->prepare(why); });
  return is_fit ? std::move(drawer) : nullptr;
}

// Unfit drivers are told from others before there is anything to draw.
bool SumDrawer::prepare(std::string& why) {
  // llvmpipe says of every compute shader that it took a second.
  objects_ = std::make_unique<Objects>(!is_software() && context_->has_extension("GL_EXT_disjoint_timer_query"));
  return objects_->programs.use({.output = SumProgram::Output::kBlocksI420, .has_map = true}, why);
}

// Samples of views that are not blended by their mesh that the card is given at once: of several views, and of one. It
// may be a slow one, which its driver takes for hung after a while.
static constexpr size_t kMostSamples = 64'000'000, kMostSamplesOfOne = 256'000'000;
// Projections in double of what such a view leaves open, by one thread.
static constexpr size_t kMostMended = 4'000'000;

static bool refuse(std::string& why, std::string reason) {
  why = std::move(reason);
  return false;
}

// Sides of what is drawn, and how much it is. Images are seen to by their atlas.
bool SumDrawer::fits(std::span<const DrawnView> views, std::string& why) const {
  const Objects& o = *objects_;
  if (!o.blocks.fits(views)) return refuse(why, "the view is too large");
  int level_rows = 0;
  size_t samples = 0;
  for (const DrawnView& view : views) {
    if (view.task->plan->blend()) samples += simd::samples_of(*view.task, view.rect);
    if (const FocalMap* map = view.task->plan->view().focus.map.get()) level_rows += map->rows;
    if (std::max({view.rect.width(), view.rect.height(), level_rows}) > o.max_size)
      return refuse(why, "the view is too large");
  }
  if (samples > (views.size() > 1 ? kMostSamples : kMostSamplesOfOne))
    return refuse(why, "there are too many cameras a pixel");
  return true;
}

// `begin`: has the card begin with what is drawn of views whose images `atlas` has laid out; `read` waits for it.
template <class Begin, class Read>
bool SumDrawer::draw_now(std::span<const DrawnView> views, ImageAtlas& atlas, const ParallelFor& parallel,
                         const Begin& begin, const Read& read, std::string& why) {
  Objects& o = *objects_;
  const auto in_context = [&](const auto& job) {
    bool done = false;
    if (context_->run([&] { done = job(); })) return done;
    lost_ = true;
    return refuse(why, "the context is lost");
  };
  const auto reserve = [&] {
    atlas.reserve();
    return true;
  };
  if (!atlas.has_room() && !in_context(reserve)) return false;
  atlas.fill(parallel);
  return in_context([&] {
    if (!o.textures.upload(views, atlas, o.programs, why)) return false;
    o.stopwatch.reset();
    if (!begin()) return false;
    if (!read()) {
      lost_ = true;
      return refuse(why, "the card does not answer");
    }
    drawn_ns_ += o.stopwatch.nanoseconds();
    if (const GLenum error = glGetError(); error != GL_NO_ERROR) {
      lost_ = error == GL_OUT_OF_MEMORY || lost_;
      return refuse(why, "OpenGL error " + std::to_string(error));
    }
    return true;
  });
}

// How many of the first orders may go in one pass: the same program draws them, so that what a sum comes to does not
// depend on those beside it.
size_t SumDrawer::together(std::span<const SumOrder> orders) const {
  const simd::SumTask& first = *orders.front().task;
  const SumProgram program = program_of(first);
  if (program.has_rays) return 1;
  const auto end = std::ranges::find_if_not(orders, [&](const SumOrder& order) {
    return order.task->family == first.family && program_of(*order.task) == program;
  });
  return static_cast<size_t>(end - orders.begin());
}

// Mends what the card has left open. False with the reason in `why` where that can't be put back.
bool SumDrawer::finish(std::span<SumOrder> orders, std::span<SumReading> readings, const ParallelFor& parallel,
                       std::string& why) {
  for (size_t i = 0; i < orders.size(); i++)
    if (orders[i].task->plan->blend() && open_samples(*readings[i].out) * orders[i].task->slots.size() > kMostMended)
      return refuse(why, "the card can't tell too much of it");
  std::vector<size_t> mended(orders.size());
  parallel(orders.size(), [&](size_t i) { mended[i] = mend(*orders[i].task, orders[i].sources, *readings[i].out); });
  bool any = false, is_there = true;
  for (size_t i = 0; i < orders.size(); i++) {
    mended_ += mended[i];
    any = any || (orders[i].stays && mended[i] > 0);
  }
  if (!any) return true;
  // Another drawer may add them to its own as soon as they are known.
  const auto write_back = [&] {
    for (size_t i = 0; i < orders.size(); i++)
      if (orders[i].stays && mended[i] > 0) readings[i].sum->write_back(*readings[i].out);
    is_there = wait_for_card();
  };
  if (context_->run(write_back) && is_there) return true;
  lost_ = true;
  return refuse(why, is_there ? "the context is lost" : "the card does not answer");
}

// All of them in one pass, or where that is too much, in two that are half as large.
void SumDrawer::draw_pass(std::span<SumOrder> orders, const ParallelFor& parallel) {
  Objects& o = *objects_;
  const auto part = [](const DrawnView& view, const Source& source) {
    return needed_pixels(*view.task->plan, source.camera, *source.rig_camera);
  };
  std::vector<DrawnView> views;
  for (const SumOrder& order : orders) views.push_back({order.task, order.sources, order.rect});
  const auto refuse_all = [&](const std::string& reason) {
    for (SumOrder& order : orders) order.why_not = reason.empty() ? "the card can't draw it" : reason;
  };
  std::string why;
  const Passes::Lease pass(o.passes);
  if (!fits(views, why) ||
      (!pass->atlas.lay_out(views, {part}, o.max_size) && !refuse(why, "the cameras' images are too large"))) {
    if (orders.size() == 1) return refuse_all(why);
    draw_pass(orders.first(orders.size() / 2), parallel);
    return draw_pass(orders.subspan(orders.size() / 2), parallel);
  }
  pass->numbers.make(views, pass->atlas, parallel);
  passes_++;
  std::vector<DrawnSum> open(orders.size());  // of those that stay, what the card has left open
  std::vector<SumReading> readings(orders.size());
  std::vector<std::shared_ptr<BlockSum>> sums;
  const auto begin = [&] {
    return o.blocks.begin(views, pass->numbers, o.textures, o.programs, o.stopwatch, why);
  };
  for (size_t i = 0; i < orders.size(); i++) {
    SumOrder& order = orders[i];
    DrawnSum* const out = order.stays ? &open[i] : &order.drawn;
    *out = {.family = order.task->family, .rect = order.rect};
    readings[i] = {.out = out, .only_open = order.stays};
  }
  const auto read_all = [&] {
    sums.assign(o.blocks.latest().begin(), o.blocks.latest().end());
    for (size_t i = 0; i < orders.size(); i++) readings[i].sum = sums[i].get();
    return read_sums(readings);
  };
  if (!draw_now(views, pass->atlas, parallel, begin, read_all, why) || !finish(orders, readings, parallel, why))
    return refuse_all(why);
  for (size_t i = 0; i < orders.size(); i++) {
    const View& view = orders[i].task->plan->view();
    if (orders[i].stays)
      orders[i].stayed = std::make_shared<CardSum>(shared_from_this(), std::move(sums[i]),
                                                   Rect{0, 0, view.width, view.height}, readings[i].any_lost);
  }
}

void SumDrawer::draw(std::span<SumOrder> orders, const ParallelFor& parallel) {
  passes_ = mended_ = 0;
  drawn_ns_ = 0;
  while (!orders.empty()) {
    const size_t count = together(orders);
    draw_pass(orders.first(count), parallel);
    orders = orders.subspan(count);
  }
}

bool SumDrawer::work(const std::function<bool(Programs& programs, Buffer& scratch)>& job) {
  bool done = false;
  const auto work = [&] { done = job(objects_->programs, objects_->scratch) && glGetError() == GL_NO_ERROR; };
  if (context_->run(work)) return done;
  lost_ = true;
  return false;
}

std::shared_ptr<BlockSum> SumDrawer::add(std::span<const std::shared_ptr<BlockSum>> sums, const Rect& view,
                                         std::string& why) {
  std::shared_ptr<BlockSum> sum;
  const auto add = [&](Programs& programs, Buffer&) {
    sum = objects_->blocks.add(sums, view, programs, why);
    return sum != nullptr;
  };
  if (work(add)) return sum;
  if (why.empty()) why = lost_ ? "the context is lost" : "OpenGL refuses it";
  return nullptr;
}

bool SumDrawer::draw_moments(const MomentTask& task, std::span<const Source> sources,
                             const std::function<Rect(const Source&)>& part, const ParallelFor& parallel,
                             DrawnMoments& out, std::string& why) {
  Objects& o = *objects_;
  for (const simd::Slot& slot : task.sums.slots) out.rect = unite(out.rect, slot.rect);
  const DrawnView view{&task.sums, sources, out.rect};
  const Passes::Lease pass(o.passes);
  if (!fits({&view, 1}, why)) return false;
  const auto part_of = [&part](const DrawnView&, const Source& source) { return part(source); };
  if (!pass->atlas.lay_out({&view, 1}, {part_of, false}, o.max_size))
    return refuse(why, "the cameras' images are too large");
  pass->numbers.make({&view, 1}, pass->atlas, parallel, task.boxes);
  const auto begin = [&] {
    return o.moments.begin(task, out.rect, pass->numbers, o.textures, o.programs, o.stopwatch, why);
  };
  const auto read_all = [&] { return o.moments.read(out); };
  drawn_ns_ = 0;
  return draw_now({&view, 1}, pass->atlas, parallel, begin, read_all, why);
}

}  // namespace lf::gl
