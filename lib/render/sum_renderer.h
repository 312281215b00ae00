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
class GpuSum;
class GlesRenderer;
}  // namespace gl

struct Source {
  CameraIndex camera = 0;  // index of the camera in the plan's rig
  const Camera* rig_camera = nullptr;
  // The image must have the camera's size. If its family is kNone, there is no image, and the camera's weight is
  // missing. The image may be in textures of the GPU that renders the sum; the CPU downloads it when needed.
  ImageView image;
};

// Throws Error unless the image has the camera's size.
void check_image(const Camera& camera, const ImageView& image);

// Selects how positions in camera images are computed.
enum class Coordinates {
  kExact,  // projected for every pixel, in float
  // projected every 16 pixels of a row, or at the nodes of a focal map; interpolated where accurate to kGridError
  kGrid,
};
inline constexpr double kGridError = 1.0 / 512;  // pixels of the camera image

// Says whether the GPU rendered a sum.
struct GpuStatus {
  bool drawn = false;
  bool refused = false;  // the GPU tried and failed
  std::string why_not;   // the reason, if `drawn` is false
};

// Renders a sum: the weighted total of the contributions of some cameras to one view. Products of weight and colour are
// added in registers, in 16 bits with 7 fractional bits, so that rounding to 8 bits happens only once, at the end. The
// code uses portable SIMD (Highway): SSE2, SSE4, AVX2, AVX-512 or NEON, as the processor supports.
//
// The rounded result differs from the rule in double precision by at most 1 of 255 if coverage is above 0.999; see
// docs/reference/error-budget.md.
class SumRenderer {
 public:
  // All arguments must outlive this object. Throws Error unless all sources have one family and images of their
  // cameras' sizes; each camera may occur only once. If `gpu` is not null, the GPU renders this sum in a separate
  // draw(). The sum may stay on the GPU if `keep_on_gpu` (see gpu_sum()). A shared_ptr must then own `gpu`.
  SumRenderer(const ViewPlan& plan, const FaceRuns& runs, std::span<const Source> sources, PixelFamily family,
              Coordinates coordinates = Coordinates::kGrid, gl::GlesRenderer* gpu = nullptr,
              const ParallelFor& parallel = serial_for, bool keep_on_gpu = false);
  ~SumRenderer();
  SumRenderer(const SumRenderer&) = delete;
  SumRenderer& operator=(const SumRenderer&) = delete;

  // Renders the sums of several renderers on a GPU in shared passes (see GlesRenderer::draw()), as far as possible. The
  // renderers must have been constructed without a GPU. `parallel` copies the images. render_rows() renders the
  // remaining sums on the CPU.
  static void draw(std::span<SumRenderer* const> renderers, gl::GlesRenderer& gpu, const ParallelFor& parallel);

  // Downloads images from the GPU in parallel, if the CPU renders the sum. Without this call, render_rows() downloads
  // them in one thread.
  void fetch(const ParallelFor& parallel);

  // Contains the sources' contributions according to the plan, in whole chroma samples for kI420; may be empty.
  const Rect& rect() const { return rect_; }
  // Returns an upper bound of the number of samples: pixels times cameras.
  size_t samples() const;
  const GpuStatus& drawing() const;
  // Returns the sum of rect(), extended to whole 2x2 blocks, if the sum stayed on the GPU. In that case, do not call
  // render_rows().
  std::shared_ptr<gl::GpuSum> gpu_sum() const;
  // Writes rows [y0, y1) of the sum into `out`. y0 must be even, and y1 must be even or the end of out.rect. Pixels
  // without a contribution become 0. out.rect must be inside the region of the runs. Fills out.lost unless it is null.
  // Returns true if any weight is missing. Several threads may render different rows.
  bool render_rows(int y0, int y1, const SumPlanes& out) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
  Rect rect_;
};

// Returns the name of the instruction set that SumRenderer uses on this machine, such as "AVX2".
const char* simd_target_name();

// Divides a sum into rectangles that are worth sending. The rectangles are disjoint, contain every pixel with a weight
// of one of `cameras` (ascending), and are sorted by their upper edges. In kI420 they are chroma-aligned. `runs` must
// cover the cameras' chroma-aligned rectangles.
//
// A rectangle is merged with its neighbour if this adds at most `spare_pixels` pixels without weight. Choose the number
// of pixels that is cheaper to send than another rectangle. For example, a camera's part of a view is about a hexagon.
// A small number gives rectangles of kTileRows rows, each as wide as the hexagon is there. A large number gives the
// bounds of the hexagon.
std::vector<Rect> sum_tiles(const ViewPlan& plan, const FaceRuns& runs, std::span<const CameraIndex> cameras,
                            PixelFamily family, size_t spare_pixels);

// Rectangles begin and end at multiples of this number of rows, except at the top and bottom, because a JPEG has whole
// MCUs.
inline constexpr int kTileRows = 16;

}  // namespace lf
