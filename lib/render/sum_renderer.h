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

// One camera and its current image.
struct Source {
  CameraIndex camera = 0;              // index in the rig of the plan
  const Camera* rig_camera = nullptr;  // the camera in the rig
  // Must have the camera's size. Family kNone: no image, the camera's weight is missing. The image may be in textures
  // of the GPU that renders the sum; the CPU downloads the image when needed.
  ImageView image;
};

// Throws Error unless the image has the camera's size.
void check_image(const Camera& camera, const ImageView& image);

// How positions in camera images are computed.
enum class Coordinates {
  kExact,  // projected for every pixel, in float
  kGrid,   // projected every 16 pixels of a row, or at a focal map's nodes; interpolated where accurate to kGridError
};
inline constexpr double kGridError = 1.0 / 512;  // pixels of the camera image

// The GPU's part in a sum.
struct GpuStatus {
  bool drawn = false;    // by the GPU
  bool refused = false;  // the GPU failed to render the sum
  std::string why_not;   // reason if not drawn by the GPU
};

// Adds up the contributions of any number of cameras to one view. Products of weight and colour are accumulated in
// registers, in 16 bits with 7 fractional bits, so that rounding to 8 bits happens once, at the end. Uses portable SIMD
// (Highway): SSE2, SSE4, AVX2, AVX-512 or NEON, as the processor supports.
//
// Error bound against the rule in double precision, where coverage is above 0.999: 1 of 255 after rounding; see
// docs/reference/error-budget.md.
class SumRenderer {
 public:
  // All arguments must outlive this object. Sources must have one family, images of their cameras' sizes (else throws
  // Error), and no duplicate cameras. `gpu`: calls draw() for this sum alone, if not null. `keep_on_gpu`: the sum may
  // stay on the GPU, see gpu_sum(); a shared_ptr must own the GPU's renderer.
  SumRenderer(const ViewPlan& plan, const FaceRuns& runs, std::span<const Source> sources, PixelFamily family,
              Coordinates coordinates = Coordinates::kGrid, gl::GlesRenderer* gpu = nullptr,
              const ParallelFor& parallel = serial_for, bool keep_on_gpu = false);
  ~SumRenderer();
  SumRenderer(const SumRenderer&) = delete;
  SumRenderer& operator=(const SumRenderer&) = delete;

  // Renders the sums of several renderers on a GPU, as far as possible, in shared passes (see GlesRenderer::draw()).
  // The renderers must have been made without a GPU. `parallel` copies the images. The CPU renders the remaining sums
  // in render_rows().
  static void draw(std::span<SumRenderer* const> renderers, gl::GlesRenderer& gpu, const ParallelFor& parallel);

  // Downloads images from the GPU if the CPU renders the sum. Otherwise render_rows() downloads them in one
  // thread.
  void fetch(const ParallelFor& parallel);

  // Bounds of the sources' contributions according to the plan; whole chroma samples in kI420; may be empty.
  const Rect& rect() const { return rect_; }
  // Upper bound of the number of samples: pixels times cameras.
  size_t samples() const;
  const GpuStatus& drawing() const;
  // Returns the sum of rect(), extended to whole 2x2 blocks, if it has stayed on the GPU; then do not call
  // render_rows().
  std::shared_ptr<gl::GpuSum> gpu_sum() const;
  // Writes rows [y0, y1) of the sum into `out`; y0 is even, and y1 is even or the end of out.rect. Pixels without a
  // contribution become 0. out.rect must be inside the runs' region. Fills out.lost unless null. Returns true if any
  // weight is missing. Thread-safe for different rows.
  bool render_rows(int y0, int y1, const SumPlanes& out) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
  Rect rect_;
};

// Returns the name of the instruction set that SumRenderer uses on this machine, such as "AVX2".
const char* simd_target_name();

// Returns disjoint rectangles of the view that contain every pixel with a weight of one of `cameras` (ascending),
// sorted by their upper edges. They are chroma-aligned in kI420. `runs` must cover the cameras' chroma-aligned
// rectangles.
//
// A rectangle is merged with its neighbour if this adds at most `spare_pixels` pixels without weight: the number that
// is cheaper to send than another rectangle. A camera's part of a view is about a hexagon. Few spare pixels give
// rectangles of kTileRows rows, as wide as the hexagon is there; many give the bounds of the hexagon.
std::vector<Rect> sum_tiles(const ViewPlan& plan, const FaceRuns& runs, std::span<const CameraIndex> cameras,
                            PixelFamily family, size_t spare_pixels);

// Rectangles begin and end at multiples of this number of rows, except at the top and bottom: whole MCUs of a JPEG.
inline constexpr int kTileRows = 16;

}  // namespace lf
