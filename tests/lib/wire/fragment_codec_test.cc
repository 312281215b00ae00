// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/fragment_codec.h"

#include <gtest/gtest.h>

#include "lib/wire/answers.h"
#include "support/expect_error.h"
#include "wire/answer_codec.h"
#include "wire/answer_parser.h"
#include "wire/payload.h"

namespace lf::wire {
namespace {

constexpr PixelFamily kFamilies[] = {PixelFamily::kRgb, PixelFamily::kI420};

std::vector<size_t> groups_of(const AnswerView& view) {
  std::vector<size_t> sizes;
  const std::span<const FragmentView> all = view.fragments;
  for (size_t i = 0; i < all.size(); i += sizes.back()) sizes.push_back(group_size(all.subspan(i)));
  return sizes;
}

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
        for (const Fragment& in : fragments) {
          const auto out = std::ranges::find(answer->fragments, in.camera, &Fragment::camera);
          ASSERT_NE(out, answer->fragments.end());
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
      const std::vector<CameraFragment> fragments{{5, planes_of(pixels), true}};
      const ByteBuffer bytes = FragmentEncoder().encode(header, fragments, quality);
      std::string reason;
      const std::optional<AnswerView> answer = parse_answer(bytes, &reason);
      ASSERT_TRUE(answer) << reason;
      ASSERT_EQ(answer->fragments.size(), 1u);
      EXPECT_TRUE(answer->fragments[0].plain);
      EXPECT_EQ(answer->fragments[0].rect, pixels.rect);
      jpeg::Errors8 luma, chroma;
      FragmentDecoder decoder;
      const std::span<const FragmentPlanes> planes = decoder.decode(answer->fragments);
      ASSERT_EQ(planes.size(), 1u);
      jpeg::compare_pixels(planes_of(pixels), planes[0], luma, chroma);
      EXPECT_LE(luma.worst, quality == 0 ? 0 : 255);
      EXPECT_GT(luma.psnr(), 34);
      // Whoever wants contributions is not given something else.
      EXPECT_FALSE(decode_answer(bytes, &reason));
      EXPECT_EQ(reason, "fragments[0].flags: plain colour, no contribution to the view");
    }
}

TEST(FragmentCodec, RefusesPlainPixelsThatCanNotBe) {
  const Fragment pixels = jpeg::patterned(PixelFamily::kRgb, {0, 0, 8, 8}, true, 1);
  const AnswerHeader header = header_of_view(PixelFamily::kRgb, 40, 30);
  const auto encode = [&](CameraFragment fragment) { return FragmentEncoder().encode(header, {&fragment, 1}, 0); };
  EXPECT_ERROR(encode({5, planes_of(pixels), true}), "fragments[0].flags: plain colour has no lost weight");
  Fragment whole = pixels;
  whole.lost.clear();
  EXPECT_ERROR(encode({Fragment::kSum, planes_of(whole), true}), "fragments[0].camera: plain colour of a sum");
  whole.rect = {kMaxImageSize - 7, 0, kMaxImageSize + 1, 8};
  EXPECT_ERROR(encode({5, planes_of(whole), true}), "fragments[0].rectangle: is not inside any image");
}

TEST(FragmentCodec, SmallFragmentsShareAtlasesOfOneWidth) {
  const auto groups = [](int w, int h, int count) {
    const ByteBuffer bytes = FragmentEncoder().encode(header_of_view(PixelFamily::kI420, 400, 400),
                                                      patterned_fragments(PixelFamily::kI420, count, w, h), 90);
    return groups_of(parse_answer(bytes).value());
  };
  EXPECT_EQ(groups(40, 30, 10), (std::vector<size_t>{4, 4, 2}));
  EXPECT_EQ(groups(40, 30, 1), (std::vector<size_t>{1}));
  EXPECT_EQ(groups(64, 48, 3), (std::vector<size_t>{2, 1}));
  EXPECT_EQ(groups(65, 48, 3), (std::vector<size_t>{1, 1, 1}));
  EXPECT_EQ(groups(96, 72, 3), (std::vector<size_t>{1, 1, 1}));

  std::vector<Fragment> fragments;  // 48 and 32 wide, taking turns
  for (int i = 0; i < 8; i++)
    fragments.push_back(jpeg::patterned(PixelFamily::kRgb, {0, 0, i % 2 ? 40 : 30, 30}, false, i));
  const ByteBuffer bytes = FragmentEncoder().encode(header_of_view(PixelFamily::kRgb, 400, 400), fragments, 90);
  const AnswerView view = parse_answer(bytes).value();
  EXPECT_EQ(groups_of(view), (std::vector<size_t>{4, 4}));
  for (size_t i = 0; i < 8; i++) EXPECT_EQ(view.fragments[i].rect.width(), i < 4 ? 30 : 40);
}

TEST(FragmentCodec, AtlasesSaveBytesToo) {
  FragmentEncoder encoder;
  const std::vector<Fragment> fragments = patterned_fragments(PixelFamily::kI420, 12, 40, 30);
  const AnswerHeader header = header_of_view(PixelFamily::kI420, 400, 400);
  const size_t together = encoder.encode(header, fragments, 90).size();
  size_t alone = 72;
  for (const Fragment& f : fragments) alone += encoder.encode(header, {&f, 1}, 90).size() - 72;
  EXPECT_LE(together, alone + 3 * 8);  // but for the differences of the first blocks' means
  EXPECT_LT(together, encoder.encode(header, fragments, 0).size() / 2);
}

TEST(FragmentCodec, DamageStaysInItsGroup) {
  const std::vector<Fragment> fragments = patterned_fragments(PixelFamily::kI420, 6, 40, 30);
  ByteBuffer bytes = FragmentEncoder().encode(header_of_view(PixelFamily::kI420, 400, 400), fragments, 90);
  const AnswerView view = parse_answer(bytes).value();
  ASSERT_EQ(groups_of(view), (std::vector<size_t>{4, 2}));
  const std::span<const FragmentView> all = view.fragments;
  bytes[all[0].payload.data() - bytes.data() + 40] = 0xff;  // a marker
  bytes[all[0].payload.data() - bytes.data() + 41] = 0xd9;
  FragmentDecoder decoder;
  EXPECT_TRUE(decoder.decode(all.first(4)).empty());
  EXPECT_EQ(decoder.decode(all.subspan(4)).size(), 2u);
  std::string reason;
  EXPECT_FALSE(decode_answer(bytes, &reason).has_value());
  EXPECT_EQ(reason, "fragments[0].payload: damaged JPEG");
  EXPECT_TRUE(decoder.decode({}).empty());
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
    EXPECT_TRUE(decoder.decode({&f, 1}).empty());  // not its business
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
