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

// The two kinds of pixels. kRgb is gamma-encoded 8-bit full-range RGB, interleaved. kI420 is full-range BT.601 YCbCr in
// planes of 8 bits, with chroma at half resolution (rounded up). Chroma is centred: sample k is at luma coordinate 2k +
// 0.5.
enum class PixelFamily : uint8_t { kNone = 0, kRgb = 1, kI420 = 2 };

// The byte order of RGB pixels, for example {4, 2, 1, 0} for BGRx: bytes per pixel, and the byte of each channel.
struct RgbLayout {
  int pixel_stride = 3;
  int r = 0, g = 1, b = 2;
  bool operator==(const RgbLayout&) const = default;
};

class GpuImage;

// The pixels of an image on a GPU, and the processing that they need before sampling.
struct GpuPixels {
  const GpuImage* image = nullptr;  // null if the pixels are in memory and already processed
  float gain = 1;                   // exposure gain to divide by, see divide_by_gain(); 1: none
  bool sharpened = false;           // after the division, see sharpen()
  auto operator<=>(const GpuPixels&) const = default;
};

// A camera image in memory that belongs to someone else. It is valid as long as the owner keeps the memory.
struct ImageView {
  PixelFamily family = PixelFamily::kNone;
  int width = 0, height = 0;
  RgbLayout layout;              // for kRgb
  const uint8_t* plane[3] = {};  // kRgb: plane[0]; kI420: Y, Cb, Cr (offset 128)
  ptrdiff_t stride[3] = {};      // bytes from row to row
  GpuPixels on_gpu;              // if set, the planes are null, and fetched() returns the pixels
};

inline int chroma_size(int luma) { return (luma + 1) / 2; }

// An image that owns its pixels, without padding: RGB with 3 bytes a pixel, or consecutive Y, Cb and Cr planes.
class Image {
 public:
  Image() = default;
  Image(PixelFamily family, int width, int height);  // zeroed

  PixelFamily family() const { return family_; }
  int width() const { return width_; }
  int height() const { return height_; }
  std::vector<uint8_t>& data() { return data_; }
  const std::vector<uint8_t>& data() const { return data_; }
  uint8_t* pixel(int x, int y) { return &data_[(static_cast<size_t>(y) * width_ + x) * 3]; }  // only for kRgb
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

// Returns the number of samples of an image without padding: RGB, or Y, Cb and Cr planes.
size_t packed_size(PixelFamily family, int width, int height);

// Convert in full-range BT.601 (JFIF). to_i420() averages chroma over 2x2 pixels, and to_rgb() takes the nearest
// sample.
Image to_i420(const Image& rgb);
Image to_rgb(const Image& i420);

// Reads PNG, JPEG and the other formats of load_image_size() as 8-bit RGB. Throws Error with the file's name.
Image load_image(const std::string& path);
// Writes an RGB image. The extension selects the format: .png (lossless) or .jpg (quality 95). Throws Error with the
// file's name.
void save_image(const Image& rgb, const std::string& path);

enum class Resampling {
  kBilinear,
  kSharpened,  // bilinear, on sharpened images (image/image_filters.h)
};

// A camera image in OpenGL textures, for example from a hardware decoder. The owner of the textures implements this
// interface. A renderer on the same GPU uses the textures directly, and the CPU downloads them with fetch().
class GpuImage {
 public:
  virtual ~GpuImage() = default;

  struct Texture {
    unsigned name;  // OpenGL name of a GL_TEXTURE_2D of at least the plane's size
    // channel of a kI420 plane's samples; unused for kRgb, because its channels are the bytes of a pixel
    int channel;
  };
  // `index` is 0 for kRgb, and 0 to 2 for Y, Cb, Cr.
  virtual Texture plane(int index) const = 0;
  // Call this in a context that shares the textures, before the first access. Later commands of the context then see
  // complete textures.
  virtual void wait() const = 0;
  // Returns the image in memory, of the same family, size and layout, or kNone on failure. It is valid as long as this
  // object. Any thread may call this, any number of times.
  virtual ImageView fetch() const = 0;
  virtual bool is_fetched() const = 0;
};

// Memory for the result of fetched(), which callers can reuse for the next image.
struct FetchBuffers {
  ByteBuffer divided, sharpened;
};

// Returns the image in memory, after the processing of its GpuPixels in `part`. `part` must be inside the image, with
// even x0 and y0 for kI420. An image that is already in memory is returned as it is. Returns kNone on failure. The
// result is valid until `memory` or the GpuImage changes.
ImageView fetched(const ImageView& image, const Rect& part, FetchBuffers& memory);

// The encoding of 8-bit YCbCr video (ITU-R BT.601-7, BT.709-6, BT.2020-2): Y = kr R + (1 - kr - kb) G + kb B.
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

  // `in` contains three planes in the source encoding. `out` has the same size, with rows `stride` bytes apart, and
  // must not overlap `in`.
  void convert(const ImageView& in, uint8_t* const out[3], const ptrdiff_t stride[3]) const;

 private:
  void sited_row(const ImageView& in, int plane, int y, int32_t* out) const;

  const YcbcrFormat from_;
  std::array<int32_t, 256> luma_;  // output levels in 1/2^16
  int32_t luma_of_[2];             // output luma for Cb and Cr of 1/16 level, in 1/2^16
  int32_t chroma_of_[2][2];        // output Cb and Cr for Cb and Cr of 1/16 level, in 1/2^16
};

// Returns a colour (R, G, B) for a value: black at 0, then violet, red, orange, and pale yellow at 1. Brightness
// increases, so that the scale works in grey and for colour-blind users. This is "inferno" of matplotlib (S. van der
// Walt and N. Smith 2015). Values are clamped to 0..1.
std::array<uint8_t, 3> heat_colour(double share);

// Grey level of heat maps for NaN.
inline constexpr uint8_t kNoValueGrey = 96;

// Opacity of the underlay's luma where a heat map is black.
inline constexpr float kUnderlayOpacity = 0.4f;

// Draws a heat map of width * height values, row by row. 0 is black, `full` is the end of the scale, and NaN is
// kNoValueGrey. The luma of `underlay` (an RGB image of the same size) shines through where values are small. Throws
// Error if a size differs.
Image heat_map(std::span<const float> values, int width, int height, double full, const Image* underlay = nullptr);

}  // namespace lf
