// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <string>

#include "image/image.h"

namespace lf {

// The frames of a GStreamer URI (file:///..., v4l2:///dev/video0, rtsp://...) as RGB images until `use` returns false or
// the video ends. A live camera's frames that come while one is looked at are left out. Throws Error where there is no
// video.
void for_each_frame(const std::string& uri, const std::function<bool(const Image&)>& use);

}  // namespace lf
