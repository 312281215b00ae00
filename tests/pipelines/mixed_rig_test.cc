// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Cameras of different size, rate, format and colour in one rig.

#include "gst/camera_files.h"
#include "pipelines/gst_launch.h"
#include "quality/image_quality.h"
#include "rig/rig_json.h"
#include "scene/calibration_targets.h"
#include "scene/scene.h"
#include "support/temp_dir.h"
#include "view/view_path.h"

namespace lf::test {
namespace {

struct Kind {
  const char* source;
  int width, height, rate;
  std::string maker;  // elements from a raw stream to the file; empty: image files
};

// Records 0.7 s of the moving scene with `camera` into its source.
void film(const TempDir& dir, const Camera& camera, const Kind& kind) {
  for (int k = 0; k < kind.rate * 7 / 10; k++) {
    char name[32];
    std::snprintf(name, sizeof name, "%s_%02d.png", camera.name.c_str(), k);
    const double time = static_cast<double>(k) / kind.rate;
    save_image(render_scene({camera.width, camera.height, camera.lens, camera.pose}, time), dir / name);
  }
  if (kind.maker.empty()) return;
  expect_runs("multifilesrc location=" + dir / (camera.name + "_%02d.png") +
              " caps=image/png,framerate=" + std::to_string(kind.rate) + "/1 ! pngdec ! videoconvert ! " + kind.maker +
              " ! filesink location=" + dir / kind.source);
}

TEST(MixedRig, EveryCameraShowsItsPictureOfTheTime) {
  const TempDir dir;
  std::vector<Kind> kinds = {
      {"mjpeg.mkv", 160, 120, 15, "video/x-raw,format=I420 ! jpegenc quality=95 ! matroskamux"},
      {"cam_00_01_%02d.png", 96, 128, 15, ""},  // default rate of the node, which applies to image sequences
      {"raw.avi", 120, 90, 30, "video/x-raw,format=I420 ! avimux"},
      {"mjpeg.avi", 208, 144, 10, "video/x-raw,format=I420 ! jpegenc quality=95 ! avimux"},
  };
  const std::string encoder = CameraFiles::h264_encoder();
  if (!encoder.empty())
    kinds[3] = {"h264.mp4", 208, 144, 10, "video/x-raw,format=I420 ! " + encoder + " ! h264parse ! mp4mux"};
  else
    std::printf("no H.264: no encoder and decoder are installed\n");

  Rig rig = scene_rig(2, 2, 160, 120);
  for (size_t i = 0; i < kinds.size(); i++) {
    Camera& camera = rig.cameras[i];
    camera.width = kinds[i].width;
    camera.height = kinds[i].height;
    camera.lens = Lens::pinhole(1.2 * camera.width, (camera.width - 1) / 2.0, (camera.height - 1) / 2.0);
    camera.source = kinds[i].source;
    film(dir, camera, kinds[i]);
  }
  save_rig(rig, dir / "rig.json");

  std::vector<NamedView> views;
  for (const double time : {0.0, 0.2, 0.6})  // cameras of all frame rates have a frame at these times
    for (const Camera& camera : rig.cameras) {
      NamedView view{"view_" + std::to_string(views.size()), time, {}};
      view.view.width = camera.width;
      view.view.height = camera.height;
      view.view.lens = camera.lens;
      view.view.pose = camera.pose;
      view.view.focus.plane = focal_plane_at(camera.pose, kSceneMiddle);
      views.push_back(view);
    }
  save_views(views, dir / "views.json");

  for (const std::string decode : {"false", "true"}) {
    expect_runs("lfviewrequest location=" + dir / "views.json" +
                " ! tee name=r  r. ! queue ! n.request  lfcameranode name=n decode=" + decode + " rig=" +
                dir / "rig.json" + " ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c ! videoconvert ! " +
                "pngenc ! multifilesink location=" + dir / ("out_" + decode + "_%02d.png"));
    for (size_t i = 0; i < views.size(); i++) {
      const View& view = views[i].view;
      char name[32];
      std::snprintf(name, sizeof name, "out_%s_%02zu.png", decode.c_str(), i);
      const Image picture = load_image(dir / name);
      ASSERT_EQ(picture.width(), view.width);
      ASSERT_EQ(picture.height(), view.height);
      const auto psnr_at = [&](double time) {
        return compare(picture, render_scene({view.width, view.height, view.lens, view.pose}, time)).psnr_db;
      };
      const double psnr = psnr_at(views[i].time), next = psnr_at(views[i].time + 1.0 / kinds[i % 4].rate);
      std::printf("decode=%s, camera %zu at %.1f s: %.1f dB, the next frame would be %.1f dB\n", decode.c_str(), i % 4,
                  views[i].time, psnr, next);
      EXPECT_GT(psnr, 28);
      EXPECT_GT(psnr, next + 0.5) << "not the camera's next frame";
    }
  }
}

// Cameras with colour corrections in the rig. Every second camera has less red and more blue, and only one rig file
// contains the corrections.
class ColourPipeline : public testing::Test {
 protected:
  void SetUp() override {
    Rig rig = scene_rig(3, 3, 160, 120);
    for (size_t i = 0; i < rig.cameras.size(); i++) {
      Camera& camera = rig.cameras[i];
      camera.image = camera.name + "_0.png";
      camera.source = camera.name + "_%d.png";
      const Image film = render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0);
      const ColourFault fault{.balance = i % 2 ? Vec3(0.85, 1, 1.15) : Vec3(1)};
      save_image(apply_fault(film, fault, camera.principal_point(), i), dir_ / camera.image);
    }
    save_rig(rig, dir_ / "wrong.json");
    for (size_t i = 1; i < rig.cameras.size(); i += 2)
      rig.cameras[i].colour =
          ColourModel{.matrix = {std::pow(0.85, -kPictureGamma), 0, 0, 0, 1, 0, 0, 0, std::pow(1.15, -kPictureGamma)}};
    save_rig(rig, dir_ / "right.json");
    View view{.width = 160,
              .height = 120,
              .lens = rig.cameras[4].lens,
              .pose = {{0.012, 0.015, 0}, {1, 0, 0, 0}},
              .focus = {}};
    view.focus.plane = plane_through({0, 0, kSceneMiddle}, {0, 0, 1});
    dir_.write("views.json", views_to_json({{"view", 0, view}}));
  }
  Image pipeline(const std::string& rig, const std::string& access = "") {
    const std::string out = dir_ / (rig + ".png");
    expect_runs("lfviewrequest location=" + dir_ / "views.json" + access +
                (access.empty() ? "" : " rig=" + dir_ / rig) +
                " ! tee name=r r. ! queue ! n.request "
                "lfcameranode name=n rig=" +
                dir_ / rig + access +
                " ! c.sink_0 r. ! queue ! c.request "
                "lfcompositor name=c focus=plane rig=" +
                dir_ / rig + " ! videoconvert ! pngenc ! filesink location=" + out);
    return load_image(out);
  }
  Image still(const std::string& rig) {
    test::expect_outcome(
        run_program("lf-render", "--rig " + rig + " --views views.json --out still-" + rig + " --focus plane",
                    dir_.path()),
        0);
    return load_image(dir_ / ("still-" + rig + "/view.png"));
  }
  const TempDir dir_;
};

// Mean of a channel; the fault of every second camera shifts this mean by a sixth or a half of the fault.
double mean(const Image& image, size_t channel) {
  double sum = 0;
  for (size_t i = channel; i < image.data().size(); i += 3) sum += image.data()[i];
  return 3 * sum / static_cast<double>(image.data().size());
}

TEST_F(ColourPipeline, PictureHasTheColoursOfTheRig) {
  const Image wrong = pipeline("wrong.json"), right = pipeline("right.json");
  EXPECT_GT(mean(right, 0), 1.04 * mean(wrong, 0)) << "red comes back";
  EXPECT_NEAR(mean(right, 1) / mean(wrong, 1), 1, 0.01);
  EXPECT_LT(mean(right, 2), 0.98 * mean(wrong, 2)) << "blue goes";
  EXPECT_EQ(right.data(), still("right.json").data()) << "bit-identical without GStreamer";
}

TEST_F(ColourPipeline, PixelAccessSendsCorrectedPixels) {
  const Image right = pipeline("right.json"), told = pipeline("right.json", " access=pixels");
  EXPECT_GT(compare(told, right, std::vector<float>(160 * 120, 1)).psnr_db, 40);
}

}  // namespace
}  // namespace lf::test
