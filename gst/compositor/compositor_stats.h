// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>

#include <gst/gst.h>

#include "base/maths.h"
#include "focus/depth_estimator.h"
#include "quality/camera_monitor.h"
#include "render/contribution_map.h"

namespace lf {

// Collects the counters and durations that lfcompositor shows in its property `stats`. Thread-safe.
class CompositorStats {
 public:
  // The counters of the property, in its order.
  enum Counter {
    kPictures,
    kComplete,
    kUnseen,  // pictures of views that no camera sees: no fragments arrived, and none were expected
    kGpuPictures,
    kRepeatedPictures,
    kDroppedPictures,
    kSkippedRequests,
    kFragments,
    kMissingFragments,
    kDamagedFragments,
    kLateAnswers,
    kUnexpectedAnswers,
    kFailedPictures,  // pictures that failed, for example because memory was exhausted
    kRepeatedAnswers,
    kBytes,
    kBadRequests,
    kBadAnswers,
    kRigMismatches,
    kConsistencyBytes,
    // Bytes of the answers that only the camera monitor needs, which do not become part of a picture.
    kMonitorBytes,
    kNumCounters
  };

  // Measurements of one finished picture, which record() adds to the statistics. Times are microseconds, as from
  // g_get_monotonic_time().
  struct Picture {
    uint32_t view_id = 0, sequence = 0;
    GstClockTime pts = GST_CLOCK_TIME_NONE;
    unsigned fragments = 0, missing = 0, damaged = 0;
    // Share of the view that cameras see. Nothing if the compositor has no rig.
    std::optional<MeanCoverage> coverage;
    uint64_t bytes = 0;
    uint64_t consistency_bytes = 0;  // size of the photo-consistency units
    uint64_t skew_ns = 0;            // largest absolute difference between capture time and requested time
    int64_t answered = 0;            // time when the last answer arrived, or the deadline passed
    // Duration of adding the answers, microseconds.
    int64_t adding = 0;
    // Time when the picture was finished.
    int64_t done = 0;
  };

  void reset();
  void count(Counter counter, uint64_t by = 1);
  void set_out_of_service(size_t cameras);
  void set_focus(const DepthEstimator::State& state, uint64_t consistency_bytes);
  void set_monitor(const CameraMonitor& monitor);
  // Record that a request has arrived, or will get no picture. record() uses the arrival time (microseconds) to compute
  // the latency.
  void request_arrived(uint32_t sequence, int64_t time);
  void request_skipped(uint32_t sequence);
  struct Totals {
    uint64_t pictures, skipped;
  };
  Totals totals() const;
  // Adds a picture to the statistics. If `describe` is true, returns the structure for the element message
  // "lightfield-view" about this picture, which the caller owns; otherwise returns null. A picture without any fragment
  // does not count as complete.
  GstStructure* record(const Picture& picture, bool describe);
  // Returns the value of the property `stats`. The caller owns the structure.
  GstStructure* structure() const;

 private:
  struct Values {
    uint64_t counters[kNumCounters] = {};
    uint64_t out_of_service = 0, max_skew_ns = 0;
    std::optional<MeanCoverage> coverage;
    DepthEstimator::State focus;
    std::optional<CameraMonitor> monitor;
    std::map<uint32_t, int64_t> arrivals;  // arrival time by sequence number, of unanswered requests
    // Durations of the latest pictures: from the request to the last answer, of adding the answers, of making the
    // picture, from the last answer to the finished picture, and from the request to the finished picture.
    Percentiles answer_ns, add_ns, picture_ns, composite_ns, latency_ns;
  };
  mutable std::mutex mutex_;
  Values values_;
};

// Sets the field to an array with one structure "lightfield-suspect" for each camera that the camera monitor reports.
// Its fields are camera (uint: index in the rig) and fault (string).
void set_suspects(GstStructure* structure, const char* field, const std::vector<CameraMonitor::Suspect>& suspects);

}  // namespace lf
