// SPDX-License-Identifier: LGPL-2.1-or-later
// Separate from image.cc, so that programs without image files do not load OpenCV.
#include "image/image_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include "base/file.h"
#include "base/text.h"
#include "image/coded_image_check.h"

namespace lf {
namespace {

// Silences OpenCV's log, since errors are reported as exceptions.
class ScopedOpenCvSilence {
 public:
  ScopedOpenCvSilence() : before_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)) {}
  ~ScopedOpenCvSilence() { cv::utils::logging::setLogLevel(before_); }
  ScopedOpenCvSilence(const ScopedOpenCvSilence&) = delete;
  ScopedOpenCvSilence& operator=(const ScopedOpenCvSilence&) = delete;

 private:
  const cv::utils::logging::LogLevel before_;
};

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

// The size follows an empty line as "-Y 480 +X 640".
std::optional<HeaderSize> hdr_size(std::string_view bytes) {
  size_t at = bytes.find("\n\n");
  if (at == bytes.npos) return std::nullopt;
  at += 2;
  std::array<int64_t, 2> sides{};
  for (int i = 0; i < 2; i++) {
    at = std::min(bytes.find_first_of("XY", at), bytes.size());
    const bool is_width = at < bytes.size() && bytes[at] == 'X';
    if (at < bytes.size()) at++;
    const auto number = next_number(bytes, at);
    if (!number) return std::nullopt;
    (is_width ? sides[0] : sides[1]) = *number;
  }
  return HeaderSize{sides[0], sides[1]};
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
  if (begins("#?RADIANCE") || begins("#?RGBE")) return hdr_size(bytes);
  if (bytes.size() > 2 && bytes[0] == 'P' && std::string_view("123456Ff").find(bytes[1]) != std::string_view::npos)
    return pnm_size(bytes);
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

void fail_if_damaged(const std::string& path, const std::string& damage) {
  if (!damage.empty()) throw Error(path + ": damaged: " + damage);
}

// Returns false if OpenCV refuses the bytes. May throw cv::Exception.
bool decode_with_opencv(std::span<const uint8_t> bytes, cv::Mat& pixels) {
  const cv::Mat coded(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<uint8_t*>(bytes.data()));
  cv::imdecode(coded, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION, &pixels);
  return !pixels.empty();
}

Image decode_image(const std::string& path, const std::string& bytes, ImageSize size) {
  // OpenCV accepts damaged PNG and JPEG files.
  const std::span coded_bytes(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  if (detect_image_coding(coded_bytes) != ImageCoding::kOther) {
    try {
      return decode_still(coded_bytes, PixelFamily::kRgb);
    } catch (const Error& error) {
      throw Error(path + ": " + error.what());
    }
  }
  if (is_tiff(bytes)) fail_if_damaged(path, tiff_damage(coded_bytes));
  // OpenCV decodes into the image's memory if the size matches.
  Image image(PixelFamily::kRgb, size.width, size.height);
  cv::Mat pixels(size.height, size.width, CV_8UC3, image.data().data());
  try {
    const ScopedOpenCvSilence quiet;
    decode_with_opencv(coded_bytes, pixels);
    if (is_webp(bytes) && !pixels.empty())
      fail_if_damaged(path, webp_damage(coded_bytes, [](std::span<const uint8_t> part) {
                        cv::Mat ignored;
                        return decode_with_opencv(part, ignored);
                      }));
  } catch (const cv::Exception& e) {
    throw Error(path + ": " + e.what());
  }
  if (pixels.empty()) throw Error(path + ": not an image that can be read, such as a JPEG or PNG file");
  if (pixels.data != image.data().data() || pixels.cols != size.width || pixels.rows != size.height)
    throw Error(path + ": header and pixels have different sizes");
  for (size_t i = 0; i + 2 < image.data().size(); i += 3) std::swap(image.data()[i], image.data()[i + 2]);
  return image;
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

GreyImage decode_jpeg_luma(const std::vector<uint8_t>& bytes, int smaller) {
  try {
    const cv::Mat grey = cv::imdecode(bytes, smaller == 8   ? cv::IMREAD_REDUCED_GRAYSCALE_8
                                             : smaller == 4 ? cv::IMREAD_REDUCED_GRAYSCALE_4
                                             : smaller == 2 ? cv::IMREAD_REDUCED_GRAYSCALE_2
                                                            : cv::IMREAD_GRAYSCALE);
    if (grey.empty()) throw Error("can't be decoded as JPEG");
    GreyImage picture{grey.cols, grey.rows, {}};
    for (int y = 0; y < grey.rows; y++)
      picture.samples.insert(picture.samples.end(), grey.ptr<uint8_t>(y), grey.ptr<uint8_t>(y) + grey.cols);
    return picture;
  } catch (const cv::Exception& error) {
    throw Error(error.what());
  }
}

}  // namespace lf
