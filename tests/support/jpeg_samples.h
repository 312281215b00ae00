// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "image/image.h"
#include "jpeg/jpeg_frame.h"

namespace lf::test {

struct JpegKind {
  bool grey = false;
  int h = 2, v = 2;  // sampling factors of luma
  int chroma_h = 1, chroma_v = 1;
  int quality = 88;
  int restart_interval = 0;
  bool optimise = false;
  bool progressive = false;
  bool arithmetic = false;
  bool rgb = false;
  bool one_by_one = false;
};

// Returns an image with smooth areas, edges and noise, determined by the seed.
Image noisy_picture(int width, int height, unsigned seed);

std::vector<uint8_t> encode_jpeg(const Image& rgb, const JpegKind& kind);
// Removes the DHT segments, as in AVI files.
std::vector<uint8_t> without_huffman_tables(const std::vector<uint8_t>& jpeg);

// A baseline frame as decoded by libjpeg, with planes of any resolution.
struct RawPlanes {
  struct Plane {
    int width = 0, height = 0;
    int stride = 0;
    std::vector<uint8_t> samples;
  };
  std::vector<Plane> planes;
};
// Throws std::runtime_error with libjpeg's message.
RawPlanes decode_raw(std::span<const uint8_t> jpeg);
Image to_i420(const RawPlanes& raw);

// Without `reason`, throws std::runtime_error if the frame cannot be opened.
std::shared_ptr<JpegFrame> open_jpeg(const std::vector<uint8_t>& jpeg, std::string* reason = nullptr);

}  // namespace lf::test
