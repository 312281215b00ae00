// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <array>
#include <atomic>

// A capture device that fails when it is told to: failing://0 to failing://63, live grey pictures of 64x48 in I420 at
// 30 frames/s. It stands for v4l2:// cameras with loose cables.
namespace lf::test {

struct FailingDevice {
  std::atomic<bool> broken = false;     // an error with the next frame, or when it is opened
  std::atomic<bool> ends = false;       // EOS with the next frame
  std::atomic<bool> stalls = false;     // no more frames, and not a word
  std::atomic<int> frames_at_most = 0;  // each time it is opened, then an error; 0: any number
  std::atomic<int> opened = 0;
};

inline FailingDevice& failing_device(size_t id) {
  static std::array<FailingDevice, 64> devices;
  return devices.at(id);
}

inline void reset_failing_devices() {
  for (size_t id = 0; id < 64; id++) {
    FailingDevice& device = failing_device(id);
    device.broken = device.ends = device.stalls = false;
    device.frames_at_most = device.opened = 0;
  }
}

// Once, after gst_init().
void register_failing_camera();

}  // namespace lf::test
