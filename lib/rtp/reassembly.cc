// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/reassembly.h"

#include <algorithm>
#include <utility>

namespace lf::rtp {

void Reassembly::drop_oldest() {
  bytes_ -= making_.front().cost();
  making_.erase(making_.begin());
  dropped_++;
}

void Reassembly::clear() {
  while (!making_.empty()) drop_oldest();
}

ByteBuffer Reassembly::finish(Making& making) {
  if (making.in_order) return std::move(making.bytes);
  ByteBuffer unit;
  unit.reserve(making.size);
  for (const auto& [offset, place] : making.chunks) append(unit, std::span(making.bytes).subspan(place.at, place.size));
  return unit;
}

Reassembly::Result Reassembly::add(uint32_t source, const Chunk& chunk, ByteBuffer& unit) {
  if (chunk.size > limits_.bytes) return Result::kTooLarge;
  auto found = std::ranges::find_if(
      making_, [&](const Making& making) { return making.source == source && making.number == chunk.unit; });
  const uint32_t end = chunk.offset + static_cast<uint32_t>(chunk.bytes.size());
  if (found != making_.end()) {
    if (found->size != chunk.size) return Result::kBad;
    const auto next = found->chunks.lower_bound(chunk.offset);
    if (next != found->chunks.end()) {
      if (next->first == chunk.offset && next->second.size == chunk.bytes.size()) return Result::kDuplicate;
      if (next->first < end) return Result::kBad;
    }
    if (next != found->chunks.begin()) {
      const auto before = std::prev(next);
      if (before->first + before->second.size > chunk.offset) return Result::kBad;
    }
  } else {
    if (making_.size() >= limits_.units) drop_oldest();
    making_.push_back({source, chunk.unit, chunk.size});
    found = making_.end() - 1;
  }
  if (found->bytes.size() != chunk.offset) found->in_order = false;
  found->chunks.emplace(chunk.offset, Place{chunk.bytes.size(), found->bytes.size()});
  append(found->bytes, chunk.bytes);
  bytes_ += chunk.bytes.size() + kChunkCost;
  if (found->bytes.size() == found->size) {
    bytes_ -= found->cost();
    unit = finish(*found);
    making_.erase(found);
    return Result::kComplete;
  }
  while (bytes_ > limits_.bytes && !making_.empty()) drop_oldest();
  return Result::kKept;
}

}  // namespace lf::rtp
