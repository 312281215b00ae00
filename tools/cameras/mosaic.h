// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "image/image.h"
#include "quality/camera_monitor.h"
#include "rig/rig.h"

namespace lf::cameras {

// Shows all cameras in one live picture, arranged like the array, and detects a hand that is waved in front of a
// camera. Each camera is a small tile of the picture. Tiles cost CPU time only while clients request the picture.
// Thread-safe.
class Mosaic {
 public:
  explicit Mosaic(const Rig& rig);
  Mosaic(const Mosaic&) = delete;

  // Processes a raw or JPEG frame of the camera with this id; unknown ids are ignored. `now` is the time of a monotonic
  // clock in seconds.
  void see(uint32_t id, GstBuffer* buffer, GstCaps* caps, double now);
  // Swaps the images of two cameras, after their devices were swapped in the rig.
  void swap(uint32_t a, uint32_t b);

  // Returns the latest complete mosaic as a JPEG file. A background thread encodes at most ten mosaics per second, so
  // calls are cheap. Throws Error.
  std::vector<uint8_t> jpeg(double now);
  // Returns the state of the cameras as JSON:
  //    {"columns": 8, "rows": 8, "tile": [160, 120], "cameras": [{"id": 0, "name": "cam_00_00", "column": 0, "row": 0,
  //     "rate": 29.9, "problem": "", "lit": false}, ...]}
  // "problem" is the reason why a camera delivers no frames. During a guided recording, RecordingPage adds "told", an
  // instruction for the person, and "places", the columns and rows of image regions that a light should reach. Each
  // camera then has "came", one flag per region in row-major order, and "wanted", the missing regions.
  nlohmann::json state(double now, const std::function<std::string(uint32_t id)>& problem) const;

 private:
  struct Tile {
    std::string name;
    uint32_t id = 0;
    int column = 0, row = 0;
    Image small;
    double looked = -1e9, arrival_time = -1e9, rate = 0;
  };
  Tile* find(uint32_t id);
  void encode(const std::stop_token& stop);
  Image picture() const;
  int columns_ = 1, rows_ = 1, width_ = 160, height_ = 120;
  mutable std::mutex mutex_;
  std::vector<Tile> tiles_;
  HandWaveDetector waves_;
  double watched_ = -1e9;
  std::condition_variable_any changed_;
  bool wanted_ = false;
  std::vector<uint8_t> jpeg_;
  std::string problem_;
  std::jthread encoder_;  // the last member, so that it ends first
};

}  // namespace lf::cameras
