// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/partial_answer.h"

#include <algorithm>
#include <vector>

#include "render/sum_rounding.h"
#include "wire/answer_writer.h"
#include "wire/fragment_codec.h"
#include "wire/strips.h"

namespace lf {
namespace {

void copy(const ConstSumPlanes& from, const SumPlanes& to) {
  for (int c = 0; c < 3; c++)
    for (int y = 0; y < plane_height(from.family, from.rect, c); y++)
      std::copy_n(from.plane[c] + y * from.stride[c], plane_width(from.family, from.rect, c),
                  to.plane[c] + y * to.stride[c]);
  if (!from.lost) return;
  for (int y = 0; y < from.rect.height(); y++)
    std::copy_n(from.lost + y * from.lost_stride, from.rect.width(), to.lost + y * to.lost_stride);
}

}  // namespace

ByteBuffer partial_answer(const wire::AnswerHeader& header, const Accumulator& sum, const CodedAs& form,
                          ByteBuffer memory, const ParallelFor& parallel) {
  const std::optional<ConstSumPlanes> sums = sum.sums();
  if (!sums || sums->rect.empty()) return wire::AnswerWriter(header, 0, std::move(memory)).finish();
  if (form.codec == wire::Codec::kRaw16) {
    wire::AnswerWriter writer(header, 1, std::move(memory));
    copy(*sums, writer.add_sums({{}, sums->family, sums->rect, wire::Codec::kRaw16, 0, sums->lost != nullptr}));
    return writer.finish();
  }
  const std::vector<Rect> rects = wire::cut_rows(sums->rect, wire::strip_rows(sums->rect.width()));
  std::vector<Fragment> strips(rects.size());
  parallel(rects.size(), [&](size_t i) { strips[i] = rounded_fragment(part_of(*sums, rects[i])); });
  std::vector<wire::AnswerFragment> fragments;
  for (const Fragment& strip : strips) fragments.push_back({{}, planes_of(strip)});
  return wire::encode_fragments(header, fragments, form.quality, std::move(memory), parallel);
}

}  // namespace lf
