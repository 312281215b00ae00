// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <lightfield/image.h>
#include <lightfield/rig.h>

#include "focus/focus_control.h"
#include "image/image.h"
#include "rig/rig.h"
#include "view/view.h"

// Inside a public rig: the array, and the text that it was read from, for what this version does not know of it.
struct [[gnu::visibility("hidden")]] lightfield::Rig::Data {
  std::shared_ptr<const lf::Rig> rig;
  uint64_t hash = 0;
  std::string original;  // empty: the rig was made of values, not read
};

namespace lf::api {

// These convert the public API's plain values to the library's own, and back. All throw Error for values that make no
// sense.
Pose to_pose(const lightfield::Pose& pose);
Lens to_lens(const lightfield::Lens& lens);
View to_view(const lightfield::View& view);
FocusControl::Settings to_settings(lightfield::Focus focus, double nearest, double farthest);
lightfield::Pose from_pose(const Pose& pose);
lightfield::Lens from_lens(const Lens& lens);
lightfield::Image from_image(Image image);

// The image of `camera`, whose index is `index`; family kNone where there is none. Checks its size and its planes.
ImageView to_image(const lightfield::ImageView& image, const Camera& camera, CameraIndex index);
// The family that all of these have; kNone where there is none. Throws Error if they have different ones.
PixelFamily family_of(std::span<const lightfield::ImageView> images);
// Throws Error unless there are as many images as `count` cameras.
void check_count(size_t images, size_t count);

}  // namespace lf::api
