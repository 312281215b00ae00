// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Sets of views in one picture, compared with single views, geometry, and ground truth.
#include <gst/app/gstappsink.h>

#include "gst/gst_test.h"
#include "pipelines/gst_launch.h"
#include "quality/image_quality.h"
#include "support/photographs.h"

namespace lf::test {
namespace {

constexpr int kWidth = 80, kHeight = 60;

class ViewSets : public testing::Test {
 protected:
  // A view from between the cameras, focused at a distance in metres.
  static View view(double focus, int width = kWidth, int height = kHeight) {
    return view_from({0.003, -0.002, 0}, width, height, 30, focus);
  }
  // Saves an array with the moving built-in scene.
  void film(int side, int width = kWidth, int height = kHeight) {
    rig_ = scene_rig(side, side, width, height);
    for (Camera& camera : rig_.cameras) camera.image.clear();
    save_rig(rig_, dir_ / "rig.json");
  }
  void save(const std::string& name, const std::vector<View>& views, const std::vector<double>& times) {
    std::vector<NamedView> path = path_of(views, 0);
    for (size_t i = 0; i < views.size(); i++) path[i].time = times[i];
    save_views(path, dir_ / name);
  }
  // Returns the concatenated RGB pictures of the views in a file.
  std::vector<uint8_t> pictures(const std::string& views, const std::string& properties) {
    const std::string out = dir_ / "out.rgb";
    const Outcome run =
        gst_launch("lfviewsrc is-live=false rig=" + dir_ / "rig.json" + " location=" + dir_ / views + " " + properties +
                   " ! videoconvert ! video/x-raw,format=RGB ! filesink location=" + out);
    EXPECT_EQ(run.status, 0) << run.output;
    EXPECT_EQ(run.output, "");
    return read_bytes(out);
  }
  static Image part(const uint8_t* whole, const ViewSetPosition& place, int width = kWidth, int height = kHeight) {
    Image image(PixelFamily::kRgb, width, height);
    const size_t row = 3 * static_cast<size_t>(width), stride = row * static_cast<size_t>(place.columns);
    for (int y = 0; y < height; y++)
      std::copy_n(whole + (static_cast<size_t>(place.row() * height + y)) * stride + place.column() * row, row,
                  image.data().begin() + static_cast<ptrdiff_t>(y * row));
    return image;
  }
  static std::string properties_of(const ViewSet& set) {
    const char* const names[] = {"mono", "stereo", "cross-eyed", "top-bottom", "row", "quilt"};
    return std::string("views=") + names[static_cast<int>(set.layout)] + " columns=" + std::to_string(set.columns) +
           " rows=" + std::to_string(set.rows) + " eye-distance=" + std::to_string(set.eye_distance) +
           " view-cone=" + std::to_string(set.cone) + " converged=" + (set.converged ? "true" : "false");
  }

  TempDir dir_;
  Rig rig_;
};

TEST_F(ViewSets, EqualTheirSingleViews) {
  film(3);
  const std::vector<View> middles = {view(2.2), view(1.5), view(3)};
  const std::vector<double> times = {0, 0.4, 1.1};
  save("middle.json", middles, times);
  const ViewSet sets[] = {
      {.layout = ViewSetLayout::kQuilt, .columns = 3, .rows = 2, .eye_distance = 0.012},
      {.layout = ViewSetLayout::kRow, .columns = 5, .cone = 2},
      {.layout = ViewSetLayout::kStereo, .eye_distance = 0.03, .converged = false},
      {.layout = ViewSetLayout::kCrossEyed, .eye_distance = 0.03},
      {.layout = ViewSetLayout::kTopBottom, .eye_distance = 0.03},
  };
  for (const ViewSet& set : sets) {
    SCOPED_TRACE(properties_of(set));
    const std::vector<uint8_t> sheets = pictures("middle.json", "focus=plane " + properties_of(set));
    const int count = set.place(0).count();
    const size_t bytes = size_t{3} * kWidth * kHeight;
    ASSERT_EQ(sheets.size(), middles.size() * bytes * static_cast<size_t>(count));
    for (int index = 0; index < count; index++) {
      std::vector<View> eyes;
      for (const View& middle : middles) eyes.push_back(set.view(middle, set.place(index)));
      save("eye.json", eyes, times);
      const std::vector<uint8_t> alone = pictures("eye.json", "focus=plane");
      ASSERT_EQ(alone.size(), middles.size() * bytes);
      for (size_t i = 0; i < middles.size(); i++) {
        const Image of_set = part(&sheets[i * bytes * static_cast<size_t>(count)], set.place(index));
        EXPECT_TRUE(
            std::equal(of_set.data().begin(), of_set.data().end(), alone.begin() + static_cast<ptrdiff_t>(i * bytes)))
            << "view " << index << ", picture " << i;
      }
    }
  }
}

// Returns the centre of the single bright spot in a picture.
Vec2 spot_in(const Image& image) {
  double sum = 0;
  Vec2 centre(0, 0);
  for (int y = 0; y < image.height(); y++)
    for (int x = 0; x < image.width(); x++) {
      const double light = image.data()[3 * (static_cast<size_t>(y) * image.width() + x)];
      sum += light;
      centre += light * Vec2(x, y);
    }
  return centre / sum;
}

TEST_F(ViewSets, HaveTheExpectedDisparity) {
  constexpr double kEyes = 0.06;
  for (const double depth : {1.2, 3.0})
    for (const bool converged : {true, false}) {
      const double focus = depth;
      const Vec3 spot(0.02 * depth, -0.03 * depth, depth);
      rig_ = scene_rig(4, 4, 160, 120);
      for (Camera& camera : rig_.cameras) {
        Image image(PixelFamily::kRgb, camera.width, camera.height);
        const Vec2 at = *camera.lens.project(camera.pose.camera_from_world(spot));
        for (int y = 0; y < camera.height; y++)
          for (int x = 0; x < camera.width; x++)
            for (int c = 0; c < 3; c++)
              image.data()[3 * (static_cast<size_t>(y) * camera.width + x) + c] =
                  static_cast<uint8_t>(std::lround(250 * std::exp(-glm::dot(at - Vec2(x, y), at - Vec2(x, y)) / 18)));
        camera.image = camera.name + ".png";
        save_image(image, dir_ / camera.image);
      }
      save_rig(rig_, dir_ / "rig.json");
      const View middle = view(focus, 160, 120);
      save("middle.json", {middle}, {0});
      const ViewSet set{.layout = ViewSetLayout::kStereo, .eye_distance = kEyes, .converged = converged};
      const std::vector<uint8_t> pair = pictures("middle.json", "focus=plane " + properties_of(set));
      ASSERT_EQ(pair.size(), 2u * 160 * 120 * 3);
      const Vec2 left = spot_in(part(pair.data(), set.place(0), 160, 120));
      const Vec2 right = spot_in(part(pair.data(), set.place(1), 160, 120));
      const double expected = middle.lens.fx() * kEyes * (1 / depth - (converged ? 1 / focus : 0));
      std::printf("at %.1f m, %s: disparity %.3f pixels, by geometry %.3f; %.3f along columns\n", depth,
                  converged ? "converged" : "parallel", left.x - right.x, expected, left.y - right.y);
      EXPECT_NEAR(left.x - right.x, expected, 0.1);
      EXPECT_NEAR(left.y - right.y, 0, 0.1);
    }
}

double psnr(const Image& picture, const View& view) {
  return compare(picture, render_scene({view.width, view.height, view.lens, view.pose}, 0.5)).psnr_db;
}

// The middle view determines the surface, which lacks areas that only other views see beside near objects. Views a
// pitch or more away lose up to 2 dB of the roughly 6 dB that their own surface would gain.
TEST_F(ViewSets, UseTheSurfaceOfTheMiddleView) {
  constexpr int kPictures = 8;
  rig_ = scene_rig(4, 4, 160, 120);
  save_photographs(rig_, dir_, 0.5);
  const View middle = view(kSceneMiddle, 160, 120);
  std::vector<double> times;
  for (int i = 0; i < kPictures; i++) times.push_back(i / 15.0);
  save("middle.json", std::vector<View>(kPictures, middle), times);
  const ViewSet set{.layout = ViewSetLayout::kQuilt, .columns = 3, .rows = 2, .eye_distance = 0.018};
  const size_t bytes = size_t{3} * 160 * 120, last = (kPictures - 1) * bytes;
  const std::vector<uint8_t> focused = pictures("middle.json", properties_of(set));
  const std::vector<uint8_t> flat = pictures("middle.json", "focus=plane " + properties_of(set));
  ASSERT_EQ(focused.size(), 6 * kPictures * bytes);
  double lost = 0;
  for (int index = 0; index < 6; index++) {
    const ViewSetPosition place = set.place(index);
    const View eye = set.view(middle, place);
    save("eye.json", std::vector<View>(kPictures, eye), times);
    const std::vector<uint8_t> alone = pictures("eye.json", "");
    const double of_set = psnr(part(&focused[6 * last], place, 160, 120), eye);
    const double on_plane = psnr(part(&flat[6 * last], place, 160, 120), eye);
    const double by_itself = psnr(part(&alone[last], ViewSetPosition(), 160, 120), eye);
    std::printf("view %d: %.2f dB with the set's surface, %.2f with its own, %.2f on the plane\n", index, of_set,
                by_itself, on_plane);
    EXPECT_GT(of_set, on_plane + 3);
    EXPECT_GT(of_set, by_itself - 2.5);
    EXPECT_TRUE(!place.leads() || of_set == by_itself);
    lost += (by_itself - of_set) / 6;
  }
  EXPECT_LT(lost, 1);
}

TEST_F(ViewSets, SeekAndEnd) {
  film(2);
  std::vector<double> times;
  for (int i = 0; i < 10; i++) times.push_back(i / 10.0);
  save("middle.json", std::vector<View>(10, view(2)), times);
  const std::string set = "focus=plane views=stereo eye-distance=0.02";
  const std::vector<uint8_t> straight = pictures("middle.json", set);
  const size_t bytes = size_t{2} * 3 * kWidth * kHeight;
  ASSERT_EQ(straight.size(), 10 * bytes);
  const PipelinePtr pipeline =
      launch("lfviewsrc is-live=false rig=" + dir_ / "rig.json" + " location=" + dir_ / "middle.json" + " " + set +
             " ! videoconvert ! video/x-raw,format=RGB ! appsink name=s sync=false");
  const ElementPtr sink = child_of(pipeline.get(), "s");
  const auto pull = [&] { return gst_app_sink_try_pull_sample(GST_APP_SINK(sink.get()), 30 * GST_SECOND); };
  gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
  ASSERT_EQ(gst_element_get_state(pipeline.get(), nullptr, nullptr, 30 * GST_SECOND), GST_STATE_CHANGE_SUCCESS);
  for (const size_t to : {size_t{6}, size_t{3}}) {
    ASSERT_TRUE(gst_element_seek_simple(pipeline.get(), GST_FORMAT_TIME,
                                        GstSeekFlags(GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE),
                                        static_cast<gint64>(to * GST_SECOND / 10)));
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    for (size_t i = to; i < (to == 6 ? size_t{8} : size_t{10}); i++) {
      g_autoptr(GstSample) sample = pull();
      ASSERT_TRUE(sample) << to << " " << i;
      const std::vector<uint8_t> picture = to_bytes(gst_sample_get_buffer(sample));
      EXPECT_TRUE(std::equal(picture.begin(), picture.end(), straight.begin() + static_cast<ptrdiff_t>(i * bytes)))
          << to << " " << i;
    }
  }
  EXPECT_FALSE(pull());
  EXPECT_TRUE(gst_app_sink_is_eos(GST_APP_SINK(sink.get())));
  EXPECT_EQ(gst_element_set_state(pipeline.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
}

TEST_F(ViewSets, AreRefusedByName) {
  film(2);
  const auto refused = [&](const std::string& properties) {
    const Outcome run =
        gst_launch("lfviewsrc is-live=false num-buffers=2 rig=" + dir_ / "rig.json" + " " + properties + " ! fakesink");
    EXPECT_NE(run.status, 0) << properties;
    return run.output;
  };
  EXPECT_MENTIONS(refused("views=quilt columns=16 rows=16"), "set", "16x16", "128");
  EXPECT_MENTIONS(refused("views=stereo width=33 height=24"), "set", "even", "33x24");
  EXPECT_MENTIONS(refused("views=row columns=128 width=130"), "16384");
}

}  // namespace
}  // namespace lf::test
