// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/access.h"

GType lf_access_get_type(void) {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<gint>(lf::Access::kSelf), "Cameras know their places and answer view requests", "self"},
        {static_cast<gint>(lf::Access::kWarp), "Cameras know their lenses alone and answer warp commands", "warp"},
        {static_cast<gint>(lf::Access::kPixels), "Cameras give pixels alone and answer pixel commands", "pixels"},
        {0, nullptr, nullptr}};
    return g_enum_register_static("LfAccess", values);
  }();
  return type;
}
