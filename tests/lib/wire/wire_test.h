// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "jpeg/fragment_codec.h"
#include "support/test.h"
#include "wire/answer_codec.h"

namespace lf::jpeg {

inline std::vector<FragmentPlanes> planes_of_all(const std::vector<Fragment>& fragments) {
  std::vector<FragmentPlanes> planes;
  for (const Fragment& f : fragments) planes.push_back(planes_of(f));
  return planes;
}

// Returns the same fragment without samples, for a decoder to fill.
inline FragmentPlanes empty_like(const FragmentPlanes& fragment) {
  return {.family = fragment.family, .rect = fragment.rect};
}

struct Errors8 {
  double squares = 0, count = 0;
  int worst = 0;

  void add(int a, int b) {
    squares += (a - b) * (a - b);
    count++;
    worst = std::max(worst, std::abs(a - b));
  }
  double psnr() const { return squares == 0 ? 99 : 10 * std::log10(255. * 255. * count / squares); }
};

inline void compare_pixels(const FragmentPlanes& a, const FragmentPlanes& b, Errors8& luma, Errors8& chroma) {
  const int w = a.rect.width(), h = a.rect.height();
  const bool rgb = a.family == PixelFamily::kRgb;
  for (int y = 0; y < h; y++)
    for (int x = 0; x < (rgb ? 3 * w : w); x++)
      luma.add(a.plane[0][y * a.stride[0] + x], b.plane[0][y * b.stride[0] + x]);
  if (rgb) return;
  for (int c = 1; c < 3; c++)
    for (int y = 0; y < chroma_size(h); y++)
      for (int x = 0; x < chroma_size(w); x++)
        chroma.add(static_cast<int8_t>(a.plane[c][y * a.stride[c] + x]),
                   static_cast<int8_t>(b.plane[c][y * b.stride[c] + x]));
}

inline void compare_missing(const FragmentPlanes& a, const FragmentPlanes& b, Errors8& errors) {
  for (int y = 0; y < a.rect.height(); y++)
    for (int x = 0; x < a.rect.width(); x++)
      errors.add(a.lost[y * a.missing_stride + x], b.lost[y * b.missing_stride + x]);
}

// A smooth pattern with a pyramid of weights; with `lost`, missing weight right of a slanted edge.
inline Fragment patterned(PixelFamily family, const Rect& rect, bool lost = false, int seed = 1) {
  const int w = rect.width(), h = rect.height();
  Fragment f{family, rect, {}, {}};
  const auto weight = [&](double x, double y) {
    return std::max(0., 1 - std::max(std::abs(2 * x / w - 1), std::abs(2 * y / h - 1)));
  };
  const auto value = [&](double x, double y, int c) {
    return std::sin(x * (.11 + .03 * c) + seed) * std::cos(y * .13 + c);
  };
  if (family == PixelFamily::kRgb) {
    for (int y = 0; y < h; y++)
      for (int x = 0; x < w; x++)
        for (int c = 0; c < 3; c++)
          f.pixels.push_back(static_cast<uint8_t>(weight(x, y) * (128 + 60 * value(x, y, 0) + 20 * value(x, y, c))));
  } else {
    for (int y = 0; y < h; y++)
      for (int x = 0; x < w; x++) f.pixels.push_back(static_cast<uint8_t>(weight(x, y) * (128 + 100 * value(x, y, 0))));
    for (int c = 1; c < 3; c++)
      for (int y = 0; y < chroma_size(h); y++)
        for (int x = 0; x < chroma_size(w); x++)
          f.pixels.push_back(static_cast<uint8_t>(static_cast<int>(weight(2 * x, 2 * y) * 90 * value(x, y, c))));
  }
  if (lost)
    for (int y = 0; y < h; y++)
      for (int x = 0; x < w; x++)
        f.lost.push_back(x > w / 2 + y / 4 ? static_cast<uint8_t>(255 * weight(x, y)) : uint8_t{0});
  return f;
}

}  // namespace lf::jpeg

namespace lf::wire {

inline std::vector<uint8_t> from_hex(std::string_view hex) {
  const auto digit = [](char c) { return static_cast<uint8_t>(c <= '9' ? c - '0' : c - 'a' + 10); };
  std::vector<uint8_t> out;
  for (size_t i = 0; i + 1 < hex.size(); i += 2)
    out.push_back(static_cast<uint8_t>(digit(hex[i]) << 4 | digit(hex[i + 1])));
  return out;
}

inline std::vector<uint8_t> with(std::vector<uint8_t> bytes, size_t offset, int size, uint64_t value) {
  for (int i = 0; i < size; i++) bytes.at(offset + i) = static_cast<uint8_t>(value >> (8 * (size - 1 - i)));
  return bytes;
}

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

// A wrong number in a unit, and the decoder's error.
struct WrongField {
  size_t offset;
  int size;
  uint64_t value;
  std::vector<std::string> facts;
};
inline void expect_reasons(std::string (*reason_of)(const std::vector<uint8_t>&), const std::vector<uint8_t>& golden,
                           std::span<const WrongField> rows) {
  for (const WrongField& row : rows)
    EXPECT_MENTIONS(reason_of(with(golden, row.offset, row.size, row.value)), row.facts) << "offset " << row.offset;
}

// Returns the reason why `decode` refuses the bytes; tests decoding with and without a reason argument.
template <auto decode>
std::string refusal(const std::vector<uint8_t>& bytes) {
  std::string reason;
  EXPECT_FALSE(decode(bytes, &reason).has_value());
  EXPECT_FALSE(decode(bytes, nullptr).has_value());
  return reason;
}

// `recode` decodes and re-encodes a unit; accepted units with flipped bits must not change.
template <typename Recode>
void expect_corruption_survived(const std::vector<std::vector<uint8_t>>& units, size_t front, std::mt19937& random,
                                Recode recode) {
  int accepted = 0;
  for (int i = 0; i < 100'000; i++) {
    std::vector<uint8_t> bytes = units[i % units.size()];
    if (i % 8 == 0) bytes = resized(std::move(bytes), random() % (bytes.size() + 8));
    if (bytes.empty()) continue;
    corrupt(bytes, front, random);
    const std::optional<std::vector<uint8_t>> again = recode(bytes);
    if (!again) continue;
    accepted++;
    ASSERT_EQ(*again, bytes);
  }
  EXPECT_GT(accepted, 10'000);
  EXPECT_LT(accepted, 90'000);
}

// Returns a valid answer, or throws the reason why the answer is invalid.
inline AnswerView parsed(std::span<const uint8_t> bytes) {
  std::string reason;
  std::optional<AnswerView> answer = parse_answer(bytes, &reason);
  if (!answer) throw std::runtime_error(reason);
  return *std::move(answer);
}

inline AnswerHeader header_of_view(PixelFamily family, int width, int height) {
  AnswerHeader header;
  header.view_id = 7;
  header.sequence = 9;
  header.view_width = width;
  header.view_height = height;
  header.family = family;
  header.rig_hash = 0x1122334455667788;
  return header;
}

// `count` fragments of w x h each, side by side in rows of a view of 400 x 400; every third has missing weight.
inline std::vector<Fragment> patterned_fragments(PixelFamily family, int count, int w, int h) {
  std::vector<Fragment> out;
  for (int i = 0, x = 0, y = 0; i < count; i++) {
    out.push_back(jpeg::patterned(family, {x, y, x + w, y + h}, i % 3 == 0, i + 1));
    x += w & ~1;
    if (x + w > 400) x = 0, y += h & ~1;
  }
  return out;
}

}  // namespace lf::wire
