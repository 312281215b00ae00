// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <bit>
#include <cctype>
#include <csetjmp>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <png.h>
#include <zlib.h>

#include "base/file.h"
#include "base/text.h"
#include "image/image_file.h"
#include "jpeg/codec_errors.h"

namespace lf {
namespace {

void check_pixels(const Image& rgb) {
  if (rgb.family() != PixelFamily::kRgb || rgb.data().empty()) throw Error("only RGB images can be encoded");
}

// --- JPEG ------------------------------------------------------------------------------------------------------------

// No object with a destructor may live between setjmp() and longjmp(), so the caller owns all objects.
bool write_jpeg(jpeg_compress_struct& info, jpeg::Errors& errors, const Image& rgb, int quality, unsigned char*& bytes,
                unsigned long& size) {
  if (setjmp(errors.jump)) return false;
  jpeg_create_compress(&info);
  jpeg_mem_dest(&info, &bytes, &size);
  info.image_width = static_cast<JDIMENSION>(rgb.width());
  info.image_height = static_cast<JDIMENSION>(rgb.height());
  info.in_color_space = JCS_RGB;
  info.input_components = 3;
  jpeg_set_defaults(&info);  // 4:2:0
  jpeg_set_quality(&info, quality, TRUE);
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row = const_cast<uint8_t*>(rgb.pixel(0, static_cast<int>(info.next_scanline)));
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  return true;
}

// --- PNG -------------------------------------------------------------------------------------------------------------

struct PngOutput : PngErrors {
  std::vector<uint8_t> bytes;
};

void append_png_bytes(png_structp png, png_bytep from, size_t count) {
  auto* output = static_cast<PngOutput*>(png_get_io_ptr(png));
  try {
    output->bytes.insert(output->bytes.end(), from, from + count);
    return;
  } catch (const std::exception&) {
  }
  png_error(png, "out of memory");
}

// The samples of a picture without padding; 16 bits in the order of this processor.
struct PngPicture {
  int width, height, bits, colour;
  const uint8_t* samples;
};

// No object with a destructor may live between setjmp() and longjmp(), so the caller owns all objects.
bool write_png(png_structp png, png_infop info, PngOutput& output, const PngPicture& picture) {
  if (setjmp(output.jump)) return false;
  png_set_write_fn(png, &output, append_png_bytes, [](png_structp) {});
  // These settings are fast, and good for images of cameras.
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_set_compression_level(png, Z_BEST_SPEED);
  png_set_compression_strategy(png, Z_RLE);
  png_set_IHDR(png, info, static_cast<png_uint_32>(picture.width), static_cast<png_uint_32>(picture.height),
               picture.bits, picture.colour, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  if (picture.bits == 16 && std::endian::native == std::endian::little) png_set_swap(png);
  const size_t stride = png_get_rowbytes(png, info);
  for (int y = 0; y < picture.height; y++) png_write_row(png, picture.samples + stride * static_cast<size_t>(y));
  png_write_end(png, info);
  return true;
}

std::vector<uint8_t> encode_png(const PngPicture& picture) {
  PngOutput output;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, static_cast<PngErrors*>(&output), PngErrors::fail,
                                            PngErrors::ignore);
  png_infop info = png ? png_create_info_struct(png) : nullptr;
  const bool whole = info && write_png(png, info, output, picture);
  png_destroy_write_struct(&png, &info);
  if (!whole) throw Error(std::string("PNG: ") + output.text);
  return std::move(output.bytes);
}

std::vector<uint8_t> encode_png(const Image& rgb) {
  check_pixels(rgb);
  return encode_png({rgb.width(), rgb.height(), 8, PNG_COLOR_TYPE_RGB, rgb.data().data()});
}

void write_bytes(const std::vector<uint8_t>& bytes, const std::string& path) {
  AtomicFileWriter file(path);
  file.write({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  file.commit();
}

void save_grey(int bits, const void* samples, int width, int height, const std::string& path) {
  std::vector<uint8_t> bytes;
  try {
    bytes = encode_png({width, height, bits, PNG_COLOR_TYPE_GRAY, static_cast<const uint8_t*>(samples)});
  } catch (const Error& error) {
    throw Error(path + ": " + error.what());
  }
  write_bytes(bytes, path);
}

}  // namespace

std::vector<uint8_t> encode_jpeg(const Image& rgb, int quality) {
  check_pixels(rgb);
  jpeg_compress_struct info{};
  jpeg::Errors errors;
  info.err = errors.install(false);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  const bool whole = write_jpeg(info, errors, rgb, quality, bytes, size);
  char text[JMSG_LENGTH_MAX] = "";
  if (!whole) errors.manager.format_message(reinterpret_cast<j_common_ptr>(&info), text);
  jpeg_destroy_compress(&info);
  // After an error, libjpeg may have freed or replaced the buffer.
  if (!whole) throw Error(std::string("JPEG: ") + text);
  std::vector<uint8_t> coded(bytes, bytes + size);
  std::free(bytes);
  return coded;
}

void save_image(const Image& rgb, const std::string& path) {
  constexpr int kQuality = 95;
  std::string ending = std::filesystem::path(path).extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return std::tolower(c); });
  std::vector<uint8_t> bytes;
  try {
    if (ending == ".png")
      bytes = encode_png(rgb);
    else if (ending == ".jpg" || ending == ".jpeg")
      bytes = encode_jpeg(rgb, kQuality);
    else
      throw Error("the name of a picture must end in .png or .jpg");
  } catch (const Error& error) {
    throw Error(path + ": " + error.what());
  }
  write_bytes(bytes, path);
}

void save_grey_png(std::span<const uint8_t> samples, int width, int height, const std::string& path) {
  save_grey(8, samples.data(), width, height, path);
}
void save_grey_png(std::span<const uint16_t> samples, int width, int height, const std::string& path) {
  save_grey(16, samples.data(), width, height, path);
}

}  // namespace lf
