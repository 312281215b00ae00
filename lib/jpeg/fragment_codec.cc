// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/fragment_codec.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <new>
#include <string>

#include "base/memory.h"
#include "base/text.h"
#include "jpeg/codec_errors.h"

namespace lf::jpeg {
namespace {

constexpr size_t kMinRoom = 4096;  // minimum growth of the output, bytes

// Copies a row and repeats its last sample up to the padded width. The decoder discards the padding, and repeated
// samples cost the fewest bits.
void copy_row(uint8_t* to, const uint8_t* from, int n, int padded_n) {
  std::memcpy(to, from, n);
  std::memset(to + n, from[n - 1], padded_n - n);
}

void copy_chroma_row(uint8_t* __restrict to, const uint8_t* __restrict from, int n, int padded_n) {
  for (int i = 0; i < n; i++) to[i] = from[i] ^ 0x80;  // the 128 offset
  std::memset(to + n, to[n - 1], padded_n - n);
}

void copy_rgb_row(uint8_t* to, const uint8_t* from, int n, int padded_n) {
  std::memcpy(to, from, 3 * static_cast<size_t>(n));
  for (int i = 3 * n; i < 3 * padded_n; i++) to[i] = to[i - 3];
}

}  // namespace

class FragmentEncoder::Picture {
 public:
  enum class Kind { kYCbCr, kRgb, kLost };

  explicit Picture(Kind kind) : kind_(kind) {
    info_.err = errors_.install(false);
    if (setjmp(errors_.jump)) throw Error("JPEG: libjpeg can't be used: " + message());
    jpeg_create_compress(&info_);
    info_.in_color_space = kind == Kind::kLost ? JCS_GRAYSCALE : kind == Kind::kRgb ? JCS_RGB : JCS_YCbCr;
    info_.input_components = kind == Kind::kLost ? 1 : 3;
    jpeg_set_defaults(&info_);  // 4:2:0 for colour
    info_.raw_data_in = kind != Kind::kRgb;
    info_.dct_method = JDCT_ISLOW;
    info_.write_JFIF_header = FALSE;
    info_.dest = &destination_;
    destination_.init_destination = [](j_compress_ptr info) { self(info)->begin_output(); };
    destination_.empty_output_buffer = [](j_compress_ptr info) { return self(info)->grow_output(); };
    destination_.term_destination = [](j_compress_ptr) {};
    info_.client_data = this;
  }
  ~Picture() { jpeg_destroy_compress(&info_); }
  Picture(const Picture&) = delete;

  void encode(const FragmentPlanes& fragment, int quality, ByteBuffer& out) {
    const CodedSize size = coded_size(fragment.rect, unit());
    rows_.resize(static_cast<size_t>(size.width) * unit() * 3);
    out_ = &out;
    const size_t begin = out.size();
    if (!compress(fragment, size, quality)) {
      jpeg_abort_compress(&info_);
      out.resize(begin);
      if (out_of_memory_) throw std::bad_alloc();
      throw Error("JPEG: " + message());
    }
    out.resize(out.size() - destination_.free_in_buffer - kEoi);
  }

 private:
  static Picture* self(j_compress_ptr info) { return static_cast<Picture*>(info->client_data); }
  int unit() const { return kind_ == Kind::kLost ? kMissingUnit : kPixelUnit; }
  std::string message() {
    char text[JMSG_LENGTH_MAX];
    errors_.manager.format_message(reinterpret_cast<j_common_ptr>(&info_), text);
    return text;
  }

  // No object in this function may have a destructor, because longjmp() skips destructors.
  bool compress(const FragmentPlanes& fragment, const CodedSize& size, int quality) {
    if (setjmp(errors_.jump)) return false;
    if (quality != quality_) jpeg_set_quality(&info_, quality, TRUE);
    quality_ = quality;
    info_.image_width = size.width;
    info_.image_height = size.height;
    jpeg_suppress_tables(&info_, TRUE);
    jpeg_start_compress(&info_, FALSE);
    for (int y = 0; y < fragment.rect.height(); y += unit()) write_rows(fragment, y, size.width);
    jpeg_finish_compress(&info_);
    return true;
  }

  void write_rows(const FragmentPlanes& fragment, int y, int width) {
    const int w = fragment.rect.width(), h = fragment.rect.height(), step = unit();
    const auto row = [&](int i) { return std::min(y + i, h - 1); };
    JSAMPROW lines[3][kPixelUnit];
    if (kind_ == Kind::kRgb) {
      for (int i = 0; i < step; i++) {
        lines[0][i] = &rows_[static_cast<size_t>(i) * width * 3];
        copy_rgb_row(lines[0][i], fragment.plane[0] + row(i) * fragment.stride[0], w, width);
      }
      jpeg_write_scanlines(&info_, lines[0], step);
      return;
    }
    const uint8_t* const plane = kind_ == Kind::kLost ? fragment.lost : fragment.plane[0];
    const ptrdiff_t stride = kind_ == Kind::kLost ? fragment.missing_stride : fragment.stride[0];
    for (int i = 0; i < step; i++) {
      lines[0][i] = &rows_[static_cast<size_t>(i) * width];
      copy_row(lines[0][i], plane + row(i) * stride, w, width);
    }
    if (kind_ == Kind::kYCbCr)
      for (int c = 1; c < 3; c++)
        for (int i = 0; i < step / 2; i++) {
          lines[c][i] = &rows_[(static_cast<size_t>(step) + (c - 1) * step / 2 + i) * width];
          const int chroma_row = std::min(y / 2 + i, chroma_size(h) - 1);
          copy_chroma_row(lines[c][i], fragment.plane[c] + chroma_row * fragment.stride[c], chroma_size(w), width / 2);
        }
    JSAMPARRAY planes[3] = {lines[0], lines[1], lines[2]};
    jpeg_write_raw_data(&info_, planes, step);
  }

  void begin_output() {
    out_of_memory_ = false;
    destination_.next_output_byte = header_;
    destination_.free_in_buffer = kind_ == Kind::kLost ? kMissingHeader : kPixelHeader;
  }
  boolean grow_output() {
    const size_t used = out_->size(), room = std::max(kMinRoom, used / 2);
    try {
      out_->resize(used + room);
    } catch (const std::bad_alloc&) {
      out_of_memory_ = true;
    }
    if (out_of_memory_) info_.err->error_exit(reinterpret_cast<j_common_ptr>(&info_));
    destination_.next_output_byte = out_->data() + used;
    destination_.free_in_buffer = room;
    return TRUE;
  }

  const Kind kind_;
  Errors errors_;
  jpeg_compress_struct info_{};
  jpeg_destination_mgr destination_{};
  uint8_t header_[kPixelHeader];
  ByteBuffer* out_ = nullptr;
  bool out_of_memory_ = false;
  int quality_ = 0;
  ByteBuffer rows_;
};

FragmentEncoder::FragmentEncoder() = default;
FragmentEncoder::~FragmentEncoder() = default;
FragmentEncoder::FragmentEncoder(FragmentEncoder&&) noexcept = default;
FragmentEncoder& FragmentEncoder::operator=(FragmentEncoder&&) noexcept = default;

void FragmentEncoder::encode_pixels(const FragmentPlanes& fragment, int quality, ByteBuffer& out) {
  if (fragment.family == PixelFamily::kNone) throw Error("JPEG: the fragment has no pixel family");
  const bool rgb = fragment.family == PixelFamily::kRgb;
  auto& picture = rgb ? rgb_ : ycbcr_;
  if (!picture) picture = std::make_unique<Picture>(rgb ? Picture::Kind::kRgb : Picture::Kind::kYCbCr);
  picture->encode(fragment, quality, out);
}

void FragmentEncoder::encode_missing(const FragmentPlanes& fragment, int quality, ByteBuffer& out) {
  if (!fragment.lost) throw Error("JPEG: the fragment has no missing weight");
  if (!missing_) missing_ = std::make_unique<Picture>(Picture::Kind::kLost);
  missing_->encode(fragment, quality, out);
}

namespace {

// libjpeg has a fast path through the entropy-coded bytes, which needs this many bytes after every MCU (512 a block).
// Most fragments are shorter, so they decode faster if zeros follow the scan.
constexpr size_t kRoomBehind = 6 * 512;

// This offset misaligns RGB rows on purpose. libjpeg would write aligned rows with stores that bypass the caches,
// although the rows are read immediately. For small pictures, that takes up to four times as long.
constexpr size_t kUnaligned = 1;

// Writes the markers that are not transmitted, for a baseline scan. Component 1 has table 0. If there are further
// components, it has 2x2 samples per unit, and they have table 1.
size_t write_header(uint8_t* out, const CodedSize& size, int components) {
  const uint8_t* const begin = out;
  const auto put = [&out](std::initializer_list<int> bytes) {
    for (const int byte : bytes) *out++ = static_cast<uint8_t>(byte);
  };
  put({0xff, 0xd8});
  put({0xff, 0xc0, 0, 8 + 3 * components, 8, size.height >> 8, size.height, size.width >> 8, size.width, components});
  for (int c = 0; c < components; c++) put({c + 1, c == 0 && components > 1 ? 0x22 : 0x11, c > 0});
  put({0xff, 0xda, 0, 6 + 2 * components, components});
  for (int c = 0; c < components; c++) put({c + 1, c > 0 ? 0x11 : 0});
  put({0, 63, 0});
  return out - begin;
}

// The quantisation tables of each quality, computed by libjpeg on first use.
class Tables {
 public:
  Tables() {
    info_.err = errors_.install(false);
    if (setjmp(errors_.jump)) throw Error("JPEG: libjpeg can't be used");
    jpeg_create_compress(&info_);
  }
  ~Tables() { jpeg_destroy_compress(&info_); }
  Tables(const Tables&) = delete;

  // Returns the tables of luma (or missing weight) and chroma. Needs no setjmp(): libjpeg cannot fail for 1 to 100.
  std::array<JQUANT_TBL, 2>& of(int quality) {
    auto& tables = tables_[quality];
    if (!tables) {
      jpeg_set_quality(&info_, quality, TRUE);
      tables = std::make_unique<std::array<JQUANT_TBL, 2>>();
      for (int i = 0; i < 2; i++) (*tables)[i] = *info_.quant_tbl_ptrs[i];
    }
    return *tables;
  }

 private:
  Errors errors_;
  jpeg_compress_struct info_{};
  std::unique_ptr<std::array<JQUANT_TBL, 2>> tables_[101];
};

}  // namespace

// The state of libjpeg for the pixels or the missing weight, and the planes of the latest picture.
class FragmentDecoder::Picture {
 public:
  explicit Picture(bool lost) : components_(lost ? 1 : 3) {
    info_.err = errors_.install(true);
    if (setjmp(errors_.jump)) throw Error("JPEG: libjpeg can't be used");
    jpeg_create_decompress(&info_);
    info_.src = &source_;
  }
  ~Picture() { jpeg_destroy_decompress(&info_); }
  Picture(const Picture&) = delete;

  bool decode(std::span<const uint8_t> scan, int quality, const CodedSize& size, bool rgb) {
    if (quality < 1 || quality > 100 || size.width < 1 || size.height < 1) return false;
    if (size.width > JPEG_MAX_DIMENSION || size.height > JPEG_MAX_DIMENSION) return false;
    if (scan.size() < (components_ == 1 ? min_missing_scan(size) : min_pixel_scan(size))) return false;
    auto& tables = tables_.of(quality);
    info_.quant_tbl_ptrs[0] = &tables[0];
    info_.quant_tbl_ptrs[1] = &tables[1];

    const size_t header = components_ == 1 ? kMissingHeader : kPixelHeader;
    bytes_.resize(header + scan.size() + kEoi + kRoomBehind);
    write_header(bytes_.data(), size, components_);
    uint8_t* const end = bytes_.data() + header + scan.size();
    std::memcpy(bytes_.data() + header, scan.data(), scan.size());
    end[0] = 0xff;
    end[1] = 0xd9;
    std::memset(end + kEoi, 0, kRoomBehind);
    source_.next_input_byte = bytes_.data();
    source_.bytes_in_buffer = bytes_.size();

    const size_t area = static_cast<size_t>(size.width) * size.height;
    planes_.resize(rgb ? kUnaligned + 3 * area : components_ == 1 ? area : area + area / 2);
    size_ = size;
    // A whole scan is consumed to its last byte. Stop there, because the bytes after it are not a header.
    const bool whole = rgb ? decompress_rgb() : decompress_planes();
    const bool used_up = source_.next_input_byte >= end;
    jpeg_abort_decompress(&info_);
    return whole && used_up;
  }

  // Returns a row of the latest picture, which must be RGB.
  uint8_t* rgb_row(int y) { return planes_.data() + kUnaligned + static_cast<size_t>(y) * size_.width * 3; }
  // Returns a sample of the latest picture, which must not be RGB.
  uint8_t* plane(int c, int x, int y) {
    const size_t area = static_cast<size_t>(size_.width) * size_.height;
    uint8_t* const begin = planes_.data() + (c == 0 ? 0 : c == 1 ? area : area + area / 4);
    return begin + y * stride(c) + x;
  }
  ptrdiff_t stride(int c) const { return c == 0 ? size_.width : size_.width / 2; }

 private:
  // No object in this function may have a destructor, because longjmp() skips destructors.
  bool start(bool rgb) {
    jpeg_read_header(&info_, TRUE);
    info_.dct_method = JDCT_ISLOW;
    // Matches the encoder's averages over 2x2 pixels.
    info_.do_fancy_upsampling = FALSE;
    info_.raw_data_out = !rgb;
    return jpeg_start_decompress(&info_);
  }

  bool decompress_rgb() {
    if (setjmp(errors_.jump)) return false;
    if (!start(true)) return false;
    while (info_.output_scanline < info_.output_height) {
      JSAMPROW lines[kPixelUnit];
      const int left = static_cast<int>(info_.output_height - info_.output_scanline);
      for (int i = 0; i < kPixelUnit; i++) lines[i] = rgb_row(static_cast<int>(info_.output_scanline) + i);
      if (jpeg_read_scanlines(&info_, lines, std::min(left, kPixelUnit)) == 0) return false;
    }
    return true;
  }

  bool decompress_planes() {
    if (setjmp(errors_.jump)) return false;
    if (!start(false)) return false;
    const int step = components_ == 1 ? kMissingUnit : kPixelUnit;
    for (int y = 0; y < size_.height; y += step) {
      JSAMPROW lines[3][kPixelUnit];
      JSAMPARRAY planes[3] = {lines[0], lines[1], lines[2]};
      for (int c = 0; c < components_; c++)
        for (int i = 0; i < (c ? step / 2 : step); i++) lines[c][i] = plane(c, 0, (c ? y / 2 : y) + i);
      if (jpeg_read_raw_data(&info_, planes, step) == 0) return false;
      for (int c = 1; c < components_; c++) {  // rows of a plane are contiguous
        uint8_t* const chroma = lines[c][0];
        const int n = static_cast<int>(stride(c)) * step / 2;
        for (int i = 0; i < n; i++) chroma[i] ^= 0x80;  // the 128 offset
      }
    }
    return true;
  }

  const int components_;
  Errors errors_;
  jpeg_decompress_struct info_{};
  jpeg_source_mgr source_ = memory_source();
  Tables tables_;
  ByteBuffer bytes_, planes_;
  CodedSize size_;
};

FragmentDecoder::FragmentDecoder() = default;
FragmentDecoder::~FragmentDecoder() = default;
FragmentDecoder::FragmentDecoder(FragmentDecoder&&) noexcept = default;
FragmentDecoder& FragmentDecoder::operator=(FragmentDecoder&&) noexcept = default;

bool FragmentDecoder::decode_pixels(std::span<const uint8_t> scan, int quality, FragmentPlanes& fragment) {
  if (fragment.family == PixelFamily::kNone || fragment.rect.empty()) return false;
  const bool rgb = fragment.family == PixelFamily::kRgb;
  if (!pixels_) pixels_ = std::make_unique<Picture>(false);
  if (!pixels_->decode(scan, quality, coded_size(fragment.rect, kPixelUnit), rgb)) return false;
  for (int c = 0; c < (rgb ? 1 : 3); c++) {
    fragment.plane[c] = rgb ? pixels_->rgb_row(0) : pixels_->plane(c, 0, 0);
    fragment.stride[c] = rgb ? 3 * pixels_->stride(0) : pixels_->stride(c);
  }
  return true;
}

bool FragmentDecoder::decode_missing(std::span<const uint8_t> scan, int quality, FragmentPlanes& fragment) {
  if (fragment.rect.empty()) return false;
  if (!missing_) missing_ = std::make_unique<Picture>(true);
  if (!missing_->decode(scan, quality, coded_size(fragment.rect, kMissingUnit), false)) return false;
  fragment.lost = missing_->plane(0, 0, 0);
  fragment.missing_stride = missing_->stride(0);
  return true;
}

}  // namespace lf::jpeg
