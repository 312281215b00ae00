// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/fragment_encoder.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <string>

#include "base/error.h"
#include "jpeg/coded_size.h"
#include "jpeg/scan.h"

namespace lf::jpeg {
namespace {

constexpr size_t kLeastRoom = 4096;  // bytes that the output grows by

// A row of samples, its last one repeated up to the picture's edge: what the decoder throws away costs fewest bits so.
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

// libjpeg's state for one kind of picture.
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
  int unit() const { return kind_ == Kind::kLost ? kLostUnit : kPixelUnit; }
  std::string message() {
    char text[JMSG_LENGTH_MAX];
    errors_.manager.format_message(reinterpret_cast<j_common_ptr>(&info_), text);
    return text;
  }

  // Nothing in here has a destructor that a jump would pass over.
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

  // One row of units, from row y of the fragment on.
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
    const ptrdiff_t stride = kind_ == Kind::kLost ? fragment.lost_stride : fragment.stride[0];
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

  // The header goes nowhere.
  void begin_output() {
    out_of_memory_ = false;
    destination_.next_output_byte = header_;
    destination_.free_in_buffer = kind_ == Kind::kLost ? kLostHeader : kPixelHeader;
  }
  // Called when all room is used up.
  boolean grow_output() {
    const size_t used = out_->size(), room = std::max(kLeastRoom, used / 2);
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
  int quality_ = 0;  // that the tables are for
  ByteBuffer rows_;  // one row of units
};

FragmentEncoder::FragmentEncoder() = default;
FragmentEncoder::~FragmentEncoder() = default;
FragmentEncoder::FragmentEncoder(FragmentEncoder&&) noexcept = default;
FragmentEncoder& FragmentEncoder::operator=(FragmentEncoder&&) noexcept = default;

void FragmentEncoder::encode_pixels(const FragmentPlanes& fragment, int quality, ByteBuffer& out) {
  if (fragment.family == PixelFamily::kNone) throw Error("JPEG: a fragment of no family");
  const bool rgb = fragment.family == PixelFamily::kRgb;
  auto& picture = rgb ? rgb_ : ycbcr_;
  if (!picture) picture = std::make_unique<Picture>(rgb ? Picture::Kind::kRgb : Picture::Kind::kYCbCr);
  picture->encode(fragment, quality, out);
}

void FragmentEncoder::encode_lost(const FragmentPlanes& fragment, int quality, ByteBuffer& out) {
  if (!fragment.lost) throw Error("JPEG: a fragment without lost weight");
  if (!lost_) lost_ = std::make_unique<Picture>(Picture::Kind::kLost);
  lost_->encode(fragment, quality, out);
}

}  // namespace lf::jpeg
