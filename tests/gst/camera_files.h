// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/gst_test.h"
#include "rig/rig.h"

namespace lf::test {

// Plays a pipeline until EOS. Throws std::runtime_error on an error.
void run_to_end(const std::string& line);

// A temporary folder with one small recording of each kind that lfcamsrc reads: kFrames frames of 64x48 at 15 frames/s.
// Frame k is uniform grey of level grey_of(k). Throws std::runtime_error if GStreamer cannot write a recording.
class CameraFiles {
 public:
  static constexpr int kWidth = 64, kHeight = 48, kFrames = 6, kRate = 15;

  CameraFiles();
  ~CameraFiles();
  CameraFiles(const CameraFiles&) = delete;
  CameraFiles& operator=(const CameraFiles&) = delete;

  // Returns the part of a launch line that encodes raw video as H.264; "" if an encoder or decoder is missing. If it is
  // not empty, h264.mp4 and h264.mkv exist.
  static std::string h264_encoder();
  static int grey_of(int frame) { return 20 + 30 * frame; }
  std::string path(const std::string& name) const { return folder_ + "/" + name; }
  std::string uri(const std::string& name) const { return "file://" + path(name); }

  // Saves a rig of `count` cameras in a row with ids 0, 1, ...; `edit` changes each camera. Returns the path of the rig
  // file.
  std::string save(const std::string& name, int count, const std::function<void(Camera&)>& edit) const;

 private:
  std::string folder_;
};

}  // namespace lf::test
