// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/properties.h"

GType lf_access_get_type(void) {
  static const GType type = lf::register_enum<lf::Access>(
      "LfAccess",
      {{lf::Access::kSelf, "Cameras that know the whole array and answer view requests", "self"},
       {lf::Access::kWarp,
        "Cameras that know only their lenses and answer commands to warp their image "
        "into the view",
        "warp"},
       {lf::Access::kPixels, "Cameras that only deliver pixels and answer commands that name these pixels", "pixels"}});
  return type;
}

const char* lf::access_nick(Access access) {
  auto* const values = static_cast<GEnumClass*>(g_type_class_ref(LF_TYPE_ACCESS));
  const char* nick = g_enum_get_value(values, static_cast<gint>(access))->value_nick;
  g_type_class_unref(values);  // the type and its strings are static
  return nick;
}
