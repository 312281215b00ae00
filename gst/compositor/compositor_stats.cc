// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/compositor_stats.h"

#include <algorithm>
#include <functional>
#include <string>
#include <utility>

namespace lf {
namespace {

constexpr size_t kMaxInFlight = 256;  // limit for requests that are never answered

uint64_t nanoseconds(int64_t from, int64_t to) { return to > from ? static_cast<uint64_t>(to - from) * 1000 : 0; }

void set_figures(GstStructure* stats, const char* name, const CameraMonitor& monitor,
                 const std::function<double(const PredictionError&)>& figure) {
  GValue array = G_VALUE_INIT, value = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  g_value_init(&value, G_TYPE_DOUBLE);
  for (CameraIndex i = 0; i < monitor.cameras(); i++) {
    g_value_set_double(&value, figure(monitor.error(i)));
    gst_value_array_append_value(&array, &value);
  }
  g_value_unset(&value);
  gst_structure_take_value(stats, name, &array);
}

}  // namespace

void set_suspects(GstStructure* structure, const char* field, const std::vector<CameraMonitor::Suspect>& suspects) {
  GValue array = G_VALUE_INIT, value = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  g_value_init(&value, GST_TYPE_STRUCTURE);
  for (const CameraMonitor::Suspect& suspect : suspects) {
    g_value_take_boxed(
        &value, gst_structure_new("lightfield-suspect", "camera", G_TYPE_UINT, suspect.camera, "fault", G_TYPE_STRING,
                                  std::string(to_string(suspect.fault)).c_str(), nullptr));
    gst_value_array_append_value(&array, &value);
  }
  g_value_unset(&value);
  gst_structure_take_value(structure, field, &array);
}

void CompositorStats::reset() {
  std::lock_guard lock(mutex_);
  for (uint64_t& counter : counters_) counter = 0;
  pictures_ = complete_ = fragments_ = missing_ = damaged_ = bytes_ = max_skew_ns_ = out_of_service_ =
      consistency_bytes_ = 0;
  unseen_ = 0;
  coverage_.reset();
  focus_ = {};
  monitor_.reset();
  monitor_bytes_ = 0;
  arrivals_.clear();
  for (Percentiles* times : {&answer_ns_, &composite_ns_, &latency_ns_, &add_ns_, &picture_ns_}) times->clear();
}

void CompositorStats::count(Counter counter) {
  std::lock_guard lock(mutex_);
  counters_[counter]++;
}

void CompositorStats::set_out_of_service(size_t cameras) {
  std::lock_guard lock(mutex_);
  out_of_service_ = cameras;
}

void CompositorStats::set_focus(const DepthEstimator::State& state, uint64_t consistency_bytes) {
  std::lock_guard lock(mutex_);
  focus_ = state;
  consistency_bytes_ += consistency_bytes;
}

void CompositorStats::add_monitor_bytes(uint64_t bytes) {
  std::lock_guard lock(mutex_);
  monitor_bytes_ += bytes;
}

void CompositorStats::set_monitor(const CameraMonitor& monitor) {
  std::lock_guard lock(mutex_);
  monitor_ = monitor;
}

void CompositorStats::request_arrived(uint32_t sequence, int64_t time) {
  std::lock_guard lock(mutex_);
  if (arrivals_.size() >= kMaxInFlight) arrivals_.clear();
  arrivals_[sequence] = time;
}

void CompositorStats::request_skipped(uint32_t sequence) {
  std::lock_guard lock(mutex_);
  arrivals_.erase(sequence);
  counters_[kSkippedRequests]++;
}

CompositorStats::Totals CompositorStats::totals() const {
  std::lock_guard lock(mutex_);
  return {pictures_, counters_[kSkippedRequests]};
}

GstStructure* CompositorStats::record(const Picture& p, bool describe) {
  std::lock_guard lock(mutex_);
  int64_t asked = p.answered;
  if (const auto arrival = arrivals_.find(p.sequence); arrival != arrivals_.end()) {
    asked = arrival->second;
    arrivals_.erase(arrival);
  }
  const uint64_t composite = nanoseconds(p.answered, p.done), latency = nanoseconds(asked, p.done);
  pictures_++;
  const bool unseen = p.fragments == 0 && p.missing == 0 && p.damaged == 0;
  const bool complete = p.fragments > 0 && p.missing == 0 && p.damaged == 0;
  complete_ += complete;
  unseen_ += unseen;
  coverage_ = p.coverage;
  fragments_ += p.fragments;
  missing_ += p.missing;
  damaged_ += p.damaged;
  bytes_ += p.bytes;
  max_skew_ns_ = std::max(max_skew_ns_, p.skew_ns);
  answer_ns_.add(nanoseconds(asked, p.answered));
  composite_ns_.add(composite);
  const uint64_t adding = nanoseconds(0, p.adding);
  add_ns_.add(adding);
  picture_ns_.add(composite - std::min(composite, adding));
  latency_ns_.add(latency);
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
  if (p.coverage)
    gst_structure_set(description, "coverage", G_TYPE_DOUBLE, p.coverage->seen, "extrapolated", G_TYPE_DOUBLE,
                      p.coverage->extrapolated, nullptr);
  return description;
}

GstStructure* CompositorStats::structure() const {
  std::lock_guard lock(mutex_);
  GstStructure* stats = gst_structure_new_empty("lightfield-compositor-stats");
  const auto set = [stats](const char* name, uint64_t value) {
    gst_structure_set(stats, name, G_TYPE_UINT64, value, nullptr);
  };
  set("pictures", pictures_);
  set("complete", complete_);
  set("incomplete", pictures_ - complete_);
  set("unseen", unseen_);
  if (coverage_)
    gst_structure_set(stats, "coverage", G_TYPE_DOUBLE, coverage_->seen, "extrapolated", G_TYPE_DOUBLE,
                      coverage_->extrapolated, nullptr);
  set("gpu-pictures", counters_[kGpuPictures]);
  set("repeated", counters_[kRepeatedPictures]);
  set("dropped", counters_[kDroppedPictures]);
  set("skipped", counters_[kSkippedRequests]);
  set("fragments", fragments_);
  set("missing-fragments", missing_);
  set("damaged-fragments", damaged_);
  set("late-answers", counters_[kLateAnswers]);
  set("unexpected-answers", counters_[kUnexpectedAnswers]);
  set("failed", counters_[kFailedPictures]);
  set("repeated-answers", counters_[kRepeatedAnswers]);
  set("bytes", bytes_);
  set("out-of-service", out_of_service_);
  set("bad-requests", counters_[kBadRequests]);
  set("bad-answers", counters_[kBadAnswers]);
  set("rig-mismatches", counters_[kRigMismatches]);
  set("max-skew-ns", max_skew_ns_);
  set("focus-rounds", focus_.rounds);
  set("focus-interval", focus_.interval);
  set("focus-hypotheses", focus_.hypotheses);
  set("focus-scene-changes", focus_.scene_changes);
  set("consistency-bytes", consistency_bytes_);
  gst_structure_set(stats, "focus-residual", G_TYPE_DOUBLE, focus_.residual, "focus-improvement", G_TYPE_DOUBLE,
                    focus_.gained, "focus-flat", G_TYPE_BOOLEAN, focus_.flat, "focus-deviation", G_TYPE_DOUBLE,
                    focus_.deviation, "focus-over-plane", G_TYPE_DOUBLE, focus_.over_plane, "focus-near", G_TYPE_DOUBLE,
                    focus_.near, "focus-far", G_TYPE_DOUBLE, focus_.far, nullptr);
  set("monitor-turns", monitor_ ? monitor_->turns() : 0);
  set("monitor-bytes", monitor_bytes_);
  if (monitor_) {
    set_figures(stats, "monitor-psnr", *monitor_, [](const PredictionError& error) { return error.psnr_db; });
    set_figures(stats, "monitor-gain", *monitor_, [](const PredictionError& error) { return error.gain; });
    set_figures(stats, "monitor-shift", *monitor_,
                [](const PredictionError& error) { return glm::length(error.shift); });
    set_suspects(stats, "monitor-suspects", monitor_->suspects());
  }
  const std::pair<const char*, const Percentiles*> stages[] = {{"answer", &answer_ns_},
                                                               {"add", &add_ns_},
                                                               {"picture", &picture_ns_},
                                                               {"composite", &composite_ns_},
                                                               {"latency", &latency_ns_}};
  for (const auto& [name, times] : stages)
    for (const int p : {50, 95, 99}) set((std::string(name) + "-ns-p" + std::to_string(p)).c_str(), times->at(p));
  return stats;
}

}  // namespace lf
