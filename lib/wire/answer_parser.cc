// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/answer_parser.h"

#include <algorithm>

#include "jpeg/coded_size.h"
#include "wire/answer_layout.h"
#include "wire/limits.h"
#include "wire/payload.h"
#include "wire/unit.h"

namespace lf::wire {
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
                  std::to_string(last) + " is no range beyond the one before");
  }
  return out;
}

ParsedHeader read_head(std::span<const uint8_t> bytes) {
  std::string reason;
  const std::optional<UnitHeader> unit =
      check_unit_header(bytes, UnitKind::kAnswer, kFragmentsType, kLastOfNode, reason);
  if (!unit) throw Error(reason);
  ParsedHeader head{.unit = *unit};
  Reader in(bytes.first(std::min(bytes.size(), unit->size)).subspan(kUnitHeaderBytes));
  AnswerPartHeader& answer = head.answer;
  answer.last_of_node = unit->flags & kLastOfNode;
  answer.view_id = in.get<uint32_t>();
  answer.sequence = in.get<uint32_t>();
  answer.target_time = in.get<uint64_t>();
  answer.actual_time = in.get<uint64_t>();
  answer.rig_hash = in.get<uint64_t>();
  answer.node = in.get<uint32_t>();
  answer.view_width = in.get<uint16_t>();
  answer.view_height = in.get<uint16_t>();
  answer.family = static_cast<PixelFamily>(in.get<uint8_t>());
  const uint8_t reserved = in.get<uint8_t>();
  const uint16_t cameras = in.get<uint16_t>();
  answer.part.count = in.get<uint32_t>();
  answer.part.first = in.get<uint32_t>();
  answer.part.total = in.get<uint32_t>();
  const uint16_t blind = in.get<uint16_t>(), reserved_too = in.get<uint16_t>();
  const size_t header_bytes = kAnswerHeaderBytes + kRangeBytes * (size_t{cameras} + blind);
  if (!in.ok() || in.left() < header_bytes - kAnswerHeaderBytes)
    throw Error("header: needs " + std::to_string(in.ok() ? header_bytes : kAnswerHeaderBytes) + " bytes, there are " +
                std::to_string(std::min(bytes.size(), unit->size)));
  if (reserved != 0 || reserved_too != 0)
    throw Error("reserved: must be 0, is " + std::to_string(std::max<uint32_t>(reserved, reserved_too)));
  answer.cameras = read_ranges(in, "cameras", cameras);
  answer.blind = read_ranges(in, "blind", blind);
  check_header(answer, answer.part.count);
  check_part(answer.part);
  if (answer.part.count > (unit->size - header_bytes) / kFragmentBytes)
    throw Error("fragments: a table of " + std::to_string(answer.part.count) + " is longer than the answer");
  return head;
}

// One entry of the table; its payload is taken from the front of `payloads`, which begins at `offset` in the unit.
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
  fragment.has_lost = flags & kLostPlane;
  check_fragment(answer, fragment);
  if (plane != 0) throw Error("plane: " + std::to_string(plane) + " is not supported");
  if (flags & ~(kWeighted | kLostPlane)) throw Error("flags: unknown bits");
  if (fragment.camera.has_value() == static_cast<bool>(flags & kWeighted))
    throw Error("flags: a sum is weighted, and pixels of a camera are not");
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
  const std::optional<Scans> scans = split_scans(fragment.payload, fragment.has_lost);
  if (!scans) throw Error("length: of the first scan is beyond the payload");
  const auto long_enough = [](size_t least, std::span<const uint8_t> scan) {
    if (scan.size() < least)
      throw Error("length: a scan of this size has at least " + std::to_string(least) + " bytes, not " +
                  std::to_string(scan.size()));
  };
  long_enough(jpeg::least_pixel_scan(jpeg::coded_size(fragment.rect, jpeg::kPixelUnit)), scans->pixels);
  if (fragment.has_lost)
    long_enough(jpeg::least_lost_scan(jpeg::coded_size(fragment.rect, jpeg::kLostUnit)), scans->lost);
}

AnswerView read_answer(std::span<const uint8_t> bytes) {
  const ParsedHeader head = read_head(bytes);
  std::string reason;
  if (!check_unit_size(bytes, head.unit, reason)) throw Error(reason);
  AnswerView answer{head.answer, {}};
  const size_t table_begin = table_offset(answer), begin = table_begin + answer.part.count * kFragmentBytes;
  Reader table(bytes.first(begin).subspan(table_begin));
  Reader payloads(bytes.subspan(begin));
  answer.fragments.reserve(answer.part.count);  // their entries are there
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
  return or_reason(reason, [&] { return read_answer(bytes); });
}

std::optional<AnswerPartHeader> parse_answer_header(std::span<const uint8_t> bytes, std::string* reason) {
  return or_reason(reason, [&] { return read_head(bytes).answer; });
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

}  // namespace lf::wire
