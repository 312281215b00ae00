// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <glib-object.h>

#include "wire/commands.h"

// Property "access" of who asks cameras and of who answers for them: lf::Access.
#define LF_TYPE_ACCESS (lf_access_get_type())
GType lf_access_get_type(void);

namespace lf {
// The name of a value of the property.
const char* access_nick(Access access);
}  // namespace lf
