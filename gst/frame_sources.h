// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <vector>

#include "camera_image.h"
#include "render/render_job.h"
#include "render/sum_renderer.h"

namespace lf {

// The frames that one request is answered from, mapped as long as this lives.
class FrameSources {
 public:
  explicit FrameSources(const Rig& rig) : rig_(rig) {}

  // False if the frame can't be mapped; the camera has no image then.
  bool add(CameraIndex camera, const CameraFrame& frame);
  void add_without_image(CameraIndex camera) { sources_.push_back({camera, &rig_.cameras[camera], {}}); }

  const std::vector<Source>& sources() const { return sources_; }
  // Of the images; kNone without any.
  PixelFamily family() const;

 private:
  const Rig& rig_;
  std::vector<Source> sources_;
  std::vector<std::unique_ptr<MappedFrame>> mapped_;
};

}  // namespace lf
