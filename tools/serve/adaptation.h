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

// Drops packets that a viewer does not need to send. The SRTP decoder and the RTP session keep state for each SSRC; the
// decoder does so before it authenticates the packet. The RTP session of GStreamer 1.22 deadlocks on RTCP feedback of
// format 5 (RFC 6051), and keeps up to 65,536 records for one transport-wide congestion control packet. Times are
// g_get_monotonic_time(). Without locks.
class RtcpFilter {
 public:
  static constexpr size_t kMostSenders = 8;                 // SSRCs of one browser
  static constexpr double kPerSecond = 200, kAtOnce = 400;  // RTCP packets
  static constexpr size_t kMostBytes = 1500;                // of one packet

  // Whether a packet from the network may pass, before it is decrypted (RFC 7983). DTLS may. RTP may not: browsers
  // receive video, and send none. RTCP may from a few SSRCs, at a limited rate.
  bool take_sealed(std::span<const uint8_t> packet, int64_t now);

  // Extracts the receiver reports and the requests for lost packets (generic NACK) and key frames (PLI, FIR) from a
  // decrypted compound packet, up to its first malformed packet. Returns std::nullopt if the whole packet is needed.
  static std::optional<std::vector<uint8_t>> needed_part(std::span<const uint8_t> compound);

 private:
  std::set<uint32_t> senders_;
  TokenBucket packets_{kPerSecond, kAtOnce};
};

// Decides which of a viewer's requests are made, and knows which are being answered. Where the machine or the network
// is slower than the frame rate, requests that nobody has time for are not made: pictures come at the rate that there
// is, each whole and of the newest moment, in place of queues that end in gaps. Thread-safe. Times are those of
// requests, nanoseconds, rising.
class Pace {
 public:
  static constexpr uint64_t kPatience = 1000000000;  // nanoseconds until an answer is not waited for any more

  explicit Pace(size_t most) : most_(most) {}

  // Sets how far apart requests are at least, nanoseconds.
  void set_interval(uint64_t interval) {
    const std::lock_guard lock(mutex_);
    interval_ = interval;
  }
  // Whether the request of this time may be made now; if so it counts as made. What is said of the first request of a
  // time holds for those that follow it: they are for the other eye.
  bool begin(uint64_t time) {
    const std::lock_guard lock(mutex_);
    if (time == asked_) return time == latest_;
    asked_ = time;
    while (!under_way_.empty() && time - under_way_.front() > kPatience) under_way_.pop_front();
    if (latest_ && time < *latest_ + interval_) return false;
    wanted_++;
    if (under_way_.size() >= most_) return false;
    made_++;
    latest_ = time;
    under_way_.push_back(time);
    return true;
  }
  // The part that was made of the requests since the last call that were not too soon; 1 where there were none.
  double kept() {
    const std::lock_guard lock(mutex_);
    const double part = wanted_ > 0 ? static_cast<double>(made_) / static_cast<double>(wanted_) : 1;
    wanted_ = made_ = 0;
    return part;
  }
  // The request of this time has become a picture. What was asked for before never will.
  void end(uint64_t time) {
    const std::lock_guard lock(mutex_);
    while (!under_way_.empty() && under_way_.front() <= time) under_way_.pop_front();
  }

 private:
  const size_t most_;
  std::mutex mutex_;
  std::deque<uint64_t> under_way_;
  uint64_t interval_ = 0, wanted_ = 0, made_ = 0;
  std::optional<uint64_t> asked_, latest_;  // times of the latest request, and of the latest that was made
};

// Follows what the network takes: the bit rate falls at once where packets are lost or queue up, and comes back slowly.
// Where it is too little for every pixel first every other picture is left out, then pictures are of half the size.
// Plain arithmetic without clock or locks; update() once a second.
class QualityControl {
 public:
  static constexpr double kMuchLoss = 0.05, kLittleLoss = 0.02;  // parts of a second's packets that were lost
  static constexpr double kQueueing = 0.1;                       // seconds of round trip beyond the least seen
  static constexpr double kFall = 0.75, kRise = 1.08;
  // Below, H.264 shows blocks where anything moves. To come back takes a little more, or steps would follow steps.
  static constexpr double kLeastBitsPerPixel = 0.05, kBack = 1.25;
  // Browsers take H.264's key frame although the packets before it, which tell the new size, are lost, decode it as of
  // the old size, and notice nothing. So the key frame of a new size is followed by one a second, for this long, where
  // packets are lost.
  static constexpr int kRepeats = 5;

  // `pixels_per_second`: of the video at its best.
  QualityControl(int least, int most, double pixels_per_second)
      : least_(least), most_(most), pixels_(pixels_per_second), now_(most) {
    choose_step();
  }

  int bits_per_second() const { return static_cast<int>(now_); }
  int pictures_left_out() const { return step_ > 0 ? 1 : 0; }  // pictures left out after each that is shown
  int size_divisor() const { return step_ > 1 ? 2 : 1; }
  bool wants_key_frame() const { return wants_key_frame_; }

  // What the receiver reported; `round_trip` in seconds, 0: unknown. Returns whether anything has changed.
  bool update(double loss, double round_trip) {
    if (round_trip > 0) best_ = best_ > 0 ? std::min(best_, round_trip) : round_trip;
    const double before = now_;
    const int size_before = size_divisor();
    const double queueing = round_trip > 0 ? round_trip - best_ : 0;
    if (loss > kMuchLoss || queueing > kQueueing)
      now_ = std::max<double>(least_, now_ * kFall);
    else if (loss < kLittleLoss && queueing < kQueueing / 2)
      now_ = std::min<double>(most_, now_ * kRise);
    choose_step();
    wants_key_frame_ = repeats_ > 0 && loss > 0;
    repeats_ = size_divisor() != size_before ? kRepeats : std::max(repeats_ - 1, 0);
    return now_ != before;
  }

 private:
  static constexpr double kShare[] = {1, 1.0 / 2, 1.0 / 8};  // part of the pixels at each step
  static constexpr int kLastStep = 2;

  double needed(int step) const { return kLeastBitsPerPixel * pixels_ * kShare[step]; }
  void choose_step() {
    while (step_ < kLastStep && now_ < needed(step_)) step_++;
    while (step_ > 0 && (now_ >= most_ || now_ >= kBack * needed(step_ - 1)) && now_ >= needed(step_ - 1)) step_--;
  }

  double least_, most_, pixels_, now_, best_ = 0;
  int step_ = 0;
  int repeats_ = 0;  // repetitions of the key frame still to come
  bool wants_key_frame_ = false;
};

// What is left away when the machine can't make all pictures, the same for all viewers: first trials of the focal
// surface, then every other picture, then pixels. A step is taken where requests are turned away while the processors
// have nothing left, and taken back, after a while, where they would have enough again; a step back that turns out to
// be wrong makes the next one wait twice as long. Plain arithmetic without clock or locks; update() once a second.
class Shedding {
 public:
  static constexpr double kKept = 0.9;      // part of viewers' requests that is made: less is too little
  static constexpr double kBusy = 0.85;     // part of the processors in use: with less something else is slow
  static constexpr double kRelaxed = 0.65;  // part of the processors in use: less leaves enough for a step back
  static constexpr int kPatience = 3;       // seconds that are too slow before a step is taken
  static constexpr int kRest = 10, kLongestRest = 160;  // seconds from a step to taking it back

  // Requests from one with trials to the next.
  unsigned trial_interval() const { return step_ == 0 ? 1 : step_ == 1 ? 3 : 8; }
  int pictures_left_out() const { return step_ > 2 ? 1 : 0; }  // pictures left out after each that is shown
  int size_divisor() const { return step_ > 3 ? 2 : 1; }
  int step() const { return step_; }

  // `busy`: of the processors, 0 to 1; `kept`: of the requests that viewers would make, those that were made. Returns
  // whether anything has changed.
  bool update(double busy, double kept) {
    since_++;
    slow_ = kept < kKept && busy > kBusy ? slow_ + 1 : 0;
    if (slow_ >= kPatience && step_ < kLastStep) {
      if (went_back_ && since_ < rest_) rest_ = std::min(2 * rest_, kLongestRest);
      return go(step_ + 1, false);
    }
    if (slow_ == 0 && kept >= kKept && busy < kRelaxed && step_ > 0 && since_ >= rest_) return go(step_ - 1, true);
    if (step_ == 0 && since_ > kLongestRest) rest_ = kRest;
    return false;
  }

 private:
  static constexpr int kLastStep = 4;

  bool go(int step, bool back) {
    step_ = step;
    went_back_ = back;
    since_ = slow_ = 0;
    return true;
  }

  int step_ = 0, slow_ = 0, since_ = 0, rest_ = kRest;
  bool went_back_ = false;
};

// How much of this machine's processors is in use, by everybody, from /proc/stat.
class ProcessorLoad {
 public:
  // The load since the call before, 0 to 1; 0 where nothing is known.
  double update() {
    std::ifstream stat("/proc/stat");
    std::string name;
    uint64_t ticks[8] = {};  // user, nice, system, idle, waiting for disks, interrupts, soft interrupts, stolen
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

// The part of the time between two pictures, 0 to 1, that has passed when a viewer's requests leave. Those of viewers
// that came one after the other are far apart, however many they are (multiples of the golden ratio: any n of them in a
// row are at least 1 / (1 + sqrt 5) / n apart): all at the same instant, each would wait for the others' pictures.
inline double turn_of(uint32_t view) {
  constexpr double kGoldenRatio = 0.6180339887498949;
  const double turns = kGoldenRatio * view;
  return turns - std::floor(turns);
}

}  // namespace lf::serve
