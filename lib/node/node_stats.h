// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/percentiles.h"
#include "focus/camera_gains.h"
#include "render/sum_renderer.h"

namespace lf {

// What a node has done and how long its stages took. Thread-safe.
struct NodeStats {
  std::atomic<uint64_t> requests{0}, bad_requests{0}, rig_mismatches{0}, answers{0}, drawn{0}, together{0},
      card_frames{0}, fragments{0}, bytes{0}, skipped{0}, superseded{0}, missing_frames{0}, stale_frames{0}, damaged_frames{0};
  std::atomic<uint64_t> max_skew_ns{0};

  // How long an answer took from the request's arrival to the answer's departure, nanoseconds.
  struct Stages {
    uint64_t wait = 0;    // waiting for frames that belong to the request's time
    uint64_t decode = 0;  // decoding regions of JPEG frames
    uint64_t render = 0;  // rendering, with planning
    uint64_t encode = 0;
  };
  void add(const Stages& stages);
  // What the cameras of a request were divided by.
  void set_gains(std::span<const Source> cameras, const CameraGains& gains);
  // All numbers by name; stages, nanoseconds, as the latest answer's and as percentiles over the latest answers.
  std::vector<std::pair<std::string, uint64_t>> all() const;
  // The gains that images were divided by, by the camera's id.
  std::map<uint32_t, float> gains() const;

 private:
  mutable std::mutex mutex_;
  Stages latest_;
  std::map<uint32_t, float> gains_;  // gains by the camera's id
  Percentiles wait_, decode_, render_, encode_, total_;
};

}  // namespace lf
