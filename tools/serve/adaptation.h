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

// The contents of a browser's RTCP receiver report for one stream (RFC 3550, 6.4.1). Numbers are totals since the
// start.
struct ReceptionReport {
  uint32_t ssrc = 0;
  uint32_t highest = 0;  // highest sequence number, extended to 32 bits
  int32_t lost = 0;      // number of lost packets minus duplicates
};

// Computes the packet loss of a viewer from the packet counts in consecutive RTCP receiver reports. The field "fraction
// lost" of the reports is unusable: browsers send a report with each request for lost packets, so this fraction covers
// only two or three packets.
class PacketLoss {
 public:
  // `reports` contains the latest report of each stream. Returns the fraction of packets, 0 to 1, that were lost since
  // the previous call. Without newer reports, returns the previous result.
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

// Protects a viewer's pipeline from harmful packets of its browser. There are three attacks. Packets with many SSRCs
// (stream ids) exhaust the memory, because the SRTP decoder and the RTP session keep state for each SSRC. The decoder
// does so even for packets that it cannot authenticate. RTCP feedback of format 5 (RFC 6051) deadlocks the RTP session
// of GStreamer 1.22. One packet of transport-wide congestion control makes the session keep up to 65,536 records.
//
// Times are g_get_monotonic_time(). Not thread-safe.
class RtcpFilter {
 public:
  static constexpr size_t kMaxSenders = 8;                  // maximum number of SSRCs per browser
  static constexpr double kPerSecond = 200, kAtOnce = 400;  // rate limit of RTCP packets: per second, and burst
  static constexpr size_t kMaxBytes = 1500;

  // Decides whether a packet from the network passes, before its decryption (RFC 7983). DTLS passes. RTCP passes from a
  // few SSRCs at a limited rate. RTP is dropped, because browsers only receive video.
  bool accept_encrypted(std::span<const uint8_t> packet, int64_t now);

  // Reduces a decrypted compound RTCP packet to the parts that the server uses. These are receiver reports, requests
  // for lost packets (generic NACK) and requests for key frames (PLI, FIR). Everything from the first malformed part on
  // is dropped. Returns std::nullopt if the packet can be used as it is.
  static std::optional<std::vector<uint8_t>> filter_compound(std::span<const uint8_t> compound);

 private:
  std::set<uint32_t> senders_;
  TokenBucket packets_{kPerSecond, kAtOnce};
};

// Limits the number of a viewer's requests that are in flight, that is, sent to the cameras but not answered. If the
// machine or the network is too slow for the frame rate, further requests are skipped. The frame rate then drops, but
// pictures stay complete and current. Without this limit, queues would fill, and all pictures would be late.
//
// Thread-safe. Times are request times in nanoseconds and must not decrease.
class RequestPacer {
 public:
  static constexpr uint64_t kPatience = 1000000000;  // nanoseconds until an unanswered request no longer counts
  static constexpr unsigned kRepeats = 6;            // equal requests until the view rests
  // Each equal request of a resting view increases the time between requests by this step, in nanoseconds.
  static constexpr uint64_t kRestStep = 62500000;
  static constexpr unsigned kRestSteps = 4;

  explicit RequestPacer(size_t most) : most_(most) {}

  void set_interval(uint64_t interval) {
    const std::lock_guard lock(mutex_);
    interval_ = interval;
  }
  // Returns true if the request of this time may be sent, and then counts it as sent.
  bool begin(uint64_t time) {
    const std::lock_guard lock(mutex_);
    while (!in_flight_.empty() && time - in_flight_.front() > kPatience) in_flight_.pop_front();
    const uint64_t least =
        std::max(interval_, kRestStep * std::min(repeats_ - std::min(repeats_, kRepeats), kRestSteps));
    if (latest_ && time < *latest_ + least) return false;
    wanted_++;
    if (in_flight_.size() >= most_) return false;
    made_++;
    latest_ = time;
    in_flight_.push_back(time);
    return true;
  }
  // Call this if the latest request has the same picture as the request before, or another picture. After kRepeats
  // repeats, the view rests: requests become rare, because the viewer has the picture already. They do not end, because
  // the focal surface may still improve.
  void note_repeat(bool repeats) {
    const std::lock_guard lock(mutex_);
    repeats_ = repeats ? repeats_ + 1 : 0;
  }
  bool is_resting() const {
    const std::lock_guard lock(mutex_);
    return repeats_ > kRepeats;
  }
  // Returns how many of the requests that were due since the previous call have been sent, as a fraction; 1 if none was
  // due.
  double kept() {
    const std::lock_guard lock(mutex_);
    const double part = wanted_ > 0 ? static_cast<double>(made_) / static_cast<double>(wanted_) : 1;
    wanted_ = made_ = 0;
    return part;
  }
  // Call this when the picture of this time is complete. Earlier requests do not count as in flight any more.
  void end(uint64_t time) {
    const std::lock_guard lock(mutex_);
    while (!in_flight_.empty() && in_flight_.front() <= time) in_flight_.pop_front();
  }

 private:
  const size_t most_;
  mutable std::mutex mutex_;
  std::deque<uint64_t> in_flight_;
  uint64_t interval_ = 0, wanted_ = 0, made_ = 0;
  unsigned repeats_ = 0;
  std::optional<uint64_t> latest_;
};

// Adapts a viewer's video to the network. The bit rate drops at once if packets are lost or queue up in the network,
// and recovers slowly. If the bit rate is too low for the number of pixels, first the frame rate is halved, and then
// the size. Call update() once a second.
class QualityControl {
 public:
  static constexpr double kHighLoss = 0.05, kLowLoss = 0.02;
  // increase of the round-trip time over its minimum that indicates a queue, seconds
  static constexpr double kQueueing = 0.1;
  static constexpr double kDecrease = 0.75, kIncrease = 1.08;
  // H.264 shows blocks in moving regions below kMinBitsPerPixel. kHysteresis prevents oscillation between two steps.
  static constexpr double kMinBitsPerPixel = 0.05, kHysteresis = 1.25;
  // If the first packets after a change of the size are lost, browsers decode the next H.264 key frame in the old size
  // and do not notice. While packets are lost, key frames are therefore repeated once a second, for this many seconds.
  static constexpr int kKeyFrameRepeats = 5;

  // `least` and `most` limit the bit rate. `pixels_per_second` is the pixel rate of the video at full quality.
  QualityControl(int least, int most, double pixels_per_second)
      : least_(least), most_(most), pixels_(pixels_per_second), now_(most) {
    choose_step();
  }

  int bits_per_second() const { return static_cast<int>(now_); }
  int pictures_left_out() const { return step_ > 0 ? 1 : 0; }
  int size_divisor() const { return step_ > 1 ? 2 : 1; }
  bool wants_key_frame() const { return wants_key_frame_; }

  // Updates the state with the packet loss (0 to 1) and the round-trip time (seconds; 0: unknown) that a browser
  // reports. Returns true if the bit rate has changed.
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
  static constexpr double kShare[] = {1, 1.0 / 2, 1.0 / 8};  // fraction of the pixel rate at each step
  static constexpr int kLastStep = 2;

  double needed(int step) const { return kMinBitsPerPixel * pixels_ * kShare[step]; }
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

// Reduces the quality in steps, equally for all viewers, if the machine is too slow. The steps are: fewer depth
// hypotheses (guessed depths, which the cameras test), then half the frame rate, then half the size. The load is
// reduced by a step if requests are skipped while the processors are busy. It rises again by a step after a while if
// the processors have enough reserve. If this proves wrong, the next attempt waits twice as long. Call update() once a
// second.
class LoadShedding {
 public:
  static constexpr double kMinMadeShare = 0.9;  // fraction of sent requests below which the machine is too slow
  static constexpr double kBusy = 0.85;         // processor load above which the processors are the cause
  static constexpr double kRelaxed = 0.65;      // processor load below which the load may rise
  static constexpr int kPatience = 3;           // seconds of overload before the load is reduced
  static constexpr int kRecoveryTime = 10, kMaxRecoveryTime = 160;  // seconds after a step until the load may rise

  // Returns n if only every n-th request may contain depth hypotheses, which cost the most time.
  unsigned depth_interval() const { return step_ == 0 ? 1 : step_ == 1 ? 3 : 8; }
  int pictures_left_out() const { return step_ > 2 ? 1 : 0; }
  int size_divisor() const { return step_ > 3 ? 2 : 1; }
  int step() const { return step_; }

  // `busy` is the processor load, 0 to 1, and `kept` the fraction of due requests that were sent. Returns true if the
  // step has changed.
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

// Measures the load of all processors of this machine, from /proc/stat.
class ProcessorLoad {
 public:
  // Returns the load since the previous call, from 0 (idle) to 1.
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

// Returns when a viewer sends its requests within each frame period, as a fraction from 0 to 1. The times of the
// viewers are evenly spread. If all viewers sent their requests at the same time, each request would wait for the
// pictures of all other viewers.
inline double request_phase(uint32_t view) {
  constexpr double kGoldenRatio = 0.6180339887498949;
  const double turns = kGoldenRatio * view;
  return turns - std::floor(turns);
}

}  // namespace lf::serve
