// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <lightfield/image.h>
#include <lightfield/rig.h>

#include "focus/depth_estimator.h"
#include "image/image.h"
#include "rig/rig.h"
#include "view/view.h"

struct [[gnu::visibility("hidden")]] lightfield::Rig::Data {
  std::shared_ptr<const lf::Rig> rig;
  uint64_t hash = 0;
  // text of the rig file, to preserve keys that this version does not know; empty: created from values
  std::string original;
};

namespace lf::api {

// Conversions between the public API and the library's types. Throw Error for invalid values.
Pose to_pose(const lightfield::Pose& pose);
Lens to_lens(const lightfield::Lens& lens);
View to_view(const lightfield::View& view);
DepthEstimator::Settings to_settings(lightfield::Focus focus, double nearest, double farthest);
lightfield::Pose from_pose(const Pose& pose);
lightfield::Lens from_lens(const Lens& lens);
lightfield::Image from_image(Image image);

// Returns the image of `camera`, or family kNone if there is no image. Throws Error if size or planes are wrong; the
// text names `index`.
ImageView to_image(const lightfield::ImageView& image, const Camera& camera, CameraIndex index);
// Returns the family of a picture that is written to `out`. Throws Error if the format, size or planes are wrong.
PixelFamily check_output(const lightfield::MutableImageView& out, int width, int height);
// Returns the common family of the images; kNone if there is no image. Throws Error if families differ.
PixelFamily family_of(std::span<const lightfield::ImageView> images);
void check_count(size_t images, size_t count);

}  // namespace lf::api
