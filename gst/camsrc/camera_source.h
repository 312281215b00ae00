// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "rig/camera_source.h"

namespace lf {

// As find_camera_source(), with kDevice told from kUri.
CameraSource find_playable_source(const Rig& rig, const Camera& camera);

}  // namespace lf
