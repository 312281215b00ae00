// SPDX-License-Identifier: LGPL-2.1-or-later
// What most files of programs include, compiled once for all of a program. Each file still includes what it uses.
#ifndef LF_PCH_PROGRAMS_H
#define LF_PCH_PROGRAMS_H

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gst/gst.h>
#include <nlohmann/json.hpp>

#include "base/vec.h"

#endif  // LF_PCH_PROGRAMS_H
