// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/frame_sources.h"

#include "scene/scene.h"
#include "support/test.h"

namespace lf {
namespace {

// A picture that may be unavailable and that records its calls.
struct FakePicture : CameraPicture {
  FakePicture(bool compressed, bool sound) : compressed_(compressed), sound_(sound) {}
  int width() const override { return 80; }
  int height() const override { return 60; }
  bool is_compressed() const override { return compressed_; }
  bool takes_work(PixelFamily) const override { return compressed_; }
  std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) override {
    asked_ = region;
    return sound_ ? std::make_shared<const ImageView>(ImageView{family, 80, 60, {}, {}, {}}) : nullptr;
  }
  const bool compressed_, sound_;
  Rect asked_{};
};

class FrameSourcesTest : public testing::Test {
 protected:
  std::shared_ptr<FakePicture> add(CameraIndex camera, bool compressed, bool sound = true) {
    const auto picture = std::make_shared<FakePicture>(compressed, sound);
    sources_.add(camera, CameraFrame{picture, 0, 100 + camera});
    return picture;
  }
  void decode() {
    sources_.decode(
        PixelFamily::kI420,
        [this](CameraIndex, const CameraFrame&) -> std::optional<CameraFrame> {
          replaced_++;
          if (!before_) return std::nullopt;
          return CameraFrame{std::exchange(before_, nullptr), 0, 50};
        },
        serial_for);
  }

  const Rig rig_ = scene_rig(2, 2, 80, 60);
  int regions_ = 0, replaced_ = 0;
  std::shared_ptr<CameraPicture> before_;
  FrameSources sources_{rig_, [this](CameraIndex) { return regions_++, Rect{0, 0, 16, 16}; }};
};

TEST_F(FrameSourcesTest, OnlyCompressedPicturesDecodeRegions) {
  const auto raw = add(0, false), compressed = add(2, true);
  sources_.add(3, std::nullopt);
  decode();
  EXPECT_EQ(regions_, 1) << "computed once";
  EXPECT_EQ(compressed->asked_, (Rect{0, 0, 16, 16}));
  ASSERT_EQ(sources_.sources().size(), 3u);
  EXPECT_EQ(sources_.sources()[1].rig_camera, &rig_.cameras[2]);
  EXPECT_EQ(sources_.sources()[1].image.family, PixelFamily::kI420);
  EXPECT_EQ(sources_.sources()[2].image.family, PixelFamily::kNone);
  EXPECT_EQ(sources_.time(1), 102u);
}

TEST_F(FrameSourcesTest, PreviousFrameReplacesADamagedOne) {
  add(0, true, false);
  before_ = std::make_shared<FakePicture>(true, true);
  decode();
  EXPECT_EQ(replaced_, 1);
  EXPECT_EQ(sources_.time(0), 50u);
  EXPECT_EQ(sources_.sources()[0].image.family, PixelFamily::kI420);
}

TEST_F(FrameSourcesTest, NoImageWithoutAReplacement) {
  add(0, true, false);
  before_ = std::make_shared<FakePicture>(true, false);
  decode();
  EXPECT_EQ(replaced_, 2) << "the previous frame is damaged, too";
  EXPECT_EQ(sources_.sources()[0].image.family, PixelFamily::kNone);
}

}  // namespace
}  // namespace lf
