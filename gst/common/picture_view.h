// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <optional>

#include "view/view.h"

namespace lf {

// Returns the view of a picture from its meta "lightfield-view" (see lfcompositor). Returns nothing for sets of views.
std::optional<View> view_of_picture(const GstStructure* picture);

}  // namespace lf
