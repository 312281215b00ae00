// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <webp/decode.h>

#include "base/file.h"
#include "base/text.h"
#include "image/coded_image_check.h"

namespace lf {
namespace {

struct HeaderSize {
  int64_t width = 0, height = 0;
};

class HeaderBytes {
 public:
  HeaderBytes(std::string_view bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

  std::optional<uint32_t> number(size_t at, size_t size) const {
    if (at > bytes_.size() || bytes_.size() - at < size) return std::nullopt;
    uint32_t value = 0;
    for (size_t i = 0; i < size; i++) {
      const size_t place = big_endian_ ? i : size - 1 - i;
      value = value << 8 | static_cast<uint8_t>(bytes_[at + place]);
    }
    return value;
  }

 private:
  std::string_view bytes_;
  bool big_endian_;
};

std::optional<HeaderSize> pair_of(std::optional<uint32_t> width, std::optional<uint32_t> height) {
  if (!width || !height) return std::nullopt;
  return HeaderSize{*width, *height};
}

std::optional<HeaderSize> png_size(std::string_view bytes) {
  const HeaderBytes header(bytes, true);
  return pair_of(header.number(16, 4), header.number(20, 4));
}

// Finds the first frame header (SOF) of a JPEG file, after segments with a length each.
std::optional<HeaderSize> jpeg_size(std::string_view bytes) {
  const HeaderBytes header(bytes, true);
  for (size_t at = 2;;) {
    while (at + 1 < bytes.size() && bytes[at] == '\xff' && bytes[at + 1] == '\xff') at++;
    const auto marker = header.number(at, 2);
    if (!marker || *marker >> 8 != 0xff) return std::nullopt;
    const uint32_t kind = *marker & 0xff;
    const bool is_frame = kind >= 0xc0 && kind <= 0xcf && kind != 0xc4 && kind != 0xc8 && kind != 0xcc;
    if (is_frame) return pair_of(header.number(at + 7, 2), header.number(at + 5, 2));
    const bool has_length = kind != 0x01 && !(kind >= 0xd0 && kind <= 0xd7);
    if (kind == 0xd9 || kind == 0xda) return std::nullopt;
    const auto length = has_length ? header.number(at + 2, 2) : std::optional<uint32_t>(0);
    if (!length) return std::nullopt;
    at += 2 + *length;
  }
}

std::optional<HeaderSize> bmp_size(std::string_view bytes) {
  const HeaderBytes header(bytes, false);
  const auto kind = header.number(14, 4);
  if (!kind) return std::nullopt;
  if (*kind == 12) return pair_of(header.number(18, 2), header.number(20, 2));
  const auto size = pair_of(header.number(18, 4), header.number(22, 4));
  if (!size) return std::nullopt;
  // The height is negative for top-down rows.
  const auto height = static_cast<int32_t>(static_cast<uint32_t>(size->height));
  return HeaderSize{size->width, std::abs(int64_t{height})};
}

std::optional<HeaderSize> tiff_size(std::string_view bytes) {
  const HeaderBytes header(bytes, bytes[0] == 'M');
  const auto directory = header.number(4, 4);
  const auto count = directory ? header.number(*directory, 2) : std::nullopt;
  std::optional<uint32_t> width, height;
  for (size_t i = 0; count && i < *count; i++) {
    const size_t at = size_t{*directory} + 2 + 12 * i;
    const auto tag = header.number(at, 2), type = header.number(at + 2, 2);
    if (!tag || !type) return std::nullopt;
    constexpr uint32_t kWidth = 256, kHeight = 257, kShort = 3;
    if (*tag == kWidth) width = header.number(at + 8, *type == kShort ? 2 : 4);
    if (*tag == kHeight) height = header.number(at + 8, *type == kShort ? 2 : 4);
  }
  return pair_of(width, height);
}

std::optional<HeaderSize> webp_size(std::string_view bytes) {
  const HeaderBytes header(bytes, false);
  const std::string_view kind = bytes.substr(12, 4);
  if (kind == "VP8X") {
    const auto size = pair_of(header.number(24, 3), header.number(27, 3));
    return size ? std::optional(HeaderSize{size->width + 1, size->height + 1}) : std::nullopt;
  }
  if (kind == "VP8L") {
    const auto packed = header.number(21, 4);
    return packed ? std::optional(HeaderSize{(*packed & 0x3fff) + 1, (*packed >> 14 & 0x3fff) + 1}) : std::nullopt;
  }
  const auto size = pair_of(header.number(26, 2), header.number(28, 2));
  return size ? std::optional(HeaderSize{size->width & 0x3fff, size->height & 0x3fff}) : std::nullopt;
}

std::optional<int64_t> next_number(std::string_view text, size_t& at) {
  while (at < text.size() && (std::isspace(static_cast<unsigned char>(text[at])) || text[at] == '#'))
    at = text[at] == '#' ? std::min(text.find('\n', at), text.size()) : at + 1;
  int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data() + at, text.data() + text.size(), number);
  if (error != std::errc()) return std::nullopt;
  at = static_cast<size_t>(end - text.data());
  return number;
}

std::optional<HeaderSize> pnm_size(std::string_view bytes) {
  size_t at = 2;
  const auto width = next_number(bytes, at);
  const auto height = width ? next_number(bytes, at) : std::nullopt;
  if (!height) return std::nullopt;
  return HeaderSize{*width, *height};
}

bool is_tiff(std::string_view bytes) {
  return bytes.starts_with(std::string_view("II*\0", 4)) || bytes.starts_with(std::string_view("MM\0*", 4));
}

bool is_webp(std::string_view bytes) {
  return bytes.starts_with("RIFF") && bytes.size() >= 16 && bytes.substr(8, 4) == "WEBP";
}

std::optional<HeaderSize> claimed_size(std::string_view bytes) {
  const auto begins = [&](std::string_view magic) { return bytes.substr(0, magic.size()) == magic; };
  if (begins("\x89PNG\r\n\x1a\n")) return png_size(bytes);
  if (begins("\xff\xd8\xff")) return jpeg_size(bytes);
  if (begins("BM")) return bmp_size(bytes);
  if (is_tiff(bytes)) return tiff_size(bytes);
  if (is_webp(bytes)) return webp_size(bytes);
  if (begins("P5") || begins("P6")) return pnm_size(bytes);
  return std::nullopt;
}

ImageSize checked_size(const std::string& path, std::string_view bytes) {
  const std::optional<HeaderSize> size = claimed_size(bytes);
  if (!size || size->width < 1 || size->height < 1)
    throw Error(path + ": not an image that can be read, such as a JPEG or PNG file");
  const auto [width, height] = *size;
  if (width > kMaxImageSide || height > kMaxImageSide || width * height > kMaxImagePixels)
    throw Error(path + ": is " + std::to_string(width) + "x" + std::to_string(height) + " pixels: at most " +
                std::to_string(kMaxImageSide) + " a side and " + std::to_string(kMaxImagePixels / 1'000'000) +
                " million in all can be read");
  return {static_cast<int>(width), static_cast<int>(height)};
}

std::string read_image_file(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) throw Error(path + ": no such image file");
  return read_file(path);
}

// PGM and PPM with 8 or 16 bits.
Image decode_pnm(std::string_view bytes, ImageSize size) {
  Image image(PixelFamily::kRgb, size.width, size.height);
  size_t at = 2;
  next_number(bytes, at);
  next_number(bytes, at);
  const int64_t white = next_number(bytes, at).value_or(0);
  if (white < 1 || white > 65535) throw Error("damaged: no valid level of white");
  const size_t wide = white > 255 ? 2 : 1, repeats = bytes[1] == '6' ? 1 : 3;
  const HeaderBytes samples(bytes.substr(std::min(at + 1, bytes.size())), true);
  for (size_t i = 0; i < image.data().size(); i++) {
    const auto sample = samples.number(i / repeats * wide, wide);
    if (!sample) throw Error("damaged: the file is truncated");
    image.data()[i] = static_cast<uint8_t>((std::min<int64_t>(*sample, white) * 255 + white / 2) / white);
  }
  return image;
}

// Uncompressed BMP with a palette, or with 24 or 32 bits per pixel.
Image decode_bmp(std::string_view bytes, ImageSize size) {
  constexpr uint32_t kUncompressed = 0, kMasks = 3;
  const HeaderBytes header(bytes, false);
  const uint32_t begin = header.number(10, 4).value_or(0), header_size = header.number(14, 4).value_or(0);
  const uint32_t bits = header.number(28, 2).value_or(0), compression = header.number(30, 4).value_or(0);
  if (header_size < 40 || (bits != 8 && bits != 24 && bits != 32) ||
      (compression != kUncompressed && (compression != kMasks || bits != 32)))
    throw Error("only uncompressed BMP files with 8, 24 or 32 bits per pixel can be read");
  if (compression == kMasks &&
      (header.number(54, 4) != 0xff0000u || header.number(58, 4) != 0xff00u || header.number(62, 4) != 0xffu))
    throw Error("the colour masks must be ff0000, ff00 and ff (8 bits each, in the order BGR)");
  const bool from_top = static_cast<int32_t>(header.number(22, 4).value_or(0)) < 0;
  const size_t pixel = bits / 8, stride = (pixel * static_cast<size_t>(size.width) + 3) / 4 * 4;
  Image image(PixelFamily::kRgb, size.width, size.height);
  for (int y = 0; y < size.height; y++) {
    const size_t row = begin + stride * static_cast<size_t>(from_top ? y : size.height - 1 - y);
    for (int x = 0; x < size.width; x++) {
      std::optional<uint32_t> bgr = header.number(row + pixel * static_cast<size_t>(x), pixel);
      if (bgr && bits == 8) bgr = header.number(14 + header_size + 4 * size_t{*bgr}, 4);
      if (!bgr) throw Error("damaged: the file is truncated");
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>(*bgr >> (16 - 8 * c));
    }
  }
  return image;
}

Image decode_webp(std::span<const uint8_t> bytes, ImageSize size) {
  Image image(PixelFamily::kRgb, size.width, size.height);
  ImageSize inside;
  if (!WebPGetInfo(bytes.data(), bytes.size(), &inside.width, &inside.height) || inside != size ||
      !WebPDecodeRGBInto(bytes.data(), bytes.size(), image.data().data(), image.data().size(), 3 * size.width))
    throw Error("damaged: its pixels can't be decoded");
  const std::string damage = webp_damage(bytes, [](std::span<const uint8_t> part) {
    int width = 0, height = 0;
    const std::unique_ptr<uint8_t, decltype(&WebPFree)> pixels(WebPDecodeRGB(part.data(), part.size(), &width, &height),
                                                               WebPFree);
    return pixels != nullptr;
  });
  if (!damage.empty()) throw Error("damaged: " + damage);
  return image;
}

Image decode_image(const std::string& path, const std::string& bytes, ImageSize size) {
  const std::span coded_bytes(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  try {
    if (detect_image_coding(coded_bytes) != ImageCoding::kOther) return decode_still(coded_bytes, PixelFamily::kRgb);
    if (is_tiff(bytes)) return decode_tiff(coded_bytes, size);
    if (is_webp(bytes)) return decode_webp(coded_bytes, size);
    return bytes[0] == 'B' ? decode_bmp(bytes, size) : decode_pnm(bytes, size);
  } catch (const Error& error) {
    throw Error(path + ": " + error.what());
  }
}

}  // namespace

ImageSize load_image_size(const std::string& path) { return checked_size(path, read_image_file(path)); }

Image load_image(const std::string& path) {
  const std::string bytes = read_image_file(path);
  return decode_image(path, bytes, checked_size(path, bytes));
}

Image load_image_of_size(const std::string& path, ImageSize expected) {
  const std::string bytes = read_image_file(path);
  const ImageSize size = checked_size(path, bytes);
  if (size != expected)
    throw Error(path + ": has " + size_text(size.width, size.height) + " pixels, the rig says " +
                size_text(expected.width, expected.height));
  return decode_image(path, bytes, size);
}

}  // namespace lf
