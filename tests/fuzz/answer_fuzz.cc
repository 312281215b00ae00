// SPDX-License-Identifier: LGPL-2.1-or-later
// Answers: parsed and decoded, JPEG and all, as a compositor does it.
#include "fuzz/repair.h"
#include "wire/answer_parser.h"
#include "wire/fragment_codec.h"
#include "wire/payload.h"

using lf::Rect;

namespace {

// So that the sanitizer sees what lies outside.
uint64_t g_sum = 0;

void read_plane(const uint8_t* plane, ptrdiff_t stride, int width, int height) {
  for (int y = 0; y < height; y++) g_sum += plane[y * stride] + plane[y * stride + width - 1];
}

void read(const lf::FragmentPlanes& f) {
  const int w = f.rect.width(), h = f.rect.height();
  const bool rgb = f.family == lf::PixelFamily::kRgb;
  read_plane(f.plane[0], f.stride[0], rgb ? 3 * w : w, h);
  for (int c = 1; c < 3 && !rgb; c++) read_plane(f.plane[c], f.stride[c], lf::chroma_size(w), lf::chroma_size(h));
  if (f.lost) read_plane(f.lost, f.lost_stride, w, h);
}

}  // namespace

LF_FUZZ_ANSWERS(0)

LF_FUZZ_TARGET(answer)(const uint8_t* data, size_t size) {
  static lf::wire::FragmentDecoder decoder;
  std::string reason;
  const std::optional<lf::wire::AnswerView> answer = lf::wire::parse_answer({data, size}, &reason);
  lf::fuzz::require(answer || !reason.empty());
  if (!answer) return 0;
  lf::fuzz::require(lf::wire::parse_answer_header({data, size}).has_value());
  for (const lf::wire::FragmentView& fragment : answer->fragments) {
    if (fragment.codec == lf::wire::Codec::kRaw16) {
      const lf::ConstSumPlanes sums = decoder.sums(fragment);
      const Rect& rect = fragment.rect;
      for (int c = 0; c < 3; c++)
        g_sum += sums.plane[c][(lf::plane_height(sums.family, rect, c) - 1) * sums.stride[c] +
                               lf::plane_width(sums.family, rect, c) - 1];
    } else if (const std::optional<lf::FragmentPlanes> planes = decoder.decode(fragment)) {
      read(*planes);
    }
  }
  return 0;
}
