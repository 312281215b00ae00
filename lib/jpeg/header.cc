// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/header.h"

#include <algorithm>
#include <cstring>

#include "base/text.h"
#include "jpeg/codec_errors.h"
#include "jpeg/idct.h"
#include "rig/rig.h"

namespace lf::jpeg {
namespace {

HuffmanSpec huffman_of(const JHUFF_TBL& table) {
  HuffmanSpec spec;
  std::copy_n(table.bits + 1, spec.counts.size(), spec.counts.begin());
  std::copy_n(table.huffval, spec.symbols.size(), spec.symbols.begin());
  return spec;
}

void set_huffman(const HuffmanSpec& spec, JHUFF_TBL& table) {
  std::copy(spec.counts.begin(), spec.counts.end(), table.bits + 1);
  std::copy(spec.symbols.begin(), spec.symbols.end(), table.huffval);
}

struct Standard {
  HuffmanSpec dc[2], ac[2];
};

// Returns the default tables of libjpeg's encoder. No object here may have a destructor, because longjmp() skips
// destructors.
Standard make_standard() {
  Errors errors;
  jpeg_compress_struct info{};
  info.err = errors.install(false);
  if (setjmp(errors.jump))
    throw Error("JPEG: libjpeg can't be used; is it the version that this program was built with?");
  jpeg_create_compress(&info);
  info.input_components = 3;
  info.in_color_space = JCS_YCbCr;
  jpeg_set_defaults(&info);
  Standard standard;
  for (int i = 0; i < 2; i++) {
    standard.dc[i] = huffman_of(*info.dc_huff_tbl_ptrs[i]);
    standard.ac[i] = huffman_of(*info.ac_huff_tbl_ptrs[i]);
  }
  jpeg_destroy_compress(&info);
  return standard;
}

const Standard& standard() {
  static const Standard tables = make_standard();
  return tables;
}

bool has_known_colours(const jpeg_decompress_struct& info) {
  switch (info.jpeg_color_space) {
    case JCS_GRAYSCALE:
    case JCS_YCbCr:
    case JCS_RGB:
    case JCS_CMYK:
    case JCS_YCCK: return true;
    default: return false;
  }
}

// Returns true if a libjpeg error means an unsupported kind of JPEG rather than damage.
bool is_unsupported(int code) {
  return code == JERR_BAD_PRECISION || code == JERR_SOF_UNSUPPORTED || code == JERR_ARITH_NOTIMPL ||
         code == JERR_COMPONENT_COUNT || code == JERR_CONVERSION_NOTIMPL;
}

// libjpeg's header reader, reused for all frames. It resets the tables for each frame, because libjpeg would keep the
// tables of earlier frames.
class Reader {
 public:
  Reader() {
    info_.err = errors_.install(false);
    if (setjmp(errors_.jump))
      throw Error("JPEG: libjpeg can't be used; is it the version that this program was built with?");
    jpeg_create_decompress(&info_);
    info_.src = &source_;
    for (int i = 0; i < 4; i++) {
      info_.quant_tbl_ptrs[i] = &quant_[i];
      info_.dc_huff_tbl_ptrs[i] = &dc_[i];
      info_.ac_huff_tbl_ptrs[i] = &ac_[i];
    }
  }
  ~Reader() { jpeg_destroy_decompress(&info_); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  // Returns null, or a text about the problem that is valid until the next call.
  const char* read(std::span<const uint8_t> frame, Header& h) {
    reset_tables();
    source_.next_input_byte = frame.data();
    source_.bytes_in_buffer = frame.size();
    unsupported_ = false;
    const char* const error = read_markers() ? take(h) : text_;
    h.scan = frame.size() - source_.bytes_in_buffer;
    jpeg_abort_decompress(&info_);
    return error;
  }

  // Returns true if read() refused the latest frame as unsupported. The frame may be intact.
  bool is_unsupported_kind() const { return unsupported_; }

 private:
  void reset_tables() {
    static const HuffmanSpec kNone;
    for (int i = 0; i < 4; i++) {
      std::memset(quant_[i].quantval, 0, sizeof quant_[i].quantval);
      set_huffman(i < 2 ? standard_dc(i) : kNone, dc_[i]);
      set_huffman(i < 2 ? standard_ac(i) : kNone, ac_[i]);
    }
  }

  // No object here may have a destructor, because longjmp() skips destructors.
  bool read_markers() {
    if (setjmp(errors_.jump)) {
      errors_.manager.format_message(reinterpret_cast<j_common_ptr>(&info_), text_);
      unsupported_ = is_unsupported(errors_.manager.msg_code);
      return false;
    }
    jpeg_read_header(&info_, TRUE);
    return true;
  }

  const char* take(Header& h);
  bool is_one_baseline_scan(const Header& h) const;

  Errors errors_;
  jpeg_decompress_struct info_{};
  jpeg_source_mgr source_ = memory_source();
  JQUANT_TBL quant_[4]{};
  JHUFF_TBL dc_[4]{}, ac_[4]{};
  char text_[JMSG_LENGTH_MAX] = "";
  bool unsupported_ = false;
};

const char* Reader::take(Header& h) {
  if (info_.image_width > kMaxImageSize || info_.image_height > kMaxImageSize) return "bad image size";
  unsupported_ = !has_known_colours(info_);
  if (unsupported_) return "only grey, YCbCr, RGB and CMYK are supported";
  h.width = static_cast<int>(info_.image_width);
  h.height = static_cast<int>(info_.image_height);
  h.components = std::min(info_.num_components, 3);
  h.restart_interval = static_cast<int>(info_.restart_interval);
  for (int i = 0; i < h.components; i++) {
    const jpeg_component_info& from = info_.comp_info[i];
    const bool only = h.components == 1;
    if (from.quant_tbl_no > 3) return "a table number is above 3";
    Component& c = h.component[i];
    c.id = static_cast<uint8_t>(from.component_id);
    c.h = static_cast<uint8_t>(only ? 1 : from.h_samp_factor);
    c.v = static_cast<uint8_t>(only ? 1 : from.v_samp_factor);
    c.quant = static_cast<uint8_t>(from.quant_tbl_no);
    h.h_max = std::max<int>(h.h_max, c.h);
    h.v_max = std::max<int>(h.v_max, c.v);
  }
  // Later scans may define the tables of further components.
  for (int i = 0; i < info_.comps_in_scan; i++) {
    const jpeg_component_info& from = *info_.cur_comp_info[i];
    if (from.dc_tbl_no > 3 || from.ac_tbl_no > 3) return "a table number is above 3";
    if (from.component_index >= h.components) continue;
    Component& c = h.component[from.component_index];
    c.dc = static_cast<uint8_t>(from.dc_tbl_no);
    c.ac = static_cast<uint8_t>(from.ac_tbl_no);
    // An undefined table has only zeros.
    const UINT16* const natural = quant_[c.quant].quantval;
    if (std::all_of(natural, natural + 64, [](UINT16 q) { return q == 0; })) return "a quantisation table is missing";
    for (int k = 0; k < 64; k++) h.quant[c.quant][k] = natural[kZigzag[k]];
  }
  for (int i = 0; i < 4; i++) {
    h.dc[i] = huffman_of(dc_[i]);
    h.ac[i] = huffman_of(ac_[i]);
  }
  h.one_baseline_scan = is_one_baseline_scan(h);
  return nullptr;
}

bool Reader::is_one_baseline_scan(const Header& h) const {
  if (info_.jpeg_color_space != JCS_YCbCr && info_.jpeg_color_space != JCS_GRAYSCALE) return false;
  if (info_.progressive_mode || info_.arith_code || info_.comps_in_scan != h.components) return false;
  for (int i = 0; i < h.components; i++)
    if (info_.cur_comp_info[i] != &info_.comp_info[i]) return false;
  // A full scan contains all coefficients with all bits.
  if (info_.Ss != 0 || info_.Se != 63 || info_.Ah != 0 || info_.Al != 0) return false;
  const Component &y = h.component[0], &cb = h.component[1], &cr = h.component[2];
  if (y.h != h.h_max || y.v != h.v_max || y.h > 2 || y.v > 2) return false;
  return h.components == 1 || (cb.h == cr.h && cb.v == cr.v && h.blocks_per_mcu() <= 10);
}

}  // namespace

const HuffmanSpec& standard_dc(int chroma) { return standard().dc[chroma]; }
const HuffmanSpec& standard_ac(int chroma) { return standard().ac[chroma]; }

int Header::blocks_per_mcu() const {
  int blocks = 0;
  for (int i = 0; i < components; i++) blocks += component[i].h * component[i].v;
  return blocks;
}

std::optional<Header> parse_header(std::span<const uint8_t> frame, std::string* reason, bool* unsupported) {
  thread_local Reader reader;
  std::optional<Header> header(std::in_place);
  const char* error = reader.read(frame, *header);
  if (!error) {
    // A block takes at least two bits, or one bit in a progressive scan of DC only.
    const int64_t blocks = int64_t{header->mcus_x()} * header->mcus_y() * header->blocks_per_mcu();
    const auto bits = static_cast<int64_t>(frame.size() - header->scan) * 8;
    if (bits < blocks * (header->one_baseline_scan ? 2 : 1)) error = "too few bytes for the image's size";
  }
  if (!error && !header->one_baseline_scan && header->width * header->height > kMaxWholePixels)
    error = "too large to be decoded as a whole";
  if (!error) return header;
  if (reason) *reason = error;
  if (unsupported) *unsupported = reader.is_unsupported_kind();
  return std::nullopt;
}

}  // namespace lf::jpeg
