// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/sequence_window.h"

#include <algorithm>

namespace lf::rtp {

void SequenceWindow::restart(uint16_t sequence, uint32_t timestamp) {
  slots_.fill({});
  started_ = true;
  restart_at_.reset();
  newest_ = sequence;
  slot(sequence) = {State::kSeen, timestamp};
}

SequenceWindow::Verdict SequenceWindow::add(uint16_t sequence, uint32_t timestamp) {
  if (!started_) {
    restart(sequence, timestamp);
    return Verdict::kNew;
  }
  const int ahead = static_cast<int16_t>(static_cast<uint16_t>(sequence - newest_));
  if (ahead > kMaxJump || ahead <= -kSize) {
    if (restart_at_ == sequence) {
      restart(sequence, timestamp);
      return Verdict::kRestarted;
    }
    restart_at_ = static_cast<uint16_t>(sequence + 1);
    return Verdict::kNew;
  }
  restart_at_.reset();
  if (ahead > 0) {
    lost_ += static_cast<uint64_t>(ahead - 1);
    for (int i = std::max(1, ahead - kSize + 1); i < ahead; i++)
      slot(static_cast<uint16_t>(newest_ + i)) = {State::kMissing, 0};
    newest_ = sequence;
  } else {
    const Slot& old = slot(sequence);
    if (old.state == State::kSeen) {
      if (old.timestamp == timestamp) return Verdict::kDuplicate;
      restart(sequence, timestamp);
      return Verdict::kRestarted;
    }
    if (old.state == State::kMissing) lost_--;
  }
  slot(sequence) = {State::kSeen, timestamp};
  return Verdict::kNew;
}

}  // namespace lf::rtp
