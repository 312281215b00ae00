// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/maths.h"
#include "base/worker_pool.h"
#include "image/image.h"
#include "render/ownership.h"
#include "render/sum_planes.h"
#include "render/view_plan.h"
#include "rig/rig.h"

namespace lf {

namespace gl {
class CardSum;
class SumDrawer;
}  // namespace gl

// One camera and what it sees now.
struct Source {
  CameraIndex camera = 0;              // index in the rig of the plan
  const Camera* rig_camera = nullptr;  // what the rig says of the camera
  // Has the camera's size; family kNone: there is no picture, and the camera's weight is lost. May be on the card that
  // is to draw it, in textures that the card's context shares; whatever the CPU then has to do with it, it comes here.
  ImageView image;
};

// Throws Error unless the image is of the camera's size.
void check_image(const Camera& camera, const ImageView& image);

// How positions in the cameras' images are found.
enum class Coordinates {
  kExact,  // projected for every pixel, in float
  kGrid,   // projected every 16 pixels of a row, or at a focal map's nodes; interpolated between where that is
           // good to kGridError
};
inline constexpr double kGridError = 1.0 / 512;  // pixels of the camera's image

// What a graphics card has to do with a sum.
struct Drawing {
  bool drawn = false;    // by the card
  bool refused = false;  // the card was asked to draw it, and could not
  std::string why_not;   // of what is refused; also of what no card is asked for
};

// Adds up the contributions of any number of cameras to one view: the fast path. Weight x colour of up to three cameras
// a pixel meet in registers, in 16 bits with 7 bits of fraction, so that rounding to 8 bits comes once and at the end.
// Portable SIMD (Highway): SSE2, SSE4, AVX2, AVX-512 or NEON as the processor has them.
//
// Bound against the rule in double precision, where coverage is above 0.999: 1 of 255 once rounded; see
// docs/error-budget.md.
class SumRenderer {
 public:
  // Everything must outlive this. Sources: one family, images of their cameras' sizes (else Error), no camera twice.
  // `card`: draw() is called, for this sum alone, where there is one. `may_stay`: what a card draws may stay there, see
  // card_sum(); the card is then owned by a shared_ptr.
  SumRenderer(const ViewPlan& plan, const OwnerRuns& runs, std::span<const Source> sources, PixelFamily family,
              Coordinates coordinates = Coordinates::kGrid, gl::SumDrawer* card = nullptr,
              const ParallelFor& parallel = serial_for, bool may_stay = false);
  ~SumRenderer();
  SumRenderer(const SumRenderer&) = delete;
  SumRenderer& operator=(const SumRenderer&) = delete;

  // Has a card draw the sums of renderers that were made without one here and now, where it can, out of images that
  // `parallel` copies to it: of views of one moment in a pass, see SumDrawer::draw(). Else the CPU does, row by row, as
  // it is asked for. A card without compute shaders is asked only for views that are blended by their mesh.
  static void draw(std::span<SumRenderer* const> renderers, gl::SumDrawer& card, const ParallelFor& parallel);

  // Has the images that are on a card come here, if the CPU is to render them: render_rows() does, too, in one thread.
  void fetch(const ParallelFor& parallel);

  // Bounds what the sources contribute, from the plan: whole chroma samples in kI420; may be empty.
  const Rect& rect() const { return rect_; }
  // How many samples of cameras it takes at the most: pixels times cameras.
  size_t samples() const;
  const Drawing& drawing() const;
  // The sum of rect(), grown to whole blocks of two by two pixels, if it has stayed on the card: render_rows() is then
  // not called.
  std::shared_ptr<gl::CardSum> card_sum() const;
  // Writes rows [y0, y1) (y0 even; y1 even or the end of out.rect) of the sum into `out`, all samples of them, zeros
  // where nothing contributes; out.rect inside the runs' region. Lost weight is written to out.lost (all of it). True
  // if any weight was lost. Call from several threads for different rows.
  bool render_rows(int y0, int y1, const SumPlanes& out) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
  Rect rect_;
};

// Name of the instruction set that SumRenderer uses on this machine: "AVX2".
const char* simd_target_name();

// Rectangles of the view that together hold every pixel in which one of `cameras` (ascending) has a weight: what the
// sum of these cameras has to consist of. They are disjoint, ascend by their upper edges, and are chroma-aligned in
// kI420. `runs` cover the cameras' chroma-aligned rectangles.
//
// A rectangle is grown by what lies next to it as long as that adds at most `spare_pixels` pixels without any weight:
// as many as are cheaper to send than another rectangle. One camera's part of a view is a hexagon or so: of few spare
// pixels become rectangles of kTileRows rows, each as wide as the hexagon is there, and of many its bounds.
std::vector<Rect> sum_tiles(const ViewPlan& plan, const OwnerRuns& runs, std::span<const CameraIndex> cameras,
                            PixelFamily family, size_t spare_pixels);

// Rectangles begin and end at multiples of so many rows, but for the first and the last: whole units of a JPEG.
inline constexpr int kTileRows = 16;

}  // namespace lf
