// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/still_images.h"

#include <algorithm>
#include <string>

#include "base/text.h"
#include "image/colour_correction.h"
#include "image/image_file.h"

namespace lf {

bool has_images(const Rig& rig) {
  return std::none_of(rig.cameras.begin(), rig.cameras.end(), [](const Camera& c) { return c.image.empty(); });
}

const Image& StillImages::get(CameraIndex camera) {
  if (const auto found = place_.find(camera); found != place_.end()) {
    kept_.splice(kept_.begin(), kept_, found->second);
    return kept_.front().image;
  }
  const Camera& rig_camera = rig_.cameras[camera];
  const std::string name = rig_camera.label() + ": ";
  if (rig_camera.image.empty())
    throw Error(name + "the rig names no image for it (lf-rig snapshot takes one of each camera)");
  const std::string path = rig_.resolve(rig_camera.image);
  Image image;
  try {
    image = load_image_of_size(path, {rig_camera.width, rig_camera.height});
  } catch (const Error& e) {
    throw Error(name + e.what());
  }
  if (family_ == PixelFamily::kI420) image = to_i420(image);
  if (rig_camera.colour) image = corrected(image, *rig_camera.colour, rig_camera.principal_point());

  used_ += image.data().size();
  kept_.push_front({camera, std::move(image)});
  place_[camera] = kept_.begin();
  while (used_ > room_ && kept_.size() > 1) {
    used_ -= kept_.back().image.data().size();
    place_.erase(kept_.back().camera);
    kept_.pop_back();
  }
  return kept_.front().image;
}

}  // namespace lf
