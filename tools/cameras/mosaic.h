// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <thread>
#include <vector>

#include "image/image.h"
#include "quality/camera_monitor.h"
#include "rig/rig.h"

namespace lf::cameras {

// Small live pictures of all cameras of a rig, side by side as the cameras stand, and who of them has a hand held
// before it. Pictures are made while somebody looks. Thread-safe.
class Mosaic {
 public:
  explicit Mosaic(const Rig& rig);
  ~Mosaic();
  Mosaic(const Mosaic&) = delete;

  // A frame of the camera with this id in the rig, raw or JPEG; at `now`, seconds of a clock that never goes back. Of
  // ids that are not in the rig nothing becomes.
  void see(uint32_t id, GstBuffer* buffer, GstCaps* caps, double now);
  // The devices of two cameras have been swapped.
  void swap(uint32_t a, uint32_t b);

  // A JPEG file of all tiles, in rows: the latest one that is complete. A thread makes them one after the other while
  // clients ask, ten times a second at most, so that a request costs next to nothing. Throws Error.
  std::vector<uint8_t> jpeg(double now);
  // {"columns": 8, "rows": 8, "tile": [160, 120], "cameras": [{"id": 0, "name": "cam_00_00", "column": 0, "row": 0,
  // "rate": 29.9, "problem": "", "lit": false}, ...]}: `problem` says why a camera gives no frames. A page of a
  // recording has more (RecordingPage): "told", a line for the person before the cameras; "places": [4, 3], those of
  // each picture that a light should come to; and of each camera "came", for each place whether it did, row by row, and
  // "wanted", where it is to go.
  nlohmann::json state(double now, const std::function<std::string(uint32_t id)>& problem) const;

 private:
  struct Tile {
    std::string name;
    uint32_t id = 0;
    int column = 0, row = 0;
    Image small;
    double looked = -1e9, came = -1e9, rate = 0;
  };
  Tile* find(uint32_t id);
  void encode();
  Image picture() const;
  int columns_ = 1, rows_ = 1, width_ = 160, height_ = 120;
  mutable std::mutex mutex_;
  std::vector<Tile> tiles_;
  WaveFinder waves_;
  double watched_ = -1e9;
  std::condition_variable changed_;
  bool wanted_ = false, ends_ = false;
  std::vector<uint8_t> jpeg_;  // the latest
  std::string problem_;        // why there is none
  std::thread encoder_;        // started by the first request
};

}  // namespace lf::cameras
