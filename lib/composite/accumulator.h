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
#include "render/gl/card_sum.h"
#include "render/ownership.h"
#include "render/sum_planes.h"

namespace lf {

// The compositor's arithmetic: image = sum of fragments, divided by 1 - (sum of lost weight) where weight was lost.
// Sums as in SumPlanes, saturating: fragments of a picture, whose weights sum to 1, never get there; if foreign ones
// do, luma and RGB still do not depend on the order of adding. Not thread-safe.
class Accumulator {
 public:
  // Forgets everything. Keeps its memory.
  void reset(PixelFamily family, int width, int height);

  PixelFamily family() const { return family_; }
  int width() const { return width_; }
  int height() const { return height_; }

  bool fits(PixelFamily family, const Rect& rect) const;
  // False, and nothing is added, where fits() says no: if the family differs or the rectangle is not inside the picture
  // or begins at an odd pixel in kI420; for a Fragment also if its planes don't fill the rectangle.
  bool add(const FragmentPlanes& fragment);
  bool add(const Fragment& fragment);
  bool add(const ConstSumPlanes& sums);
  // Adds sums whose memory stays as it is until reset(): the only ones of a whole picture need not be copied.
  bool add_kept(const ConstSumPlanes& sums);
  // Adds what is on a card. It comes to this process's memory when something else is added to it, or somebody looks at
  // it.
  bool add_kept(std::shared_ptr<gl::CardSum> sum);
  // The weights of a camera whose answer never came count as lost: `weights` as from pixel_weights() over `rect`.
  bool add_lost_weights(const Rect& rect, const std::vector<float>& weights);
  // Pixels that no face of the mesh owns show the background too (without it they stay as they are: black).
  void set_uncovered(const OwnerMap& whole_view);

  // The finished picture, see resolve().
  void resolve(const Background& background, const RgbLayout& layout, uint8_t* const plane[3],
               const ptrdiff_t stride[3], const Levels& levels = kFullLevels) const;
  Image resolve(const Background& background = {}) const;
  // The contexts in whose textures resolve_on_card() may be called, as all that was added is on their card; 0: it is
  // not.
  gl::ShareGroup share_group() const;
  // Whether what was added was on a card that was there no more when somebody looked at it: all weight is lost.
  bool is_gone() const;
  // The one of what was added whose drawer makes the picture then. share_group() is not 0.
  const gl::CardSum& first_on_card() const { return *card_sums_.front(); }
  // The same as resolve() in such textures, once CardSum::wait() of what it returns has returned; `to` says which. Null
  // with the reason in `why` if that can't be done.
  std::shared_ptr<gl::CardSum> resolve_on_card(const Background& background, const Levels& levels, gl::CardPicture to,
                                               std::string& why) const;
  // Per pixel, 0..1: how much of its weight was not lost, to 1e-4; 0 where no face owns it, as set_uncovered() says.
  std::vector<float> coverage() const;
  // Call after resolve(): the picture before shows where most of the weight was lost, see conceal().
  void conceal(const ImageView& before, uint8_t* const plane[3], const ptrdiff_t stride[3]) const;

  // The sum of what was added so far, over the bounding rectangle of it all; nothing if nothing was added. Valid until
  // the next call that is not const.
  std::optional<ConstSumPlanes> sums() const;

 private:
  Rect all() const { return {0, 0, width_, height_}; }
  std::optional<ConstSumPlanes> kept() const;
  ConstSumPlanes fetched() const;
  SumPlanes own();               // the sum of the whole picture in own memory, after materialize()
  ConstSumPlanes whole() const;  // the sum of the whole picture, in own or kept memory, or zeros
  void materialize();            // copies what was added into own memory
  void materialize_lost();

  PixelFamily family_ = PixelFamily::kNone;
  int width_ = 0, height_ = 0;
  Rect touched_;                                         // bounds all rectangles that were added
  std::optional<ConstSumPlanes> kept_;                   // the only sums so far, in the caller's memory
  std::vector<std::shared_ptr<gl::CardSum>> card_sums_;  // or on a card
  mutable std::unique_ptr<Accumulator> looked_at_;       // what these come to, once somebody has looked at it
  bool own_set_ = false, own_lost_set_ = false;          // whether sum_, lost_ hold anything yet; they are cleared late
  UninitializedVector<int16_t> sum_;                     // three planes, of the whole picture
  UninitializedVector<uint16_t> lost_;
  std::vector<int16_t> zeros_;      // a row of zeros
  std::vector<uint8_t> uncovered_;  // per pixel, not 0: no face owns it; empty: not known
};

}  // namespace lf
