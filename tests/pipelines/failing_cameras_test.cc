// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Launch lines and scripts with failing cameras and with cameras from the rig.

#include "gst/camera_files.h"
#include "pipelines/gst_launch.h"
#include "support/photographs.h"

namespace lf::test {
namespace {

class FailingCamerasTest : public testing::Test {
 protected:
  std::string rig(const std::string& second) {
    return files_.save("rig.json", 3, [&](Camera& camera) { camera.source = camera.id == 1 ? second : "mjpeg.mkv"; });
  }
  CameraFiles files_;
};

// gst-launch-1.0 stops at the first error.
TEST_F(FailingCamerasTest, OneFailingCameraDoesNotEndThePipeline) {
  for (const std::string live : {"", "is-live=true "}) {
    const std::string path = rig("nowhere.mkv");
    const std::string pace = live.empty() ? "" : "capture-delay=200000000 ";
    test::expect_outcome(
        gst_launch("lfviewrequest num-buffers=30 framerate=15/1 width=64 height=48 " + live + pace + "rig=" + path +
                       " ! tee name=r  r. ! queue ! n.request lfcameranode name=n loop=true " + live + "rig=" + path +
                       " ! c.sink_0  r. ! queue ! c.request lfcompositor name=c rig=" + path +
                       " post-messages=true ! fakesink sync=false",
                   "-m"),
        0,
        AllOf(HasSubstr("lightfield-camera-lost, camera=(uint)1, name=(string)cam_1"),
              HasSubstr("WARNING: from element"), mentions("nowhere.mkv", "no such", "out of service"),
              HasSubstr("Got EOS")));
  }
}

// Pictures and depth hypotheses are bit-identical to an array without the missing cameras, from the start and with the
// viewpoint in the gap.
TEST_F(FailingCamerasTest, MissingFilesAreOutOfService) {
  constexpr int kPictures = 10;
  Rig rig = scene_rig(3, 3, 96, 72);
  for (Camera& camera : rig.cameras) camera.image.clear();
  std::vector<View> views;
  for (int i = 0; i < kPictures; i++)  // at camera 4 first
    views.push_back(view_from({i < 5 ? 0 : 0.005, i < 5 ? 0 : 0.004, i % 5 * -0.03}, 128, 96, 25, 2.2));
  save_views(path_of(views, 0.1), files_.path("views.json"));
  const auto pictures = [&](const std::set<uint32_t>& missing, const std::string& settings) {
    Rig of_files = rig;
    for (Camera& camera : of_files.cameras)
      if (missing.contains(camera.id)) camera.source = "nowhere.mkv";
    save_rig(of_files, files_.path("array.json"));
    expect_runs("lfviewsrc is-live=false rig=" + files_.path("array.json") + " location=" + files_.path("views.json") +
                " " + settings + " ! filesink location=" + files_.path("pictures"));
    return read_binary(files_.path("pictures"));
  };
  for (const auto& [missing, list] : {std::pair<std::set<uint32_t>, std::string>{{4}, "4"}, {{1, 4, 5}, "1,4-5"}}) {
    const std::string without = pictures({}, "view::out-of-service=" + list), lost = pictures(missing, "");
    ASSERT_EQ(without.size(), kPictures * size_t{128} * 96 * 3);
    EXPECT_TRUE(lost == without) << list;
    size_t dark = 0;
    for (size_t i = 0; i < lost.size() / kPictures; i += 3)
      dark += std::ranges::all_of(lost.substr(i, 3), [](char c) { return static_cast<uint8_t>(c) < 4; });
    EXPECT_EQ(dark, 0u) << list;
  }
  // A lost corner stays in the mesh: its neighbours show its part.
  EXPECT_TRUE(pictures({0, 4}, "") == pictures({0}, "view::out-of-service=4"));
}

TEST_F(FailingCamerasTest, CameraHostHasAllCamerasByDefault) {
  const std::string log = files_.path("log");
  const std::string script = "GST_PLUGIN_PATH=" LF_PLUGIN_DIR " GST_REGISTRY=" LF_PLUGIN_DIR
                             "/test-registry.bin gst-launch-1.0 -m lfnodesink rig=" +
                             rig("mjpeg.mkv") + " listen=27431 answers=127.0.0.1:27432 >" + log +
                             " 2>&1 & node=$!; for i in $(seq 300); do sleep 0.1; kill -0 $node 2>/dev/null || break; "
                             "grep -q 'pipeline0.*new-state=(GstState)playing' " +
                             log + " && break; done; kill $node; cat " + log;
  FILE* pipe = popen(script.c_str(), "r");
  ASSERT_TRUE(pipe);
  std::string output;
  char buffer[4096];
  while (const size_t n = fread(buffer, 1, sizeof buffer, pipe)) output.append(buffer, n);
  pclose(pipe);
  EXPECT_THAT(output, AllOf(HasSubstr("new-state=(GstState)playing"), HasSubstr("camera2"), Not(HasSubstr("ERROR"))));
}

}  // namespace
}  // namespace lf::test
