// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/properties.h"

GType lf_access_get_type(void) {
  static const GType type = lf::register_enum<lf::Access>(
      "LfAccess",
      {{lf::Access::kSelf, "The cameras know the whole rig and answer view requests without further help", "self"},
       {lf::Access::kWarp,
        "The cameras know only their own lens. The viewer also sends each camera a warp command: the transformation of "
        "its image into the view",
        "warp"},
       {lf::Access::kPixels,
        "The cameras only deliver image regions. The viewer also sends each camera a command that "
        "names the region, and the compositor transforms the pixels",
        "pixels"}});
  return type;
}

const char* lf::access_nick(Access access) {
  auto* const values = static_cast<GEnumClass*>(g_type_class_ref(LF_TYPE_ACCESS));
  const char* nick = g_enum_get_value(values, static_cast<gint>(access))->value_nick;
  g_type_class_unref(values);  // the type and its strings are static
  return nick;
}
