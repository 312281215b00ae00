// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/compositor_stats.h"

#include <algorithm>
#include <iterator>
#include <ranges>
#include <string>
#include <utility>

#include "common/common.h"

namespace lf {
namespace {

constexpr size_t kMaxInFlight = 256;  // limit for requests that are never answered

uint64_t nanoseconds(int64_t from, int64_t to) { return to > from ? static_cast<uint64_t>(to - from) * 1000 : 0; }

void set_coverage(GstStructure* structure, const std::optional<MeanCoverage>& coverage) {
  if (coverage)
    gst_structure_set(structure, "coverage", G_TYPE_DOUBLE, coverage->seen, "extrapolated", G_TYPE_DOUBLE,
                      coverage->extrapolated, nullptr);
}

constexpr const char* kCounterNames[] = {"pictures",
                                         "complete",
                                         "unseen",
                                         "gpu-pictures",
                                         "repeated",
                                         "dropped",
                                         "skipped",
                                         "fragments",
                                         "missing-fragments",
                                         "damaged-fragments",
                                         "late-answers",
                                         "unexpected-answers",
                                         "failed",
                                         "repeated-answers",
                                         "bytes",
                                         "bad-requests",
                                         "bad-answers",
                                         "rig-mismatches",
                                         "consistency-bytes",
                                         "monitor-bytes"};
static_assert(std::size(kCounterNames) == CompositorStats::kNumCounters);

}  // namespace

void set_suspects(GstStructure* structure, const char* field, const std::vector<CameraMonitor::Suspect>& suspects) {
  set_array(structure, field, GST_TYPE_STRUCTURE, suspects, [](GValue* value, const CameraMonitor::Suspect& suspect) {
    g_value_take_boxed(value, gst_structure_new("lightfield-suspect", "camera", G_TYPE_UINT, suspect.camera, "fault",
                                                G_TYPE_STRING, std::string(to_string(suspect.fault)).c_str(), nullptr));
  });
}

void CompositorStats::reset() {
  std::lock_guard lock(mutex_);
  values_ = {};
}

void CompositorStats::count(Counter counter, uint64_t by) {
  std::lock_guard lock(mutex_);
  values_.counters[counter] += by;
}

void CompositorStats::set_out_of_service(size_t cameras) {
  std::lock_guard lock(mutex_);
  values_.out_of_service = cameras;
}

void CompositorStats::set_focus(const DepthEstimator::State& state, uint64_t consistency_bytes) {
  std::lock_guard lock(mutex_);
  values_.focus = state;
  values_.counters[kConsistencyBytes] += consistency_bytes;
}

void CompositorStats::set_monitor(const CameraMonitor& monitor) {
  std::lock_guard lock(mutex_);
  values_.monitor = monitor;
}

void CompositorStats::request_arrived(uint32_t sequence, int64_t time) {
  std::lock_guard lock(mutex_);
  if (values_.arrivals.size() >= kMaxInFlight) values_.arrivals.clear();
  values_.arrivals[sequence] = time;
}

void CompositorStats::request_skipped(uint32_t sequence) {
  std::lock_guard lock(mutex_);
  values_.arrivals.erase(sequence);
  values_.counters[kSkippedRequests]++;
}

CompositorStats::Totals CompositorStats::totals() const {
  std::lock_guard lock(mutex_);
  return {values_.counters[kPictures], values_.counters[kSkippedRequests]};
}

GstStructure* CompositorStats::record(const Picture& p, bool describe) {
  std::lock_guard lock(mutex_);
  int64_t asked = p.answered;
  if (const auto arrival = values_.arrivals.find(p.sequence); arrival != values_.arrivals.end()) {
    asked = arrival->second;
    values_.arrivals.erase(arrival);
  }
  const uint64_t composite = nanoseconds(p.answered, p.done), latency = nanoseconds(asked, p.done),
                 adding = nanoseconds(0, p.adding);
  const bool has_gaps = p.missing > 0 || p.damaged > 0, complete = p.fragments > 0 && !has_gaps;
  auto& counters = values_.counters;
  counters[kPictures]++;
  counters[kComplete] += complete;
  counters[kUnseen] += p.fragments == 0 && !has_gaps;
  counters[kFragments] += p.fragments;
  counters[kMissingFragments] += p.missing;
  counters[kDamagedFragments] += p.damaged;
  counters[kBytes] += p.bytes;
  values_.coverage = p.coverage;
  values_.max_skew_ns = std::max(values_.max_skew_ns, p.skew_ns);
  values_.answer_ns.add(nanoseconds(asked, p.answered));
  values_.add_ns.add(adding);
  values_.picture_ns.add(composite - std::min(composite, adding));
  values_.composite_ns.add(composite);
  values_.latency_ns.add(latency);
  if (!describe) return nullptr;
  GstStructure* description =
      gst_structure_new("lightfield-view", "view-id", G_TYPE_UINT, p.view_id, "sequence", G_TYPE_UINT,
                        p.sequence,  //
                        "pts", G_TYPE_UINT64, p.pts, "complete", G_TYPE_BOOLEAN, complete, "fragments", G_TYPE_UINT,
                        p.fragments, "missing", G_TYPE_UINT, p.missing,                                            //
                        "damaged", G_TYPE_UINT, p.damaged,                                                         //
                        "bytes", G_TYPE_UINT64, p.bytes, "consistency-bytes", G_TYPE_UINT64, p.consistency_bytes,  //
                        "skew-ns", G_TYPE_UINT64, p.skew_ns,                                                       //
                        "latency-ns", G_TYPE_UINT64, latency, "add-ns", G_TYPE_UINT64, adding,                     //
                        "composite-ns", G_TYPE_UINT64, composite, nullptr);
  set_coverage(description, p.coverage);
  return description;
}

GstStructure* CompositorStats::structure() const {
  std::lock_guard lock(mutex_);
  const auto& [counters, out_of_service, max_skew_ns, coverage, focus, monitor, arrivals, answer_ns, add_ns, picture_ns,
               composite_ns, latency_ns] = values_;
  GstStructure* stats = gst_structure_new_empty("lightfield-compositor-stats");
  const auto set = [stats](const char* name, uint64_t value) {
    gst_structure_set(stats, name, G_TYPE_UINT64, value, nullptr);
  };
  for (size_t i = 0; i < kNumCounters; i++) set(kCounterNames[i], counters[i]);
  set("incomplete", counters[kPictures] - counters[kComplete]);
  set_coverage(stats, coverage);
  set("out-of-service", out_of_service);
  set("max-skew-ns", max_skew_ns);
  set("focus-rounds", focus.rounds);
  set("focus-interval", focus.interval);
  set("focus-hypotheses", focus.hypotheses);
  set("focus-scene-changes", focus.scene_changes);
  gst_structure_set(stats, "focus-residual", G_TYPE_DOUBLE, focus.residual, "focus-improvement", G_TYPE_DOUBLE,
                    focus.gained, "focus-flat", G_TYPE_BOOLEAN, focus.flat, "focus-deviation", G_TYPE_DOUBLE,
                    focus.deviation, "focus-over-plane", G_TYPE_DOUBLE, focus.over_plane, "focus-near", G_TYPE_DOUBLE,
                    focus.near, "focus-far", G_TYPE_DOUBLE, focus.far, nullptr);
  set("monitor-turns", monitor ? monitor->turns() : 0);
  if (monitor) {
    const auto set_figures = [stats, &of = *monitor](const char* name, auto figure) {
      set_array(stats, name, G_TYPE_DOUBLE, std::views::iota(size_t{0}, of.cameras()),
                [&](GValue* value, size_t camera) {
                  g_value_set_double(value, figure(of.error(static_cast<CameraIndex>(camera))));
                });
    };
    set_figures("monitor-psnr", [](const PredictionError& error) { return error.psnr_db; });
    set_figures("monitor-gain", [](const PredictionError& error) { return error.gain; });
    set_figures("monitor-shift", [](const PredictionError& error) { return glm::length(error.shift); });
    set_suspects(stats, "monitor-suspects", monitor->suspects());
  }
  const std::pair<const char*, const Percentiles*> stages[] = {{"answer", &answer_ns},
                                                               {"add", &add_ns},
                                                               {"picture", &picture_ns},
                                                               {"composite", &composite_ns},
                                                               {"latency", &latency_ns}};
  for (const auto& [name, times] : stages)
    for (const int p : {50, 95, 99}) set((std::string(name) + "-ns-p" + std::to_string(p)).c_str(), times->at(p));
  return stats;
}

}  // namespace lf
