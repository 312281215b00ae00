// SPDX-License-Identifier: LGPL-2.1-or-later
// Runs lf-scene: its output is complete, matches the rig file, and shows the scene.
#include <gst/app/gstappsink.h>
#include <gst/video/video.h>

#include <nlohmann/json.hpp>

#include "gst/gst_test.h"
#include "quality/image_quality.h"
#include "support/photographs.h"
#include "support/run_program.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

class LfScene : public testing::Test {
 protected:
  int run(const std::string& arguments) {
    const Outcome outcome = run_program("lf-scene", arguments);
    output_ = outcome.output;
    return outcome.status;
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::string out(const std::string& name) const { return "--out '" + path(name) + "' "; }

  static Image rendered(const Camera& c, double time) {
    return render_scene({c.width, c.height, c.lens, c.pose}, time);
  }
  static void expect_whole(const fs::path& folder) {
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
      EXPECT_THAT(entry.path().filename().string(), Not(HasSubstr("part"))) << entry.path();
  }

  const TempDir temp_dir_;
  const fs::path folder_ = temp_dir_.path();
  std::string output_;
};

struct Frame {
  Image i420;
  double time;
};

std::vector<Frame> decode(const std::string& file, std::string& colorimetry) {
  const test::PipelinePtr pipeline =
      test::launch("filesrc location=\"" + file +
                   "\" ! matroskademux ! jpegdec ! video/x-raw,format=I420 ! appsink name=s sync=false");
  const test::ElementPtr sink = test::child_of(pipeline.get(), "s");
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  std::vector<Frame> frames;
  while (g_autoptr(GstSample) sample = gst_app_sink_try_pull_sample(GST_APP_SINK(sink.get()), 10 * GST_SECOND)) {
    GstVideoInfo info;
    gst_video_info_from_caps(&info, gst_sample_get_caps(sample));
    g_autofree gchar* name = gst_video_colorimetry_to_string(&info.colorimetry);
    colorimetry = name ? name : "";
    GstVideoFrame frame;
    gst_video_frame_map(&frame, &info, gst_sample_get_buffer(sample), GST_MAP_READ);
    Image image(PixelFamily::kI420, info.width, info.height);
    for (int i = 0; i < 3; i++)
      for (int y = 0, w = GST_VIDEO_FRAME_COMP_WIDTH(&frame, i); y < GST_VIDEO_FRAME_COMP_HEIGHT(&frame, i); y++)
        std::copy_n(static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, i)) +
                        static_cast<ptrdiff_t>(y) * GST_VIDEO_FRAME_PLANE_STRIDE(&frame, i),
                    w, image.plane(i) + static_cast<ptrdiff_t>(y) * w);
    gst_video_frame_unmap(&frame);
    frames.push_back(
        {std::move(image), static_cast<double>(GST_BUFFER_PTS(gst_sample_get_buffer(sample))) / GST_SECOND});
  }
  return frames;
}

TEST_F(LfScene, FilmsMotionJpeg) {
  ASSERT_EQ(run(out("a b") + "--grid 2x2 --width 161 --height 120 --frames 3 --framerate 12.5 --quality 95"), 0)
      << output_;
  expect_whole(folder_);
  const Rig rig = load_rig(path("a b/rig.json"));
  ASSERT_EQ(rig.cameras.size(), 4u);
  EXPECT_EQ(rig.hash(), scene_rig(2, 2, 161, 120).hash());
  for (const Camera& camera : rig.cameras) {
    EXPECT_EQ(camera.source, camera.name + ".mkv");
    EXPECT_EQ(load_image(rig.resolve(camera.image)).data(), rendered(camera, 0).data());
    std::string colorimetry;
    const std::vector<Frame> frames = decode(rig.resolve(camera.source), colorimetry);
    ASSERT_EQ(frames.size(), 3u) << camera.name;
    EXPECT_EQ(colorimetry.substr(0, 3), "1:4") << "full range, BT.601";
    for (int n = 0; n < 3; n++) {
      EXPECT_NEAR(frames[n].time, n / 12.5, 0.0011);  // Matroska timestamps are in milliseconds
      const Image expected = to_rgb(to_i420(rendered(camera, n / 12.5)));
      EXPECT_GT(compare(to_rgb(frames[n].i420), expected).psnr_db, 34) << camera.name << " frame " << n;
    }
    EXPECT_LT(compare(to_rgb(frames[0].i420), to_rgb(frames[2].i420)).psnr_db, 32) << "nothing moves";
  }
}

TEST_F(LfScene, FilmsImageSequencesOfAnyRig) {
  Rig rig = scene_rig(1, 3, 100, 75);
  rig.cameras[1].lens = Lens(LensModel::kOpenCv, {120, 118, 52, 36, -0.2, 0.05, 0.002, -0.001});
  rig.cameras[1].time_offset = 0.25;
  rig.cameras[2].pose = look_at({0.3, -0.1, 0.1}, {0, 0.1, 2}, {0, 1, 0});
  rig.cameras[2].image = "a-photograph.jpg";
  save_rig(rig, path("rig.json"));
  ASSERT_EQ(run("--rig '" + path("rig.json") + "' " + out("o") + "--format png --frames 4"), 0) << output_;
  ASSERT_EQ(run("--rig '" + path("rig.json") + "' " + out("o") + "--format png --frames 3 --framerate 30000/1001"), 0);
  expect_whole(folder_);
  const Rig filmed = load_rig(path("o/rig.json"));
  EXPECT_EQ(filmed.hash(), rig.hash());
  for (const Camera& camera : filmed.cameras) {
    EXPECT_EQ(camera.source, camera.name + "_%04d.png");
    EXPECT_EQ(camera.image, camera.name + "_0000.png");
    for (int n = 0; n < 3; n++) {
      const Image image = load_image(path("o/" + camera.name + "_000" + std::to_string(n) + ".png"));
      EXPECT_EQ(image.data(), rendered(camera, n * 1001 / 30000.0 + camera.time_offset).data()) << camera.name << n;
    }
    EXPECT_FALSE(fs::exists(path("o/" + camera.name + "_0003.png"))) << "left over from the longer recording";
  }
}

TEST_F(LfScene, WritesGroundTruth) {
  const View still = test::view_from({}, 64, 48, 40, 2);
  View moved = still;
  moved.pose.position = {0.05, 0, 0.1};
  const std::vector<NamedView> views = {{"first", 0, still}, {"second", 1.5, moved}};
  save_views(views, path("views.json"));
  const std::string arguments = out("o") + "--grid 1x1 --width 32 --height 24 --frames 1 --format png --truth '";
  ASSERT_EQ(run(arguments + path("views.json") + "'"), 0) << output_;
  for (const NamedView& v : views) {
    const Image truth = load_image(path("o/truth/" + v.name + ".png"));
    EXPECT_EQ(truth.data(), render_scene({64, 48, v.view.lens, v.view.pose}, v.time).data()) << v.name;
  }
}

TEST_F(LfScene, ErrorsNameTheProblem) {
  const auto expect_refused = [&](const std::string& arguments, const std::vector<std::string>& facts) {
    EXPECT_EQ(run(arguments), 1) << arguments;
    EXPECT_MENTIONS(output_, facts);
  };
  std::ofstream(path("log")) << "not a folder";
  expect_refused("--grid 2x2", {"--out"});
  expect_refused(out("o") + "--grid 2by2", {"--grid 2by2", "ROWSxCOLUMNS"});
  expect_refused(out("o") + "--grid 0x2", {"0x2"});
  expect_refused(out("o") + "--framerate 0/1", {"--framerate 0/1"});
  expect_refused(out("o") + "--framerate nan", {"--framerate nan"});
  expect_refused(out("o") + "--grid 2x2 --rig r.json", {"--grid"});
  expect_refused(out("o") + "--rig '" + path("none.json") + "'", {"none.json"});
  expect_refused(out("log/o") + "--grid 1x1 --frames 1", {"log/o"});  // a file has the name of the folder
  Rig rig = scene_rig(1, 2, 8, 8);
  rig.cameras[1].name = "../outside";
  save_rig(rig, path("rig.json"));
  expect_refused(out("o") + "--rig '" + path("rig.json") + "'", {"cameras[1].name", "../outside"});
  EXPECT_FALSE(fs::exists(path("o")));
}

TEST_F(LfScene, FailedRunKeepsTheOldRecording) {
  ASSERT_EQ(run(out("o") + "--grid 1x2 --width 16 --height 16 --frames 2"), 0) << output_;
  fs::remove(path("o/cam_00_01.mkv"));
  fs::create_directories(path("o/cam_00_01.mkv/in-the-way"));
  const auto content = [&](const char* name) { return read_binary(path(name)); };
  const std::string rig = content("o/rig.json"), film = content("o/cam_00_00.mkv");
  EXPECT_EQ(run(out("o") + "--grid 1x2 --width 24 --height 16 --frames 3"), 1);
  EXPECT_THAT(output_, HasSubstr("cam_00_01.mkv"));
  EXPECT_EQ(content("o/rig.json"), rig);
  EXPECT_EQ(content("o/cam_00_00.mkv"), film);
}

class LfSceneLights : public LfScene {
 protected:
  struct Film {
    uintmax_t bytes = 0;
    int darkest = 255, brightest = 0;
    double apart = 0;  // distance between the lights in the first frame, pixels
  };
  Film film(const std::string& options) {
    const std::string name = "lights" + std::to_string(films_++);
    EXPECT_EQ(run("lights --rig '" + path("film/rig.json") + "' --seconds 0.2 --noise 0 " + out(name) + options), 0)
        << output_;
    const std::string file = path(name + "/cam_00_00.mkv");
    Film film{fs::file_size(file)};
    std::string ignored;
    const Image frame = decode(file, ignored).at(0).i420;
    for (int i = 0; i < frame.width() * frame.height(); i++) {
      film.darkest = std::min<int>(film.darkest, frame.plane(0)[i]);
      film.brightest = std::max<int>(film.brightest, frame.plane(0)[i]);
    }
    const auto lights = nlohmann::json::parse(read_binary(path(name + "/lights.json")))["cameras"][0]["frames"][0];
    film.apart = std::hypot(lights[1][0].get<double>() - lights[2][0].get<double>(),
                            lights[1][1].get<double>() - lights[2][1].get<double>());
    return film;
  }
  void SetUp() override {
    ASSERT_EQ(run("--grid 2x2 --width 96 --height 72 --frames 1 --format png " + out("film")), 0) << output_;
  }
  int films_ = 0;
};

TEST_F(LfSceneLights, OptionsHaveTheirEffect) {
  const Film usual = film("");
  const Film near = film("--near 1 --far 1.2"), far = film("--near 3 --far 3.2");
  EXPECT_NEAR(near.apart / far.apart, 3.1 / 1.1, 0.5) << "at three times the distance, a third of the spacing";
  const Film weak = film("--power 0.05");
  EXPECT_LT(weak.brightest, usual.brightest / 2) << usual.brightest;
  const Film lit = film("--ambient 0.3");
  EXPECT_GT(lit.darkest, usual.darkest + 5) << usual.darkest;
  const Film coarse = film("--quality 20");
  EXPECT_LT(coarse.bytes, usual.bytes * 3 / 4) << usual.bytes;
  for (const char* wrong : {"--near 3 --far 1", "--near -1", "--near nan", "--power 0", "--power nan", "--ambient -1"})
    EXPECT_NE(run("lights --rig '" + path("film/rig.json") + "' " + out("wrong") + wrong), 0) << wrong;
}

TEST_F(LfSceneLights, QualityAppliesToChartJpegs) {
  const auto bytes = [&](const std::string& name, const std::string& options) {
    EXPECT_EQ(run("chart --places 2 --rig '" + path("film/rig.json") + "' " + out(name) + options), 0) << output_;
    return fs::file_size(path(name + "/cam_00_00.mkv"));
  };
  EXPECT_LT(bytes("coarse", "--quality 20"), bytes("fine", "--quality 97") / 2);
}

}  // namespace
}  // namespace lf
