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

// Combines the answers of all nodes into one picture. A node sends fragments: rectangles of the view, with colours that
// are already multiplied by the blending weights of the cameras. The accumulator adds all fragments. It then divides
// each pixel by the weight that has arrived. This weight is 1 if all cameras have contributed, and less if a camera is
// missing, so the division keeps the brightness of the picture.
//
// The sums have the 16-bit format of SumPlanes. Additions saturate, so that forged fragments cannot cause an overflow.
// The weights of valid fragments add up to at most 1, so valid sums never saturate. Not thread-safe.
class Accumulator {
 public:
  // Starts a new picture and keeps the memory.
  void reset(PixelFamily family, int width, int height);

  PixelFamily family() const { return family_; }
  int width() const { return width_; }
  int height() const { return height_; }

  // Returns true if a fragment with this family and rectangle can be added.
  bool fits(PixelFamily family, const Rect& rect) const;
  // Adds a fragment to the sums. Returns false and adds nothing if the fragment does not fit: it must have the
  // picture's pixel family and lie inside the picture. In kI420 it must start at an even pixel. The planes of a
  // Fragment must also have the size of its rectangle.
  bool add(const FragmentPlanes& fragment);
  bool add(const Fragment& fragment);
  bool add(const ConstSumPlanes& sums);
  // Uses the caller's sums directly, to save a copy of the whole picture. This works if the sums cover the whole
  // picture and nothing else is added. The sums must stay valid until reset().
  bool add_borrowed(const ConstSumPlanes& sums);
  // Adds the sum of one node that is in GPU memory. The sum stays there if all sums of the picture are on the same GPU
  // and the picture is made there, too. Otherwise it is downloaded.
  bool add_borrowed(std::shared_ptr<gl::GpuSum> sum);
  // Records that a camera did not answer: adds its blending weights to the missing weight of the pixels in `rect`.
  // resolve() then scales up the contributions of the remaining cameras. `weights` has one value for each pixel of
  // `rect`, as pixel_weights() returns.
  bool add_missing_weights(const Rect& rect, const std::vector<float>& weights);
  // Marks the pixels outside the camera mesh (the triangles between neighbouring cameras), so that resolve() fills them
  // with the background colour. Without this call, these pixels are black.
  void set_uncovered(const FaceIdMap& whole_view);

  // Makes the picture: divides the sums by their weights, and writes 8-bit pixels. The first function writes to `plane`
  // (see resolve() in resolve.h); the second returns a new image.
  void resolve(const Background& background, const RgbLayout& layout, uint8_t* const plane[3],
               const ptrdiff_t stride[3], const Levels& levels = kFullLevels) const;
  Image resolve(const Background& background = {}) const;
  // Returns the group of OpenGL contexts that can run resolve_on_gpu(). Returns 0 if the picture cannot be made on a
  // GPU, because some sums are in CPU memory or in another group.
  gl::ShareGroup share_group() const;
  // Returns true if a sum in GPU memory was lost before it could be downloaded, for example because the driver was
  // reset. All weight of that sum then counts as missing.
  bool is_gone() const;
  // Returns the sum on the GPU that will render the picture. The result is only valid if share_group() is not 0.
  const gl::GpuSum& first_gpu_sum() const { return *gpu_sums_.front(); }
  // Does the same as resolve(), but on a GPU, and writes into the textures of `to`. Requires share_group() != 0. The
  // GPU continues after this call: the picture is complete when GpuSum::wait() of the returned object returns. On
  // failure, returns null and sets `why` to the reason.
  std::shared_ptr<gl::GpuSum> resolve_on_gpu(const Background& background, const Levels& levels, gl::GpuPicture to,
                                             std::string& why) const;
  // Returns the share of each pixel's weight that has arrived, from 0 to 1 with an accuracy of 1e-4. The share is 0
  // outside the camera mesh.
  std::vector<float> coverage() const;
  // Shows the previous picture `before` in pixels that lack most of their weight, because the previous picture is
  // closer to the truth there. Call this after resolve(). See conceal() in resolve.h.
  void conceal(const ImageView& before, uint8_t* const plane[3], const ptrdiff_t stride[3]) const;

  // Returns the unscaled sum, for example to send it to another compositor. The sum covers the bounding rectangle of
  // everything that was added. Returns nothing if no fragment was added. The result is valid until the next non-const
  // call.
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
