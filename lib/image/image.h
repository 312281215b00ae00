// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace lf {

// The two pixel families. kRgb: gamma-encoded 8-bit full-range RGB, interleaved. kI420: full-range BT.601 YCbCr, planes
// of 8 bits, chroma at half resolution (rounded up), centred: chroma sample k sits at luma coordinate 2k + 0.5.
enum class PixelFamily : uint8_t { kNone = 0, kRgb = 1, kI420 = 2 };

// Interleaved RGB layouts: bytes from pixel to pixel, and where each colour is.
struct RgbLayout {
  int pixel_stride = 3;
  int r = 0, g = 1, b = 2;
  bool operator==(const RgbLayout&) const = default;
};

class CardImage;

// Where the pixels of an image are on a graphics card, and what they are to become before they are sampled: see
// image/card_image.h.
struct CardPixels {
  const CardImage* image = nullptr;  // null: they are in this process's memory, as they are to be
  float gain = 1;                    // that they are to be divided by, see divide_by_gain(); 1: they are not
  bool sharpened = false;            // and then sharpened, see sharpen()
  auto operator<=>(const CardPixels&) const = default;
};

// A camera image in somebody else's memory. Valid as long as its owner keeps it.
struct ImageView {
  PixelFamily family = PixelFamily::kNone;
  int width = 0, height = 0;     // pixels
  RgbLayout layout;              // kRgb
  const uint8_t* plane[3] = {};  // kRgb: plane[0]; kI420: Y, Cb, Cr (offset 128)
  ptrdiff_t stride[3] = {};      // bytes from row to row
  CardPixels on_card;            // where that has an image there is no plane: who reads pixels takes what is fetched()
};

// Chroma samples along a side of `luma` pixels.
inline int chroma_size(int luma) { return (luma + 1) / 2; }

// Packed pixels owned by the image: kRgb as RGB, 3 bytes a pixel; kI420 as Y, Cb, Cr planes one after the other.
class Image {
 public:
  Image() = default;
  Image(PixelFamily family, int width, int height);  // zeroed

  PixelFamily family() const { return family_; }
  int width() const { return width_; }
  int height() const { return height_; }
  std::vector<uint8_t>& data() { return data_; }
  const std::vector<uint8_t>& data() const { return data_; }
  uint8_t* pixel(int x, int y) { return &data_[(static_cast<size_t>(y) * width_ + x) * 3]; }  // kRgb only
  const uint8_t* pixel(int x, int y) const { return &data_[(static_cast<size_t>(y) * width_ + x) * 3]; }
  uint8_t* plane(int i) { return data_.data() + plane_offset(i); }
  const uint8_t* plane(int i) const { return data_.data() + plane_offset(i); }
  ImageView view() const;

 private:
  size_t plane_offset(int i) const;
  PixelFamily family_ = PixelFamily::kNone;
  int width_ = 0, height_ = 0;
  std::vector<uint8_t> data_;
};

// Bytes of a packed picture of this family and size.
size_t packed_size(PixelFamily family, int width, int height);

// These convert by full-range BT.601 (JFIF). Chroma is the mean over 2x2 pixels on the way there, the nearest sample on
// the way back.
Image to_i420(const Image& rgb);
Image to_rgb(const Image& i420);

// Reads PNG, JPEG and whatever else OpenCV's imgcodecs reads, as 8-bit RGB. Throws Error naming the file.
Image load_image(const std::string& path);
// Writes an RGB image, as the name's ending says: .png (lossless), .jpg (quality 95). Throws Error naming the file.
void save_image(const Image& rgb, const std::string& path);

// How cameras' images are sampled.
enum class Resampling {
  kBilinear,
  kSharpened,  // bilinear, of images that were sharpened (image/correction.h)
};

}  // namespace lf
