// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "image/image.h"
#include "jpeg/jpeg_frame.h"

namespace lf::test {

// How a camera's JPEG may be made.
struct JpegKind {
  bool grey = false;
  int h = 2, v = 2;  // sampling factors of luma, and
  int chroma_h = 1, chroma_v = 1;
  int quality = 88;
  int restart_interval = 0;  // MCUs
  bool optimise = false;     // Huffman tables of its own
  bool progressive = false;
  bool arithmetic = false;
  bool rgb = false;         // no YCbCr inside
  bool one_by_one = false;  // a scan for each component
};

// An image of smooth parts, edges and noise, the same for the same seed.
Image noisy_picture(int width, int height, unsigned seed);

std::vector<uint8_t> encode_jpeg(const Image& rgb, const JpegKind& kind);
// Without its DHT segments, as in AVI files.
std::vector<uint8_t> without_huffman_tables(const std::vector<uint8_t>& jpeg);

// What libjpeg makes of a baseline frame, as planes of any resolution.
struct RawPlanes {
  struct Plane {
    int width = 0, height = 0;  // samples of the image
    int stride = 0;
    std::vector<uint8_t> samples;
  };
  std::vector<Plane> planes;
};
// Throws std::runtime_error with libjpeg's message.
RawPlanes decode_raw(std::span<const uint8_t> jpeg);
// By the rule of JpegFrame, written as plainly as possible.
Image to_i420(const RawPlanes& raw);

// A frame that owns a copy of the bytes.
std::shared_ptr<JpegFrame> open_jpeg(const std::vector<uint8_t>& jpeg, std::string* reason = nullptr);

}  // namespace lf::test
