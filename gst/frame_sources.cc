// SPDX-License-Identifier: LGPL-2.1-or-later
#include "frame_sources.h"

namespace lf {

bool FrameSources::add(CameraIndex camera, const CameraFrame& frame) {
  auto mapped = std::make_unique<MappedFrame>(frame);
  if (!mapped->ok()) {
    add_without_image(camera);
    return false;
  }
  sources_.push_back({camera, &rig_.cameras[camera], mapped->view()});
  mapped_.push_back(std::move(mapped));
  return true;
}

PixelFamily FrameSources::family() const {
  for (const Source& source : sources_)
    if (source.image.family != PixelFamily::kNone) return source.image.family;
  return PixelFamily::kNone;
}

}  // namespace lf
