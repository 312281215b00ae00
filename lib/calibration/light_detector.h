// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "base/vec.h"

namespace lf {

// A light as it was found in a picture.
struct Sight {
  Vec2 pixel{0, 0};       // (0, 0) is the centre of the top-left pixel
  double sigma = 0;       // standard deviation of x and of y, pixels, predicted from the picture's noise
  double brightness = 0;  // above the background, summed over the light's image: compares lights of one camera
};

// The pictures of one camera so far.
struct LightRecord {
  size_t frames = 0;
  size_t lit = 0;         // frames that show a light
  size_t busy = 0;        // frames so much of which is brighter than the background that no light can be told
  double noise = 0;       // standard deviation of a sample, of 255
  double background = 0;  // mean of the background, of 255
  double brightest = 0;   // the brightest sample of all, of 255
};

// Finds small lights that move through a dark room, in one camera's pictures one after the other. What is there all the
// time (lamps of machines, a window) is background; what comes from a light elsewhere (reflections) is found, too: only
// the geometry of several cameras tells which is which.
//
// The background is the running median of each pixel, so that nothing must be learnt first. A light is where its image
// equals a normal distribution best (the centroid under a weight that adapts to the image's size and direction, as
// Bernstein and Jarvis 2002 do for galaxies): as exact as a fit for round, elongated and clipped images alike. Not
// thread-safe.
class LightDetector {
 public:
  LightDetector(int width, int height);

  // The lights of the next picture: 8 bits a sample, `stride` bytes from row to row. Brightest first, not more than
  // kMostSights; none in the first picture, which is the background.
  std::vector<Sight> look(const uint8_t* grey, ptrdiff_t stride);
  const LightRecord& record() const { return record_; }

  static constexpr size_t kMostSights = 8;

 private:
  struct Blob;
  std::vector<Blob> find_blobs(float threshold);
  bool refine(Blob& blob, const std::vector<Blob>& others, const uint8_t* grey, ptrdiff_t stride);
  void part_neighbours(std::vector<Blob>& blobs, const uint8_t* grey, ptrdiff_t stride);
  void mark_lit(const std::vector<Blob>& blobs);
  void watch_noise(const std::vector<Blob>& blobs);
  void learn(const uint8_t* grey, ptrdiff_t stride);
  float at(int x, int y) const { return difference_[static_cast<size_t>(y) * width_ + x]; }

  int width_, height_;
  std::vector<float> background_, difference_;
  std::vector<uint8_t> lit_;           // pixels of lights, and those around them
  double white_ = 0, correlated_ = 0;  // moments of noise: as they would be if it were white, and as they are
  uint32_t random_ = 1;
  LightRecord record_;
};

}  // namespace lf
