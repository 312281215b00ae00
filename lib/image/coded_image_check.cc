// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/coded_image_check.h"

#include <algorithm>
#include <cstdarg>
#include <cstring>
#include <memory>
#include <string_view>
#include <vector>

#include <tiffio.h>

#include "base/text.h"

namespace lf {
namespace {

using Bytes = std::span<const uint8_t>;

// A TIFF file in memory, and the first problem that libtiff has reported.
struct TiffFile {
  Bytes bytes;
  size_t at = 0;
  bool decoding = false;
  std::string problem;
};

tmsize_t read_tiff(thandle_t handle, void* to, tmsize_t size) {
  auto& file = *static_cast<TiffFile*>(handle);
  const size_t count = std::min(file.bytes.size() - file.at, static_cast<size_t>(size));
  std::memcpy(to, file.bytes.data() + file.at, count);
  file.at += count;
  return static_cast<tmsize_t>(count);
}

tmsize_t write_nothing(thandle_t, void*, tmsize_t) { return 0; }

toff_t seek_tiff(thandle_t handle, toff_t offset, int whence) {
  auto& file = *static_cast<TiffFile*>(handle);
  const toff_t from = whence == SEEK_CUR ? file.at : whence == SEEK_END ? file.bytes.size() : 0;
  file.at = static_cast<size_t>(std::min<toff_t>(from + offset, file.bytes.size()));
  return file.at;
}

int close_nothing(thandle_t) { return 0; }

toff_t size_of_tiff(thandle_t handle) { return static_cast<TiffFile*>(handle)->bytes.size(); }

void note(TiffFile& file, const char* format, va_list arguments) {
  if (!file.problem.empty()) return;
  char text[200];
  std::vsnprintf(text, sizeof text, format, arguments);
  file.problem = text;
}

int on_tiff_error(TIFF*, void* data, const char*, const char* format, va_list arguments) {
  note(*static_cast<TiffFile*>(data), format, arguments);
  return 1;
}

// Damaged pixels of CCITT and JPEG are only warnings. Warnings about tags come before decoding.
int on_tiff_warning(TIFF*, void* data, const char*, const char* format, va_list arguments) {
  auto& file = *static_cast<TiffFile*>(data);
  if (file.decoding && !std::string_view(format).starts_with("Old-style")) note(file, format, arguments);
  return 1;
}

Image decode_pixels(TIFF* tiff, TiffFile& file, ImageSize size) {
  uint32_t width = 0, height = 0;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &height);
  Image image(PixelFamily::kRgb, size.width, size.height);
  std::vector<uint32_t> pixels(static_cast<size_t>(size.width) * static_cast<size_t>(size.height));
  TIFFSetField(tiff, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  file.decoding = true;
  const bool whole = width == static_cast<uint32_t>(size.width) && height == static_cast<uint32_t>(size.height) &&
                     TIFFReadRGBAImageOriented(tiff, width, height, pixels.data(), ORIENTATION_TOPLEFT, 1);
  if (!whole && file.problem.empty()) file.problem = "its pixels can't be decoded";
  for (size_t i = 0; i < pixels.size(); i++)
    for (size_t c = 0; c < 3; c++) image.data()[3 * i + c] = static_cast<uint8_t>(pixels[i] >> 8 * c);
  return image;
}

uint32_t little_endian(Bytes bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; i++) value |= uint32_t{bytes[at + i]} << 8 * i;
  return value;
}

}  // namespace

Image decode_tiff(Bytes bytes, ImageSize size) {
  TiffFile file{bytes, 0, false, ""};
  const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(TIFFOpenOptionsAlloc(),
                                                                                 TIFFOpenOptionsFree);
  constexpr tmsize_t kMaxAllocation = tmsize_t{1} << 31;
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kMaxAllocation);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), on_tiff_error, &file);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), on_tiff_warning, &file);
  const std::unique_ptr<TIFF, decltype(&TIFFClose)> tiff(
      TIFFClientOpenExt("TIFF", "rm", &file, read_tiff, write_nothing, seek_tiff, close_nothing, size_of_tiff, nullptr,
                        nullptr, options.get()),
      TIFFClose);
  char reason[1024] = "";
  if (tiff && !TIFFRGBAImageOK(tiff.get(), reason))
    throw Error("this kind of TIFF can't be read: " + std::string(reason));
  Image image = tiff ? decode_pixels(tiff.get(), file, size) : Image();
  if (!tiff && file.problem.empty()) file.problem = "its header can't be read";
  if (!file.problem.empty()) throw Error("damaged: " + file.problem);
  return image;
}

std::string webp_damage(Bytes bytes, const std::function<bool(Bytes)>& decodes) {
  constexpr size_t kHeader = 12, kChunkHeader = 8;
  // Encoders pad the compressed data with up to two bytes.
  constexpr size_t kPadding = 8, kFewest = 64;
  for (size_t at = kHeader; at <= bytes.size() && bytes.size() - at >= kChunkHeader;) {
    const std::string_view kind(reinterpret_cast<const char*>(bytes.data()) + at, 4);
    const size_t size = little_endian(bytes, at + 4), content = at + kChunkHeader;
    if (size > bytes.size() - content) return "the file is truncated";
    if (kind != "VP8 " && kind != "VP8L") {
      at = content + size + (size & 1);
      continue;
    }
    if (size < kFewest) return "";
    // A file of this chunk alone, without the last bytes.
    const size_t shorter = (size - kPadding) & ~size_t{1};
    std::vector<uint8_t> cut(bytes.begin(), bytes.begin() + kHeader);
    const auto put_size = [&cut](size_t place, size_t value) {
      for (size_t i = 0; i < 4; i++) cut[place + i] = static_cast<uint8_t>(value >> 8 * i);
    };
    const Bytes chunk = bytes.subspan(at, kChunkHeader + shorter);
    cut.insert(cut.end(), chunk.begin(), chunk.end());
    put_size(4, cut.size() - kChunkHeader);
    put_size(kHeader + 4, shorter);
    return decodes(cut) ? "the decoder needs only a part of the compressed data" : "";
  }
  return "";
}

}  // namespace lf
