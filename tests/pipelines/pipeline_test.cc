// SPDX-License-Identifier: LGPL-2.1-or-later
//
// gst-launch-1.0 on files, compared with the library without GStreamer and with ground truth.

#include <regex>

#include "composite/still.h"
#include "pipelines/gst_launch.h"
#include "quality/image_quality.h"
#include "support/photographs.h"

namespace lf::test {
namespace pipeline_test {

// Renders a view of a still array with the library: the expected picture of the pipeline.
Image render_without_gstreamer(const Rig& rig, const View& view, const std::vector<Image>& images) {
  return render_still(rig, build_mesh(rig), view, [&](CameraIndex i) -> const Image& { return images[i]; }).picture;
}

// The README's first launch line, with planes and bilinear samples for a simple expectation.
std::string files_in_files_out(const std::string& rig, const std::string& views, const std::string& out) {
  return "lfviewrequest location=" + views +
         " ! tee name=r  r. ! queue ! n.request  lfcameranode name=n resampling=bilinear rig=" + rig +
         " ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c focus=plane rig=" + rig +
         " ! videoconvert ! pngenc ! multifilesink location=" + out;
}

class StillArray : public testing::Test {
 protected:
  void SetUp() override {
    rig_ = scene_rig(3, 3, 80, 60);
    for (Camera& camera : rig_.cameras)
      camera.lens = Lens(LensModel::kRadial, {camera.lens.fx(), 39.5, 29.5, -0.1, 0.02});
    images_ = save_photographs(rig_, dir_, 0, 1);
    rig_ = load_rig(dir_ / "rig.json");
    const double focus[] = {kSceneNear, kSceneMiddle, kSceneFar};
    std::vector<View> path;
    for (int i = 0; i < 3; i++) path.push_back(view_from(Vec3(0.01, -0.005, -0.02) * double(i), 100, 75, 30, focus[i]));
    save_views(path_of(path, 0), views);
    views_ = load_views(views);
  }

  void write_requests(const std::string& properties = "") {
    expect_runs("lfviewrequest rig=" + rig + properties + " location=" + views + " ! filesink location=" + requests);
  }
  void composite_files() {
    expect_runs("filesrc location=" + requests + " ! lfparse ! c.request filesrc location=" + answers +
                " ! lfparse ! c.sink_0 lfcompositor name=c focus=plane rig=" + rig +
                " ! videoconvert ! pngenc ! multifilesink location=" + out);
  }
  std::vector<Quality> qualities() {
    std::vector<Quality> all;
    for (size_t i = 0; i < views_.size(); i++)
      all.push_back(compare(load_image(dir_ / ("out_0" + std::to_string(i) + ".png")),
                            render_without_gstreamer(rig_, views_[i].view, images_)));
    return all;
  }

  TempDir dir_;
  const std::string rig = dir_ / "rig.json", views = dir_ / "views.json", out = dir_ / "out_%02d.png",
                    requests = dir_ / "path.lfq", answers = dir_ / "path.lfa";
  Rig rig_;
  std::vector<Image> images_;
  std::vector<NamedView> views_;
};

TEST_F(StillArray, PipelineMakesTheLibrarysPictures) {
  expect_runs(files_in_files_out(rig, views, out));
  for (const Quality& quality : qualities()) EXPECT_EQ(quality.max_error, 0);
  EXPECT_FALSE(std::filesystem::exists(dir_ / "out_03.png"));
}

TEST_F(StillArray, TwoNodesMakeTheSamePicturesAsOne) {
  expect_runs("lfviewrequest location=" + views + " ! tee name=r r. ! queue ! n.request lfcameranode name=n rig=" +
              rig + " ! c.sink_0 r. ! queue ! c.request lfcompositor name=c ! filesink location=" + dir_ / "one.raw");
  expect_runs("lfviewrequest location=" + views +
              " ! tee name=r r. ! queue ! a.request lfcameranode name=a node=0 cameras=0-3 rig=" + rig +
              " ! queue ! c.sink_0 r. ! queue ! b.request lfcameranode name=b node=1 cameras=4-8 rig=" + rig +
              " ! queue ! c.sink_1 r. ! queue ! c.request lfcompositor name=c ! filesink location=" + dir_ / "two.raw");
  const std::vector<uint8_t> one = read_bytes(dir_ / "one.raw");
  EXPECT_EQ(one.size(), 3u * 100 * 75 * 3);
  EXPECT_EQ(one, read_bytes(dir_ / "two.raw"));
}

TEST_F(StillArray, RequestsAndAnswersTravelThroughFiles) {
  write_requests();
  expect_runs("filesrc location=" + requests +
              " blocksize=97 ! lfparse ! n.request lfcameranode name=n resampling=bilinear codec=raw16 rig=" + rig +
              " ! filesink location=" + answers);
  composite_files();
  for (const Quality& quality : qualities()) EXPECT_EQ(quality.max_error, 0);
}

TEST_F(StillArray, EveryCodecTravelsThroughFiles) {
  write_requests();
  size_t auto_bytes = 0;
  for (const std::string codec : {"auto", "raw", "raw16", "jpeg"}) {
    expect_runs("filesrc location=" + requests + " ! lfparse ! lfcameranode name=n resampling=bilinear codec=" + codec +
                " rig=" + rig + " ! filesink location=" + answers);
    composite_files();
    if (codec == "auto") auto_bytes = std::filesystem::file_size(answers);
    if (codec == "raw") {
      EXPECT_LT(4 * auto_bytes, std::filesystem::file_size(answers)) << "a file is a link: JPEG";
    }
    for (const Quality& quality : qualities())
      EXPECT_GT(quality.psnr_db, codec == "raw" || codec == "raw16" ? 50 : 30) << codec;
  }
}

TEST_F(StillArray, RtpChangesNoPicture) {
  const std::string link = " ! rtplfpay mtu=700 ! rtplfdepay ! ";
  expect_runs("lfviewrequest location=" + views + " rig=" + rig + " ! tee name=r r. ! queue" + link +
              "n.request lfcameranode name=n resampling=bilinear codec=raw16 rig=" + rig + link +
              "c.sink_0 r. ! queue ! c.request lfcompositor name=c focus=plane rig=" + rig +
              " ! videoconvert ! pngenc ! multifilesink location=" + out);
  for (const Quality& quality : qualities()) EXPECT_EQ(quality.max_error, 0);
}

// The paper's three random access cameras give the same pictures. Cameras without the rig stay on the plane by default.
TEST_F(StillArray, CommandsMakeTheSamePictures) {
  const auto pictures = [&](const std::string& access, const std::string& node, const std::string& quality = "0") {
    const std::string focus = access == "self" ? "focus=plane" : "focus=auto";
    expect_runs(
        "lfviewrequest location=" + views + " rig=" + rig + " access=" + access + " quality=" + quality +
        " ! tee name=r r. ! queue ! a.request lfcameranode name=a node=0 cameras=0-3 " + node + " access=" + access +
        " rig=" + rig + " ! queue ! c.sink_0 r. ! queue ! b.request lfcameranode name=b node=1 cameras=4-8 " + node +
        " access=" + access + " rig=" + rig + " ! queue ! c.sink_1 r. ! queue ! c.request lfcompositor name=c " +
        focus + " rig=" + rig + " ! videoconvert ! pngenc ! multifilesink location=" + dir_ / (access + "_%d.png"));
    std::vector<Image> images;
    for (size_t i = 0; i < views_.size(); i++)
      images.push_back(load_image(dir_ / (access + "_" + std::to_string(i) + ".png")));
    EXPECT_FALSE(std::filesystem::exists(dir_ / (access + "_3.png")));
    return images;
  };
  const std::vector<Image> self = pictures("self", "codec=auto"), jpeg = pictures("self", "codec=jpeg", "90");
  for (const std::string access : {"warp", "pixels"}) {
    const std::vector<Image> same = pictures(access, "codec=auto");
    const std::vector<Image> coded = pictures(access, "codec=jpeg", "90");
    for (size_t i = 0; i < views_.size(); i++) {
      EXPECT_EQ(compare(same[i], self[i]).max_error, 0) << access << " " << i;
      const double psnr = compare(coded[i], self[i]).psnr_db;
      std::printf("%s, view %zu: JPEG 90 %.1f dB (self %.1f dB)\n", access.c_str(), i, psnr,
                  compare(jpeg[i], self[i]).psnr_db);
      EXPECT_GT(psnr, 29) << access << " " << i;
    }
  }
}

TEST_F(StillArray, CommandsTravelThroughFiles) {
  for (const std::string access : {"warp", "pixels"}) {
    write_requests(" access=" + access);
    expect_runs("filesrc location=" + requests +
                " blocksize=997 ! lfparse ! n.request lfcameranode name=n resampling=bilinear access=" + access +
                " codec=raw16 rig=" + rig + " ! filesink location=" + answers);
    composite_files();
    for (const Quality& quality : qualities()) EXPECT_EQ(quality.max_error, 0) << access;
  }
}

TEST_F(StillArray, NothingLeaks) {
  const Outcome run = gst_launch(files_in_files_out(rig, views, out), "-q",
                                 "GST_TRACERS=leaks GST_DEBUG=GST_TRACER:7,leaks:7 GST_DEBUG_NO_COLOR=1");
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("object-alive, type-name=(string)%s"));  // the tracer works and logs its format
  EXPECT_THAT(run.output, Not(ContainsRegex("object-alive, type-name=.string.[A-Za-z]")));
}

// A camera that fails to open is out of service: its neighbours fill in, and a warning gives the reason.
TEST_F(StillArray, MissingImageIsNamed) {
  std::filesystem::remove(dir_ / "cam_01_01.png");
  test::expect_outcome(gst_launch(files_in_files_out(rig, views, out), ""), 0,
                       AllOf(HasSubstr("WARNING"), HasSubstr("cam_01_01.png")));
  EXPECT_TRUE(std::filesystem::exists(dir_ / "out_00.png"));
}

TEST_F(StillArray, ImageOfAnotherSizeIsNamed) {
  save_image(Image(PixelFamily::kRgb, 81, 60), dir_ / "cam_02_00.png");
  test::expect_outcome(gst_launch(files_in_files_out(rig, views, out), ""), 0,
                       AllOf(HasSubstr("WARNING"), HasSubstr("cam_02_00"), HasSubstr("81x60"), HasSubstr("80x60")));
}

TEST_F(StillArray, ViewsFileWithoutViewsIsNamed) {
  std::ofstream(dir_ / "none.json") << R"({"format": "lightfield-views", "version": 1, "views": []})";
  test::expect_outcome(gst_launch(files_in_files_out(rig, dir_ / "none.json", out)), testing::Ne(0),
                       HasSubstr("none.json"));
}

TEST_F(StillArray, OddTinyAndOneCameraViewsRender) {
  std::vector<NamedView> views = {views_[0], views_[0]};
  views[0].view.width = views[0].view.height = 1;
  views[0].view.lens = Lens::from_fov_y(30, 1, 1);
  views[1].name = "odd";
  views[1].view.width = 33;
  views[1].view.height = 17;
  views[1].view.lens = Lens::from_fov_y(30, 33, 17);
  save_views(views, dir_ / "tiny.json");
  const std::string line =
      "lfviewrequest location=" + dir_ / "tiny.json" +
      " ! tee name=r r. ! queue ! n.request lfcameranode name=n rig=" + dir_ / "one.json" +
      " ! c.sink_0 r. ! queue ! c.request lfcompositor name=c ! filesink location=" + dir_ / "tiny.raw";
  for (const size_t cameras : {9, 2, 1}) {
    std::vector<CameraIndex> some(cameras);
    for (CameraIndex i = 0; i < cameras; i++) some[i] = i;
    save_rig(rig_subset(rig_, some), dir_ / "one.json");
    const Outcome run = gst_launch(line);
    ASSERT_EQ(run.status, 0) << cameras << " cameras: " << run.output;
    EXPECT_EQ(read_bytes(dir_ / "tiny.raw").size(), 4u + 100 * 17) << cameras;  // GStreamer pads rows to 4 bytes
  }
}

// The moving built-in scene as MJPEG files, seen from between the cameras.
TEST(FilmPipeline, MovingScene) {
  const TempDir dir;
  expect_outcome(
      run_program("lf-scene", "--grid 3x3 --width 160 --height 120 --frames 6 --framerate 15 --out .", dir.path()), 0);
  std::vector<View> path;
  for (int i = 0; i < 6; i++) path.push_back(view_from({0.004 * i, 0.004, -0.01}, 160, 120, 28, kSceneMiddle));
  const std::vector<NamedView> views = path_of(path, 1 / 15.0);
  save_views(views, dir / "views.json");
  const std::string line =
      "lfviewrequest location=" + dir / "views.json" +
      " ! tee name=r r. ! queue ! n.request lfcameranode name=n rig=" + dir / "rig.json" +
      " ! c.sink_0 r. ! queue ! c.request lfcompositor name=c ! video/x-raw,format=I420 ! filesink location=";
  expect_runs(line + dir / "a.raw");
  const std::vector<uint8_t> film = read_bytes(dir / "a.raw");
  const size_t frame_bytes = packed_size(PixelFamily::kI420, 160, 120);
  ASSERT_EQ(film.size(), 6 * frame_bytes);
  for (size_t i = 0; i < 6; i++) {
    Image picture(PixelFamily::kI420, 160, 120);
    std::copy_n(film.begin() + static_cast<ptrdiff_t>(i * frame_bytes), frame_bytes, picture.data().begin());
    const View& view = views[i].view;
    const Image truth = render_scene({view.width, view.height, view.lens, view.pose}, views[i].time);
    const Quality quality = compare(to_rgb(picture), truth);
    std::printf("frame %zu: %.2f dB, SSIM %.3f, largest error %d\n", i, quality.psnr_db, quality.ssim,
                quality.max_error);
    EXPECT_GT(quality.psnr_db, 20) << i;
  }
  ASSERT_EQ(gst_launch(line + dir / "b.raw").status, 0);
  EXPECT_EQ(film, read_bytes(dir / "b.raw"));
  // Region decoding gives the same pixels as decoding whole frames.
  expect_runs(std::regex_replace(line, std::regex("lfcameranode"), "lfcameranode decode=true") + dir / "c.raw");
  EXPECT_EQ(film, read_bytes(dir / "c.raw"));
}

TEST(ChessPipeline, MakesTheLibrarysPictures) {
  const std::string data = LF_SOURCE_ROOT "/../shared/data/chess/";
  if (!std::filesystem::exists(data + "rig.json")) GTEST_SKIP() << "no chess data beside the checkout";
  const TempDir dir;
  expect_runs(files_in_files_out(data + "rig.json", data + "views.json", dir / "out_%02d.png"));
  const Rig rig = load_rig(data + "rig.json");
  std::vector<Image> images;
  for (const Camera& camera : rig.cameras) images.push_back(load_image(rig.resolve(camera.image)));
  const std::vector<NamedView> views = load_views(data + "views.json");
  for (size_t i = 0; i < views.size(); i++) {
    const Image picture = load_image(dir / ("out_0" + std::to_string(i) + ".png"));
    const Image expected = render_without_gstreamer(rig, views[i].view, images);
    size_t off_by_more = 0;
    for (size_t k = 0; k < picture.data().size(); k++)
      off_by_more += std::abs(picture.data()[k] - expected.data()[k]) > 1;
    EXPECT_LE(static_cast<double>(off_by_more), 0.001 * static_cast<double>(picture.data().size())) << views[i].name;
  }
}

}  // namespace pipeline_test
}  // namespace lf::test
