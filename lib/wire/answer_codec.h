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

// An answer is the reply of a node (a process with some of the cameras) to a request for a view. An answer consists of
// fragments: rectangles of the view with the pixels that the node's cameras contribute. It is sent as a single unit
// (message) of type application/x-lightfield-answer, or as several parts in separate units. spec.md describes the
// bytes.

// The fields before the fragments of an answer: the request that it answers, and the cameras that it covers.
struct AnswerHeader {
  uint32_t view_id = 0;
  uint32_t sequence = 0;
  int view_width = 0, view_height = 0;
  PixelFamily family = PixelFamily::kNone;  // family of all fragments; kNone if the node has no camera image yet
  uint64_t target_time = kNoTime;           // copied from the request, nanoseconds
  // Capture time of the frame that is farthest from target_time, on the same clock.
  uint64_t actual_time = kNoTime;
  uint64_t rig_hash = 0;
  uint32_t node = 0;
  bool last_of_node = true;  // the node sends no further answer to this request
  CameraRanges cameras;      // cameras that the answer covers, even if they contribute no pixels; empty: unknown
  CameraRanges blind;        // subset of `cameras` that have no frame, so that their weight is missing from the pixels
  bool operator==(const AnswerHeader&) const = default;
};

// Returns the header of an answer to this request. `view_size` is the width and height in pixels.
inline AnswerHeader answer_to(const RequestHeader& request, std::pair<int, int> view_size, uint64_t rig_hash) {
  return {.view_id = request.view_id,
          .sequence = request.sequence,
          .view_width = view_size.first,
          .view_height = view_size.second,
          .target_time = request.target_time,
          .rig_hash = rig_hash};
}

// The fragments that one unit of an answer contains: `count` fragments, starting at number `first`. The whole answer
// has `total` fragments. For example, {10, 5, 32} means fragments 10 to 14 of 32.
struct AnswerPart {
  uint32_t first = 0, count = 0, total = 0;
  bool whole() const { return count == total; }
  bool operator==(const AnswerPart&) const = default;
};

// The header of one unit of an answer, which is sent in one or several parts.
struct AnswerPartHeader : AnswerHeader {
  AnswerPart part;
  bool operator==(const AnswerPartHeader&) const = default;
};

enum class Codec : uint8_t {
  kRaw = 0,    // 8 bits per value; the planes of a Fragment (image/image.h) in sequence
  kJpeg = 1,   // the entropy-coded scan of a JPEG image, without its tables; see jpeg/fragment_codec.h
  kRaw16 = 2,  // 16 bits per value, before rounding; the planes of SumPlanes in sequence
};

// Describes the payload of one fragment: its position, and how its pixels are encoded.
struct FragmentHeader {
  // The only camera that contributes to the pixels, or nullopt if the pixels are the weighted sum of the node's
  // cameras.
  std::optional<CameraIndex> camera;
  PixelFamily family = PixelFamily::kNone;
  // Position of the pixels, in the view if they are a sum, and otherwise in the image of `camera`. x0 and y0 are even
  // in kI420.
  Rect rect;
  Codec codec = Codec::kRaw;
  uint8_t quality = 0;  // JPEG quality, 1 to 100; otherwise 0
  // The payload also has the missing weight of each pixel; see split_scans().
  bool has_missing = false;
  bool operator==(const FragmentHeader&) const = default;
};

// A fragment of a parsed answer. The payload points into the bytes of the answer.
struct FragmentView : FragmentHeader {
  std::span<const uint8_t> payload;
};

struct AnswerView : AnswerPartHeader {
  std::vector<FragmentView> fragments;
};

// A payload contains its planes in sequence, with no padding between rows; see spec.md.
static_assert(std::endian::native == std::endian::little, "sums in 16 bits are used where they lie");

inline size_t area(const Rect& rect) { return static_cast<size_t>(rect.width()) * rect.height(); }

inline size_t raw_size(const FragmentHeader& f) {
  const size_t values =
      packed_size(f.family, f.rect.width(), f.rect.height()) + (f.has_missing ? area(f.rect) : size_t{0});
  return f.codec == Codec::kRaw16 ? 2 * values : values;
}

inline FragmentPlanes raw_planes(const FragmentHeader& f, const uint8_t* payload) {
  const size_t pixels = packed_size(f.family, f.rect.width(), f.rect.height());
  return packed_planes(f.family, f.rect, payload, f.has_missing ? payload + pixels : nullptr);
}

// The payload must be at an even address. `Byte` is uint8_t or const uint8_t.
template <typename Byte>
auto raw16_planes(const FragmentHeader& f, Byte* payload) {
  constexpr bool kConst = std::is_const_v<Byte>;
  using Sample = std::conditional_t<kConst, const int16_t, int16_t>;
  using Weight = std::conditional_t<kConst, const uint16_t, uint16_t>;
  Sample* const samples = reinterpret_cast<Sample*>(payload);
  const size_t pixels = packed_size(f.family, f.rect.width(), f.rect.height());
  return packed_sums(f.family, f.rect, samples, f.has_missing ? reinterpret_cast<Weight*>(samples + pixels) : nullptr);
}

// Copies `height` rows of `width` bytes and removes their padding. Returns the end of the output.
inline uint8_t* copy_rows(const uint8_t* from, ptrdiff_t stride, size_t width, int height, uint8_t* to) {
  for (int y = 0; y < height; y++, to += width) std::memcpy(to, from + y * stride, width);
  return to;
}

// Splits the payload of a JPEG fragment into the scan of the pixels and the scan of the missing weight (the share of
// each pixel that no camera could provide). Without missing weight, the payload is one scan. Otherwise the length of
// the pixels' scan precedes both scans, in 4 bytes. Returns nullopt if the length is invalid.
struct Scans {
  std::span<const uint8_t> pixels, lost;
};
std::optional<Scans> split_scans(std::span<const uint8_t> payload, bool has_missing);

inline constexpr uint16_t kLastOfNode = 1;
inline constexpr size_t kAnswerHeaderBytes = 72, kRangeBytes = 4, kFragmentBytes = 20;
inline constexpr uint16_t kWeighted = 1, kMissingPlane = 2;
inline constexpr uint16_t kSumOnWire = 0xffff;  // the value of the field `camera` if the fragment is a sum

// These functions throw Error with the name of the invalid field.
void check_header(const AnswerHeader& answer, size_t fragments);
void check_part(const AnswerPart& part);
void check_fragment(const AnswerHeader& answer, const FragmentHeader& fragment);

inline size_t table_offset(const AnswerHeader& answer) {
  return kAnswerHeaderBytes + kRangeBytes * (answer.cameras.ranges().size() + answer.blind.ranges().size());
}

// Calls f(). If f() throws an Error, the error's text gets a prefix that names the invalid fragment, such as
// "fragments[3].".
template <typename F>
auto in_fragment(size_t index, F f) {
  try {
    return f();
  } catch (const Error& error) {
    throw Error("fragments[" + std::to_string(index) + "]." + error.what());
  }
}

// Finds out when an answer that is sent in several parts is complete. Parts may arrive in any order and repeatedly.
// Memory grows with the number of parts.
class AnswerParts {
 public:
  // Records an arrived part. Returns false and ignores the part if it repeats fragments or contradicts earlier parts.
  bool add(const AnswerPart& part);
  bool complete() const { return any_ && received_ == total_; }
  void clear() { *this = {}; }

 private:
  bool any_ = false;
  uint32_t total_ = 0, received_ = 0;
  std::map<uint32_t, uint32_t> parts_;  // key: first fragment; value: end of the part
};

// Parses an answer without copying, so payloads point into `bytes`. Checks everything except the contents of JPEG
// scans: rectangles must be inside the view, raw payloads must have their exact size, and scans must be long enough for
// their image size.

// Returns nullopt unless `bytes` is exactly one valid answer. `reason`, unless null, then receives a text that names
// the invalid field.
std::optional<AnswerView> parse_answer(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// Parses only the fields before the fragment table, which is fast. The checks are the same. `bytes` may end anywhere
// after these fields.
std::optional<AnswerPartHeader> parse_answer_header(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// Returns the view id of any unit in an answer stream without checking the rest. Returns nullopt unless `bytes` starts
// such a unit of this version.
std::optional<uint32_t> peek_answer_view(std::span<const uint8_t> bytes);

// Returns the width and height of the view in pixels, if `bytes` starts a unit with fragments of this version.
// Otherwise returns nullopt.
std::optional<std::pair<int, int>> peek_answer_size(std::span<const uint8_t> bytes);

// Writes an answer into one buffer. Fragments are rendered or encoded directly in the buffer, so nothing is copied.
//
//   AnswerWriter writer(header, 2, std::move(recycled));
//   renderer.render(..., writer.add_sums(sum_header));                                     // size known in advance
//   writer.add(jpeg_header, [&](ByteBuffer& out) { encoder.encode_pixels(..., out); });  // size known afterwards
//   ByteBuffer bytes = writer.finish();
//
// All functions throw Error with the invalid field if parse_answer() would reject the result. A writer cannot be used
// after an error. Not thread-safe.
class AnswerWriter {
 public:
  // Reserves space for the table of `max_fragments` fragments. If there are fewer fragments, finish() must move the
  // payloads. The capacity of `memory` is reused and its content is discarded.
  AnswerWriter(const AnswerHeader& header, size_t max_fragments, ByteBuffer memory = {});

  // Allocates memory for this many bytes of payloads, so that the planes of add_sums() stay valid while fragments are
  // added.
  void reserve_payloads(size_t bytes);

  // Adds a fragment with codec kRaw or kRaw16. Returns uninitialised memory for its payload, valid until the next call.
  // A kRaw16 payload must start at an even offset, so add these fragments before fragments with other codecs.
  std::span<uint8_t> add(const FragmentHeader& fragment);
  // Adds a fragment with codec kRaw16 and returns its planes. They are valid until the reserved space is exceeded.
  SumPlanes add_sums(const FragmentHeader& fragment);

  // Removes planes of missing weight that turned out to be all zero, to save bandwidth. `is_nothing` gets a fragment
  // number and returns true if the fragment's plane is unnecessary. All fragments must be kRaw16. Planes returned
  // earlier become invalid.
  void drop_missing(const std::function<bool(size_t)>& is_nothing);

  // Adds a fragment with any codec. `append(ByteBuffer&)` must append the payload without changing earlier bytes.
  template <typename Append>
  void add(const FragmentHeader& fragment, Append append) {
    const size_t begin = begin_payload(fragment);
    append(bytes_);
    end_payload(fragment, begin);
  }

  // Turns the unit into a part of an answer with `total` fragments. The unit's fragments have the numbers from `first`.
  // Without this call, the unit is the whole answer.
  void set_part(uint32_t first, uint32_t total);

  size_t fragments() const { return fragments_; }
  ByteBuffer finish();

 private:
  size_t begin_payload(const FragmentHeader& fragment);
  void end_payload(const FragmentHeader& fragment, size_t begin);
  void put_entry(const FragmentHeader& fragment, size_t length);

  AnswerHeader header_;
  size_t table_;
  std::optional<AnswerPart> part_;  // set by set_part(); its count is unused
  size_t max_fragments_, fragments_ = 0;
  std::vector<std::pair<FragmentHeader, size_t>> added_;
  ByteBuffer bytes_;
};

}  // namespace lf::wire
