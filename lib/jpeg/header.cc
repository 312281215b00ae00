// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/header.h"

#include <algorithm>
#include <cstring>

#include "rig/rig.h"

namespace lf::jpeg {
namespace {

enum Marker : uint8_t {
  kSof0 = 0xc0,
  kSof1 = 0xc1,
  kSof2 = 0xc2,
  kDht = 0xc4,
  kSof9 = 0xc9,
  kSof10 = 0xca,
  kJpg = 0xc8,
  kDac = 0xcc,
  kSof15 = 0xcf,
  kSoi = 0xd8,
  kEoi = 0xd9,
  kSos = 0xda,
  kDqt = 0xdb,
  kDri = 0xdd,
  kApp0 = 0xe0,
  kApp14 = 0xee,
};

// The payload of one marker segment. Reading past its end gives zeros and is remembered.
class Segment {
 public:
  explicit Segment(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  size_t left() const { return bytes_.size() - at_; }
  bool whole() const { return whole_; }
  uint8_t u8() {
    if (left() < 1) {
      whole_ = false;
      return 0;
    }
    return bytes_[at_++];
  }
  uint16_t u16() {
    const int high = u8();
    return static_cast<uint16_t>(high << 8 | u8());
  }
  bool starts_with(const char* text, size_t size) const {
    return bytes_.size() >= size && std::memcmp(bytes_.data(), text, size) == 0;
  }
  uint8_t peek(size_t i) const { return i < bytes_.size() ? bytes_[i] : 0; }

 private:
  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
  bool whole_ = true;
};

class Parser {
 public:
  explicit Parser(std::span<const uint8_t> frame) : frame_(frame) {}

  // Nullptr, or what is wrong.
  const char* parse(Header& h);

 private:
  const char* quantisation(Header& h, Segment s);
  const char* huffman(Header& h, Segment s);
  const char* frame_header(Header& h, uint8_t marker, Segment s);
  const char* scan_header(Header& h, Segment s);
  const char* check_colour(const Header& h) const;

  std::span<const uint8_t> frame_;
  bool quant_defined_[4] = {};
  bool sequential_ = false, jfif_ = false, adobe_ = false;
  uint8_t adobe_transform_ = 0;
};

const char* Parser::quantisation(Header& h, Segment s) {
  while (s.left() > 0) {
    const int precision_and_id = s.u8(), id = precision_and_id & 15;
    if (id > 3 || precision_and_id > 0x1f) return "bad DQT segment";
    for (uint16_t& q : h.quant[id]) q = precision_and_id & 0x10 ? s.u16() : s.u8();
    quant_defined_[id] = true;
  }
  return s.whole() ? nullptr : "short DQT segment";
}

const char* Parser::huffman(Header& h, Segment s) {
  while (s.left() > 0) {
    const int class_and_id = s.u8(), id = class_and_id & 15;
    if (id > 3 || class_and_id > 0x1f) return "bad DHT segment";
    HuffmanSpec& spec = class_and_id & 0x10 ? h.ac[id] : h.dc[id];
    spec = {};
    int total = 0;
    for (uint8_t& count : spec.counts) total += count = s.u8();
    if (total > 256) return "bad DHT segment";
    for (int i = 0; i < total; i++) spec.symbols[i] = s.u8();
  }
  return s.whole() ? nullptr : "short DHT segment";
}

const char* Parser::frame_header(Header& h, uint8_t marker, Segment s) {
  if (h.components != 0) return "more than one frame header";
  if (marker != kSof0 && marker != kSof1 && marker != kSof2 && marker != kSof9 && marker != kSof10)
    return "lossless and hierarchical JPEG are not supported";
  sequential_ = marker == kSof0 || marker == kSof1;
  if (s.u8() != 8) return "only 8 bits a sample are supported";
  h.height = s.u16();
  h.width = s.u16();
  h.components = s.u8();
  if (h.components != 1 && h.components != 3) return "only grey and YCbCr are supported";
  if (h.width < 1 || h.height < 1 || h.width > kMaxImageSize || h.height > kMaxImageSize) return "bad image size";
  for (int i = 0; i < h.components; i++) {
    Component& c = h.component[i];
    c.id = s.u8();
    const int factors = s.u8();
    c.h = static_cast<uint8_t>(factors >> 4);
    c.v = factors & 15;
    c.quant = s.u8();
    if (c.h < 1 || c.v < 1 || c.h > 4 || c.v > 4 || c.quant > 3) return "bad frame header";
    if (h.components == 1) c.h = c.v = 1;
    h.h_max = std::max<int>(h.h_max, c.h);
    h.v_max = std::max<int>(h.v_max, c.v);
  }
  return s.whole() ? nullptr : "short frame header";
}

const char* Parser::scan_header(Header& h, Segment s) {
  if (h.components == 0) return "a scan before the frame header";
  const int components = s.u8();
  bool regions = sequential_ && components == h.components;
  for (int i = 0; i < components; i++) {
    const uint8_t id = s.u8(), tables = s.u8();
    if (i >= h.components) continue;
    Component& c = h.component[i];
    regions &= id == c.id;
    c.dc = tables >> 4;
    c.ac = tables & 15;
    if (c.dc > 3 || c.ac > 3) return "bad scan header";
    if (!quant_defined_[c.quant]) return "a quantisation table is missing";
  }
  regions &= s.u8() == 0;   // from the DC coefficient
  regions &= s.u8() == 63;  // to the last
  regions &= s.u8() == 0;   // all bits of them
  if (!s.whole()) return "short scan header";
  const Component &y = h.component[0], &cb = h.component[1], &cr = h.component[2];
  regions &= y.h == h.h_max && y.v == h.v_max && y.h <= 2 && y.v <= 2;
  regions &= h.components == 1 || (cb.h == cr.h && cb.v == cr.v && h.blocks_per_mcu() <= 10);
  h.one_baseline_scan = regions;
  return nullptr;
}

// The rules by which libjpeg tells RGB from YCbCr.
const char* Parser::check_colour(const Header& h) const {
  if (h.components == 1 || jfif_) return nullptr;
  const bool rgb =
      adobe_ ? adobe_transform_ == 0 : h.component[0].id == 'R' && h.component[1].id == 'G' && h.component[2].id == 'B';
  return rgb ? "RGB inside of JPEG is not supported" : nullptr;
}

const char* Parser::parse(Header& h) {
  if (frame_.size() < 4 || frame_[0] != 0xff || frame_[1] != kSoi) return "no JPEG";
  for (int i = 0; i < 2; i++) {
    h.dc[i] = standard_dc(i);
    h.ac[i] = standard_ac(i);
  }
  size_t at = 2;
  for (;;) {
    if (at >= frame_.size()) return "it ends before the image data";
    if (frame_[at] != 0xff) return "no marker where one has to be";
    while (at < frame_.size() && frame_[at] == 0xff) at++;  // fill bytes
    if (frame_.size() - at < 3) return "it ends before the image data";
    const uint8_t marker = frame_[at++];
    if (marker == kEoi || marker < kSof0 || (marker >= 0xd0 && marker <= kSoi)) return "no marker where one has to be";
    const size_t size = static_cast<size_t>(frame_[at]) << 8 | frame_[at + 1];
    if (size < 2 || size > frame_.size() - at) return "it ends inside of a header";
    const Segment segment(frame_.subspan(at + 2, size - 2));
    at += size;

    const char* error = nullptr;
    if (marker == kDqt) {
      error = quantisation(h, segment);
    } else if (marker == kDht) {
      error = huffman(h, segment);
    } else if (marker == kDri) {
      Segment s = segment;
      h.restart_interval = s.u16();
      if (!s.whole()) error = "short DRI segment";
    } else if (marker == kApp0) {
      jfif_ |= segment.starts_with("JFIF", 5);
    } else if (marker == kApp14 && segment.starts_with("Adobe", 5)) {
      adobe_ = true;
      adobe_transform_ = segment.peek(11);
    } else if (marker == kSos) {
      error = scan_header(h, segment);
      if (!error) error = check_colour(h);
      h.scan = at;
      return error;
    } else if (marker >= kSof0 && marker <= kSof15 && marker != kDac && marker != kJpg) {
      error = frame_header(h, marker, segment);
    }
    if (error) return error;
  }
}

}  // namespace

int Header::blocks_per_mcu() const {
  int blocks = 0;
  for (int i = 0; i < components; i++) blocks += component[i].h * component[i].v;
  return blocks;
}

std::optional<Header> parse_header(std::span<const uint8_t> frame, std::string* reason) {
  std::optional<Header> header(std::in_place);
  const char* error = Parser(frame).parse(*header);
  if (!error) {
    // A coefficient block takes two bits at least, one where a progressive scan has only its DC.
    const int64_t blocks = int64_t{header->mcus_x()} * header->mcus_y() * header->blocks_per_mcu();
    const auto bits = static_cast<int64_t>(frame.size() - header->scan) * 8;
    if (bits < blocks * (header->one_baseline_scan ? 2 : 1)) error = "too few bytes for the image's size";
  }
  if (!error && !header->one_baseline_scan && header->width * header->height > kMaxWholePixels)
    error = "too large for a frame that has to be decoded as a whole";
  if (!error) return header;
  if (reason) *reason = error;
  return std::nullopt;
}

}  // namespace lf::jpeg
