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
  const std::span<const wire::FragmentView> all = answer.fragments;
  for (size_t i = 0, n; i < all.size(); i += n) {
    n = wire::group_size(all.subspan(i));
    const size_t bytes = all[i].payload.size();
    const std::optional<wire::Tiling> tiling =
        tiles && bytes > max_payload ? wire::tile_raw(all[i], max_payload) : std::nullopt;
    if (!tiling) {
      pieces.push_back({i, n, {}, bytes});
      continue;
    }
    for (size_t t = 0; t < tiling->count(); t++) {
      const Rect tile = tiling->tile(t);
      pieces.push_back({i, 1, tile, wire::raw_size(wire::tile_header(all[i], tile))});
    }
  }
  return pieces;
}

uint32_t fragments_of(const std::vector<Piece>& pieces) {
  size_t count = 0;
  for (const Piece& piece : pieces) count += piece.count;
  return static_cast<uint32_t>(count);
}

}  // namespace

std::optional<PartPlan> plan_parts(const wire::AnswerView& answer, size_t max_bytes) {
  const size_t header = wire::table_offset(answer);
  if (header > max_bytes / 2) return std::nullopt;
  const size_t room = max_bytes - header;
  const bool whole = answer.part.whole();

  PartPlan plan;
  plan.pieces = cut(answer, room - wire::kFragmentBytes, whole);
  if (fragments_of(plan.pieces) > wire::kMaxFragments) plan.pieces = cut(answer, room, false);
  plan.total = whole ? fragments_of(plan.pieces) : answer.part.total;

  uint32_t first = answer.part.first;
  bool even = true;  // where the next payload would begin
  for (size_t i = 0; i < plan.pieces.size(); i++) {
    const Piece& piece = plan.pieces[i];
    const size_t bytes = piece.bytes + piece.count * wire::kFragmentBytes;
    const bool misplaced = answer.fragments[piece.first].codec == wire::Codec::kRaw16 && !even;
    if (plan.parts.empty() || misplaced || plan.parts.back().bytes + bytes > max_bytes) {
      plan.parts.push_back({.first_piece = i, .first = first, .bytes = header});
      even = true;
    }
    Part& part = plan.parts.back();
    part.pieces++;
    part.count += static_cast<uint32_t>(piece.count);
    part.bytes += bytes;
    first += static_cast<uint32_t>(piece.count);
    even ^= piece.bytes % 2 != 0;
  }
  if (plan.parts.empty()) plan.parts.push_back({.bytes = header});
  return plan;
}

ByteBuffer write_part(const wire::AnswerView& answer, const PartPlan& plan, const Part& part, ByteBuffer memory) {
  wire::AnswerWriter writer(answer, part.count, std::move(memory));
  writer.set_part(part.first, plan.total);
  for (const Piece& piece : std::span(plan.pieces).subspan(part.first_piece, part.pieces)) {
    const wire::FragmentView& fragment = answer.fragments[piece.first];
    if (piece.tile) {
      wire::copy_tile(fragment, *piece.tile, writer.add(wire::tile_header(fragment, *piece.tile)).data());
      continue;
    }
    writer.add(fragment, [&](ByteBuffer& out) { append(out, fragment.payload); });
    for (size_t i = 1; i < piece.count; i++) writer.add_member(answer.fragments[piece.first + i]);
  }
  return writer.finish();
}

}  // namespace lf::rtp
