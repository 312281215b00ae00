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

struct RgbLayout {
  int pixel_stride = 3;
  int r = 0, g = 1, b = 2;
  bool operator==(const RgbLayout&) const = default;
};

class GpuImage;

// Location of pixels on a GPU, and the processing that sampling expects.
struct GpuPixels {
  const GpuImage* image = nullptr;  // null: the pixels are in memory and already processed
  float gain = 1;                   // divisor, see divide_by_gain(); 1: none
  bool sharpened = false;           // after the division, see sharpen()
  auto operator<=>(const GpuPixels&) const = default;
};

// A camera image in memory of its owner, valid as long as the owner keeps the memory.
struct ImageView {
  PixelFamily family = PixelFamily::kNone;
  int width = 0, height = 0;     // pixels
  RgbLayout layout;              // kRgb
  const uint8_t* plane[3] = {};  // kRgb: plane[0]; kI420: Y, Cb, Cr (offset 128)
  ptrdiff_t stride[3] = {};      // bytes from row to row
  GpuPixels on_gpu;              // if set, the planes are null; fetched() returns the pixels
};

inline int chroma_size(int luma) { return (luma + 1) / 2; }

// Packed pixels owned by the image: kRgb as RGB, 3 bytes a pixel; kI420 as consecutive Y, Cb, Cr planes.
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

size_t packed_size(PixelFamily family, int width, int height);

// Full-range BT.601 (JFIF). to_i420() averages chroma over 2x2 pixels, to_rgb() takes the nearest sample.
Image to_i420(const Image& rgb);
Image to_rgb(const Image& i420);

// Reads PNG, JPEG and all other formats of OpenCV's imgcodecs, as 8-bit RGB. Throws Error naming the file.
Image load_image(const std::string& path);
// Writes an RGB image. The extension selects the format: .png (lossless), .jpg (quality 95). Throws Error naming the
// file.
void save_image(const Image& rgb, const std::string& path);

enum class Resampling {
  kBilinear,
  kSharpened,  // bilinear, on sharpened images (image/image_filters.h)
};

// An image in GPU textures, which can be sampled without a copy in memory.
class GpuImage {
 public:
  virtual ~GpuImage() = default;

  struct Texture {
    unsigned name;  // OpenGL name of a GL_TEXTURE_2D of at least the plane's size
    int channel;    // kI420: channel of the plane's samples; kRgb: unused, channels are the bytes of a pixel
  };
  // `index`: 0 for kRgb; 0 to 2 for Y, Cb, Cr.
  virtual Texture plane(int index) const = 0;
  // Call in a context that shares the textures, before the first access. Later commands of the context see complete
  // textures.
  virtual void wait() const = 0;
  // Returns the image in memory, of the same family, size and layout; kNone on failure. Valid as long as this object
  // lives. May be called from any thread, any number of times.
  virtual ImageView fetch() const = 0;
  virtual bool is_fetched() const = 0;
};

struct FetchBuffers {
  ByteBuffer divided, sharpened;
};

// Returns the image in memory, with the processing of its GpuPixels applied to `part` (inside the image; x0, y0 even
// for kI420). An image in memory is returned as is; kNone on failure. Valid as long as `memory` and the GpuImage are
// unchanged.
ImageView fetched(const ImageView& image, const Rect& part, FetchBuffers& memory);

// Encoding of 8-bit YCbCr video (ITU-R BT.601-7, BT.709-6, BT.2020-2): Y = kr R + (1 - kr - kb) G + kb B.
struct YcbcrFormat {
  double kr = 0.299, kb = 0.114;
  bool full_range = true;      // 0 to 255; false: luma 16 to 235, chroma 16 to 240
  double right = 0, down = 0;  // pixels from the middle of 2 x 2 pixels to the chroma sample: 0 or -0.5
};

// Converts planar 4:2:0 video of another encoding to PixelFamily::kI420. Values are within 1 of exact arithmetic, and
// the mean error of a uniform image is at most half a level. If the matrix differs, one chroma value serves all of its
// 2 x 2 pixels. Chroma is interpolated linearly. Immutable.
class YcbcrConversion {
 public:
  explicit YcbcrConversion(const YcbcrFormat& from);

  // `in`: three planes in the source encoding. `out`: the same size, rows `stride` bytes apart, must not overlap `in`.
  void convert(const ImageView& in, uint8_t* const out[3], const ptrdiff_t stride[3]) const;

 private:
  void sited_row(const ImageView& in, int plane, int y, int32_t* out) const;

  const YcbcrFormat from_;
  std::array<int32_t, 256> luma_;  // output levels in 1/2^16
  int32_t luma_of_[2];             // output luma for Cb and Cr of 1/16 level, in 1/2^16
  int32_t chroma_of_[2][2];        // output Cb and Cr for Cb and Cr of 1/16 level, in 1/2^16
};

// Returns the colour (R, G, B) of a value: black at 0, then violet, red, orange, and pale yellow at 1, with increasing
// brightness, so that the scale works in grey and for colour-blind users. This is "inferno" of matplotlib (S. van der
// Walt and N. Smith 2015). Values are clamped to 0..1.
std::array<uint8_t, 3> heat_colour(double share);

inline constexpr uint8_t kNoValueGrey = 96;

// Opacity of the luma of the underlay where a heat map is black.
inline constexpr float kUnderlayOpacity = 0.4f;

// Draws width * height values, row-major: 0 is black, `full` the end of the scale, NaN is kNoValueGrey. The luma of
// `underlay` (RGB, same size) shines through where values are small. Throws Error if a size differs.
Image heat_map(std::span<const float> values, int width, int height, double full, const Image* underlay = nullptr);

}  // namespace lf
