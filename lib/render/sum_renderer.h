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
#include "view/visibility_mask.h"

namespace lf {

namespace gl {
class GpuSum;
class GlesRenderer;
}  // namespace gl

struct Source {
  CameraIndex camera = 0;  // index of the camera in the plan's rig
  const Camera* rig_camera = nullptr;
  // The image must have the size that the rig states for the camera. The family kNone means that the camera has no
  // image; its weight then counts as missing. The image may be stored in textures of the GPU that renders the sum. If
  // the CPU renders the sum instead, the image is downloaded first.
  ImageView image;
  // The part of the focal surface that the camera sees, or null if this is not known. Must have the size of the view's
  // focal map, and is only used if the map's nodes are FocalMap::kMinStep apart. The CPU renders sums with masks.
  const VisibilityMask* visibility = nullptr;
  // The depths of single pixels at the edges of the view's focal map, or null. All sources of a sum must have the same
  // edges, and masks with values for these edges. Used under the same conditions as `visibility`.
  const DepthEdges* edges = nullptr;
};

// Checks that an image has the size that the rig gives for its camera. Throws Error otherwise.
void check_image(const Camera& camera, const ImageView& image);

enum class Coordinates {
  kExact,  // projected for every pixel, in float
  // projected every 16 pixels of a row, or at the nodes of a focal map; interpolated where accurate to kGridError
  kGrid,
};
inline constexpr double kGridError = 1.0 / 512;  // pixels of the camera image

struct GpuStatus {
  bool drawn = false;
  bool refused = false;  // the GPU tried and failed
  std::string why_not;   // the reason, if `drawn` is false
};

// Renders the weighted sum of the images of some cameras, warped into one view. If these are all cameras of the view,
// the sum is the picture. Products of weight and colour are added in registers, in 16 bits with 7 fractional bits, so
// that rounding to 8 bits happens only once, at the end. The code uses portable SIMD (Highway): SSE2, SSE4, AVX2,
// AVX-512 or NEON, as the processor supports.
//
// The rounded result differs from double precision by at most 1 of 255 in pixels with a coverage above 0.999; see
// docs/reference/error-budget.md.
class SumRenderer {
 public:
  // Prepares the sum of the images in `sources`. All arguments must outlive this object. Throws Error unless all
  // sources have one family and images of their cameras' sizes. Each camera may occur only once.
  //
  // If `gpu` is not null, the GPU renders this sum, in a separate draw(). If `keep_on_gpu` is true, the sum may stay on
  // the GPU (see gpu_sum()). A shared_ptr must then own `gpu`.
  SumRenderer(const ViewPlan& plan, const FaceRuns& runs, std::span<const Source> sources, PixelFamily family,
              Coordinates coordinates = Coordinates::kGrid, gl::GlesRenderer* gpu = nullptr,
              const ParallelFor& parallel = serial_for, bool keep_on_gpu = false);
  ~SumRenderer();
  SumRenderer(const SumRenderer&) = delete;
  SumRenderer& operator=(const SumRenderer&) = delete;

  // Renders the sums of several renderers on a GPU together, which is faster than one by one (see
  // GlesRenderer::draw()). The renderers must have been constructed without a GPU. `parallel` copies the images. If the
  // GPU cannot render a sum, render_rows() renders it on the CPU.
  static void draw(std::span<SumRenderer* const> renderers, gl::GlesRenderer& gpu, const ParallelFor& parallel);

  // Downloads images from the GPU in parallel if the CPU renders the sum. This call is optional, but render_rows()
  // would download the images in a single thread.
  void fetch(const ParallelFor& parallel);

  // Returns the part of the view that the sources contribute to, in whole chroma samples for kI420; may be empty.
  const Rect& rect() const { return rect_; }
  // Returns an upper bound of the work, as the number of samples: pixels times cameras.
  size_t samples() const;
  const GpuStatus& drawing() const;
  // Returns the sum on the GPU, if the sum stayed there. The sum covers rect(), extended to whole 2x2 blocks. In this
  // case, do not call render_rows().
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

// Divides a sum into rectangles, so that large areas without pixels are not sent. The rectangles are disjoint, contain
// every pixel with a weight of one of `cameras` (ascending), and are sorted by their upper edges. In kI420 they consist
// of whole chroma samples. `runs` must cover the contributions of the cameras.
//
// A rectangle is merged with its neighbour if this adds at most `max_extra_pixels` pixels without weight. Choose the
// number of pixels that take as long to send as another rectangle. For example, a camera contributes to an area that is
// about a hexagon. A small number divides the hexagon into rectangles of kTileRows rows, each as wide as the hexagon is
// there. A large number gives one rectangle around the hexagon.
std::vector<Rect> sum_tiles(const ViewPlan& plan, const FaceRuns& runs, std::span<const CameraIndex> cameras,
                            PixelFamily family, size_t max_extra_pixels);

// Rectangles begin and end at multiples of this number of rows, except at the top and bottom, because a JPEG has whole
// MCUs.
inline constexpr int kTileRows = 16;

}  // namespace lf
