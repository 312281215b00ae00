// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Blending of more than three cameras per pixel in file pipelines, compared with the library: one or two nodes, each
// kind of camera access, and a focal surface.

#include "composite/still.h"
#include "pipelines/gst_launch.h"
#include "quality/image_quality.h"
#include "support/photographs.h"

namespace lf::test {
namespace {

class BlendedArray : public testing::Test {
 protected:
  void SetUp() override {
    rig_ = scene_rig(4, 4, 96, 72);
    images_ = save_photographs(rig_, dir_, 0, 1);
    rig_ = load_rig(dir_ / "rig.json");
    for (int i = 0; i < kViews; i++)
      views_.push_back(view_from(Vec3(0.01, -0.005, -0.02) * double(i), 101, 75, 30, kSceneMiddle));
    save_views(path_of(views_, 1 / 15.0), dir_ / "views.json");
  }

  Image expected(int i, const Blending& blending) const {
    View view = views_[static_cast<size_t>(i)];
    view.blending = blending;
    return render_still(rig_, build_mesh(rig_), view,
                        [this](CameraIndex camera) -> const Image& { return images_[camera]; })
        .picture;
  }
  std::string node(const std::string& name, const std::string& cameras, const std::string& more,
                   const std::string& pad) const {
    return " r. ! queue ! " + name + ".request lfcameranode name=" + name + " node=" + pad + " cameras=" + cameras +
           " resampling=bilinear rig=" + dir_ / "rig.json" + " " + more + " ! queue ! c.sink_" + pad;
  }
  // Returns the pictures that `nodes` and a compositor with these properties make.
  std::vector<Image> pictures(const std::string& request, const std::string& nodes,
                              const std::string& compositor = "focus=plane") {
    expect_runs("lfviewrequest location=" + dir_ / "views.json" + " rig=" + dir_ / "rig.json" + " " + request +
                " ! tee name=r r. ! queue ! c.request lfcompositor name=c rig=" + dir_ / "rig.json" + " " + compositor +
                " ! videoconvert ! pngenc ! multifilesink location=" + dir_ / "%d.png" + nodes);
    std::vector<Image> out;
    for (int i = 0; i < kViews; i++) out.push_back(load_image(dir_ / (std::to_string(i) + ".png")));
    return out;
  }

  static constexpr int kViews = 3;
  TempDir dir_;
  Rig rig_;
  std::vector<Image> images_;
  std::vector<View> views_;
};

const struct {
  const char* property;
  Blending blending;
} kWays[] = {{"aperture=0.1", {Blending::Kind::kAperture, 0.1, 0}},
             {"nearest-cameras=4", {Blending::Kind::kAngle, 0, 4}}};

TEST_F(BlendedArray, OneAndTwoNodesMakeTheLibrarysPictures) {
  for (const auto& [property, blending] : kWays) {
    const auto one = pictures(property, node("a", "0-15", "", "0"));
    const auto two = pictures(property, node("a", "0-6", "", "0") + node("b", "7-15", "", "1"));
    for (int i = 0; i < kViews; i++) {
      EXPECT_EQ(compare(one[i], expected(i, blending)).max_error, 0) << property << " " << i;
      EXPECT_EQ(compare(two[i], one[i]).max_error, 0) << property << " " << i;
      EXPECT_GT(compare(one[i], expected(i, {})).max_error, 8) << "is it blended at all?";
    }
  }
}

// Includes JPEG between hosts, and cameras without the rig: such cameras blend three cameras per pixel.
TEST_F(BlendedArray, WorksWithEveryAccess) {
  for (const auto& [property, blending] : kWays) {
    const auto coded = pictures(property, node("a", "0-6", "codec=jpeg", "0") + node("b", "7-15", "codec=jpeg", "1"));
    const auto rounded = pictures(property, node("a", "0-6", "codec=raw", "0") + node("b", "7-15", "codec=raw", "1"));
    const auto plain =
        pictures(std::string(property) + " access=pixels quality=0", node("a", "0-15", "access=pixels", "0"));
    const auto told = pictures(std::string(property) + " access=warp quality=0", node("a", "0-15", "access=warp", "0"));
    for (int i = 0; i < kViews; i++) {
      const Image all = expected(i, blending);
      std::printf("%s view %d: JPEG of two sums %.1f dB, %.1f dB in 8 bits\n", property, i,
                  compare(coded[i], all).psnr_db, compare(rounded[i], all).psnr_db);
      EXPECT_GT(compare(coded[i], all).psnr_db, 29) << property << " " << i;
      EXPECT_GT(compare(rounded[i], all).psnr_db, 40) << property << " " << i;
      EXPECT_EQ(compare(plain[i], all).max_error, 0) << property << " " << i;
      EXPECT_LE(compare(told[i], expected(i, {})).max_error, 2) << property << " " << i;
    }
  }
}

// All other cameras compensate for a missing node: a compositor with the rig knows its weights.
TEST_F(BlendedArray, OtherCamerasFillInForMissingOnes) {
  for (const auto& [property, blending] : kWays) {
    const auto some = pictures(property, node("a", "0-6,8-15", "", "0"));
    for (int i = 0; i < kViews; i++) EXPECT_GT(compare(some[i], expected(i, blending)).psnr_db, 28) << property;
  }
}

TEST_F(BlendedArray, FocusedOnASurface) {
  for (const auto& [property, blending] : kWays) {
    const auto found = pictures(property, node("a", "0-6", "", "0") + node("b", "7-15", "", "1"), "focus=surface");
    for (int i = 0; i < kViews; i++) EXPECT_GT(compare(found[i], expected(i, blending)).psnr_db, 20) << property;
  }
}

}  // namespace
}  // namespace lf::test
