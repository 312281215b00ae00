// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <vector>

namespace lf::serve {

// What a receiver says of one stream (RFC 3550, 6.4.1), counted since the beginning.
struct ReceptionReport {
  uint32_t ssrc = 0;
  uint32_t highest = 0;  // sequence number, extended
  int32_t lost = 0;      // packets; what came twice makes it smaller again
};

// Computes the loss between reports. Their own "fraction lost" will not do: browsers report with every request for
// packets again, so that it is that of some two or three packets.
class PacketLoss {
 public:
  // The newest report of each stream. Returns the part of the packets, 0 to 1, that was lost since the reports of the
  // call before; what it returned then, where there are no newer ones.
  double update(const std::vector<ReceptionReport>& reports) {
    double sent = 0, lost = 0;
    for (const ReceptionReport& now : reports) {
      const auto [before, first] = before_.try_emplace(now.ssrc, now);
      if (!first && now.highest != before->second.highest) {
        sent += static_cast<int32_t>(now.highest - before->second.highest);
        lost += now.lost - before->second.lost;
      }
      before->second = now;
    }
    if (sent > 0) loss_ = std::clamp(lost / sent, 0.0, 1.0);
    return loss_;
  }

 private:
  std::map<uint32_t, ReceptionReport> before_;
  double loss_ = 0;
};

}  // namespace lf::serve
