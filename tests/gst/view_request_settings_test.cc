// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/view_request_settings.h"
#include "support/test.h"

namespace lf::test {
namespace {

constexpr PictureFormat kCameras{640, 480, 15, 1};

std::optional<PictureFormat> fit(const char* caps, const PictureFormat& set = {}, int columns = 1, int rows = 1) {
  const std::unique_ptr<GstCaps, void (*)(GstCaps*)> owned(gst_caps_from_string(caps), gst_caps_unref);
  return fit_to_caps(owned.get(), set, kCameras, columns, rows);
}

TEST(PictureFormat, OpenCapsKeepTheSizeOfTheCameras) {
  EXPECT_EQ(fit("ANY"), kCameras);
  EXPECT_EQ(fit("video/x-raw"), kCameras);
  EXPECT_EQ(fit("video/x-raw,width=[1,32767],height=[1,32767],framerate=[0/1,2147483647/1]"), kCameras);
  EXPECT_EQ(fit("video/x-raw(memory:GLMemory),format=RGBA"), kCameras);
}

TEST(PictureFormat, FollowsFixedCaps) {
  EXPECT_EQ(fit("video/x-raw,width=320,height=200,framerate=30000/1001"), (PictureFormat{320, 200, 30000, 1001}));
  EXPECT_EQ(fit("video/x-raw(memory:GLMemory),width=320,height=200"), (PictureFormat{320, 200, 15, 1}));
}

TEST(PictureFormat, OneFixedSideKeepsTheAspectRatio) {
  EXPECT_EQ(fit("video/x-raw,width=320"), (PictureFormat{320, 240, 15, 1}));
  EXPECT_EQ(fit("video/x-raw,height=240"), (PictureFormat{320, 240, 15, 1}));
  EXPECT_EQ(fit("video/x-raw,width=[1,320],height=[1,1000]"), (PictureFormat{320, 240, 15, 1}));
}

TEST(PictureFormat, ExplicitValuesStay) {
  EXPECT_EQ(fit("video/x-raw,height=[1,1000],framerate={10/1,30/1}", {100, 0, 30, 1}),
            (PictureFormat{100, 480, 30, 1}));
  EXPECT_FALSE(fit("video/x-raw,width=320", {100, 0, 0, 1}));
  EXPECT_FALSE(fit("video/x-raw,framerate=25/1", {0, 0, 30, 1}));
}

TEST(PictureFormat, UsesTheFirstSuitableStructure) {
  EXPECT_EQ(fit("video/x-raw,width=320,height=200;video/x-raw"), (PictureFormat{320, 200, 15, 1}));
  EXPECT_EQ(fit("video/x-h264;video/x-raw,width=320,height=200"), (PictureFormat{320, 200, 15, 1}));
  EXPECT_EQ(fit("video/x-raw,width=320,height=200;video/x-raw,width=64", {64, 0, 0, 1}),
            (PictureFormat{64, 480, 15, 1}));
  EXPECT_FALSE(fit("video/x-h264"));
  EXPECT_FALSE(fit("EMPTY"));
  EXPECT_FALSE(fit("video/x-raw,pixel-aspect-ratio=2/1"));
  EXPECT_FALSE(fit("video/x-raw,framerate=0/1"));
}

TEST(PictureFormat, PictureIsDividedAmongItsViews) {
  EXPECT_EQ(fit("video/x-raw,width=960,height=240", {}, 3), (PictureFormat{320, 240, 15, 1}));
  EXPECT_EQ(fit("video/x-raw,width=[1,1000]", {}, 3), (PictureFormat{332, 250, 15, 1}));
  EXPECT_FALSE(fit("video/x-raw,width=1000", {}, 3)) << "not divisible by 3";
  EXPECT_FALSE(fit("video/x-raw,width=642", {}, 2)) << "odd views";
  EXPECT_FALSE(fit("video/x-raw,height=241", {}, 2)) << "odd views";
}

}  // namespace
}  // namespace lf::test
