// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/memory.h"
#include "composite/resolve.h"
#include "image/image.h"
#include "render/gl/gpu_sum.h"
#include "render/ownership.h"
#include "render/sum_planes.h"

namespace lf {

// Adds up the fragments of a picture and divides by 1 - (sum of missing weight). Sums are as in SumPlanes and saturate.
// Valid weights sum to 1 and never reach saturation; with invalid input, luma and RGB still do not depend on the order
// of the fragments. Not thread-safe.
class Accumulator {
 public:
  // Keeps the memory.
  void reset(PixelFamily family, int width, int height);

  PixelFamily family() const { return family_; }
  int width() const { return width_; }
  int height() const { return height_; }

  bool fits(PixelFamily family, const Rect& rect) const;
  // Returns false and adds nothing unless fits(): the family matches, and the rectangle is inside the picture and, in
  // kI420, starts at an even pixel. The planes of a Fragment must also fill its rectangle.
  bool add(const FragmentPlanes& fragment);
  bool add(const Fragment& fragment);
  bool add(const ConstSumPlanes& sums);
  // Adds sums that stay valid until reset(). If they cover the whole picture and stay alone, they are not copied.
  bool add_borrowed(const ConstSumPlanes& sums);
  // Adds a sum in GPU memory. It is downloaded when CPU data is added or the result is read on the CPU.
  bool add_borrowed(std::shared_ptr<gl::GpuSum> sum);
  // Counts the weights of a camera that did not answer as missing. `weights`: from pixel_weights() over `rect`.
  bool add_missing_weights(const Rect& rect, const std::vector<float>& weights);
  // Makes pixels without a mesh face show the background; without this call they stay black.
  void set_uncovered(const FaceIdMap& whole_view);

  // See resolve() in resolve.h.
  void resolve(const Background& background, const RgbLayout& layout, uint8_t* const plane[3],
               const ptrdiff_t stride[3], const Levels& levels = kFullLevels) const;
  Image resolve(const Background& background = {}) const;
  // Returns the share group for resolve_on_gpu(); 0 unless all sums are on the GPU of the group.
  gl::ShareGroup share_group() const;
  // True if a GPU sum was lost before it could be downloaded; all its weight then counts as missing.
  bool is_gone() const;
  // Returns the sum that determines the renderer of the picture. Requires share_group() != 0.
  const gl::GpuSum& first_gpu_sum() const { return *gpu_sums_.front(); }
  // Like resolve() above, but on the GPU of share_group(). The picture is ready after GpuSum::wait() on the result.
  // `to`: the target textures. Returns null and sets `why` on failure.
  std::shared_ptr<gl::GpuSum> resolve_on_gpu(const Background& background, const Levels& levels, gl::GpuPicture to,
                                             std::string& why) const;
  // Returns the share of each pixel's weight that is not missing, 0 to 1, accurate to 1e-4; 0 for uncovered pixels.
  std::vector<float> coverage() const;
  // Call after resolve(). Shows the previous picture where most weight is missing, see conceal() in resolve.h.
  void conceal(const ImageView& before, uint8_t* const plane[3], const ptrdiff_t stride[3]) const;

  // Returns the sum over the bounding rectangle of all additions; nothing if nothing was added. Valid until the next
  // non-const call.
  std::optional<ConstSumPlanes> sums() const;

 private:
  Rect all() const { return {0, 0, width_, height_}; }
  std::optional<ConstSumPlanes> kept() const;
  ConstSumPlanes fetched() const;
  SumPlanes own();               // requires materialize()
  ConstSumPlanes whole() const;  // own, borrowed or zero
  void materialize();
  void materialize_missing();

  PixelFamily family_ = PixelFamily::kNone;
  int width_ = 0, height_ = 0;
  Rect touched_;
  std::optional<ConstSumPlanes> borrowed_;             // the only sums so far, in the caller's memory
  std::vector<std::shared_ptr<gl::GpuSum>> gpu_sums_;  // alternative to borrowed_: sums in GPU memory
  mutable std::unique_ptr<Accumulator> fetched_;       // gpu_sums_ added up on the CPU, on demand
  // True if sum_, missing_ are in use; they are cleared on first use.
  bool own_set_ = false, own_missing_set_ = false;
  UninitializedVector<int16_t> sum_;
  UninitializedVector<uint16_t> missing_;
  std::vector<int16_t> zeros_;
  std::vector<uint8_t> uncovered_;  // per pixel, not 0: no mesh face; empty: unknown
};

}  // namespace lf
