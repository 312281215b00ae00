// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/pixel_access.h"

#include <gtest/gtest.h>

#include <numeric>

#include "support/expect_error.h"
#include "wire/answer_parser.h"
#include "wire/fragment_codec.h"

namespace lf {
namespace {

Camera camera_of(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  return camera;
}

std::vector<uint8_t> counting(size_t n) {
  std::vector<uint8_t> bytes(n);
  std::iota(bytes.begin(), bytes.end(), uint8_t{0});
  return bytes;
}

wire::AnswerHeader header_of(PixelFamily family) { return {.view_width = 4, .view_height = 4, .family = family}; }

TEST(PixelAnswer, HasThePixelsOfAnyLayout) {
  const Camera camera = camera_of(9, 7);
  const std::vector<uint8_t> bytes = counting(40 * 7);
  for (const RgbLayout layout : {RgbLayout{}, RgbLayout{4, 2, 1, 0}, RgbLayout{4, 1, 2, 3}}) {
    const ImageView image{PixelFamily::kRgb, 9, 7, layout, {bytes.data()}, {40}};
    const Rect rect{2, 4, 9, 7};
    const PixelSource source{{5, &camera, image}, rect};
    const RenderedAnswer answer = pixel_answer(header_of(PixelFamily::kRgb), {&source, 1}, 0);
    EXPECT_EQ(answer.fragments, 1u);
    const auto view = wire::parse_answer(answer.bytes);
    ASSERT_TRUE(view);
    const wire::FragmentView& fragment = view->fragments[0];
    EXPECT_EQ(fragment.camera, 5u);
    EXPECT_EQ(fragment.rect, rect);
    for (int y = 0; y < 3; y++)
      for (int x = 0; x < 7; x++) {
        const uint8_t* pixel = &bytes[static_cast<size_t>(40 * (y + 4) + layout.pixel_stride * (x + 2))];
        const uint8_t* out = &fragment.payload[static_cast<size_t>(3 * (7 * y + x))];
        EXPECT_EQ(out[0], pixel[layout.r]);
        EXPECT_EQ(out[1], pixel[layout.g]);
        EXPECT_EQ(out[2], pixel[layout.b]);
      }
  }
}

TEST(PixelAnswer, ChromaHasNoOffset) {
  const Camera camera = camera_of(9, 7);
  Image image(PixelFamily::kI420, 9, 7);
  image.data() = counting(image.data().size());
  const PixelSource source{{5, &camera, image.view()}, {2, 4, 9, 7}};
  const RenderedAnswer answer = pixel_answer(header_of(PixelFamily::kI420), {&source, 1}, 0);
  const auto view = wire::parse_answer(answer.bytes);
  ASSERT_TRUE(view);
  wire::FragmentDecoder decoder;
  const FragmentPlanes planes = decoder.decode(view->fragments[0]).value();
  EXPECT_EQ(planes.plane[0][0], image.plane(0)[4 * 9 + 2]);
  EXPECT_EQ(planes.plane[1][1], static_cast<uint8_t>(image.plane(1)[2 * 5 + 2] - 128));
  EXPECT_EQ(planes.plane[2][planes.stride[2]], static_cast<uint8_t>(image.plane(2)[3 * 5 + 1] - 128));
}

TEST(PixelAnswer, JpegComesInStrips) {
  const Camera camera = camera_of(640, 480);
  const Image image(PixelFamily::kI420, 640, 480);
  const PixelSource source{{5, &camera, image.view()}, {0, 0, 640, 480}};
  const RenderedAnswer answer = pixel_answer(header_of(PixelFamily::kI420), {&source, 1}, 90);
  EXPECT_GT(answer.fragments, 3u);
  const auto view = wire::parse_answer(answer.bytes);
  ASSERT_TRUE(view);
  size_t rows = 0;
  for (const wire::FragmentView& fragment : view->fragments) {
    EXPECT_TRUE(fragment.codec == wire::Codec::kJpeg);
    rows += static_cast<size_t>(fragment.rect.height());
  }
  EXPECT_EQ(rows, 480u);
}

TEST(PixelAnswer, RefusesImagesOfAnotherSize) {
  const Camera camera = camera_of(10, 7);
  const Image image(PixelFamily::kRgb, 9, 7);
  const PixelSource source{{5, &camera, image.view()}, {0, 0, 4, 4}};
  EXPECT_ERROR(pixel_answer(header_of(PixelFamily::kRgb), {&source, 1}, 0), "its image has 9x7 pixels");
}

}  // namespace
}  // namespace lf
