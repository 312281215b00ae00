// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>

#include "render/sum_planes.h"
#include "wire/answer.h"

// What lies where in a fragment's payload: planes one after the other, rows without padding; see spec.md.
namespace lf::wire {

// 16-bit samples are little-endian on the wire, because that is what they are in memory and nobody wants to touch six
// megabytes a view to change it.
static_assert(std::endian::native == std::endian::little, "sums in 16 bits are used where they lie");

inline size_t area(const Rect& rect) { return static_cast<size_t>(rect.width()) * rect.height(); }

// Bytes of a payload of kRaw or kRaw16.
inline size_t raw_size(const FragmentHeader& f) {
  const size_t values =
      packed_size(f.family, f.rect.width(), f.rect.height()) + (f.has_lost ? area(f.rect) : size_t{0});
  return f.codec == Codec::kRaw16 ? 2 * values : values;
}

// The planes of a kRaw payload, which has raw_size() bytes.
inline FragmentPlanes raw_planes(const FragmentHeader& f, const uint8_t* payload) {
  const size_t pixels = packed_size(f.family, f.rect.width(), f.rect.height());
  return packed_planes(f.family, f.rect, payload, f.has_lost ? payload + pixels : nullptr);
}

// The planes of a kRaw16 payload, which has raw_size() bytes at an even address. Byte is uint8_t or const uint8_t.
template <typename Byte>
auto raw16_planes(const FragmentHeader& f, Byte* payload) {
  constexpr bool kConst = std::is_const_v<Byte>;
  using Sample = std::conditional_t<kConst, const int16_t, int16_t>;
  using Weight = std::conditional_t<kConst, const uint16_t, uint16_t>;
  Sample* const samples = reinterpret_cast<Sample*>(payload);
  const size_t pixels = packed_size(f.family, f.rect.width(), f.rect.height());
  return packed_sums(f.family, f.rect, samples, f.has_lost ? reinterpret_cast<Weight*>(samples + pixels) : nullptr);
}

// Copies `height` rows of `width` bytes, without padding between them in `to`. Returns the end of what it wrote.
inline uint8_t* copy_rows(const uint8_t* from, ptrdiff_t stride, size_t width, int height, uint8_t* to) {
  for (int y = 0; y < height; y++, to += width) std::memcpy(to, from + y * stride, width);
  return to;
}

// A JPEG payload: the scan of the pixels, and with lost weight its length (4 bytes) in front and the scan of that
// behind. Nothing if the length is wrong.
struct Scans {
  std::span<const uint8_t> pixels, lost;
};
std::optional<Scans> split_scans(std::span<const uint8_t> payload, bool has_lost);

}  // namespace lf::wire
