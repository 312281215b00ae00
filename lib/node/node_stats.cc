// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/node_stats.h"

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

std::vector<std::pair<std::string, uint64_t>> NodeStats::all() const {
  std::lock_guard lock(mutex_);
  std::vector<std::pair<std::string, uint64_t>> all = {
      {"requests", requests},
      {"bad-requests", bad_requests},
      {"rig-mismatches", rig_mismatches},
      {"answers", answers},
      {"drawn", drawn},
      {"together", together},
      {"card-frames", card_frames},
      {"skipped", skipped},
      {"superseded", superseded},
      {"fragments", fragments},
      {"bytes", bytes},
      {"missing-frames", missing_frames},
      {"stale-frames", stale_frames},
      {"damaged-frames", damaged_frames},
      {"max-skew-ns", max_skew_ns},
      {"wait-ns", latest_.wait},
      {"decode-ns", latest_.decode},
      {"render-ns", latest_.render},
      {"encode-ns", latest_.encode},
  };
  const std::pair<const char*, const Percentiles*> stages[] = {
      {"wait", &wait_}, {"decode", &decode_}, {"render", &render_}, {"encode", &encode_}, {"answer", &total_}};
  for (const auto& [name, times] : stages)
    for (const int p : {50, 95, 99}) all.emplace_back(std::string(name) + "-ns-p" + std::to_string(p), times->at(p));
  return all;
}

std::map<uint32_t, float> NodeStats::gains() const {
  std::lock_guard lock(mutex_);
  return gains_;
}

}  // namespace lf
