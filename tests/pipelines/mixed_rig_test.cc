// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Cameras of different size, rate and format in one rig.
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "gst/camera_files.h"
#include "image/image.h"
#include "pipelines/gst_launch.h"
#include "quality/quality.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/temp_dir.h"
#include "view/views_json.h"

namespace lf::test {
namespace {

struct Kind {
  const char* source;
  int width, height, rate;
  std::string maker;  // from a raw stream to the file; empty: the pictures themselves
};

// Films the moving scene with `camera` into its source, 0.7 s long.
void film(const TempDir& dir, const Camera& camera, const Kind& kind) {
  for (int k = 0; k < kind.rate * 7 / 10; k++) {
    char name[32];
    std::snprintf(name, sizeof name, "%s_%02d.png", camera.name.c_str(), k);
    const double time = static_cast<double>(k) / kind.rate;
    save_image(render_scene({camera.width, camera.height, camera.lens, camera.pose}, time), dir / name);
  }
  if (kind.maker.empty()) return;
  const Launched run =
      gst_launch("multifilesrc location=" + dir / (camera.name + "_%02d.png") +
                 " caps=image/png,framerate=" + std::to_string(kind.rate) + "/1 ! pngdec ! videoconvert ! " +
                 kind.maker + " ! filesink location=" + dir / kind.source);
  ASSERT_EQ(run.status, 0) << run.output;
}

// A view from where a camera stands, through its lens, is that camera's picture: of the right size, time and colour.
TEST(MixedRig, EveryCameraShowsItsOwnPictureOfTheTime) {
  const TempDir dir;
  std::vector<Kind> kinds = {
      {"mjpeg.mkv", 160, 120, 15, "video/x-raw,format=I420 ! jpegenc quality=95 ! matroskamux"},
      {"cam_00_01_%02d.png", 96, 128, 15, ""},  // image sequences have the rate of the node, by default this
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
  for (const double time : {0.0, 0.2, 0.6})  // at which each of the rates has a frame
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
    const Launched run = gst_launch("lfviewrequest location=" + dir / "views.json" +
                                    " ! tee name=r  r. ! queue ! n.request  lfcameranode name=n decode=" + decode +
                                    " rig=" + dir / "rig.json" +
                                    " ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c ! videoconvert ! " +
                                    "pngenc ! multifilesink location=" + dir / ("out_" + decode + "_%02d.png"));
    ASSERT_EQ(run.status, 0) << run.output;
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
      EXPECT_GT(psnr, next + 0.5) << "it is not the camera's next frame";
    }
  }
}

}  // namespace
}  // namespace lf::test
