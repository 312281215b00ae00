// SPDX-License-Identifier: LGPL-2.1-or-later
// What most files of lib/ include, compiled once for all of a library. Each file still includes what it uses.
#ifndef LF_PCH_LIB_H
#define LF_PCH_LIB_H

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/vec.h"

#endif  // LF_PCH_LIB_H
