// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/answer_codec.h"

#include <algorithm>
#include <cstring>
#include <iterator>

#include "jpeg/fragment_codec.h"
#include "wire/unit.h"

namespace lf::wire {

std::optional<Scans> split_scans(std::span<const uint8_t> payload, bool has_missing) {
  if (!has_missing) return Scans{payload, {}};
  Reader in(payload);
  const uint32_t length = in.get<uint32_t>();
  if (!in.ok() || length > in.left()) return std::nullopt;
  Scans scans;
  scans.pixels = in.get_bytes(length);
  scans.lost = in.get_bytes(in.left());
  return scans;
}

void check_header(const AnswerHeader& answer, size_t fragments) {
  validate_size("view_width", answer.view_width);
  validate_size("view_height", answer.view_height);
  if (answer.family > PixelFamily::kI420)
    throw Error("family: " + std::to_string(static_cast<int>(answer.family)) + " is unknown");
  if (fragments > kMaxFragments)
    throw Error("fragments: at most " + std::to_string(kMaxFragments) + ", not " + std::to_string(fragments));
  if (answer.family == PixelFamily::kNone && fragments > 0)
    throw Error("family: none, but there are " + std::to_string(fragments) + " fragments");
  const auto ranges = [](const char* name, const CameraRanges& cameras) {
    if (!cameras.empty() && cameras.ranges().back().last >= kMaxCameras)
      throw Error(std::string(name) + ": camera " + std::to_string(cameras.ranges().back().last) + " is beyond " +
                  std::to_string(kMaxCameras - 1));
  };
  ranges("cameras", answer.cameras);
  ranges("blind", answer.blind);
  if (!answer.cameras.contains(answer.blind)) throw Error("blind: must be a subset of the answer's cameras");
}

void check_part(const AnswerPart& part) {
  if (part.total > kMaxFragments)
    throw Error("total: at most " + std::to_string(kMaxFragments) + " fragments, not " + std::to_string(part.total));
  if (part.first > part.total || part.count > part.total - part.first)
    throw Error("total: " + std::to_string(part.total) + " fragments, but this part has " + std::to_string(part.count) +
                " from number " + std::to_string(part.first) + " on");
  if (part.count == 0 && part.total > 0) throw Error("fragments: a part must have at least one fragment");
}

void check_fragment(const AnswerHeader& answer, const FragmentHeader& fragment) {
  const Rect& rect = fragment.rect;
  if (fragment.camera && *fragment.camera >= kMaxCameras)
    throw Error("camera: " + std::to_string(*fragment.camera) + " is beyond " + std::to_string(kMaxCameras - 1));
  if (fragment.family != answer.family) throw Error("family: differs from the answer's");
  if (rect.empty()) throw Error("rectangle: is empty");
  const int right = fragment.camera ? kMaxImageSize : answer.view_width;
  const int bottom = fragment.camera ? kMaxImageSize : answer.view_height;
  if (rect.x0 < 0 || rect.y0 < 0 || rect.x1 > right || rect.y1 > bottom)
    throw Error(std::string("rectangle: is not inside ") + (fragment.camera ? "any image" : "the view"));
  if (fragment.camera && fragment.has_missing) throw Error("flags: pixels of a camera have no missing weight");
  if (fragment.camera && fragment.codec == Codec::kRaw16)
    throw Error("codec: 16-bit values are only for sums, not for pixels of a camera");
  if (answer.family == PixelFamily::kI420 && (rect.x0 % 2 != 0 || rect.y0 % 2 != 0))
    throw Error("rectangle: x and y must be even in YCbCr");
  if (fragment.codec > Codec::kRaw16)
    throw Error("codec: " + std::to_string(static_cast<int>(fragment.codec)) + " is not supported");
  const bool jpeg = fragment.codec == Codec::kJpeg;
  if (jpeg && (fragment.quality < 1 || fragment.quality > 100))
    throw Error("quality: must be 1 to 100 for JPEG, is " + std::to_string(fragment.quality));
  if (!jpeg && fragment.quality != 0)
    throw Error("quality: must be 0 for raw pixels, is " + std::to_string(fragment.quality));
}

bool AnswerParts::add(const AnswerPart& part) {
  if (any_ && (part.total != total_ || complete())) return false;
  const uint32_t end = part.first + part.count;
  const auto next = parts_.lower_bound(part.first);
  if (next != parts_.end() && next->first < end) return false;
  if (next != parts_.begin() && std::prev(next)->second > part.first) return false;
  any_ = true;
  total_ = part.total;
  received_ += part.count;
  parts_.emplace(part.first, end);
  return true;
}

namespace {

struct ParsedHeader {
  AnswerPartHeader answer;
  UnitHeader unit;
};

CameraRanges read_ranges(Reader& in, const char* name, size_t count) {
  CameraRanges out;
  for (size_t i = 0; i < count; i++) {
    const uint16_t first = in.get<uint16_t>(), last = in.get<uint16_t>();
    if (!out.append({first, last}))
      throw Error(std::string(name) + "[" + std::to_string(i) + "]: " + std::to_string(first) + " to " +
                  std::to_string(last) + " is not a range after the previous range");
  }
  return out;
}

struct RangeCounts {
  size_t cameras = 0, blind = 0;
};

// The fields between the unit header and the ranges of cameras. `reserved` must be 0.
template <typename Io, typename Header, typename Part, typename Counts, typename Reserved>
void head_fields(Io& io, Header& answer, Part& part, Counts&& ranges, Reserved& reserved) {
  field<uint32_t>(io, answer.view_id);
  field<uint32_t>(io, answer.sequence);
  field<uint64_t>(io, answer.target_time);
  field<uint64_t>(io, answer.actual_time);
  field<uint64_t>(io, answer.rig_hash);
  field<uint32_t>(io, answer.node);
  field<uint16_t>(io, answer.view_width);
  field<uint16_t>(io, answer.view_height);
  field<uint8_t>(io, answer.family);
  field<uint8_t>(io, reserved[0]);
  field<uint16_t>(io, ranges.cameras);
  field<uint32_t>(io, part.count);
  field<uint32_t>(io, part.first);
  field<uint32_t>(io, part.total);
  field<uint16_t>(io, ranges.blind);
  field<uint16_t>(io, reserved[1]);
}

ParsedHeader read_head(std::span<const uint8_t> bytes) {
  ParsedHeader head{.unit = read_unit_header(bytes, UnitKind::kAnswer, kFragmentsType, kLastOfNode)};
  const UnitHeader& unit = head.unit;
  Reader in(bytes.first(std::min(bytes.size(), unit.size)).subspan(kUnitHeaderBytes));
  AnswerPartHeader& answer = head.answer;
  answer.last_of_node = unit.flags & kLastOfNode;
  RangeCounts ranges;
  uint32_t reserved[2];
  head_fields(in, answer, answer.part, ranges, reserved);
  const size_t header_bytes = kAnswerHeaderBytes + kRangeBytes * (ranges.cameras + ranges.blind);
  if (!in.ok() || in.left() < header_bytes - kAnswerHeaderBytes)
    throw Error("header: needs " + std::to_string(in.ok() ? header_bytes : kAnswerHeaderBytes) + " bytes, there are " +
                std::to_string(std::min(bytes.size(), unit.size)));
  if (const uint32_t value = std::ranges::max(reserved))
    throw Error("reserved: must be 0, is " + std::to_string(value));
  answer.cameras = read_ranges(in, "cameras", ranges.cameras);
  answer.blind = read_ranges(in, "blind", ranges.blind);
  check_header(answer, answer.part.count);
  check_part(answer.part);
  if (answer.part.count > (unit.size - header_bytes) / kFragmentBytes)
    throw Error("fragments: a table of " + std::to_string(answer.part.count) + " is longer than the answer");
  return head;
}

// Reads a table entry and takes its payload from the front of `payloads`, which starts at `offset` in the unit.
FragmentView read_fragment(const AnswerHeader& answer, Reader& table, Reader& payloads, size_t offset) {
  FragmentView fragment;
  const uint16_t camera = table.get<uint16_t>();
  const uint16_t plane = table.get<uint16_t>();
  const uint16_t x = table.get<uint16_t>(), y = table.get<uint16_t>();
  const uint16_t w = table.get<uint16_t>(), h = table.get<uint16_t>();
  fragment.codec = static_cast<Codec>(table.get<uint8_t>());
  fragment.quality = table.get<uint8_t>();
  const uint16_t flags = table.get<uint16_t>();
  const uint32_t length = table.get<uint32_t>();

  if (camera != kSumOnWire) fragment.camera = camera;
  fragment.family = answer.family;
  fragment.rect = {x, y, x + w, y + h};
  fragment.has_missing = flags & kMissingPlane;
  check_fragment(answer, fragment);
  if (plane != 0) throw Error("plane: " + std::to_string(plane) + " is not supported");
  if (flags & ~(kWeighted | kMissingPlane)) throw Error("flags: unknown bits");
  if (fragment.camera.has_value() == static_cast<bool>(flags & kWeighted))
    throw Error("flags: sums must be marked as weighted, and pixels of a camera must not");
  if (fragment.codec != Codec::kJpeg && length != raw_size(fragment))
    throw Error("length: must be " + std::to_string(raw_size(fragment)) + " bytes, is " + std::to_string(length));
  if (length > payloads.left())
    throw Error("length: " + std::to_string(length) + " bytes, but " + std::to_string(payloads.left()) + " are left");
  if (fragment.codec == Codec::kRaw16 && offset % 2 != 0)
    throw Error("codec: 16-bit values must begin at an even offset");
  fragment.payload = payloads.get_bytes(length);
  return fragment;
}

void check_scans(const FragmentView& fragment) {
  const std::optional<Scans> scans = split_scans(fragment.payload, fragment.has_missing);
  if (!scans) throw Error("length: the first scan is longer than the payload");
  const auto long_enough = [](size_t least, std::span<const uint8_t> scan) {
    if (scan.size() < least)
      throw Error("length: a scan of this size has at least " + std::to_string(least) + " bytes, not " +
                  std::to_string(scan.size()));
  };
  long_enough(jpeg::min_pixel_scan(jpeg::coded_size(fragment.rect, jpeg::kPixelUnit)), scans->pixels);
  if (fragment.has_missing)
    long_enough(jpeg::min_missing_scan(jpeg::coded_size(fragment.rect, jpeg::kMissingUnit)), scans->lost);
}

AnswerView read_answer(std::span<const uint8_t> bytes) {
  const ParsedHeader head = read_head(bytes);
  check_unit_size(bytes, head.unit);
  AnswerView answer{head.answer, {}};
  const size_t table_begin = table_offset(answer), begin = table_begin + answer.part.count * kFragmentBytes;
  Reader table(bytes.first(begin).subspan(table_begin));
  Reader payloads(bytes.subspan(begin));
  answer.fragments.reserve(answer.part.count);  // the table entries are in `bytes`, so this allocation is bounded
  for (uint32_t i = 0; i < answer.part.count; i++)
    answer.fragments.push_back(
        in_fragment(i, [&] { return read_fragment(answer, table, payloads, bytes.size() - payloads.left()); }));
  if (payloads.left() > 0)
    throw Error("length: " + std::to_string(payloads.left()) + " bytes after the last fragment's payload");
  for (size_t i = 0; i < answer.fragments.size(); i++)
    if (answer.fragments[i].codec == Codec::kJpeg) in_fragment(i, [&] { check_scans(answer.fragments[i]); });
  return answer;
}

}  // namespace

std::optional<AnswerView> parse_answer(std::span<const uint8_t> bytes, std::string* reason) {
  return catch_reason(reason, [&] { return read_answer(bytes); });
}

std::optional<AnswerPartHeader> parse_answer_header(std::span<const uint8_t> bytes, std::string* reason) {
  return catch_reason(reason, [&] { return read_head(bytes).answer; });
}

std::optional<std::pair<int, int>> peek_answer_size(std::span<const uint8_t> bytes) {
  constexpr size_t kSizeAt = 48;
  const std::optional<UnitHeader> unit = peek_unit(bytes);
  if (!unit || unit->kind != UnitKind::kAnswer || unit->version != kVersion || unit->type != kFragmentsType ||
      bytes.size() < kAnswerHeaderBytes)
    return std::nullopt;
  Reader in(bytes.subspan(kSizeAt));
  const int width = in.get<uint16_t>(), height = in.get<uint16_t>();
  return std::pair(width, height);
}

std::optional<uint32_t> peek_answer_view(std::span<const uint8_t> bytes) {
  const std::optional<UnitHeader> unit = peek_unit(bytes);
  if (!unit || unit->kind != UnitKind::kAnswer || unit->version != kVersion) return std::nullopt;
  Reader in(bytes.subspan(kUnitHeaderBytes));
  const uint32_t view_id = in.get<uint32_t>();
  return in.ok() ? std::optional(view_id) : std::nullopt;
}

AnswerWriter::AnswerWriter(const AnswerHeader& header, size_t max_fragments, ByteBuffer memory)
    : header_(header), table_(table_offset(header)), max_fragments_(max_fragments), bytes_(std::move(memory)) {
  check_header(header, max_fragments);
  bytes_.clear();
  bytes_.resize(table_ + max_fragments * kFragmentBytes);
}

void AnswerWriter::reserve_payloads(size_t bytes) { bytes_.reserve(bytes_.size() + std::min(bytes, kMaxAnswerBytes)); }

size_t AnswerWriter::begin_payload(const FragmentHeader& fragment) {
  if (fragments_ == max_fragments_)
    throw Error("fragments: more than the " + std::to_string(max_fragments_) + " there is room for");
  in_fragment(fragments_, [&] {
    check_fragment(header_, fragment);
    if (fragment.codec == Codec::kRaw16 && bytes_.size() % 2 != 0)
      throw Error("codec: 16-bit values must begin at an even offset");
  });
  return bytes_.size();
}

void AnswerWriter::end_payload(const FragmentHeader& fragment, size_t begin) {
  if (bytes_.size() > kMaxAnswerBytes)
    throw Error("fragments: more than the " + std::to_string(kMaxAnswerBytes) + " bytes an answer may have");
  const size_t length = bytes_.size() - begin;
  in_fragment(fragments_, [&] {
    if (fragment.codec == Codec::kJpeg ? length == 0 : length != raw_size(fragment))
      throw Error("length: " + std::to_string(length) + " bytes do not match the fragment's size and codec");
  });
  put_entry(fragment, length);
  added_.emplace_back(fragment, begin);
}

void AnswerWriter::drop_missing(const std::function<bool(size_t)>& is_nothing) {
  size_t end = added_.empty() ? bytes_.size() : added_[0].second;
  fragments_ = 0;
  for (size_t i = 0; i < added_.size(); i++) {
    auto& [fragment, begin] = added_[i];
    if (fragment.codec != Codec::kRaw16) throw Error("missing weight: can only be dropped from 16-bit sums");
    if (is_nothing(i)) fragment.has_missing = false;
    const size_t size = raw_size(fragment);
    if (begin != end) std::memmove(bytes_.data() + end, bytes_.data() + begin, size);
    begin = end;
    end += size;
    put_entry(fragment, size);
  }
  bytes_.resize(end);
}

std::span<uint8_t> AnswerWriter::add(const FragmentHeader& fragment) {
  const size_t begin = begin_payload(fragment);
  const size_t size = fragment.codec == Codec::kJpeg ? 0 : raw_size(fragment);
  if (begin + size > kMaxAnswerBytes)
    throw Error("fragments: more than the " + std::to_string(kMaxAnswerBytes) + " bytes an answer may have");
  bytes_.resize(begin + size);
  end_payload(fragment, begin);
  return {bytes_.data() + begin, size};
}

SumPlanes AnswerWriter::add_sums(const FragmentHeader& fragment) {
  if (fragment.codec != Codec::kRaw16) throw Error("codec: sums are sent in 16 bits");
  return raw16_planes(fragment, add(fragment).data());
}

void AnswerWriter::put_entry(const FragmentHeader& fragment, size_t length) {
  BufferWriter out(bytes_.data() + table_ + fragments_ * kFragmentBytes);
  out.put(static_cast<uint16_t>(fragment.camera.value_or(kSumOnWire)));
  out.put(uint16_t{0});
  out.put(static_cast<uint16_t>(fragment.rect.x0));
  out.put(static_cast<uint16_t>(fragment.rect.y0));
  out.put(static_cast<uint16_t>(fragment.rect.width()));
  out.put(static_cast<uint16_t>(fragment.rect.height()));
  out.put(static_cast<uint8_t>(fragment.codec));
  out.put(fragment.quality);
  out.put(static_cast<uint16_t>((fragment.camera ? 0 : kWeighted) | (fragment.has_missing ? kMissingPlane : 0)));
  out.put(static_cast<uint32_t>(length));
  fragments_++;
}

void AnswerWriter::set_part(uint32_t first, uint32_t total) { part_ = AnswerPart{first, 0, total}; }

ByteBuffer AnswerWriter::finish() {
  const auto count = static_cast<uint32_t>(fragments_);
  AnswerPart part = part_.value_or(AnswerPart{0, 0, count});
  part.count = count;
  check_part(part);
  if (fragments_ < max_fragments_) {
    const size_t payloads = table_ + max_fragments_ * kFragmentBytes;
    const size_t place = table_ + fragments_ * kFragmentBytes;
    std::memmove(bytes_.data() + place, bytes_.data() + payloads, bytes_.size() - payloads);
    bytes_.resize(bytes_.size() - (payloads - place));
  }
  BufferWriter out(bytes_.data());
  put_unit_header(out, UnitKind::kAnswer, kFragmentsType, header_.last_of_node ? kLastOfNode : uint16_t{0},
                  bytes_.size());
  constexpr uint32_t kReserved[2] = {};
  head_fields(out, header_, part, RangeCounts{header_.cameras.ranges().size(), header_.blind.ranges().size()},
              kReserved);
  for (const CameraRanges* cameras : {&header_.cameras, &header_.blind})
    for (const CameraRange& range : cameras->ranges()) {
      out.put(static_cast<uint16_t>(range.first));
      out.put(static_cast<uint16_t>(range.last));
    }
  return std::move(bytes_);
}

}  // namespace lf::wire
