// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

// Big-endian numbers in byte strings.
namespace lf::wire {

template <typename T>
using WireInt = std::conditional_t<
    sizeof(T) == 8, uint64_t,
    std::conditional_t<sizeof(T) == 4, uint32_t, std::conditional_t<sizeof(T) == 2, uint16_t, uint8_t>>>;

template <typename T>
void store(uint8_t* to, T value) {
  static_assert(std::is_unsigned_v<T> || std::is_same_v<T, double>);
  const auto bits = std::bit_cast<WireInt<T>>(value);
  for (size_t i = 0; i < sizeof(T); i++) to[i] = static_cast<uint8_t>(bits >> (8 * (sizeof(T) - 1 - i)));
}

// Appends numbers and bytes to a vector, whose memory is reserved for the size given.
class Writer {
 public:
  explicit Writer(size_t size) { bytes_.reserve(size); }

  // Unsigned integers of 1, 2, 4, 8 bytes, and double (IEEE 754 binary64).
  template <typename T>
  void put(T value) {
    uint8_t out[sizeof(T)];
    store(out, value);
    bytes_.insert(bytes_.end(), out, out + sizeof(T));
  }
  void put_bytes(std::span<const uint8_t> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }

  size_t size() const { return bytes_.size(); }
  std::vector<uint8_t> take() { return std::move(bytes_); }

 private:
  std::vector<uint8_t> bytes_;
};

// Writes as Writer does, into memory that is there and large enough.
class PlacedWriter {
 public:
  explicit PlacedWriter(uint8_t* to) : to_(to) {}
  template <typename T>
  void put(T value) {
    store(to_, value);
    to_ += sizeof(T);
  }
  void put_bytes(std::span<const uint8_t> bytes) { to_ = std::copy(bytes.begin(), bytes.end(), to_); }

 private:
  uint8_t* to_;
};

// Reads numbers and bytes from the front. Whatever lies beyond the end reads as 0 and makes ok() false for good: check
// it before using what was read.
class Reader {
 public:
  explicit Reader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  template <typename T>
  T get() {
    static_assert(std::is_unsigned_v<T> || std::is_same_v<T, double>);
    WireInt<T> bits = 0;
    for (const uint8_t byte : get_bytes(sizeof(T))) bits = static_cast<WireInt<T>>((uint64_t{bits} << 8) | byte);
    return std::bit_cast<T>(bits);
  }
  // Refers to the bytes read from; empty if there are not as many.
  std::span<const uint8_t> get_bytes(size_t count) {
    if (count > bytes_.size()) {
      ok_ = false;
      bytes_ = {};
      return {};
    }
    const std::span<const uint8_t> out = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return out;
  }

  size_t left() const { return bytes_.size(); }
  bool ok() const { return ok_; }

 private:
  std::span<const uint8_t> bytes_;
  bool ok_ = true;
};

}  // namespace lf::wire
