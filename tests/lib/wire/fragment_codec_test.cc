// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/fragment_codec.h"

#include <gtest/gtest.h>

#include "lib/wire/answers.h"
#include "support/answer_codec.h"
#include "support/expect_error.h"
#include "wire/answer_parser.h"
#include "wire/payload.h"

namespace lf::wire {
namespace {

constexpr PixelFamily kFamilies[] = {PixelFamily::kRgb, PixelFamily::kI420};

TEST(FragmentCodec, EveryQualityComesBack) {
  FragmentEncoder encoder;
  for (const PixelFamily family : kFamilies)
    for (const auto& [w, h] : {std::pair{40, 30}, {96, 72}, {1, 1}})
      for (const int quality : {0, 1, 50, 90, 100}) {
        const std::vector<Fragment> fragments = patterned_fragments(family, 9, w, h);
        const AnswerHeader header = header_of_view(family, 400, 400);
        const ByteBuffer bytes = encoder.encode(header, fragments, quality);
        std::string reason;
        const std::optional<Answer> answer = decode_answer(bytes, &reason);
        ASSERT_TRUE(answer.has_value()) << reason;
        EXPECT_EQ(static_cast<const AnswerHeader&>(*answer), header);
        ASSERT_EQ(answer->fragments.size(), fragments.size());
        jpeg::Errors8 luma, chroma, lost;
        for (size_t i = 0; i < fragments.size(); i++) {
          const Fragment &in = fragments[i], *const out = &answer->fragments[i];
          EXPECT_EQ(out->rect, in.rect);
          EXPECT_EQ(out->lost.empty(), in.lost.empty());
          if (quality == 0) {
            EXPECT_EQ(*out, in);
          }
          jpeg::compare_pixels(planes_of(in), planes_of(*out), luma, chroma);
          if (!in.lost.empty()) jpeg::compare_lost(planes_of(in), planes_of(*out), lost);
        }
        if (quality >= 90) {
          EXPECT_GT(luma.psnr(), 34) << w << 'x' << h << " quality " << quality;
        }
        // However coarse the pixels are, lost weight is not.
        EXPECT_LE(lost.worst, 32) << w << 'x' << h << " quality " << quality;
        EXPECT_GT(lost.psnr(), 40) << w << 'x' << h << " quality " << quality;
      }
}

TEST(FragmentCodec, PlainPixelsLieInTheCamerasImage) {
  for (const PixelFamily family : kFamilies)
    for (const int quality : {0, 90}) {
      const Fragment pixels = jpeg::patterned(family, {200, 100, 296, 172}, false, 1);
      const AnswerHeader header = header_of_view(family, 40, 30);  // smaller than the rectangle
      const std::vector<AnswerFragment> fragments{{5, planes_of(pixels)}};
      const ByteBuffer bytes = FragmentEncoder().encode(header, fragments, quality);
      std::string reason;
      const std::optional<AnswerView> answer = parse_answer(bytes, &reason);
      ASSERT_TRUE(answer) << reason;
      ASSERT_EQ(answer->fragments.size(), 1u);
      EXPECT_EQ(answer->fragments[0].camera, 5u);
      EXPECT_EQ(answer->fragments[0].rect, pixels.rect);
      jpeg::Errors8 luma, chroma;
      FragmentDecoder decoder;
      const std::optional<FragmentPlanes> planes = decoder.decode(answer->fragments[0]);
      ASSERT_TRUE(planes);
      jpeg::compare_pixels(planes_of(pixels), *planes, luma, chroma);
      EXPECT_LE(luma.worst, quality == 0 ? 0 : 255);
      EXPECT_GT(luma.psnr(), 34);
      // Whoever wants contributions is not given something else.
      EXPECT_FALSE(decode_answer(bytes, &reason));
      EXPECT_EQ(reason, "fragments[0].camera: pixels of one, no part of a sum");
    }
}

TEST(FragmentCodec, RefusesPlainPixelsThatCanNotBe) {
  const Fragment pixels = jpeg::patterned(PixelFamily::kRgb, {0, 0, 8, 8}, true, 1);
  const AnswerHeader header = header_of_view(PixelFamily::kRgb, 40, 30);
  const auto encode = [&](AnswerFragment fragment) { return FragmentEncoder().encode(header, {&fragment, 1}, 0); };
  EXPECT_ERROR(encode({5, planes_of(pixels)}), "fragments[0].flags: pixels of a camera have no lost weight");
  Fragment whole = pixels;
  whole.lost.clear();
  whole.rect = {kMaxImageSize - 7, 0, kMaxImageSize + 1, 8};
  EXPECT_ERROR(encode({5, planes_of(whole)}), "fragments[0].rectangle: is not inside any image");
}

TEST(FragmentCodec, DamageStaysInItsFragment) {
  const std::vector<Fragment> fragments = patterned_fragments(PixelFamily::kI420, 2, 40, 30);
  ByteBuffer bytes = FragmentEncoder().encode(header_of_view(PixelFamily::kI420, 400, 400), fragments, 90);
  const AnswerView view = parse_answer(bytes).value();
  bytes[view.fragments[0].payload.data() - bytes.data() + 40] = 0xff;  // a marker
  bytes[view.fragments[0].payload.data() - bytes.data() + 41] = 0xd9;
  FragmentDecoder decoder;
  EXPECT_FALSE(decoder.decode(view.fragments[0]));
  EXPECT_TRUE(decoder.decode(view.fragments[1]));
  std::string reason;
  EXPECT_FALSE(decode_answer(bytes, &reason).has_value());
  EXPECT_EQ(reason, "fragments[0].payload: damaged JPEG");
}

TEST(FragmentCodec, SumsAreUsedWhereTheyLieIfTheyCan) {
  const int16_t samples[6] = {-1, 2, 300, -400, 32767, -32768};
  std::vector<uint8_t> memory(32);
  FragmentView f;
  f.family = PixelFamily::kRgb;
  f.rect = {3, 3, 5, 4};
  f.codec = Codec::kRaw16;
  FragmentDecoder decoder;
  for (size_t offset = 0; offset < 4; offset++) {
    std::memcpy(memory.data() + offset, samples, sizeof samples);
    f.payload = std::span(memory).subspan(offset, sizeof samples);
    bool copied;
    const ConstSumPlanes sums = decoder.sums(f, &copied);
    EXPECT_EQ(copied, offset % 2 == 1);
    EXPECT_EQ(reinterpret_cast<const uint8_t*>(sums.plane[0]) == f.payload.data(), !copied);
    for (int c = 0; c < 3; c++)
      for (int x = 0; x < 2; x++) EXPECT_EQ(sums.plane[c][x], samples[2 * c + x]);
    EXPECT_FALSE(decoder.decode(f));  // not its business
  }
}

TEST(FragmentCodec, PlanesMustFillTheirRectangles) {
  std::vector<Fragment> fragments = patterned_fragments(PixelFamily::kRgb, 2, 40, 30);
  fragments[1].pixels.pop_back();
  for (const int quality : {0, 90})
    EXPECT_ERROR(FragmentEncoder().encode(header_of_view(PixelFamily::kRgb, 400, 400), fragments, quality),
                 "fragments[1].pixels: do not fill the rectangle");
}

}  // namespace
}  // namespace lf::wire
