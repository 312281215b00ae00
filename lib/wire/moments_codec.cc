// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/moments_codec.h"

#include <algorithm>

#include "base/error.h"
#include "focus/trial.h"
#include "rig/rig.h"
#include "wire/bytes.h"
#include "wire/unit.h"

namespace lf::wire {
namespace {

constexpr size_t kHeaderBytes = kUnitHeaderBytes + 4 + 4 + 8 + 4 + 2 + 2 + 2;
constexpr uint8_t kHasWeight = 1;  // flag of a trial: else all of its weight is there

bool is_whole(const Moments& moments) {
  return std::ranges::all_of(moments.weight, [](uint16_t w) { return w == Moments::kWeightOne; });
}

void put_plane(PlacedWriter& out, const std::vector<uint16_t>& values) {
  for (const uint16_t value : values) out.put(value);
}

void read_plane(Reader& in, std::vector<uint16_t>& values) {
  const std::span<const uint8_t> bytes = in.get_bytes(2 * values.size());
  for (size_t i = 0; i < bytes.size() / 2; i++)
    values[i] = static_cast<uint16_t>(bytes[2 * i] << 8 | bytes[2 * i + 1]);
}

MomentsUnit read_moments(std::span<const uint8_t> bytes) {
  std::string reason;
  const std::optional<UnitHeader> header = check_unit_header(bytes, UnitKind::kAnswer, kMomentsType, 0, reason);
  if (!header || !check_unit_size(bytes, *header, reason)) throw Error(reason);
  Reader in(bytes.subspan(kUnitHeaderBytes));
  MomentsUnit unit;
  unit.view_id = in.get<uint32_t>();
  unit.sequence = in.get<uint32_t>();
  unit.rig_hash = in.get<uint64_t>();
  unit.node = in.get<uint32_t>();
  const int columns = in.get<uint16_t>(), rows = in.get<uint16_t>();
  const uint8_t trials = in.get<uint8_t>(), reserved = in.get<uint8_t>();
  if (!in.ok()) throw Error("moments: the unit ends before its trials");
  if (reserved != 0) throw Error("reserved: must be 0, is " + std::to_string(reserved));
  if (trials < 1 || trials > kMaxTrials)
    throw Error("trials: must be 1 to " + std::to_string(kMaxTrials) + ", not " + std::to_string(trials));
  if (columns < 1 || columns > kMaxImageSize || rows < 1 || rows > kMaxImageSize)
    throw Error("moments: no view has " + std::to_string(columns) + " x " + std::to_string(rows) + " nodes");
  const size_t plane = 2 * static_cast<size_t>(columns) * static_cast<size_t>(rows);
  if (in.left() < trials * (1 + 2 * plane)) throw Error("moments: the unit ends before its trials do");
  unit.trials.resize(trials);
  for (Moments& moments : unit.trials) {
    const uint8_t flags = in.get<uint8_t>();
    if (flags > kHasWeight) throw Error("trials: unknown flags " + std::to_string(flags));
    moments.reset(columns, rows);
    if (flags & kHasWeight)
      read_plane(in, moments.weight);
    else
      std::ranges::fill(moments.weight, Moments::kWeightOne);
    read_plane(in, moments.luma);
    read_plane(in, moments.square);
  }
  if (!in.ok() || in.left() != 0) throw Error("moments: the unit's length is not that of its trials");
  return unit;
}

}  // namespace

bool is_moments(std::span<const uint8_t> bytes) {
  const std::optional<UnitHeader> header = peek_unit(bytes);
  return header && header->kind == UnitKind::kAnswer && header->type == kMomentsType;
}

ByteBuffer encode_moments(const MomentsHeader& header, std::span<const Moments> trials) {
  if (trials.empty() || trials.size() > kMaxTrials)
    throw Error("trials: must be 1 to " + std::to_string(kMaxTrials) + ", not " + std::to_string(trials.size()));
  const size_t nodes = trials[0].weight.size();
  size_t size = kHeaderBytes;
  std::vector<bool> whole;
  for (const Moments& moments : trials) {
    if (moments.columns != trials[0].columns || moments.rows != trials[0].rows)
      throw Error("trials: of different sizes");
    whole.push_back(is_whole(moments));
    size += 1 + 2 * nodes * (whole.back() ? 2 : 3);
  }
  ByteBuffer bytes(size);
  PlacedWriter out(bytes.data());
  put_unit_header(out, UnitKind::kAnswer, kMomentsType, 0, size);
  out.put(header.view_id);
  out.put(header.sequence);
  out.put(header.rig_hash);
  out.put(header.node);
  out.put(static_cast<uint16_t>(trials[0].columns));
  out.put(static_cast<uint16_t>(trials[0].rows));
  out.put(static_cast<uint8_t>(trials.size()));
  out.put(uint8_t{0});
  for (size_t t = 0; t < trials.size(); t++) {
    out.put(whole[t] ? uint8_t{0} : kHasWeight);
    if (!whole[t]) put_plane(out, trials[t].weight);
    put_plane(out, trials[t].luma);
    put_plane(out, trials[t].square);
  }
  return bytes;
}

std::optional<MomentsUnit> decode_moments(std::span<const uint8_t> bytes, std::string* reason) {
  return or_reason(reason, [&] { return read_moments(bytes); });
}

}  // namespace lf::wire
