// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image_file.h"

#include <csetjmp>
#include <cstring>
#include <string_view>
#include <utility>
#include <vector>

#include <png.h>

#include "base/text.h"
#include "jpeg/codec_errors.h"
#include "jpeg/header.h"
#include "jpeg/jpeg_frame.h"
#include "rig/rig.h"

namespace lf {
namespace {

using Bytes = std::span<const uint8_t>;

bool begins_with(Bytes bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

// --- PNG -------------------------------------------------------------------------------------------------------------

size_t png_number(Bytes bytes, size_t at) {
  return size_t{bytes[at]} << 24 | size_t{bytes[at + 1]} << 16 | size_t{bytes[at + 2]} << 8 | bytes[at + 3];
}

struct PngInput : PngErrors {
  explicit PngInput(Bytes bytes) : left(bytes) {}
  Bytes left;
};

void read_png_bytes(png_structp png, png_bytep to, size_t count) {
  auto* input = static_cast<PngInput*>(png_get_io_ptr(png));
  if (count > input->left.size()) png_error(png, "the file is truncated");
  std::memcpy(to, input->left.data(), count);
  input->left = input->left.subspan(count);
}

// No object with a destructor may live between setjmp() and longjmp(), so the caller owns all objects.
bool read_png(png_structp png, png_infop info, PngInput& input, Image& out, std::vector<uint8_t*>& rows) {
  if (setjmp(input.jump)) return false;
  png_set_read_fn(png, &input, read_png_bytes);
  png_set_user_limits(png, kMaxImageSize, kMaxImageSize);
  png_read_info(png, info);
  if (int64_t{png_get_image_width(png, info)} * png_get_image_height(png, info) > kMaxImagePixels)
    png_error(png, "too many pixels");
  png_set_expand(png);
  png_set_strip_16(png);
  png_set_strip_alpha(png);
  png_set_gray_to_rgb(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  if (png_get_rowbytes(png, info) != size_t{3} * png_get_image_width(png, info)) png_error(png, "unknown kind of PNG");
  out = Image(PixelFamily::kRgb, static_cast<int>(png_get_image_width(png, info)),
              static_cast<int>(png_get_image_height(png, info)));
  for (int y = 0; y < out.height(); y++) rows.push_back(out.pixel(0, y));
  png_read_image(png, rows.data());
  png_read_end(png, nullptr);
  return true;
}

// Returns true if a PNG has many more compressed bytes than its pixels can need. Files with excess data are refused,
// because libpng would inflate everything after the last row.
bool has_excess_data(Bytes bytes) {
  constexpr size_t kFirstChunk = 8, kMaxPerPixel = 8, kSlack = 1 << 16;  // RGBA of 16 bits
  if (bytes.size() < kFirstChunk + 16) return false;
  const size_t pixels =
      std::min(png_number(bytes, 16), size_t{kMaxImageSize}) * std::min(png_number(bytes, 20), size_t{kMaxImageSize});
  size_t compressed = 0;
  // A chunk has a length, a kind, data and a checksum.
  for (size_t at = kFirstChunk; at + 12 <= bytes.size(); at += 12 + png_number(bytes, at))
    if (std::memcmp(&bytes[at + 4], "IDAT", 4) == 0) compressed += png_number(bytes, at);
  return compressed > pixels * kMaxPerPixel + kSlack;
}

Image decode_png(Bytes bytes) {
  if (has_excess_data(bytes)) throw Error("damaged PNG: more data than pixels");
  Image out;
  std::vector<uint8_t*> rows;
  PngInput input(bytes);
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, static_cast<PngErrors*>(&input), PngErrors::fail,
                                           PngErrors::ignore);
  png_infop info = png ? png_create_info_struct(png) : nullptr;
  const bool whole = info && read_png(png, info, input, out, rows);
  png_destroy_read_struct(&png, &info, nullptr);
  if (!whole) throw Error(std::string("damaged PNG: ") + input.text);
  return out;
}

// --- JPEG markers ----------------------------------------------------------------------------------------------------

class JpegMarkers {
 public:
  explicit JpegMarkers(Bytes jpeg) : jpeg_(jpeg) {}

  // Moves to the next marker. Returns false after the last marker, at the end of the bytes, or if the bytes are not a
  // JPEG.
  bool next() {
    at_ += 2 + length_;
    if (in_scan_) skip_scan();
    while (at_ + 1 < jpeg_.size() && jpeg_[at_] == 0xff && jpeg_[at_ + 1] == 0xff) at_++;
    if (at_ + 1 >= jpeg_.size() || jpeg_[at_] != 0xff) return false;
    const bool stands_alone = marker() == 0xd8 || marker() == 0xd9 || marker() == 0x01;
    if (!stands_alone && at_ + 3 >= jpeg_.size()) return false;
    length_ = stands_alone ? 0 : size_t{jpeg_[at_ + 2]} << 8 | jpeg_[at_ + 3];
    in_scan_ = marker() == 0xda;
    return true;
  }
  uint8_t marker() const { return jpeg_[at_ + 1]; }
  size_t end() const { return at_ + 2 + length_; }
  Bytes content() const { return length_ < 2 || end() > jpeg_.size() ? Bytes() : jpeg_.subspan(at_ + 4, length_ - 2); }

 private:
  void skip_scan() {
    while (at_ < jpeg_.size()) {
      const void* found = std::memchr(jpeg_.data() + at_, 0xff, jpeg_.size() - at_);
      at_ = found ? static_cast<size_t>(static_cast<const uint8_t*>(found) - jpeg_.data()) : jpeg_.size();
      if (at_ + 1 >= jpeg_.size()) return;
      const uint8_t after = jpeg_[at_ + 1];
      if (after != 0x00 && after != 0xff && !(after >= 0xd0 && after <= 0xd7)) return;
      at_ += after == 0xff ? 1 : 2;
    }
  }

  Bytes jpeg_;
  size_t at_ = 0, length_ = static_cast<size_t>(-2);  // before the first marker
  bool in_scan_ = false;
};

// --- EXIF ------------------------------------------------------------------------------------------------------------

int tiff_orientation(Bytes tiff) {
  const bool big = begins_with(tiff, "MM");
  if (!big && !begins_with(tiff, "II")) return 1;
  const auto number = [&](size_t at, size_t size) -> size_t {
    size_t value = 0;
    if (at > tiff.size() || tiff.size() - at < size) return 0;
    for (size_t i = 0; i < size; i++) value = value << 8 | tiff[at + (big ? i : size - 1 - i)];
    return value;
  };
  const size_t directory = number(4, 4), entries = number(directory, 2);
  for (size_t i = 0; i < entries; i++) {
    const size_t entry = directory + 2 + 12 * i;
    if (entry > tiff.size()) break;
    constexpr size_t kOrientation = 0x0112;
    const size_t value = number(entry + 8, 2);
    if (number(entry, 2) == kOrientation) return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
  }
  return 1;
}

Bytes exif_of_png(Bytes png) {
  for (size_t at = 8; at + 12 <= png.size();) {
    const size_t length = png_number(png, at);
    if (length > png.size() - at - 12) break;
    if (begins_with(png.subspan(at + 4), "eXIf")) return png.subspan(at + 8, length);
    at += 12 + length;
  }
  return {};
}

Bytes exif_of_jpeg(Bytes jpeg) {
  constexpr std::string_view kExif("Exif\0\0", 6);
  for (JpegMarkers markers(jpeg); markers.next() && markers.marker() != 0xda;)
    if (markers.marker() == 0xe1 && begins_with(markers.content(), kExif))
      return markers.content().subspan(kExif.size());
  return {};
}

bool is_multi_picture(Bytes jpeg) {
  for (JpegMarkers markers(jpeg); markers.next() && markers.marker() != 0xda;)
    if (markers.marker() == 0xe2 && begins_with(markers.content(), "MPF")) return true;
  return false;
}

}  // namespace

ImageCoding detect_image_coding(Bytes bytes) {
  if (begins_with(bytes, "\x89PNG")) return ImageCoding::kPng;
  return begins_with(bytes, "\xff\xd8\xff") ? ImageCoding::kJpeg : ImageCoding::kOther;
}

Image decode_still(Bytes bytes, PixelFamily jpeg_family) {
  const ImageCoding coding = detect_image_coding(bytes);
  if (coding == ImageCoding::kPng) return decode_png(bytes);
  if (coding == ImageCoding::kOther) throw Error("neither PNG nor JPEG");
  std::string reason;
  bool unsupported = false;
  const auto header = jpeg::parse_header(bytes, &reason, &unsupported);
  if (!header) throw Error((unsupported ? "" : "damaged JPEG: ") + reason);
  if (int64_t{header->width} * header->height > kMaxImagePixels) throw Error("damaged JPEG: too many pixels");
  std::optional<Image> image =
      jpeg_family == PixelFamily::kRgb ? jpeg::decode_rgb(bytes, &reason) : jpeg::decode_whole(bytes, &reason);
  if (!image) throw Error("damaged JPEG: " + reason);
  return std::move(*image);
}

int exif_orientation(Bytes bytes) {
  const ImageCoding coding = detect_image_coding(bytes);
  return tiff_orientation(coding == ImageCoding::kPng    ? exif_of_png(bytes)
                          : coding == ImageCoding::kJpeg ? exif_of_jpeg(bytes)
                                                         : Bytes());
}

std::string orientation_notice(int orientation) {
  constexpr const char* kTurns[] = {"mirrored",
                                    "rotated by 180 degrees",
                                    "mirrored and rotated by 180 degrees",
                                    "mirrored and rotated by 270 degrees",
                                    "rotated by 90 degrees",
                                    "mirrored and rotated by 90 degrees",
                                    "rotated by 270 degrees"};
  if (orientation < 2 || orientation > 8) return "";
  return std::string("According to EXIF, the picture must be ") + kTurns[orientation - 2] + " (orientation " +
         std::to_string(orientation) +
         "). It is shown as stored, like in COLMAP. If the calibration used rotated pictures, rotate the files "
         "(mogrify -auto-orient)";
}

std::optional<size_t> jpeg_end(Bytes bytes) {
  bool begun = false;
  for (JpegMarkers markers(bytes); markers.next();) {
    if (markers.marker() == 0xd9) return markers.end();
    if (markers.marker() == 0xd8 && std::exchange(begun, true)) return markers.end() - 2;
  }
  return std::nullopt;
}

bool is_jpeg_stream(Bytes bytes) {
  const std::optional<size_t> end = jpeg_end(bytes);
  if (!end || is_multi_picture(bytes.first(*end))) return false;
  size_t next = *end;
  while (next < bytes.size() && bytes[next] == 0) next++;
  const Bytes rest = bytes.subspan(next);
  if (detect_image_coding(rest) != ImageCoding::kJpeg) return false;
  const auto first = jpeg::parse_header(bytes.first(*end), nullptr), second = jpeg::parse_header(rest, nullptr);
  return first && second && first->width == second->width && first->height == second->height;
}

namespace {

// No object with a destructor may live between setjmp() and longjmp(), so the caller owns all objects.
bool read_luma(jpeg_decompress_struct& info, jpeg::Errors& errors, jpeg_source_mgr& source, int smaller,
               GreyImage& out) {
  if (setjmp(errors.jump)) return false;
  jpeg_create_decompress(&info);
  info.src = &source;
  jpeg_read_header(&info, TRUE);
  if (int64_t{info.image_width} * info.image_height > kMaxImagePixels) ERREXIT(&info, JERR_IMAGE_TOO_BIG);
  info.out_color_space = JCS_GRAYSCALE;
  info.scale_denom = static_cast<unsigned>(smaller);
  jpeg_start_decompress(&info);
  out.width = static_cast<int>(info.output_width);
  out.height = static_cast<int>(info.output_height);
  out.samples.resize(size_t{info.output_width} * info.output_height);
  while (info.output_scanline < info.output_height) {
    JSAMPROW row = &out.samples[size_t{info.output_width} * info.output_scanline];
    jpeg_read_scanlines(&info, &row, 1);
  }
  jpeg_finish_decompress(&info);
  return true;
}

}  // namespace

GreyImage decode_jpeg_luma(const std::vector<uint8_t>& bytes, int smaller) {
  jpeg_decompress_struct info{};
  jpeg::Errors errors;
  info.err = errors.install(false);
  jpeg_source_mgr source = jpeg::memory_source();
  source.next_input_byte = bytes.data();
  source.bytes_in_buffer = bytes.size();
  GreyImage out;
  const bool whole = read_luma(info, errors, source, smaller, out);
  char text[JMSG_LENGTH_MAX] = "";
  if (!whole) errors.manager.format_message(reinterpret_cast<j_common_ptr>(&info), text);
  jpeg_destroy_decompress(&info);
  if (!whole) throw Error(std::string("can't be decoded as JPEG: ") + text);
  return out;
}

}  // namespace lf
