// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/maths.h"
#include "base/worker_pool.h"
#include "render/gl/context.h"
#include "render/simd/sum_task.h"
#include "render/sum_planes.h"
#include "render/sum_renderer.h"

namespace lf::gl {

struct BlockSum;
class Buffer;
class CardSum;
struct DrawnView;
class ImageAtlas;
class Programs;
struct SumReading;

// A sum as it came from the card.
struct DrawnSum {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;
  int pitch = 0;               // pixels from one row to the next
  uint16_t* pixels = nullptr;  // kRgb: R, G, B and 0 of each; kI420: Y. As in SumPlanes
  uint16_t* chroma = nullptr;  // kI420: Cb, Cr of each two by two, without a gap between rows
  Rect lost_rect;              // where weight may be lost
  int lost_pitch = 0;
  uint16_t* lost = nullptr;      // lost weight there
  std::shared_ptr<void> memory;  // what all of them are in; the drawer outlives it

  // Rows [y0, y1) as SumRenderer::render_rows() has them. True if any weight was lost in them.
  bool copy_rows(int y0, int y1, const SumPlanes& out) const;
};

// A sum that is to be drawn, and what comes of it.
struct SumOrder {
  // The task's slots in `rect`, which bounds them (even, but for the view's right and lower end, in kI420 and what
  // stays), of images `sources` that the task was made of.
  const simd::SumTask* task = nullptr;
  std::span<const Source> sources;
  Rect rect;
  bool stays = false;  // on the card; the drawer is owned by a shared_ptr

  DrawnSum drawn;                   // what it comes to,
  std::shared_ptr<CardSum> stayed;  // or where it has stayed
  std::string why_not;              // neither; "": it is drawn
};

// What moments of luma are to be drawn of: see focus/moments.h. A view with a focal map, with a pixel for each of its
// nodes, whose cameras look through several surfaces.
struct MomentTask {
  const simd::SumTask& sums;                       // of the view; blended by its mesh, whatever the view says
  std::span<const std::vector<uint8_t>> surfaces;  // levels of the map's nodes
  std::span<const int> boxes;                      // of each slot: the side, pixels, of what luma is the mean of, even
};

// Moments as they came from the card, of the nodes in a rectangle.
struct DrawnMoments {
  Rect rect;
  int pitch = 0;  // nodes from one row to the next
  const uint16_t* values = nullptr;
  std::shared_ptr<void> memory;  // what they are in; the drawer outlives it

  // Nodes from rect.x0 on of row y of a surface's weight (0), luma (1) or square (2).
  const uint16_t* row(size_t surface, int kind, int y) const {
    return values + ((3 * surface + kind) * rect.height() + static_cast<size_t>(y - rect.y0)) * pitch;
  }
};

// Renders sums on a graphics card, by compute shaders. Positions, weights and samples are in float, and sums are
// rounded once. The CPU determines the owners of pixels, in double. It also computes the pixels for which float can't
// decide whether a sample is lost, or where exactly it is. Every view has the error bounds of SumRenderer.
class SumDrawer : public std::enable_shared_from_this<SumDrawer> {
 public:
  // Null, with the reason in `why`, if the machine has no fit card (Drivers::kAny: no driver at all).
  static std::unique_ptr<SumDrawer> create(Context::Drivers drivers, std::string& why);
  // A drawer in another context. Null, with the reason in `why`, if that is unfit.
  static std::unique_ptr<SumDrawer> create_in(Context::Foreign foreign, Context::Drivers drivers, std::string& why);
  ~SumDrawer();

  const std::string& device() const { return context_->device(); }
  bool is_software() const { return context_->is_software(); }

  // Draws sums, or sets why_not of sums that it can't draw: sizes beyond the card's, a lost context. Successive sums
  // share a pass if their images fit in one atlas and if they have one family, all or none have focal maps, their
  // cameras are of the same kinds, and no view is distorted. An image that several sums need is sent once. A sum is the
  // same alone and with others.
  // Any thread, even in the middle of what `parallel` does for another: what copies images goes on beside what draws
  // others, and drawing is one after the other.
  void draw(std::span<SumOrder> orders, const ParallelFor& parallel);

  // The sum of sums that are on the card, see BlockSums::add(). Null with the reason in `why` if that can't be done.
  std::shared_ptr<BlockSum> add(std::span<const std::shared_ptr<BlockSum>> sums, const Rect& view, std::string& why);

  // Draws the moments of a task's slots, which `sources` are the images of, into `out`; `part`: what is looked at of a
  // source's image. They are the CPU's to the bit but where float's rounding takes a position to the next 256th of a
  // pixel or a weight to the next of Moments, which is a level of luma at most, or where it can't tell whether a camera
  // sees a node. Otherwise as draw().
  bool draw_moments(const MomentTask& task, std::span<const Source> sources,
                    const std::function<Rect(const Source&)>& part, const ParallelFor& parallel, DrawnMoments& out,
                    std::string& why);

  // The contexts that its own shares textures with; 0: none.
  ShareGroup group() const { return context_->group(); }
  // Calls what works on what is there on the card, with the context current and a buffer that nobody else uses
  // meanwhile. False if the job is, and where the context is lost or OpenGL tells of an error. Any thread.
  bool work(const std::function<bool(Programs& programs, Buffer& scratch)>& job);

  // To be called by such a job: the card has not done in time what it was given, and is left alone from now on.
  void has_not_answered() { lost_ = true; }

  // Whether the card is there no more, so that no draw() will ever succeed again.
  bool is_lost() const { return lost_; }
  // Makes the context as if its driver had lost it, from now on. Any thread.
  void lose() { context_->lose(); }
  // How long the card took for what the latest draw() or draw_moments() had it draw, without sending anything there and
  // back, nanoseconds; 0: its driver can't tell (GL_EXT_disjoint_timer_query).
  uint64_t drawn_ns() const { return drawn_ns_; }
  // Pixels (and chroma samples) that the latest draw() left to the CPU.
  size_t mended() const { return mended_; }
  // How many passes the latest draw() took.
  size_t passes() const { return passes_; }

 private:
  struct Objects;
  explicit SumDrawer(std::unique_ptr<Context> context);
  static std::unique_ptr<SumDrawer> create_on(std::unique_ptr<Context> context, std::string& why);
  bool prepare(std::string& why);
  size_t together(std::span<const SumOrder> orders) const;
  void draw_pass(std::span<SumOrder> orders, const ParallelFor& parallel);
  bool fits(std::span<const DrawnView> views, std::string& why) const;
  bool finish(std::span<SumOrder> orders, std::span<SumReading> readings, const ParallelFor& parallel,
              std::string& why);
  template <class Begin, class Read>
  bool draw_now(std::span<const DrawnView> views, ImageAtlas& atlas, const ParallelFor& parallel, const Begin& begin,
                const Read& read, std::string& why);

  std::unique_ptr<Context> context_;
  std::unique_ptr<Objects> objects_;  // what the context holds
  std::atomic<bool> lost_ = false;
  std::atomic<size_t> mended_ = 0, passes_ = 0;
  std::atomic<uint64_t> drawn_ns_ = 0;
};

// Computes what the card left open in double: pixels whose lost weight is kDoubt, chroma samples of kChromaDoubt.
// Returns how many there were. Images that are on the card come from there when they are needed; `sources`: what the
// task was made of.
size_t mend(const simd::SumTask& task, std::span<const Source> sources, DrawnSum& sum);

// How many there are.
size_t open_samples(const DrawnSum& sum);

}  // namespace lf::gl
