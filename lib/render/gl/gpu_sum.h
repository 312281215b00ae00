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

// Describes an 8-bit picture in GPU textures. GpuSum::draw() converts a sum to such a picture.
struct GpuPicture {
  // Byte order of kRgb pixels. A fourth byte becomes 255.
  RgbLayout layout;
  // True if Cb and Cr share one plane (NV12). Only for kI420.
  bool is_interleaved = false;
  // One texture per plane, at least as large as the plane, with one channel per byte of a pixel.
  unsigned textures[3] = {};
  // Position of the view's first pixel in the textures, for pictures that contain several views. Even in kI420.
  int x = 0, y = 0;
  // A sync object (GLsync) that is signalled after all pending work on the textures. It belongs to the textures' own
  // context; null if nothing is pending. draw() waits for this object and deletes the object.
  void* fence = nullptr;
  // Luma becomes gain * luma + offset, and chroma becomes 128 + chroma_gain * chroma.
  float gain = 1, offset = 0, chroma_gain = 1;
  // The colour of pixels that have received too little weight for a usable colour of their own: less than least_weight
  // (kMissingOne = 1). The values are R, G, B, or Y, Cb, Cr with chroma from -128 to 127.
  float background[3] = {};
  int least_weight = 0;
};

// A view's sum that stays on the GPU that rendered it, so that it can be shown without a download. Thread-safe.
class GpuSum {
 public:
  // `view` is the rectangle of the whole view. The view's pixels outside the sum are 0.
  GpuSum(std::shared_ptr<GlesRenderer> renderer, std::shared_ptr<BlockSum> sum, const Rect& view, bool has_missing);
  ~GpuSum();
  GpuSum(const GpuSum&) = delete;
  GpuSum& operator=(const GpuSum&) = delete;

  PixelFamily family() const;
  const Rect& view() const { return view_; }
  const Rect& rect() const;  // pixels of the view that the sum covers; begins at even coordinates
  bool has_missing() const { return has_missing_; }
  // Returns the group of contexts with textures that draw() can write to, or 0.
  ShareGroup group() const;

  // Downloads the sum of rect(), packed. The first call downloads it, and the result is valid as long as this object.
  // If the GPU does not answer, all weight is missing.
  ConstSumPlanes fetch();
  // Returns true if fetch() failed because the GPU is lost.
  bool is_gone() const { return is_gone_; }
  // Adds several sums of the same view, family and group, on the GPU of the first sum. The result keeps its inputs
  // alive, because the GPU reads them later. On failure, returns null and sets `why` to the reason.
  static std::shared_ptr<GpuSum> add(std::span<const std::shared_ptr<GpuSum>> sums, std::string& why);
  // Starts converting the sum to a picture on the GPU; the picture is complete when wait() returns. It equals the
  // result of resolve() in composite/, or differs by at most one level where weight is missing or levels are scaled. On
  // failure, returns false and sets `why` to the reason.
  bool draw(const GpuPicture& picture, std::string& why);
  // Waits for all pictures that were started from sums of the same renderer. If they failed, returns false and sets
  // `why` to the reason.
  bool wait(std::string& why);
  bool has_same_renderer(const GpuSum& other) const { return renderer_ == other.renderer_; }

 private:
  bool work(const std::function<void(Programs& programs, Buffer& scratch)>& job, std::string& why);

  const std::shared_ptr<GlesRenderer> renderer_;  // outlives its sums
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
