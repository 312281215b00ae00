// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_service.h"

#include <algorithm>

namespace lf {

void CameraService::start() {
  std::lock_guard lock(mutex_);
  report_ = {.state = State::kOpening};
  out_since_ = found_ = waited_ = 0;
}

void CameraService::stop() {
  std::lock_guard lock(mutex_);
  report_.state = State::kStopped;
}

bool CameraService::lose(const std::string& reason, uint64_t now) {
  std::lock_guard lock(mutex_);
  report_.reason = reason;
  if (report_.state == State::kLost) return false;
  report_.state = State::kLost;
  report_.losses++;
  if (out_since_ == 0 || now - found_ > waited_) out_since_ = now;
  return true;
}

uint64_t CameraService::wait(uint64_t now) {
  std::lock_guard lock(mutex_);
  return waited_ = std::clamp((now - out_since_) / 4, kShortestWait, kLongestWait);
}

void CameraService::retry() {
  std::lock_guard lock(mutex_);
  report_.retries++;
}

bool CameraService::find(uint64_t now) {
  std::lock_guard lock(mutex_);
  const bool lost = report_.state == State::kLost;
  report_.state = State::kRunning;
  report_.worked = true;
  found_ = now;
  return lost;
}

void CameraService::end() {
  std::lock_guard lock(mutex_);
  if (report_.state != State::kLost) report_.state = State::kEnded;
}

CameraService::State CameraService::state() const {
  std::lock_guard lock(mutex_);
  return report_.state;
}

CameraService::Report CameraService::report() const {
  std::lock_guard lock(mutex_);
  return report_;
}

const char* to_string(CameraService::State state) {
  using State = CameraService::State;
  switch (state) {
    case State::kStopped: return "stopped";
    case State::kOpening: return "opening";
    case State::kRunning: return "running";
    case State::kEnded: return "ended";
    case State::kLost: return "lost";
  }
  return "";
}

}  // namespace lf
