// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/access.h"

#include "common/properties.h"

GType lf_access_get_type(void) {
  static const GType type = lf::register_enum<lf::Access>(
      "LfAccess", {{lf::Access::kSelf, "Cameras know their places and answer view requests", "self"},
                   {lf::Access::kWarp, "Cameras know their lenses alone and answer warp commands", "warp"},
                   {lf::Access::kPixels, "Cameras give pixels alone and answer pixel commands", "pixels"}});
  return type;
}
