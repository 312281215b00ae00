// SPDX-License-Identifier: LGPL-2.1-or-later
// What a fragment costs on a link beyond its entropy-coded bytes.
#include <gtest/gtest.h>

#include "lib/rtp/rtp_test.h"
#include "support/weighted_fragments.h"

namespace lf::rtp {
namespace {

constexpr size_t kMtu = 1400, kRtpHeader = 12, kIpAndUdpHeaders = 28;
constexpr int kViewSize = 16 * 31 / 2;

size_t entropy_coded_bytes(const Bytes& unit) {
  size_t bytes = 0;
  for (const wire::AnswerView answer = wire::parse_answer(unit).value();
       const wire::FragmentView& f : answer.fragments) {
    const wire::Scans scans = wire::split_scans(f.payload, f.has_lost).value();
    bytes += scans.pixels.size() + scans.lost.size();
  }
  return bytes;
}

TEST(Overhead, SmallFragmentsCostAtMost60Bytes) {
  // 32 x 32 cameras that fill the view: fragments of about 16 x 16 pixels.
  std::vector<Fragment> fragments = weighted_fragments(PixelFamily::kI420, 32, kViewSize, kViewSize, 64);
  std::erase_if(fragments, [](const Fragment& f) { return f.rect.width() > 18 || f.rect.height() > 18; });
  ASSERT_GT(fragments.size(), 40u);
  const auto count = static_cast<double>(fragments.size());
  const wire::AnswerHeader header = wire::header_of_view(PixelFamily::kI420, kViewSize, kViewSize);
  for (const int quality : {50, 75, 90}) {
    const Bytes unit = to_bytes(wire::FragmentEncoder().encode(header, fragments, quality));
    size_t sent = 0;
    const std::vector<Sent> packets = packetize(wire::UnitKind::kAnswer, unit, kMtu - kRtpHeader);
    for (const Sent& packet : packets) sent += packet.payload.size() + kRtpHeader + kIpAndUdpHeaders;
    const auto coded = static_cast<double>(entropy_coded_bytes(unit));
    const double overhead = (static_cast<double>(sent) - coded) / count;
    std::printf("quality %d: %.0f fragments of %.1f bytes in %zu packets, %.1f bytes beyond each\n", quality, count,
                coded / count, packets.size(), overhead);
    EXPECT_LE(overhead, 60);
  }
}

}  // namespace
}  // namespace lf::rtp
