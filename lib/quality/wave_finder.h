// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace lf {

// Finds the camera that somebody holds a hand before: its picture is another one than it was, and those of the others
// are not. Not thread-safe.
class WaveFinder {
 public:
  explicit WaveFinder(size_t cameras) : cameras_(cameras) {}

  // A picture as the mean brightness of its parts, 0..1, always as many; taken at `time`, seconds, which do not go
  // back.
  void see(size_t camera, std::span<const float> parts, double time);
  // How far its newest picture is from its usual one, 0..1: the mean over the parts. What changes brightness as a
  // whole, as an automatic exposure does, counts half.
  double change(size_t camera) const { return cameras_[camera].change; }
  // The camera that stands out, if one does. People who walk past change several.
  std::optional<size_t> found() const;

 private:
  struct Camera {
    std::vector<float> usual;  // forgets with a time constant, so that a hand is usual after a while, too
    double time = 0, change = 0;
  };
  std::vector<Camera> cameras_;
};

}  // namespace lf
