// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "lib/wire/wire_test.h"
#include "rtp/depacketizer.h"
#include "rtp/packetizer.h"
#include "support/answers.h"
#include "wire/answer_codec.h"
#include "wire/fragment_codec.h"
#include "wire/request_codec.h"

namespace lf::rtp {

using Bytes = std::vector<uint8_t>;
inline Bytes to_bytes(std::span<const uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

inline Bytes request(uint32_t sequence, uint32_t view_id = 0, int out_of_service = 0) {
  ViewRequest r;
  r.view_id = view_id;
  r.sequence = sequence;
  r.view.width = r.view.height = 64;
  for (int i = 0; i < out_of_service; i++) r.out_of_service.push_back(static_cast<CameraIndex>(2 * i));
  return wire::encode_request(r);
}

// Patterned fragments in a view of 400 x 400; quality 0: raw.
inline Bytes answer(int fragments, int width, int height, int quality, PixelFamily family = PixelFamily::kI420,
                    const CameraRanges& cameras = {}) {
  wire::AnswerHeader header = wire::header_of_view(family, 400, 400);
  header.cameras = cameras;
  return to_bytes(wire::encode_fragments(header, wire::patterned_fragments(family, fragments, width, height), quality));
}

// A 16-bit sum of patterned values, then `jpegs` JPEG fragments.
inline Bytes answer_with_sum(int width, int height, bool lost, int jpegs = 0) {
  const wire::AnswerHeader header = wire::header_of_view(PixelFamily::kI420, 400, 400);
  wire::AnswerWriter writer(header, 1 + jpegs);
  const wire::FragmentHeader sum{{}, header.family, {0, 0, width, height}, wire::Codec::kRaw16, 0, lost};
  uint32_t state = 1;
  for (uint8_t& byte : writer.add(sum)) byte = static_cast<uint8_t>((state = state * 1664525 + 1013904223) >> 24);
  for (const Fragment& f : wire::patterned_fragments(header.family, jpegs, 30, 20)) {
    writer.add({{}, header.family, f.rect, wire::Codec::kJpeg, 80, !f.lost.empty()},
               [&](ByteBuffer& out) { wire::append_jpeg(planes_of(f), 80, out); });
  }
  return to_bytes(writer.finish());
}

struct Sent {
  Bytes payload;
  bool last;
};

inline std::vector<Sent> packetize(Packetizer& packetizer, const Bytes& unit, size_t max_payload) {
  std::vector<Sent> packets;
  std::string reason;
  const auto emit = [&](const Payload& payload) {
    packets.push_back({Bytes(payload.size()), payload.last});
    payload.copy_to(packets.back().payload.data());
  };
  EXPECT_TRUE(packetizer.packetize(unit, max_payload, emit, &reason)) << reason;
  return packets;
}

inline std::vector<Sent> packetize(wire::UnitKind kind, const Bytes& unit, size_t max_payload) {
  Packetizer packetizer(kind);
  return packetize(packetizer, unit, max_payload);
}

// Bytes of all raw fragments of an answer, as (plane of 4, x, y, value).
using Samples = std::vector<std::tuple<int, int, int, int>>;
inline void add_samples(const wire::AnswerView& answer, Samples& samples) {
  for (const wire::FragmentView& f : answer.fragments) {
    if (f.codec == wire::Codec::kJpeg) continue;
    const int size = f.codec == wire::Codec::kRaw16 ? 2 : 1;
    const uint8_t* at = f.payload.data();
    const auto plane = [&](int number, int values, int side) {
      for (int y = f.rect.y0 / side; y < (f.rect.y1 + side - 1) / side; y++)
        for (int x = f.rect.x0 / side; x < (f.rect.x1 + side - 1) / side; x++)
          for (int v = 0; v < values; v++, at += size)
            samples.emplace_back(number + v, x, y, size == 2 ? at[0] | at[1] << 8 : at[0]);
    };
    if (f.family == PixelFamily::kRgb && size == 1) {
      plane(0, 3, 1);
    } else {
      for (int c = 0; c < 3; c++) plane(c, 1, c > 0 && f.family == PixelFamily::kI420 ? 2 : 1);
    }
    if (f.has_missing) plane(3, 1, 1);
  }
}

}  // namespace lf::rtp
