// SPDX-License-Identifier: LGPL-2.1-or-later
// Moments: what is taken can be written again and is the same, and adds up to something.
#include "fuzz/fuzz.h"
#include "wire/moments_codec.h"

LF_FUZZ_TARGET(moments)(const uint8_t* data, size_t size) {
  using namespace lf;
  std::string reason;
  wire::MomentsShape shape;
  if (!wire::parse_moments_header({data, size}, &shape, &reason)) {
    fuzz::require(!reason.empty());
    return 0;
  }
  if (shape.columns > 64 || shape.rows > 64) shape = {64, 64, 4};  // what might have been asked for
  std::optional<wire::MomentsUnit> unit = wire::decode_moments({data, size}, shape, &reason);
  fuzz::require(unit || !reason.empty());
  if (!unit) return 0;
  std::vector<Moments> sums = unit->sums();
  const ByteBuffer bytes = wire::encode_moments(*unit, sums);
  const std::optional<wire::MomentsUnit> again = wire::decode_moments(bytes, shape);
  fuzz::require(again && again->trials.size() == sums.size());
  const std::vector<Moments> same = again->sums();
  for (size_t t = 0; t < sums.size(); t++) {
    Moments& moments = sums[t];
    for (size_t i = 0; i < moments.weight.size(); i++) {
      // What has no weight anywhere may have been left out.
      fuzz::require(same[t].weight[i] == moments.weight[i]);
      if (moments.weight[i] > 0) fuzz::require(same[t].square[i] == moments.square[i]);
    }
    moments.add(same[t]);
    for (size_t i = 0; i < moments.weight.size(); i++) moments.deviation(i);
  }
  return 0;
}
