// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "base/worker_pool.h"
#include "node/camera_picture.h"
#include "render/sum_renderer.h"

namespace lf {

// The frames that one request is answered from, held, and decoded where the request looks.
class FrameSources {
 public:
  // `region`: what is needed of a camera's image. `group`: images may be in textures of its contexts; 0: they may not.
  FrameSources(const Rig& rig, std::function<Rect(CameraIndex)> region, gl::ShareGroup group = 0)
      : rig_(rig), region_(std::move(region)), group_(group) {}

  // Adds a camera's frame; nothing: the camera has none.
  void add(CameraIndex camera, std::optional<CameraFrame> frame);

  // What serves in place of a damaged frame, if anything does.
  using Replace = std::function<std::optional<CameraFrame>(CameraIndex camera, const CameraFrame& damaged)>;
  // Call once after the last add(): makes images of `family` (of the node), of compressed frames of what the view
  // needs. `replace` is called from the threads of `parallel`.
  void decode(PixelFamily family, const Replace& replace, const ParallelFor& parallel);

  // The sources of the request; those whose frame is gone or damaged have no image.
  const std::vector<Source>& sources() const { return sources_; }
  // Capture time of a source's frame; sources()[i] has an image.
  uint64_t time(size_t i) const { return frames_[i].time; }
  // How many of the images are on a card, and have not come here all the same.
  size_t on_card() const;
  // The family of the images; kNone if there are none.
  PixelFamily family() const;

 private:
  void decode_one(size_t i, PixelFamily family, const Replace& replace);

  const Rig& rig_;
  const std::function<Rect(CameraIndex)> region_;
  const gl::ShareGroup group_;
  std::vector<Source> sources_;
  std::vector<CameraFrame> frames_;
  std::vector<std::shared_ptr<const ImageView>> views_;
};

}  // namespace lf
