// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/node_stats.h"

#include <string>

namespace lf {

void NodeStats::add(const Stages& stages) {
  std::lock_guard lock(mutex_);
  latest_ = stages;
  wait_.add(stages.wait);
  decode_.add(stages.decode);
  render_.add(stages.render);
  encode_.add(stages.encode);
  total_.add(stages.wait + stages.decode + stages.render + stages.encode);
}

void NodeStats::set_gains(std::span<const Source> cameras, const CameraGains& gains) {
  std::lock_guard lock(mutex_);
  for (const Source& source : cameras) gains_[source.rig_camera->id] = gains.of(source.camera);
}

GstStructure* NodeStats::structure() const {
  GstStructure* stats = gst_structure_new_empty("application/x-lightfield-fragment-stats");
  const auto set = [stats](const std::string& name, uint64_t value) {
    gst_structure_set(stats, name.c_str(), G_TYPE_UINT64, value, nullptr);
  };
  set("requests", requests);
  set("bad-requests", bad_requests);
  set("rig-mismatches", rig_mismatches);
  set("answers", answers);
  set("drawn", drawn);
  set("skipped", skipped);
  set("superseded", superseded);
  set("fragments", fragments);
  set("bytes", bytes);
  set("missing-frames", missing_frames);
  set("stale-frames", stale_frames);
  set("damaged-frames", damaged_frames);
  set("max-skew-ns", max_skew_ns);
  std::lock_guard lock(mutex_);
  set("wait-ns", latest_.wait);
  set("decode-ns", latest_.decode);
  set("render-ns", latest_.render);
  set("encode-ns", latest_.encode);
  if (!gains_.empty()) {
    GstStructure* gains = gst_structure_new_empty("gains");
    for (const auto& [id, gain] : gains_)
      gst_structure_set(gains, ("camera-" + std::to_string(id)).c_str(), G_TYPE_DOUBLE, static_cast<double>(gain),
                        nullptr);
    gst_structure_set(stats, "gains", GST_TYPE_STRUCTURE, gains, nullptr);
    gst_structure_free(gains);
  }
  const std::pair<const char*, const Percentiles*> stages[] = {
      {"wait", &wait_}, {"decode", &decode_}, {"render", &render_}, {"encode", &encode_}, {"answer", &total_}};
  for (const auto& [name, times] : stages)
    for (const int p : {50, 95, 99}) set(std::string(name) + "-ns-p" + std::to_string(p), times->at(p));
  return stats;
}

}  // namespace lf
