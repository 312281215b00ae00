// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <fstream>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "serve/limits.h"

namespace lf::serve {

// Receiver report for one stream (RFC 3550, 6.4.1); totals since the start.
struct ReceptionReport {
  uint32_t ssrc = 0;
  uint32_t highest = 0;  // highest sequence number, extended to 32 bits
  int32_t lost = 0;      // lost packets; duplicates reduce the number
};

// Computes packet loss between reports. The reports' "fraction lost" is unusable: browsers send a report with every
// NACK, so that the fraction covers two or three packets only.
class PacketLoss {
 public:
  // `reports`: the latest report of each stream. Returns the fraction of packets, 0 to 1, lost since the previous call,
  // or the previous result if there are no newer reports.
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

// Drops packets that a viewer does not need to send. The SRTP decoder and the RTP session keep state for each SSRC; the
// decoder does so before it authenticates the packet. The RTP session of GStreamer 1.22 deadlocks on RTCP feedback of
// format 5 (RFC 6051), and keeps up to 65,536 records for one transport-wide congestion control packet. Times are
// g_get_monotonic_time(). Not thread-safe.
class RtcpFilter {
 public:
  static constexpr size_t kMostSenders = 8;                 // SSRCs per browser
  static constexpr double kPerSecond = 200, kAtOnce = 400;  // RTCP packets
  static constexpr size_t kMostBytes = 1500;                // per packet

  // Returns true if a packet from the network may pass, before decryption (RFC 7983). Passes DTLS, and RTCP from a few
  // SSRCs at a limited rate. Drops RTP, because browsers only receive video.
  bool accept_encrypted(std::span<const uint8_t> packet, int64_t now);

  // Extracts receiver reports, requests for lost packets (generic NACK) and requests for key frames (PLI, FIR) from a
  // decrypted compound packet, up to the first malformed packet. Returns std::nullopt if the whole packet is needed.
  static std::optional<std::vector<uint8_t>> filter_compound(std::span<const uint8_t> compound);

 private:
  std::set<uint32_t> senders_;
  TokenBucket packets_{kPerSecond, kAtOnce};
};

// Paces the requests of a viewer and tracks pending requests. If the machine or the network is too slow for the frame
// rate, it skips requests, so that the frame rate drops but pictures stay complete and current. Without pacing, queues
// would grow and overflow. Thread-safe. Times are request times, nanoseconds, ascending.
class RequestPacer {
 public:
  static constexpr uint64_t kPatience = 1000000000;  // nanoseconds until a pending request is given up

  explicit RequestPacer(size_t most) : most_(most) {}

  // Sets the minimum interval between requests, nanoseconds.
  void set_interval(uint64_t interval) {
    const std::lock_guard lock(mutex_);
    interval_ = interval;
  }
  // Returns true if the request of this time may be sent, and then counts it as sent. Later requests of the same time,
  // for the other eye, get the same result.
  bool begin(uint64_t time) {
    const std::lock_guard lock(mutex_);
    if (time == last_request_) return time == latest_;
    last_request_ = time;
    while (!in_flight_.empty() && time - in_flight_.front() > kPatience) in_flight_.pop_front();
    if (latest_ && time < *latest_ + interval_) return false;
    wanted_++;
    if (in_flight_.size() >= most_) return false;
    made_++;
    latest_ = time;
    in_flight_.push_back(time);
    return true;
  }
  // Returns the fraction of due requests since the previous call that were sent; 1 if there were none.
  double kept() {
    const std::lock_guard lock(mutex_);
    const double part = wanted_ > 0 ? static_cast<double>(made_) / static_cast<double>(wanted_) : 1;
    wanted_ = made_ = 0;
    return part;
  }
  void end(uint64_t time) {
    const std::lock_guard lock(mutex_);
    while (!in_flight_.empty() && in_flight_.front() <= time) in_flight_.pop_front();
  }

 private:
  const size_t most_;
  std::mutex mutex_;
  std::deque<uint64_t> in_flight_;
  uint64_t interval_ = 0, wanted_ = 0, made_ = 0;
  std::optional<uint64_t> last_request_, latest_;  // time of the latest request, and of the latest sent request
};

// Adapts the video to the network. The bit rate drops at once if packets are lost or queue up, and recovers slowly.
// Below a minimum rate per pixel it halves first the frame rate, then the size. Uses no clock and no locks; call
// update() once a second.
class QualityControl {
 public:
  static constexpr double kHighLoss = 0.05, kLowLoss = 0.02;
  static constexpr double kQueueing = 0.1;  // seconds of round-trip time above the minimum
  static constexpr double kDecrease = 0.75, kIncrease = 1.08;
  // Below kLeastBitsPerPixel, H.264 shows blocks in motion. kHysteresis avoids oscillation between steps.
  static constexpr double kLeastBitsPerPixel = 0.05, kHysteresis = 1.25;
  // If the packets with the new size are lost, browsers decode H.264's next key frame with the old size and do not
  // notice. Key frames are therefore repeated once a second for this many seconds while packets are lost.
  static constexpr int kKeyFrameRepeats = 5;

  // `pixels_per_second`: of the full-quality video.
  QualityControl(int least, int most, double pixels_per_second)
      : least_(least), most_(most), pixels_(pixels_per_second), now_(most) {
    choose_step();
  }

  int bits_per_second() const { return static_cast<int>(now_); }
  int pictures_left_out() const { return step_ > 0 ? 1 : 0; }
  int size_divisor() const { return step_ > 1 ? 2 : 1; }
  bool wants_key_frame() const { return wants_key_frame_; }

  // Updates the state with a receiver's report. `round_trip`: seconds; 0: unknown. Returns true if the bit rate
  // changed.
  bool update(double loss, double round_trip) {
    if (round_trip > 0) best_ = best_ > 0 ? std::min(best_, round_trip) : round_trip;
    const double before = now_;
    const int size_before = size_divisor();
    const double queueing = round_trip > 0 ? round_trip - best_ : 0;
    if (loss > kHighLoss || queueing > kQueueing)
      now_ = std::max<double>(least_, now_ * kDecrease);
    else if (loss < kLowLoss && queueing < kQueueing / 2)
      now_ = std::min<double>(most_, now_ * kIncrease);
    choose_step();
    wants_key_frame_ = repeats_ > 0 && loss > 0;
    repeats_ = size_divisor() != size_before ? kKeyFrameRepeats : std::max(repeats_ - 1, 0);
    return now_ != before;
  }

 private:
  static constexpr double kShare[] = {1, 1.0 / 2, 1.0 / 8};  // fraction of the pixels at each step
  static constexpr int kLastStep = 2;

  double needed(int step) const { return kLeastBitsPerPixel * pixels_ * kShare[step]; }
  void choose_step() {
    while (step_ < kLastStep && now_ < needed(step_)) step_++;
    while (step_ > 0 && (now_ >= most_ || now_ >= kHysteresis * needed(step_ - 1)) && now_ >= needed(step_ - 1))
      step_--;
  }

  double least_, most_, pixels_, now_, best_ = 0;
  int step_ = 0;
  int repeats_ = 0;
  bool wants_key_frame_ = false;
};

// Reduces the load, equally for all viewers, if the machine is too slow: first fewer depth hypotheses, then half the
// frame rate, then half the size. It steps down if requests are skipped while the processors are busy. It steps up
// after a while if the processors have enough reserve. If a step up proves wrong, the next one waits twice as long.
// Uses no clock and no locks; call update() once a second.
class LoadShedding {
 public:
  static constexpr double kMinMadeShare = 0.9;  // minimum fraction of viewers' requests that must be sent
  static constexpr double kBusy = 0.85;         // processor load above which the processors are the bottleneck
  static constexpr double kRelaxed = 0.65;      // processor load below which a step up is possible
  static constexpr int kPatience = 3;           // seconds of overload before a step down
  static constexpr int kRecoveryTime = 10, kMaxRecoveryTime = 160;  // seconds between a step and the step up

  // Returns the interval, in requests, between requests with depth hypotheses.
  unsigned depth_interval() const { return step_ == 0 ? 1 : step_ == 1 ? 3 : 8; }
  int pictures_left_out() const { return step_ > 2 ? 1 : 0; }
  int size_divisor() const { return step_ > 3 ? 2 : 1; }
  int step() const { return step_; }

  // `busy`: processor load, 0 to 1; `kept`: fraction of the due requests that were sent. Returns true if the step
  // changed.
  bool update(double busy, double kept) {
    since_++;
    slow_ = kept < kMinMadeShare && busy > kBusy ? slow_ + 1 : 0;
    if (slow_ >= kPatience && step_ < kLastStep) {
      if (stepped_back_ && since_ < rest_) rest_ = std::min(2 * rest_, kMaxRecoveryTime);
      return go(step_ + 1, false);
    }
    if (slow_ == 0 && kept >= kMinMadeShare && busy < kRelaxed && step_ > 0 && since_ >= rest_)
      return go(step_ - 1, true);
    if (step_ == 0 && since_ > kMaxRecoveryTime) rest_ = kRecoveryTime;
    return false;
  }

 private:
  static constexpr int kLastStep = 4;

  bool go(int step, bool back) {
    step_ = step;
    stepped_back_ = back;
    since_ = slow_ = 0;
    return true;
  }

  int step_ = 0, slow_ = 0, since_ = 0, rest_ = kRecoveryTime;
  bool stepped_back_ = false;
};

// System-wide processor load, from /proc/stat.
class ProcessorLoad {
 public:
  // Returns the load since the previous call, 0 to 1; 0: unknown.
  double update() {
    std::ifstream stat("/proc/stat");
    std::string name;
    uint64_t ticks[8] = {};  // user, nice, system, idle, iowait, irq, softirq, steal
    stat >> name;
    for (uint64_t& t : ticks) stat >> t;
    if (!stat || name != "cpu") return 0;
    const uint64_t idle = ticks[3] + ticks[4];
    uint64_t all = 0;
    for (const uint64_t t : ticks) all += t;
    const uint64_t passed = all - all_, unused = idle - idle_;
    const bool first = all_ == 0;
    all_ = all;
    idle_ = idle;
    return first || passed == 0 ? 0 : 1 - static_cast<double>(unused) / static_cast<double>(passed);
  }

 private:
  uint64_t all_ = 0, idle_ = 0;
};

// Returns the phase of a viewer's requests within the frame period, 0 to 1. Without different phases, every
// request would wait for the pictures of all other viewers. Multiples of the golden ratio spread consecutive viewers:
// any n of them in a row are at least 1 / (1 + sqrt 5) / n apart.
inline double request_phase(uint32_t view) {
  constexpr double kGoldenRatio = 0.6180339887498949;
  const double turns = kGoldenRatio * view;
  return turns - std::floor(turns);
}

}  // namespace lf::serve
