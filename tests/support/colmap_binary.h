// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <type_traits>

// Writes COLMAP's binary files, as specified at https://colmap.github.io/format.html.
namespace lf::test {

// Returns the bytes of values in a little-endian file. Texts end with a zero byte.
template <typename... Values>
std::string bytes_of(const Values&... values) {
  std::string bytes;
  const auto add = [&bytes](const auto& value) {
    if constexpr (std::is_arithmetic_v<std::remove_cvref_t<decltype(value)>>)
      bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
    else
      bytes += std::string(value) + '\0';
  };
  (add(values), ...);
  return bytes;
}

}  // namespace lf::test
