// SPDX-License-Identifier: LGPL-2.1-or-later
// What most tests of lib/ include, compiled once for all of a program. Each file still includes what it uses.
#ifndef LF_PCH_LIB_TESTS_H
#define LF_PCH_LIB_TESTS_H

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/vec.h"

#endif  // LF_PCH_LIB_TESTS_H
