// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include <gst/gst.h>

#include "common/gst_pointers.h"
#include "serve/histogram.h"

namespace lf::serve {

// Prometheus metrics of the elements of a pipeline: camera hosts (lfnodesink) and compositors (lfcompositor, also in
// lfviewsrc). Counters of several elements of the same type are added. Must outlive the pipeline. Thread-safe.
class PipelineMetrics {
 public:
  // Watches the elements of the pipeline, also those that it adds later.
  explicit PipelineMetrics(GstElement* pipeline);
  PipelineMetrics(const PipelineMetrics&) = delete;

  // Adds a message of an element to the histograms. Returns false if it is a message for the application.
  bool take(GstMessage* message);
  // Returns the text of /metrics. Locks each lf element for its statistics, so that it does not return if one of them
  // never releases its lock.
  std::string text() const;

 private:
  void watch(GstElement* element);
  std::string cameras() const;

  GstElement* const pipeline_;  // borrowed
  const int64_t started_ = g_get_monotonic_time();
  Histogram answers_, pictures_, skews_;
  mutable std::mutex mutex_;
  std::map<uint32_t, std::atomic<int64_t>> last_frames_;  // by camera, g_get_monotonic_time(); guarded by mutex_
};

// Checks if a playing pipeline makes progress: no sink holds a buffer all the time, and answers and pictures follow
// when requests and packets arrive. An idle pipeline without input has no problem. Main thread only.
class ProgressCheck {
 public:
  explicit ProgressCheck(GstElement* pipeline) : pipeline_(pipeline) {}  // borrowed
  ProgressCheck(const ProgressCheck&) = delete;

  // Describes what has not progressed since the previous call; "" if there is no problem. Does not return if an element
  // never releases its lock.
  std::string problem();

 private:
  struct Counts {
    uint64_t in = 0, out = 0;
    bool is_waiting = false;  // there was input after the latest result
  };
  std::string stopped_element();
  std::string blocked_sink();

  GstElement* const pipeline_;
  std::map<size_t, Counts> counts_;                                    // by row of the table of counters
  std::map<std::string, std::shared_ptr<std::atomic<bool>>> is_busy_;  // by path of the pad of a sink
};

}  // namespace lf::serve
