// SPDX-License-Identifier: LGPL-2.1-or-later
// Headers of other projects that most files include. They are compiled once, which saves a third of the build time. Each
// file still includes what it uses, so that the build also works without this header (-Db_pch=false).
#ifndef LF_BASE_PRECOMPILED_H
#define LF_BASE_PRECOMPILED_H

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#endif
