// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/maths.h"
#include "base/memory.h"

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

// Where the pixels of an image are on a graphics card, and what they are to become before they are sampled.
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

// An image in textures of a graphics card, which sums are sampled from without its coming here first.
class CardImage {
 public:
  virtual ~CardImage() = default;

  struct Texture {
    unsigned name;  // OpenGL's, of a GL_TEXTURE_2D of at least the plane's size
    int channel;    // kI420: the one that has the plane's samples. kRgb: all have, one for each byte of a pixel
  };
  // Of plane 0 (kRgb), or of Y, Cb, Cr.
  virtual Texture plane(int index) const = 0;
  // To be called in a context that shares the textures, before they are read: what the context is given from then on
  // finds in them what is to be there.
  virtual void wait() const = 0;
  // The image in this process's memory, of the same family, size and layout, valid as long as this lives; kNone where
  // it can't be had. Any thread, as often as anybody wants.
  virtual ImageView fetch() const = 0;
  // Whether anybody has asked for that.
  virtual bool is_fetched() const = 0;
};

// What fetched() makes of an image.
struct FetchedMemory {
  ByteBuffer divided, sharpened;
};

// The image in this process's memory, with what its CardPixels say made of `part` of it (inside the image; x0, y0 even
// in kI420): itself if it is here; kNone where it can't be had. Valid as long as `memory` and the CardImage are left
// alone.
ImageView fetched(const ImageView& image, const Rect& part, FetchedMemory& memory);

// How 8-bit YCbCr video stands for colours (ITU-R BT.601-7, BT.709-6, BT.2020-2): Y = kr R + (1 - kr - kb) G + kb B.
struct YcbcrKind {
  double kr = 0.299, kb = 0.114;
  bool full_range = true;      // 0 to 255; else luma from 16 to 235, chroma from 16 to 240
  double right = 0, down = 0;  // pixels that chroma samples are from the middle of their 2 x 2 pixels: 0 or -0.5
};

// Makes PixelFamily::kI420 of planar video with chroma at half the resolution of another kind. Each value is that of
// exact arithmetic to 1 of 255, the mean error of a flat picture at most half of that: where the matrix is another one
// chroma stands for all of its 2 x 2 pixels, and between samples it is linear. Immutable.
class YcbcrConversion {
 public:
  explicit YcbcrConversion(const YcbcrKind& from);

  // `in`: three planes of the kind, `out` of the same size, its rows `stride` bytes apart, and not the same memory.
  void convert(const ImageView& in, uint8_t* const out[3], const ptrdiff_t stride[3]) const;

 private:
  void sited_row(const ImageView& in, int plane, int y, int32_t* out) const;

  const YcbcrKind from_;
  std::array<int32_t, 256> luma_;  // 2^16ths of output levels
  int32_t luma_of_[2];             // for each sixteenth of a level of chroma away from the middle, 2^16ths: of Cb, Cr
  int32_t chroma_of_[2][2];        // the same of output Cb and Cr
};

// The colour of a share of a scale, R, G, B: from black at 0 over violet, red and orange to pale yellow at 1, always
// brighter (the scale "inferno" of matplotlib, S. van der Walt and N. Smith 2015), so that it means the same in grey
// and to the colour-blind. Shares beyond 0..1 count as 0 and 1.
std::array<uint8_t, 3> heat_colour(double share);

// What has no value in a heat map: a grey that is no colour of the scale.
inline constexpr uint8_t kNoHeat = 96;

// How much of the luma of a picture under it the black of a heat map lets through.
inline constexpr float kHeatUnderlay = 0.4f;

// Values as colours: width * height of them, row-major; 0 is black and `full` the end of the scale; NaN is kNoHeat.
// `underlay` (RGB, of that size) shows dimly through by its luma where values are small. Throws Error for another size.
Image heat_map(std::span<const float> values, int width, int height, double full, const Image* underlay = nullptr);

}  // namespace lf
