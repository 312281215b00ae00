// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/sum_planes.h"
#include "wire/answer_parser.h"
#include "wire/fragment_codec.h"
#include "wire/payload.h"

// Answers as vectors of uncompressed fragments, for those whom a copy does not hurt.
namespace lf::wire {

// A whole answer with its fragments uncompressed, 8 bits a value.
struct Answer : AnswerHeader {
  std::vector<Fragment> fragments;
  bool operator==(const Answer&) const = default;
};

inline void append_rows(std::vector<uint8_t>& out, const uint8_t* plane, ptrdiff_t stride, int width, int height) {
  for (int y = 0; y < height; y++, plane += stride) out.insert(out.end(), plane, plane + width);
}

inline Fragment to_fragment(const FragmentHeader& header, const FragmentPlanes& planes) {
  const int w = header.rect.width(), h = header.rect.height();
  Fragment out{header.family, header.rect, {}, {}};
  if (header.family == PixelFamily::kRgb) {
    append_rows(out.pixels, planes.plane[0], planes.stride[0], 3 * w, h);
  } else {
    append_rows(out.pixels, planes.plane[0], planes.stride[0], w, h);
    for (int c = 1; c < 3; c++)
      append_rows(out.pixels, planes.plane[c], planes.stride[c], chroma_size(w), chroma_size(h));
  }
  if (planes.lost) append_rows(out.lost, planes.lost, planes.lost_stride, w, h);
  return out;
}

// Raw. Throws Error naming the field if decode_answer() would not take it back (sizes, rectangles, planes, limits).
inline std::vector<uint8_t> encode_answer(const Answer& answer) {
  const ByteBuffer bytes = FragmentEncoder().encode(answer, answer.fragments, 0);
  return {bytes.begin(), bytes.end()};
}

// Nothing for bytes that are not exactly one valid answer, whole, with sound payloads; `reason` (may be null) then says
// why, naming the field. Fragments come out with rectangles inside the view and planes of exactly their sizes, whatever
// their codec: 16-bit sums are rounded (halves up) and saturated to 8 bits.
inline std::optional<Answer> decode_answer(std::span<const uint8_t> bytes, std::string* reason = nullptr) {
  const std::optional<AnswerView> view = parse_answer(bytes, reason);
  if (!view) return std::nullopt;
  if (!view->part.whole()) {
    if (reason) *reason = "total: a part of an answer, not a whole one";
    return std::nullopt;
  }
  Answer answer{*view, {}};
  FragmentDecoder decoder;
  for (size_t i = 0; i < view->fragments.size(); i++) {
    const FragmentView& fragment = view->fragments[i];
    if (fragment.camera) {
      if (reason) *reason = "fragments[" + std::to_string(i) + "].camera: pixels of one, no part of a sum";
      return std::nullopt;
    }
    if (fragment.codec == Codec::kRaw16) {
      answer.fragments.push_back(rounded_fragment(decoder.sums(fragment)));
      continue;
    }
    const std::optional<FragmentPlanes> planes = decoder.decode(fragment);
    if (!planes) {
      if (reason) *reason = "fragments[" + std::to_string(i) + "].payload: damaged JPEG";
      return std::nullopt;
    }
    answer.fragments.push_back(to_fragment(fragment, *planes));
  }
  return answer;
}

}  // namespace lf::wire
