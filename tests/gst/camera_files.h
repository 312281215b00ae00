// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <string>

#include "rig/rig.h"

namespace lf::test {

// Runs a pipeline to its end. Throws std::runtime_error where it does not come to one.
void run_to_end(const std::string& line);

// A temporary folder with one little recording of each kind that lfcamsrc reads: kFrames frames of 64x48 at 15
// frames/s, frame k all grey of level grey_of(k). Throws std::runtime_error where GStreamer can't write one.
class CameraFiles {
 public:
  static constexpr int kWidth = 64, kHeight = 48, kFrames = 6, kRate = 15;

  CameraFiles();
  ~CameraFiles();
  CameraFiles(const CameraFiles&) = delete;
  CameraFiles& operator=(const CameraFiles&) = delete;

  // The part of a launch line that makes H.264 of raw video; "" where an encoder or a decoder is not installed. With it
  // there are h264.mp4 and h264.mkv.
  static std::string h264_encoder();
  static int grey_of(int frame) { return 20 + 30 * frame; }
  std::string path(const std::string& name) const { return folder_ + "/" + name; }
  std::string uri(const std::string& name) const { return "file://" + path(name); }

  // Saves a rig of `count` cameras on a grid of one row, ids 0, 1, ...; `edit` sets what is special about each. Returns
  // the path of the rig file.
  std::string save(const std::string& name, int count, const std::function<void(Camera&)>& edit) const;

 private:
  std::string folder_;
};

}  // namespace lf::test
