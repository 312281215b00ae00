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
class GlesRenderer;

// How a sum is converted to an 8-bit picture in textures of its GPU.
struct GpuPicture {
  // kRgb: byte order of the pixels; a fourth byte becomes 255.
  RgbLayout layout;
  // kI420: Cb and Cr share one plane (NV12).
  bool is_interleaved = false;
  // One texture per plane, at least as large as the plane, with one channel per byte of a pixel.
  unsigned textures[3] = {};
  // Position of the view's first pixel in the textures, for several views in one picture; even in kI420.
  int x = 0, y = 0;
  // Sync object (GLsync) in the textures' own context, after all pending work on the textures; null: no pending work.
  // draw() waits for the object and deletes the object.
  void* fence = nullptr;
  // Luma becomes gain * luma + offset, chroma 128 + chroma_gain * chroma.
  float gain = 1, offset = 0, chroma_gain = 1;
  // Colour of pixels that have less than least_weight (kMissingOne = 1) of their weight: R, G, B, or Y, Cb, Cr with
  // chroma from -128 to 127.
  float background[3] = {};
  int least_weight = 0;
};

// A view's sum on the GPU that rendered the view. Thread-safe.
class GpuSum {
 public:
  // `view` bounds the whole view. Its pixels outside the sum are 0.
  GpuSum(std::shared_ptr<GlesRenderer> drawer, std::shared_ptr<BlockSum> sum, const Rect& view, bool has_missing);
  ~GpuSum();
  GpuSum(const GpuSum&) = delete;
  GpuSum& operator=(const GpuSum&) = delete;

  PixelFamily family() const;
  const Rect& view() const { return view_; }
  const Rect& rect() const;  // pixels of the view that the sum covers; begins at even coordinates
  bool has_missing() const { return has_missing_; }
  // Contexts with textures that draw() can write to; 0: none.
  ShareGroup group() const;

  // Returns the sum of rect() in this process's memory, packed. The first call downloads the sum, which stays valid as
  // long as this object. If the GPU does not answer, all weight is missing.
  ConstSumPlanes fetch();
  // True if fetch() failed because the GPU is lost.
  bool is_gone() const { return is_gone_; }
  // Adds several sums of the same view, family and group on the GPU of the first sum. The result keeps its inputs
  // alive, because the GPU reads them later. Returns null, with the reason in `why`, on failure.
  static std::shared_ptr<GpuSum> add(std::span<const std::shared_ptr<GpuSum>> sums, std::string& why);
  // Starts converting the sum to a picture on the GPU. The picture equals the result of resolve() in composite/, or
  // differs by at most one level where weight is missing or levels are scaled. Returns false, with the reason in `why`,
  // on failure. The picture is complete when wait() returns.
  bool draw(const GpuPicture& picture, std::string& why);
  // Waits for all pictures of sums of the same renderer. Returns false, with the reason in `why`, if they failed.
  bool wait(std::string& why);
  bool has_same_renderer(const GpuSum& other) const { return drawer_ == other.drawer_; }

 private:
  bool work(const std::function<bool(Programs& programs, Buffer& scratch)>& job, std::string& why);

  const std::shared_ptr<GlesRenderer> drawer_;  // outlives its sums
  const std::shared_ptr<BlockSum> sum_;
  const Rect view_;
  const bool has_missing_;
  std::vector<std::shared_ptr<BlockSum>> parts_;  // inputs of add()
  std::mutex mutex_;                              // held during fetch()
  std::atomic<bool> is_gone_ = false;
  UninitializedVector<int16_t> memory_;
  ConstSumPlanes fetched_;
};

}  // namespace lf::gl
