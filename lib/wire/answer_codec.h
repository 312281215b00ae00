// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/memory.h"
#include "base/text.h"
#include "render/sum_planes.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf::wire {

// A node's answer to a request for a view: a single buffer, application/x-lightfield-answer, or several parts, each a
// separate unit; see spec.md.

struct AnswerHeader {
  uint32_t view_id = 0;
  uint32_t sequence = 0;
  int view_width = 0, view_height = 0;      // pixels
  PixelFamily family = PixelFamily::kNone;  // pixel family of all fragments; kNone: the node has no camera image yet
  uint64_t target_time = kNoTime;           // from the request, nanoseconds
  uint64_t actual_time = kNoTime;           // capture time of the frame farthest from the target, on the same clock
  uint64_t rig_hash = 0;
  uint32_t node = 0;
  bool last_of_node = true;  // the node sends nothing more for this request
  CameraRanges cameras;      // cameras that the answer covers, including those without contribution; empty: unknown
  CameraRanges blind;        // subset of `cameras` without a frame: a sum has missing weight for these cameras
  bool operator==(const AnswerHeader&) const = default;
};

// Returns the header of an answer to this request. `view_size`: width and height in pixels.
inline AnswerHeader answer_to(const RequestHeader& request, std::pair<int, int> view_size, uint64_t rig_hash) {
  return {.view_id = request.view_id,
          .sequence = request.sequence,
          .view_width = view_size.first,
          .view_height = view_size.second,
          .target_time = request.target_time,
          .rig_hash = rig_hash};
}

// The fragments of an answer in a unit: `count` of `total`, starting at number `first`.
struct AnswerPart {
  uint32_t first = 0, count = 0, total = 0;
  bool whole() const { return count == total; }
  bool operator==(const AnswerPart&) const = default;
};

struct AnswerPartHeader : AnswerHeader {
  AnswerPart part;
  bool operator==(const AnswerPartHeader&) const = default;
};

enum class Codec : uint8_t {
  kRaw = 0,    // 8 bits per value, as in Fragment
  kJpeg = 1,   // a scan without tables
  kRaw16 = 2,  // sums in 16 bits per value, as in SumPlanes
};

struct FragmentHeader {
  // The camera of the pixels; nullopt: part of the sum of the node's cameras.
  std::optional<CameraIndex> camera;
  PixelFamily family = PixelFamily::kNone;  // same as the answer's
  Rect rect;                                // inside the view, or inside the camera's image; kI420: x0, y0 even
  Codec codec = Codec::kRaw;
  uint8_t quality = 0;  // JPEG: 1 to 100, otherwise 0
  bool has_missing = false;
  bool operator==(const FragmentHeader&) const = default;
};

struct FragmentView : FragmentHeader {
  std::span<const uint8_t> payload;
};

struct AnswerView : AnswerPartHeader {
  std::vector<FragmentView> fragments;
};

// Payload layout: planes in sequence, rows without padding; see spec.md.
// 16-bit samples are little-endian on the wire, which avoids converting six megabytes per view.
static_assert(std::endian::native == std::endian::little, "sums in 16 bits are used where they lie");

inline size_t area(const Rect& rect) { return static_cast<size_t>(rect.width()) * rect.height(); }

inline size_t raw_size(const FragmentHeader& f) {
  const size_t values =
      packed_size(f.family, f.rect.width(), f.rect.height()) + (f.has_missing ? area(f.rect) : size_t{0});
  return f.codec == Codec::kRaw16 ? 2 * values : values;
}

// Returns the planes of a kRaw payload of raw_size() bytes.
inline FragmentPlanes raw_planes(const FragmentHeader& f, const uint8_t* payload) {
  const size_t pixels = packed_size(f.family, f.rect.width(), f.rect.height());
  return packed_planes(f.family, f.rect, payload, f.has_missing ? payload + pixels : nullptr);
}

// Returns the planes of a kRaw16 payload of raw_size() bytes at an even address. Byte is uint8_t or const uint8_t.
template <typename Byte>
auto raw16_planes(const FragmentHeader& f, Byte* payload) {
  constexpr bool kConst = std::is_const_v<Byte>;
  using Sample = std::conditional_t<kConst, const int16_t, int16_t>;
  using Weight = std::conditional_t<kConst, const uint16_t, uint16_t>;
  Sample* const samples = reinterpret_cast<Sample*>(payload);
  const size_t pixels = packed_size(f.family, f.rect.width(), f.rect.height());
  return packed_sums(f.family, f.rect, samples, f.has_missing ? reinterpret_cast<Weight*>(samples + pixels) : nullptr);
}

// Copies `height` rows of `width` bytes; rows in `to` have no padding. Returns the end of the output.
inline uint8_t* copy_rows(const uint8_t* from, ptrdiff_t stride, size_t width, int height, uint8_t* to) {
  for (int y = 0; y < height; y++, to += width) std::memcpy(to, from + y * stride, width);
  return to;
}

// Splits a JPEG payload: the scan of the pixels, or with missing weight the scan's length (4 bytes), the scan and the
// scan of the missing weight. Returns nullopt if the length is invalid.
struct Scans {
  std::span<const uint8_t> pixels, lost;
};
std::optional<Scans> split_scans(std::span<const uint8_t> payload, bool has_missing);

inline constexpr uint16_t kLastOfNode = 1;  // unit flag
inline constexpr size_t kAnswerHeaderBytes = 72, kRangeBytes = 4, kFragmentBytes = 20;
inline constexpr uint16_t kWeighted = 1, kMissingPlane = 2;  // fragment flags
inline constexpr uint16_t kSumOnWire = 0xffff;               // value of the field `camera` for a sum

// Throw Error with the invalid field.
void check_header(const AnswerHeader& answer, size_t fragments);
void check_part(const AnswerPart& part);
void check_fragment(const AnswerHeader& answer, const FragmentHeader& fragment);

inline size_t table_offset(const AnswerHeader& answer) {
  return kAnswerHeaderBytes + kRangeBytes * (answer.cameras.ranges().size() + answer.blind.ranges().size());
}

// Calls f() and prefixes the text of an Error with "fragments[3].".
template <typename F>
auto in_fragment(size_t index, F f) {
  try {
    return f();
  } catch (const Error& error) {
    throw Error("fragments[" + std::to_string(index) + "]." + error.what());
  }
}

// Tracks the received fragments of an answer; parts may arrive in any order. Memory grows with the number of parts.
class AnswerParts {
 public:
  // Returns false and changes nothing if the part repeats fragments or contradicts earlier parts.
  bool add(const AnswerPart& part);
  bool complete() const { return any_ && received_ == total_; }
  void clear() { *this = {}; }

 private:
  bool any_ = false;
  uint32_t total_ = 0, received_ = 0;
  std::map<uint32_t, uint32_t> parts_;  // first to first + count
};

// Parses an answer without copying; payloads point into `bytes`. Checks everything except JPEG contents: rectangles
// inside the view, raw payloads of the exact size, JPEG payloads that are long enough for their image size. Stateless;
// allocates only the fragment table. Returns nullopt unless `bytes` is exactly one valid answer; `reason` (may be null)
// then receives the invalid field.

// Nothing for bytes that are not exactly one valid answer; `reason` (may be null) then says why, naming the field.
std::optional<AnswerView> parse_answer(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// Parses only the fields before the fragment table, with the same checks. Fast. `bytes` may end anywhere after these
// fields.
std::optional<AnswerPartHeader> parse_answer_header(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// Returns the view id of any unit in an answer stream, or nullopt unless `bytes` starts such a unit of this version.
// Does not check the rest.
std::optional<uint32_t> peek_answer_view(std::span<const uint8_t> bytes);

// Returns the width and height, in pixels, of the view of a fragments unit. Returns nullopt for other units, and unless
// `bytes` starts a unit of this version.
std::optional<std::pair<int, int>> peek_answer_size(std::span<const uint8_t> bytes);

// Writes an answer into one buffer; fragments are rendered or encoded in place.
//
//   AnswerWriter writer(header, 2, std::move(recycled));
//   renderer.render(..., writer.add_sums(sum_header));                                     // size known in advance
//   writer.add(jpeg_header, [&](ByteBuffer& out) { encoder.encode_pixels(..., out); });  // size known afterwards
//   ByteBuffer bytes = writer.finish();
//
// All functions throw Error with the invalid field if parse_answer() would reject the result. The writer must not be
// used after an error. Not thread-safe.
class AnswerWriter {
 public:
  // Reserves table space for `max_fragments`; with fewer fragments, finish() must move the payloads. `memory`: its
  // content is discarded and its capacity reused.
  AnswerWriter(const AnswerHeader& header, size_t max_fragments, ByteBuffer memory = {});

  void reserve_payloads(size_t bytes);

  // kRaw and kRaw16: returns uninitialised memory for the payload (layout: see above), valid until the next call.
  // 16-bit payloads must start at an even offset: add them before the other codecs.
  std::span<uint8_t> add(const FragmentHeader& fragment);
  // Like add() for kRaw16, but returns the memory as planes, valid until the reserved space is exceeded.
  SumPlanes add_sums(const FragmentHeader& fragment);

  // Removes missing-weight planes that turned out to be empty: those of each fragment with `is_nothing`(fragment
  // number). All fragments added so far must be kRaw16. Invalidates planes returned before.
  void drop_missing(const std::function<bool(size_t)>& is_nothing);

  // Any codec: `append(ByteBuffer&)` appends the payload and must not change existing content.
  template <typename Append>
  void add(const FragmentHeader& fragment, Append append) {
    const size_t begin = begin_payload(fragment);
    append(bytes_);
    end_payload(fragment, begin);
  }

  // Makes the unit a part of an answer with `total` fragments, starting at number `first`. Default: the whole answer.
  void set_part(uint32_t first, uint32_t total);

  size_t fragments() const { return fragments_; }
  // Returns the unit and leaves the writer empty.
  ByteBuffer finish();

 private:
  size_t begin_payload(const FragmentHeader& fragment);
  void end_payload(const FragmentHeader& fragment, size_t begin);
  void put_entry(const FragmentHeader& fragment, size_t length);

  AnswerHeader header_;
  size_t table_;
  std::optional<AnswerPart> part_;  // set by set_part(); its count is not used
  size_t max_fragments_, fragments_ = 0;
  std::vector<std::pair<FragmentHeader, size_t>> added_;
  ByteBuffer bytes_;
};

}  // namespace lf::wire
