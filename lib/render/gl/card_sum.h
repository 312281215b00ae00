// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "base/maths.h"
#include "base/memory.h"
#include "image/image.h"
#include "render/gl/context.h"
#include "render/sum_planes.h"

namespace lf::gl {

struct BlockSum;
class Buffer;
class Programs;
class SumDrawer;

// How a sum becomes a picture of bytes, in textures on its card.
struct CardPicture {
  // Of kRgb: where the bytes of the one plane's pixels are; a fourth becomes 255.
  RgbLayout layout;
  // Of kI420: Cb and Cr are in one plane (NV12).
  bool is_interleaved = false;
  // The planes' textures, of at least the plane's size, with a channel for each byte of its pixels.
  unsigned textures[3] = {};
  // Where the view's first pixel is in the picture of a set of views; both are even numbers in kI420.
  int x = 0, y = 0;
  // Of the textures' own context, behind all that it has been given to do with them: a sync object (GLsync), which
  // draw() waits for and deletes; null: there is nothing.
  void* fence = nullptr;
  // Luma becomes gain * luma + offset, chroma 128 + chroma_gain * chroma.
  float gain = 1, offset = 0, chroma_gain = 1;
  // What pixels show that have less than least_weight (of kLostOne) of their weight left: R, G, B, or Y, Cb, Cr with
  // chroma from -128 to 127.
  float background[3] = {};
  int least_weight = 0;
};

// The sum of a view that has stayed on the card that drew it. Any thread.
class CardSum {
 public:
  // `view`: all of the view's pixels, of which the sum has some; the others are nothing.
  CardSum(std::shared_ptr<SumDrawer> drawer, std::shared_ptr<BlockSum> sum, const Rect& view, bool has_lost);
  ~CardSum();
  CardSum(const CardSum&) = delete;
  CardSum& operator=(const CardSum&) = delete;

  PixelFamily family() const;
  const Rect& view() const { return view_; }
  const Rect& rect() const;  // of the view: what it is the sum of; begins at even pixels
  // Whether weight may be lost somewhere.
  bool has_lost() const { return has_lost_; }
  // The contexts whose textures draw() writes to; 0: nobody's.
  ShareGroup group() const;

  // The sum of its rectangle in this process's memory, where it is from the first call on and as long as this lives,
  // without a gap between rows and planes. If the card does not answer all weight is lost.
  ConstSumPlanes fetch();
  // Whether fetch() found the card to be there no more.
  bool is_gone() const { return is_gone_; }
  // The sum of several of one view, family and group, on the card of the first one; it holds them, as they are read
  // when the card comes to it. Null with the reason in `why` if that can't be done.
  static std::shared_ptr<CardSum> add(std::span<const std::shared_ptr<CardSum>> sums, std::string& why);
  // Has the card make a picture of it, without any of that coming here: to the level what resolve() of composite/ makes
  // of it; within a level where weight was lost, or with less than full levels. False with the reason in `why` if that
  // can't be done. The picture is there once wait() has returned.
  bool draw(const CardPicture& picture, std::string& why);
  // Waits for the pictures of all sums that are beside it. False if they will never be there, with the reason in `why`.
  bool wait(std::string& why);
  // Whether another one is of the same drawer: what that does comes one after the other.
  bool is_beside(const CardSum& other) const { return drawer_ == other.drawer_; }

 private:
  bool work(const std::function<bool(Programs& programs, Buffer& scratch)>& job, std::string& why);

  const std::shared_ptr<SumDrawer> drawer_;  // outlives what it has drawn
  const std::shared_ptr<BlockSum> sum_;
  const Rect view_;
  const bool has_lost_;
  std::vector<std::shared_ptr<BlockSum>> parts_;  // that it was added up of
  std::mutex mutex_;                              // held while it is fetched
  std::atomic<bool> is_gone_ = false;
  UninitializedVector<int16_t> memory_;
  ConstSumPlanes fetched_;
};

}  // namespace lf::gl
