// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/sum_drawer.h"

#include <algorithm>
#include <mutex>
#include <utility>
#include <vector>

#include "render/camera_projection.h"
#include "render/gl/block_sums.h"
#include "render/gl/card_sum.h"
#include "render/gl/face_sums.h"
#include "render/gl/moment_sums.h"
#include "render/gl/objects.h"
#include "render/gl/view_textures.h"

namespace lf::gl {

namespace {

// Atlases for as many sums as are being made at once.
class Atlases {
 public:
  // One that nobody else has, for as long as this lives. Without a context.
  class Lease {
   public:
    explicit Lease(Atlases& from) : from_(from), atlas_(from.take()) {}
    ~Lease() { from_.give_back(std::move(atlas_)); }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    ImageAtlas* operator->() const { return atlas_.get(); }
    ImageAtlas& operator*() const { return *atlas_; }

   private:
    Atlases& from_;
    std::unique_ptr<ImageAtlas> atlas_;
  };

 private:
  std::unique_ptr<ImageAtlas> take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return std::make_unique<ImageAtlas>();
    auto atlas = std::move(free_.back());
    free_.pop_back();
    return atlas;
  }
  void give_back(std::unique_ptr<ImageAtlas> atlas) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(atlas));
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<ImageAtlas>> free_;
};

}  // namespace

struct SumDrawer::Objects {
  Atlases atlases;
  ViewTextures view;
  Programs programs;
  std::unique_ptr<FaceSums> faces;    // one of
  std::unique_ptr<BlockSums> blocks;  // the two
  std::unique_ptr<MomentSums> moments;
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

// What fragment shaders draw with. False with the reason in `why` if the driver is unfit for it.
static bool prepare_faces(const Context& context, Programs& programs, std::unique_ptr<FaceSums>& faces,
                          std::string& why) {
  GLint inputs = 0, outputs = 0;
  glGetIntegerv(GL_MAX_FRAGMENT_INPUT_COMPONENTS, &inputs);
  glGetIntegerv(GL_MAX_VERTEX_OUTPUT_COMPONENTS, &outputs);
  if (std::min(inputs, outputs) < 4 * (face_texels(true) + 1)) {
    why = "too few numbers between shaders";
    return false;
  }
  const bool has_float = context.has_extension("GL_EXT_color_buffer_float");
  if (!has_float && !context.has_extension("GL_EXT_color_buffer_half_float")) {
    why = "no sums in float";
    return false;
  }
  faces = std::make_unique<FaceSums>(has_float && context.has_extension("GL_EXT_float_blend"));
  using Output = SumProgram::Output;
  for (const Output output : {Output::kRgb, Output::kChroma})
    if (!programs.use({.output = output, .careful = true, .has_map = true}, why)) return false;
  return true;
}

std::unique_ptr<SumDrawer> SumDrawer::create_with(Shaders shaders, Context::Drivers drivers, std::string& why) {
  return create_on(Context::create(drivers, why), shaders, why);
}

std::unique_ptr<SumDrawer> SumDrawer::create_in(Context::Foreign foreign, Context::Drivers drivers, std::string& why) {
  return create_on(Context::create_in(std::move(foreign), drivers, why), Shaders::kCompute, why);
}

std::unique_ptr<SumDrawer> SumDrawer::create_on(std::unique_ptr<Context> context, Shaders shaders, std::string& why) {
  if (!context) return nullptr;
  std::unique_ptr<SumDrawer> drawer(new SumDrawer(std::move(context)));
  bool is_fit = false;
  drawer->context_->run([&] { is_fit = drawer->prepare(shaders, why); });
  return is_fit ? std::move(drawer) : nullptr;
}

// Unfit drivers are told from others before there is anything to draw.
bool SumDrawer::prepare(Shaders shaders, std::string& why) {
  if (shaders == Shaders::kFitting) shaders = is_software() ? Shaders::kFragment : Shaders::kCompute;
  // llvmpipe says of every compute shader that it took a second.
  const bool tells_time = shaders == Shaders::kFragment || !is_software();
  objects_ = std::make_unique<Objects>(tells_time && context_->has_extension("GL_EXT_disjoint_timer_query"));
  Objects& o = *objects_;
  if (shaders == Shaders::kFragment) return prepare_faces(*context_, o.programs, o.faces, why);
  o.blocks = std::make_unique<BlockSums>();
  o.moments = std::make_unique<MomentSums>();
  return o.programs.use({.output = SumProgram::Output::kBlocksI420, .careful = true, .has_map = true}, why);
}

static bool refuse(std::string& why, std::string reason) {
  why = std::move(reason);
  return false;
}

// `begin`: has the card begin with what is drawn of the task's images in `rect`; `read` waits for it.
template <class Begin, class Read>
bool SumDrawer::draw_now(const simd::SumTask& task, std::span<const Source> sources, const NeededPixels& needed,
                         const Rect& rect, const ParallelFor& parallel, const Begin& begin, const Read& read,
                         std::string& why) {
  Objects& o = *objects_;
  const auto faces = static_cast<int>(task.plan->faces().size());
  if (faces >= kMixedOwners) return refuse(why, "too many faces");
  if (std::max({rect.width(), rect.height(), faces}) > o.max_size)
    return refuse(why, "the view or the array is too large");
  const Atlases::Lease atlas(o.atlases);
  if (!atlas->lay_out(task, sources, needed, o.max_size)) return refuse(why, "the cameras' images are too large");
  const auto in_context = [&](const auto& job) {
    bool done = false;
    if (context_->run([&] { done = job(); })) return done;
    lost_ = true;
    return refuse(why, "the context is lost");
  };
  const auto reserve = [&] {
    atlas->reserve();
    return true;
  };
  if (!atlas->has_room() && !in_context(reserve)) return false;
  atlas->fill(parallel);
  return in_context([&] {
    o.view.upload(task, rect, *atlas);
    o.stopwatch.reset();
    if (!begin()) return false;
    if (!read()) {
      lost_ = true;
      return refuse(why, "the card does not answer");
    }
    drawn_ns_ = o.stopwatch.nanoseconds();
    if (const GLenum error = glGetError(); error != GL_NO_ERROR) {
      lost_ = error == GL_OUT_OF_MEMORY || lost_;
      return refuse(why, "OpenGL error " + std::to_string(error));
    }
    return true;
  });
}

// Into `out` or wherever `read` puts it.
template <class Read>
bool SumDrawer::draw_sum(const simd::SumTask& task, std::span<const Source> sources, const Rect& rect,
                         const ParallelFor& parallel, DrawnSum& out, const Read& read, std::string& why) {
  Objects& o = *objects_;
  out.family = task.family;
  out.rect = rect;
  const auto part = [&task](const Source& source) {
    return needed_pixels(*task.plan, source.camera, *source.rig_camera);
  };
  const auto begin = [&] {
    return o.blocks ? o.blocks->begin(task, o.view, o.programs, rect, o.stopwatch, why)
                    : o.faces->begin(task, o.view, o.programs, rect, o.stopwatch, why);
  };
  return draw_now(task, sources, {part}, rect, parallel, begin, read, why);
}

bool SumDrawer::draw(const simd::SumTask& task, std::span<const Source> sources, const Rect& rect,
                     const ParallelFor& parallel, DrawnSum& out, std::string& why) {
  const auto read = [&] {
    if (objects_->blocks) return objects_->blocks->latest()->read(out);
    objects_->faces->read(out);
    return true;
  };
  if (!draw_sum(task, sources, rect, parallel, out, read, why)) return false;
  mended_ = mend(task, out);
  return true;
}

std::shared_ptr<CardSum> SumDrawer::draw_to_stay(const simd::SumTask& task, std::span<const Source> sources,
                                                 const Rect& rect, const ParallelFor& parallel, std::string& why) {
  Objects& o = *objects_;
  if (!o.blocks) {
    refuse(why, "what fragment shaders draw does not stay");
    return nullptr;
  }
  DrawnSum open;  // what the card has left open
  bool any_lost = false;
  std::shared_ptr<BlockSum> sum;
  const auto read = [&] {
    sum = o.blocks->latest();
    return sum->read_open(open, any_lost);
  };
  if (!draw_sum(task, sources, rect, parallel, open, read, why)) return nullptr;
  const size_t mended = mend(task, open);  // mended_ is everybody's
  mended_ = mended;
  if (mended > 0 && !context_->run([&] { sum->write_back(open); })) {
    lost_ = true;
    refuse(why, "the context is lost");
    return nullptr;
  }
  const View& view = task.plan->view();
  return std::make_shared<CardSum>(shared_from_this(), std::move(sum), Rect{0, 0, view.width, view.height}, any_lost);
}

bool SumDrawer::work(const std::function<bool(Programs& programs, Buffer& scratch)>& job) {
  bool done = false;
  const auto work = [&] { done = job(objects_->programs, objects_->scratch) && glGetError() == GL_NO_ERROR; };
  if (context_->run(work)) return done;
  lost_ = true;
  return false;
}

bool SumDrawer::draws_moments() const { return objects_->moments != nullptr; }

bool SumDrawer::draw_moments(const MomentTask& task, std::span<const Source> sources,
                             const std::function<Rect(const Source&)>& part, const ParallelFor& parallel,
                             DrawnMoments& out, std::string& why) {
  Objects& o = *objects_;
  for (const simd::Slot& slot : task.sums.slots) out.rect = unite(out.rect, slot.rect);
  const auto begin = [&] { return o.moments->begin(task, o.view, o.programs, out.rect, o.stopwatch, why); };
  const auto read = [&] { return o.moments->read(out); };
  return draw_now(task.sums, sources, {part, false}, out.rect, parallel, begin, read, why);
}

}  // namespace lf::gl
