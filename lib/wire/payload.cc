// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/payload.h"

#include "wire/bytes.h"

namespace lf::wire {

std::optional<Scans> split_scans(std::span<const uint8_t> payload, bool has_lost) {
  if (!has_lost) return Scans{payload, {}};
  Reader in(payload);
  const uint32_t length = in.get<uint32_t>();
  if (!in.ok() || length > in.left()) return std::nullopt;
  Scans scans;
  scans.pixels = in.get_bytes(length);
  scans.lost = in.get_bytes(in.left());
  return scans;
}

}  // namespace lf::wire
