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

// Combines the fragments of a picture. A fragment carries colours that the cameras' weights have already been applied
// to. The accumulator adds all fragments and divides by the weight that has arrived, 1 - (sum of missing weight).
//
// Sums have the format of SumPlanes and saturate. The weights of valid fragments add up to 1, so they never saturate.
// With invalid input, luma and RGB still do not depend on the order of the fragments. Not thread-safe.
class Accumulator {
 public:
  // Starts a new picture and keeps the memory.
  void reset(PixelFamily family, int width, int height);

  PixelFamily family() const { return family_; }
  int width() const { return width_; }
  int height() const { return height_; }

  bool fits(PixelFamily family, const Rect& rect) const;
  // Adds a fragment. Returns false and adds nothing unless fits(): the family must match, and the rectangle must lie
  // inside the picture and, in kI420, start at an even pixel. The planes of a Fragment must also fill its rectangle.
  bool add(const FragmentPlanes& fragment);
  bool add(const Fragment& fragment);
  bool add(const ConstSumPlanes& sums);
  // Adds sums without a copy if they cover the whole picture and nothing else is added. The sums must stay valid until
  // reset().
  bool add_borrowed(const ConstSumPlanes& sums);
  // Adds a sum in GPU memory. It is only downloaded if CPU data is added or the result is read on the CPU.
  bool add_borrowed(std::shared_ptr<gl::GpuSum> sum);
  // Counts the weights of a camera that did not answer as missing. `weights` come from pixel_weights() over `rect`.
  bool add_missing_weights(const Rect& rect, const std::vector<float>& weights);
  // Makes pixels outside the camera mesh show the background. Without this call they are black.
  void set_uncovered(const FaceIdMap& whole_view);

  void resolve(const Background& background, const RgbLayout& layout, uint8_t* const plane[3],
               const ptrdiff_t stride[3], const Levels& levels = kFullLevels) const;
  Image resolve(const Background& background = {}) const;
  // Returns the share group for resolve_on_gpu(), or 0 unless all sums are on the GPU of one group.
  gl::ShareGroup share_group() const;
  // True if a GPU sum was lost before it could be downloaded. All its weight then counts as missing.
  bool is_gone() const;
  // Returns the sum that determines the renderer of the picture. Only valid if share_group() != 0.
  const gl::GpuSum& first_gpu_sum() const { return *gpu_sums_.front(); }
  // Like resolve(), but on the GPU of share_group(). `to` has the target textures. The picture is ready after
  // GpuSum::wait() on the result. On failure, returns null and sets `why`.
  std::shared_ptr<gl::GpuSum> resolve_on_gpu(const Background& background, const Levels& levels, gl::GpuPicture to,
                                             std::string& why) const;
  // Returns how much of each pixel's weight has arrived, 0 to 1, accurate to 1e-4. Pixels outside the mesh have 0.
  std::vector<float> coverage() const;
  // Shows the previous picture where most of the weight is missing; see conceal() in resolve.h. Call after resolve().
  void conceal(const ImageView& before, uint8_t* const plane[3], const ptrdiff_t stride[3]) const;

  // Returns the sum over the bounding rectangle of everything that was added, or nothing. Valid until the next
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
  std::vector<std::shared_ptr<gl::GpuSum>> gpu_sums_;  // sums in GPU memory; used instead of borrowed_
  mutable std::unique_ptr<Accumulator> fetched_;       // gpu_sums_, downloaded and added up when needed
  // True if sum_ or missing_ are in use; both are cleared on first use.
  bool own_set_ = false, own_missing_set_ = false;
  UninitializedVector<int16_t> sum_;
  UninitializedVector<uint16_t> missing_;
  std::vector<int16_t> zeros_;
  std::vector<uint8_t> uncovered_;  // per pixel, 1 outside the mesh; empty: unknown
};

}  // namespace lf
