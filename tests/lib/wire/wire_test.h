// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <random>
#include <string_view>
#include <vector>

// What the tests of both codecs share.
namespace lf::wire {

inline std::vector<uint8_t> from_hex(std::string_view hex) {
  const auto digit = [](char c) { return static_cast<uint8_t>(c <= '9' ? c - '0' : c - 'a' + 10); };
  std::vector<uint8_t> out;
  for (size_t i = 0; i + 1 < hex.size(); i += 2)
    out.push_back(static_cast<uint8_t>(digit(hex[i]) << 4 | digit(hex[i + 1])));
  return out;
}

// Overwrites a big-endian number of `size` bytes.
inline std::vector<uint8_t> with(std::vector<uint8_t> bytes, size_t offset, int size, uint64_t value) {
  for (int i = 0; i < size; i++) bytes.at(offset + i) = static_cast<uint8_t>(value >> (8 * (size - 1 - i)));
  return bytes;
}

// Cuts or extends (with zeros), and says so in the unit's length field.
inline std::vector<uint8_t> resized(std::vector<uint8_t> bytes, size_t size) {
  bytes.resize(size);
  return size < 12 ? bytes : with(bytes, 8, 4, size);
}

// Flips 1 to 4 random bits, in the first `front` bytes three times out of four.
inline void corrupt(std::vector<uint8_t>& bytes, size_t front, std::mt19937& random) {
  for (int n = 1 + random() % 4; n > 0; n--) {
    const size_t range = random() % 4 ? std::min(front, bytes.size()) : bytes.size();
    bytes[random() % range] ^= static_cast<uint8_t>(1 << random() % 8);
  }
}

}  // namespace lf::wire
