// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/part_plan.h"

#include "wire/answer_layout.h"
#include "wire/answer_writer.h"
#include "wire/limits.h"
#include "wire/payload.h"

namespace lf::rtp {
namespace {

// The pieces of an answer, raw fragments cut if `tiles`.
std::vector<Piece> cut(const wire::AnswerView& answer, size_t max_payload, bool tiles) {
  std::vector<Piece> pieces;
  for (size_t i = 0; i < answer.fragments.size(); i++) {
    const wire::FragmentView& fragment = answer.fragments[i];
    const size_t bytes = fragment.payload.size();
    const std::optional<wire::Tiling> tiling =
        tiles && bytes > max_payload ? wire::tile_raw(fragment, max_payload) : std::nullopt;
    if (!tiling) {
      pieces.push_back({i, {}, bytes});
      continue;
    }
    for (size_t t = 0; t < tiling->count(); t++) {
      const Rect tile = tiling->tile(t);
      pieces.push_back({i, tile, wire::raw_size(wire::tile_header(fragment, tile))});
    }
  }
  return pieces;
}

}  // namespace

std::optional<PartPlan> plan_parts(const wire::AnswerView& answer, size_t max_bytes) {
  const size_t header = wire::table_offset(answer);
  if (header > max_bytes / 2) return std::nullopt;
  const size_t room = max_bytes - header;
  const bool whole = answer.part.whole();

  PartPlan plan;
  plan.pieces = cut(answer, room - wire::kFragmentBytes, whole);
  if (plan.pieces.size() > wire::kMaxFragments) plan.pieces = cut(answer, room, false);
  plan.total = whole ? static_cast<uint32_t>(plan.pieces.size()) : answer.part.total;

  bool even = true;  // where the next payload would begin
  for (size_t i = 0; i < plan.pieces.size(); i++) {
    const Piece& piece = plan.pieces[i];
    const size_t bytes = piece.bytes + wire::kFragmentBytes;
    const bool misplaced = answer.fragments[piece.fragment].codec == wire::Codec::kRaw16 && !even;
    if (plan.parts.empty() || misplaced || plan.parts.back().bytes + bytes > max_bytes) {
      plan.parts.push_back({.first = i, .bytes = header});
      even = true;
    }
    Part& part = plan.parts.back();
    part.count++;
    part.bytes += bytes;
    even ^= piece.bytes % 2 != 0;
  }
  if (plan.parts.empty()) plan.parts.push_back({.bytes = header});
  return plan;
}

ByteBuffer write_part(const wire::AnswerView& answer, const PartPlan& plan, const Part& part, ByteBuffer memory) {
  wire::AnswerWriter writer(answer, part.count, std::move(memory));
  writer.set_part(answer.part.first + static_cast<uint32_t>(part.first), plan.total);
  for (const Piece& piece : std::span(plan.pieces).subspan(part.first, part.count)) {
    const wire::FragmentView& fragment = answer.fragments[piece.fragment];
    if (piece.tile) {
      wire::copy_tile(fragment, *piece.tile, writer.add(wire::tile_header(fragment, *piece.tile)).data());
      continue;
    }
    writer.add(fragment, [&](ByteBuffer& out) { append(out, fragment.payload); });
  }
  return writer.finish();
}

}  // namespace lf::rtp
