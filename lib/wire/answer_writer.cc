// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/answer_writer.h"

#include <algorithm>
#include <cstring>

#include "wire/answer_layout.h"
#include "wire/bytes.h"
#include "wire/limits.h"
#include "wire/payload.h"
#include "wire/unit.h"

namespace lf::wire {

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
      throw Error("length: " + std::to_string(length) + " bytes are no payload of this fragment");
  });
  put_entry(fragment, length);
  added_.emplace_back(fragment, begin);
}

void AnswerWriter::drop_lost(const std::function<bool(size_t)>& is_nothing) {
  size_t end = added_.empty() ? bytes_.size() : added_[0].second;
  fragments_ = 0;
  for (size_t i = 0; i < added_.size(); i++) {
    auto& [fragment, begin] = added_[i];
    if (fragment.codec != Codec::kRaw16) throw Error("lost: is taken back of sums in 16 bits alone");
    if (is_nothing(i)) fragment.has_lost = false;
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
  PlacedWriter out(bytes_.data() + table_ + fragments_ * kFragmentBytes);
  out.put(static_cast<uint16_t>(fragment.camera.value_or(kSumOnWire)));
  out.put(uint16_t{0});  // plane
  out.put(static_cast<uint16_t>(fragment.rect.x0));
  out.put(static_cast<uint16_t>(fragment.rect.y0));
  out.put(static_cast<uint16_t>(fragment.rect.width()));
  out.put(static_cast<uint16_t>(fragment.rect.height()));
  out.put(static_cast<uint8_t>(fragment.codec));
  out.put(fragment.quality);
  out.put(static_cast<uint16_t>((fragment.camera ? 0 : kWeighted) | (fragment.has_lost ? kLostPlane : 0)));
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
  PlacedWriter out(bytes_.data());
  put_unit_header(out, UnitKind::kAnswer, kFragmentsType, header_.last_of_node ? kLastOfNode : uint16_t{0},
                  bytes_.size());
  out.put(header_.view_id);
  out.put(header_.sequence);
  out.put(header_.target_time);
  out.put(header_.actual_time);
  out.put(header_.rig_hash);
  out.put(header_.node);
  out.put(static_cast<uint16_t>(header_.view_width));
  out.put(static_cast<uint16_t>(header_.view_height));
  out.put(static_cast<uint8_t>(header_.family));
  out.put(uint8_t{0});
  out.put(static_cast<uint16_t>(header_.cameras.ranges().size()));
  out.put(part.count);
  out.put(part.first);
  out.put(part.total);
  out.put(static_cast<uint16_t>(header_.blind.ranges().size()));
  out.put(uint16_t{0});
  for (const CameraRanges* cameras : {&header_.cameras, &header_.blind})
    for (const CameraRange& range : cameras->ranges()) {
      out.put(static_cast<uint16_t>(range.first));
      out.put(static_cast<uint16_t>(range.last));
    }
  return std::move(bytes_);
}

}  // namespace lf::wire
