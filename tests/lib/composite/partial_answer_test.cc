// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/assembly.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "lib/wire/answers.h"
#include "wire/answer_parser.h"
#include "wire/fragment_codec.h"
#include "wire/payload.h"

namespace lf {
namespace {

constexpr int kSize = 400;

Accumulator sum_of(std::span<const Fragment> fragments, PixelFamily family) {
  Accumulator sum;
  sum.reset(family, kSize, kSize);
  for (const Fragment& fragment : fragments) EXPECT_TRUE(sum.add(fragment));
  return sum;
}

void add_all(Accumulator& to, const ByteBuffer& answer) {
  const std::optional<wire::AnswerView> view = wire::parse_answer(answer);
  ASSERT_TRUE(view.has_value());
  wire::FragmentDecoder decoder;
  for (const wire::FragmentView& fragment : view->fragments) {
    if (fragment.codec == wire::Codec::kRaw16)
      EXPECT_TRUE(to.add(decoder.sums(fragment)));
    else
      EXPECT_TRUE(to.add(decoder.decode(fragment).value()));
  }
}

int max_difference(const Image& a, const Image& b) {
  int worst = 0;
  for (size_t i = 0; i < a.data().size(); i++) worst = std::max(worst, std::abs(a.data()[i] - b.data()[i]));
  return worst;
}

class PartialAnswer : public testing::TestWithParam<PixelFamily> {};

// Two racks and a root against one compositor.
TEST_P(PartialAnswer, ATreeMakesTheSamePicture) {
  const wire::AnswerHeader header = wire::header_of_view(GetParam(), kSize, kSize);
  std::vector<Fragment> all = wire::patterned_fragments(GetParam(), 30, 60, 44);
  for (Fragment& fragment : all) {  // weights of a half and less, as where cameras overlap
    for (uint8_t& value : fragment.pixels) value = static_cast<uint8_t>(value / 2);
    for (uint8_t& value : fragment.lost) value /= 4;
  }
  const Image expected = sum_of(all, GetParam()).resolve();
  const std::span<const Fragment> fragments = all;
  const struct {
    CodedAs form;
    int bound;  // levels of 255; what is lost is divided out, which enlarges it by a third at most
  } rows[] = {{{wire::Codec::kRaw16, 0}, 0}, {{wire::Codec::kRaw, 0}, 2}, {{wire::Codec::kJpeg, 100}, 12}};
  for (const auto& row : rows) {
    // Of RGB, JPEG keeps no colour of single pixels.
    if (row.form.codec == wire::Codec::kJpeg && GetParam() == PixelFamily::kRgb) continue;
    SCOPED_TRACE(static_cast<int>(row.form.codec));
    Accumulator root;
    root.reset(GetParam(), kSize, kSize);
    add_all(root, partial_answer(header, sum_of(fragments.first(13), GetParam()), row.form, {}));
    add_all(root, partial_answer(header, sum_of(fragments.subspan(13), GetParam()), row.form, {}));
    EXPECT_LE(max_difference(root.resolve(), expected), row.bound);
  }
}

TEST_P(PartialAnswer, OfNothingHasNoFragments) {
  const wire::AnswerHeader header = wire::header_of_view(GetParam(), kSize, kSize);
  const ByteBuffer bytes = partial_answer(header, sum_of({}, GetParam()), {wire::Codec::kRaw16, 0}, {});
  EXPECT_TRUE(wire::parse_answer(bytes).value().fragments.empty());
}

INSTANTIATE_TEST_SUITE_P(Families, PartialAnswer, testing::Values(PixelFamily::kRgb, PixelFamily::kI420),
                         [](const auto& info) { return info.param == PixelFamily::kRgb ? "Rgb" : "I420"; });

}  // namespace
}  // namespace lf
