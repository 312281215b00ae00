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

// What one node has to give for one request of one view: one buffer, application/x-lightfield-answer, or several parts
// of it, each a unit of its own; see spec.md.

struct AnswerHeader {
  uint32_t view_id = 0;
  uint32_t sequence = 0;
  int view_width = 0, view_height = 0;      // pixels
  PixelFamily family = PixelFamily::kNone;  // the family of all fragments; kNone: the node has no camera image yet
  uint64_t target_time = kNoTime;           // the request's, nanoseconds
  uint64_t actual_time = kNoTime;           // capture time of the frame farthest from the target; same clock
  uint64_t rig_hash = 0;
  uint32_t node = 0;
  bool last_of_node = true;  // nothing more comes from this node for this request
  CameraRanges cameras;  // cameras whose contributions to the view are in the answer, or are nothing; empty: not told
  CameraRanges blind;    // those of `cameras` that have no picture: in a sum, lost weight stands in its place
  bool operator==(const AnswerHeader&) const = default;
};

// The beginning of an answer to this request, for a view of this width and height, of this rig.
inline AnswerHeader answer_to(const RequestHeader& request, std::pair<int, int> view_size, uint64_t rig_hash) {
  return {.view_id = request.view_id,
          .sequence = request.sequence,
          .view_width = view_size.first,
          .view_height = view_size.second,
          .target_time = request.target_time,
          .rig_hash = rig_hash};
}

// The part of an answer that is in a unit: `count` of its `total` fragments, from number `first` on.
struct AnswerPart {
  uint32_t first = 0, count = 0, total = 0;
  bool whole() const { return count == total; }
  bool operator==(const AnswerPart&) const = default;
};

// All that a unit says in front of its fragments.
struct AnswerPartHeader : AnswerHeader {
  AnswerPart part;
  bool operator==(const AnswerPartHeader&) const = default;
};

enum class Codec : uint8_t {
  kRaw = 0,    // 8 bits, as in Fragment
  kJpeg = 1,   // a scan without tables
  kRaw16 = 2,  // sums in 16 bits, as in SumPlanes
};

// An entry of the fragment table.
struct FragmentHeader {
  // The camera whose pixels these are; nothing: part of the sum of the node's cameras.
  std::optional<CameraIndex> camera;
  PixelFamily family = PixelFamily::kNone;  // the same as the answer's
  Rect rect;                                // inside the view, or the camera's image; kI420: x0, y0 even
  Codec codec = Codec::kRaw;
  uint8_t quality = 0;    // 1 to 100 of JPEG, else 0
  bool has_lost = false;  // a plane of lost weight follows the pixels
  bool operator==(const FragmentHeader&) const = default;
};

// A fragment with its payload, which refers to the bytes of the answer.
struct FragmentView : FragmentHeader {
  std::span<const uint8_t> payload;
};

struct AnswerView : AnswerPartHeader {
  std::vector<FragmentView> fragments;
};

// What lies where in a fragment's payload: planes one after the other, rows without padding; see spec.md.

// 16-bit samples are little-endian on the wire, because that is what they are in memory and nobody wants to touch six
// megabytes a view to change it.
static_assert(std::endian::native == std::endian::little, "sums in 16 bits are used where they lie");

inline size_t area(const Rect& rect) { return static_cast<size_t>(rect.width()) * rect.height(); }

// Bytes of a payload of kRaw or kRaw16.
inline size_t raw_size(const FragmentHeader& f) {
  const size_t values =
      packed_size(f.family, f.rect.width(), f.rect.height()) + (f.has_lost ? area(f.rect) : size_t{0});
  return f.codec == Codec::kRaw16 ? 2 * values : values;
}

// The planes of a kRaw payload, which has raw_size() bytes.
inline FragmentPlanes raw_planes(const FragmentHeader& f, const uint8_t* payload) {
  const size_t pixels = packed_size(f.family, f.rect.width(), f.rect.height());
  return packed_planes(f.family, f.rect, payload, f.has_lost ? payload + pixels : nullptr);
}

// The planes of a kRaw16 payload, which has raw_size() bytes at an even address. Byte is uint8_t or const uint8_t.
template <typename Byte>
auto raw16_planes(const FragmentHeader& f, Byte* payload) {
  constexpr bool kConst = std::is_const_v<Byte>;
  using Sample = std::conditional_t<kConst, const int16_t, int16_t>;
  using Weight = std::conditional_t<kConst, const uint16_t, uint16_t>;
  Sample* const samples = reinterpret_cast<Sample*>(payload);
  const size_t pixels = packed_size(f.family, f.rect.width(), f.rect.height());
  return packed_sums(f.family, f.rect, samples, f.has_lost ? reinterpret_cast<Weight*>(samples + pixels) : nullptr);
}

// Copies `height` rows of `width` bytes, without padding between them in `to`. Returns the end of what it wrote.
inline uint8_t* copy_rows(const uint8_t* from, ptrdiff_t stride, size_t width, int height, uint8_t* to) {
  for (int y = 0; y < height; y++, to += width) std::memcpy(to, from + y * stride, width);
  return to;
}

// A JPEG payload: the scan of the pixels, and with lost weight its length (4 bytes) in front and the scan of that
// behind. Nothing if the length is wrong.
struct Scans {
  std::span<const uint8_t> pixels, lost;
};
std::optional<Scans> split_scans(std::span<const uint8_t> payload, bool has_lost);

// What reading and writing answers have in common: numbers of spec.md, and what both ask of fields.

inline constexpr uint16_t kLastOfNode = 1;  // in the flags of the unit
inline constexpr size_t kAnswerHeaderBytes = 72, kRangeBytes = 4, kFragmentBytes = 20;
inline constexpr uint16_t kWeighted = 1, kLostPlane = 2;  // in the flags of a fragment
inline constexpr uint16_t kSumOnWire = 0xffff;            // in the field `camera`: a sum

// These throw Error naming the field that is not fit for the wire.
void check_header(const AnswerHeader& answer, size_t fragments);
void check_part(const AnswerPart& part);
void check_fragment(const AnswerHeader& answer, const FragmentHeader& fragment);

// How many bytes into the answer the fragment table begins.
inline size_t table_offset(const AnswerHeader& answer) {
  return kAnswerHeaderBytes + kRangeBytes * (answer.cameras.ranges().size() + answer.blind.ranges().size());
}

// Runs f(), with "fragments[3]." in front of the text of an Error.
template <typename F>
auto in_fragment(size_t index, F f) {
  try {
    return f();
  } catch (const Error& error) {
    throw Error("fragments[" + std::to_string(index) + "]." + error.what());
  }
}

// Notes which fragments of one answer have come, part by part, in any order. Memory: as many entries as parts were
// added.
class AnswerParts {
 public:
  // False, and nothing is changed, for a part that repeats fragments or contradicts the ones before.
  bool add(const AnswerPart& part);
  // Whether all fragments have come.
  bool complete() const { return any_ && received_ == total_; }
  void clear() { *this = {}; }

 private:
  bool any_ = false;
  uint32_t total_ = 0, received_ = 0;
  std::map<uint32_t, uint32_t> parts_;  // first to first + count
};

// Reading an answer where it lies: nothing is copied, payloads refer to `bytes`. Everything is checked that can be
// without decoding JPEG: rectangles inside the view, payloads of exactly their sizes (raw), within them and no shorter
// than any scan of their size (JPEG). Stateless; memory for the table alone.

// Nothing for bytes that are not exactly one valid answer; `reason` (may be null) then says why, naming the field.
std::optional<AnswerView> parse_answer(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// Reads the fields in front of the fragment table alone, with the same checks; cheap. `bytes` may end anywhere after
// them.
std::optional<AnswerPartHeader> parse_answer_header(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// The id of the view that a unit of an answer stream, of any type, is about: enough to pass it by. Nothing for bytes
// that do not begin as such a unit of this version does; what follows is not looked at.
std::optional<uint32_t> peek_answer_view(std::span<const uint8_t> bytes);

// Width and height, pixels, of the view that a unit of fragments is about; nothing for other units, and for bytes that
// do not begin as such a unit of this version does.
std::optional<std::pair<int, int>> peek_answer_size(std::span<const uint8_t> bytes);

// Writing an answer in the one buffer it travels in: fragments are rendered or encoded straight into their places.
//
//   AnswerWriter writer(header, 2, std::move(recycled));
//   renderer.render(..., writer.add_sums(sum_header));                                     // sizes known beforehand
//   writer.add(jpeg_header, [&](ByteBuffer& out) { encoder.encode_pixels(..., out); });  // or afterwards
//   ByteBuffer bytes = writer.finish();
//
// Everything throws Error naming the field for what parse_answer() would not take back, and must then not be used
// further. Not thread-safe.
class AnswerWriter {
 public:
  // Room in the table for `max_fragments`; fewer may come (which costs moving the payloads). `memory`: what it holds is
  // thrown away and its capacity used.
  AnswerWriter(const AnswerHeader& header, size_t max_fragments, ByteBuffer memory = {});

  // Reserves the bytes that all payloads will have together, so that nothing is moved while they are added.
  void reserve_payloads(size_t bytes);

  // kRaw and kRaw16: uninitialised memory of the payload's size (see above for what lies where in it), valid until
  // the next call. 16-bit payloads must begin at an even offset: put them in front of others.
  std::span<uint8_t> add(const FragmentHeader& fragment);
  // As add() for kRaw16, with the memory as planes. They stay valid as long as there is room reserved for what else is
  // added.
  SumPlanes add_sums(const FragmentHeader& fragment);

  // The lost weight of some of the fragments added so far, all of them kRaw16, turned out to be nothing: where
  // `is_nothing`(number of the fragment) their planes are taken back. Planes handed out are no longer valid.
  void drop_lost(const std::function<bool(size_t)>& is_nothing);

  // Any codec: `append(ByteBuffer&)` appends the payload to what is there, and leaves that alone.
  template <typename Append>
  void add(const FragmentHeader& fragment, Append append) {
    const size_t begin = begin_payload(fragment);
    append(bytes_);
    end_payload(fragment, begin);
  }

  // The unit has some of an answer's `total` fragments, from number `first` on; unless this is called it has all.
  void set_part(uint32_t first, uint32_t total);

  size_t fragments() const { return fragments_; }
  // The whole unit. The writer is empty then.
  ByteBuffer finish();

 private:
  size_t begin_payload(const FragmentHeader& fragment);
  void end_payload(const FragmentHeader& fragment, size_t begin);
  void put_entry(const FragmentHeader& fragment, size_t length);

  AnswerHeader header_;
  size_t table_;                    // where the fragment table begins
  std::optional<AnswerPart> part_;  // set by set_part(); its count is not used
  size_t max_fragments_, fragments_ = 0;
  std::vector<std::pair<FragmentHeader, size_t>> added_;  // fragments, and where their payloads begin
  ByteBuffer bytes_;
};

}  // namespace lf::wire
