// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

// Headers and names of the standard library and of GoogleTest that most tests use.
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "support/mentions.h"

namespace lf {

using testing::AllOf;
using testing::AnyOf;
using testing::Contains;
using testing::ContainsRegex;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

inline bool contains(const std::string& text, const std::string& words) { return text.find(words) != text.npos; }

// Waits until the condition is true. Returns false if it still isn't after `seconds`.
template <typename Condition>
bool eventually(const Condition& condition, double seconds = 60) {
  using std::chrono::milliseconds;
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  for (milliseconds pause(1); !condition(); pause = std::min(2 * pause, milliseconds(20))) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(pause);
  }
  return true;
}

inline std::string read_binary(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}
inline std::vector<uint8_t> read_bytes(const std::string& path) {
  const std::string bytes = read_binary(path);
  return {bytes.begin(), bytes.end()};
}

}  // namespace lf
