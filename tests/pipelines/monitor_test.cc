// SPDX-License-Identifier: LGPL-2.1-or-later
//
// The live camera monitor on an array with defective cameras and on a good array.

#include "geometry/pose.h"
#include "gst/gst_test.h"
#include "image/image.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/process.h"
#include "support/temp_dir.h"

namespace lf::test {
namespace {

using testing::Pair;
using Suspects = std::map<guint, std::string>;  // index and fault

constexpr CameraIndex kTurned = 6, kBright = 18;

class MonitoredArray : public testing::Test {
 protected:
  // If `bad`, one camera points half a degree off its pose in the rig, and another is 10 % brighter.
  void film(bool bad) {
    Rig rig = scene_rig(5, 5, 160, 120);
    for (Camera& camera : rig.cameras) {
      camera.image = camera.name + ".png";
      Image image = render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0.5);
      if (bad && &camera == &rig.cameras[kBright])
        for (uint8_t& v : image.data()) v = static_cast<uint8_t>(std::min(255.0, 1.1 * v + 0.5));
      save_image(image, dir_ / camera.image);
    }
    if (bad) rig.cameras[kTurned].pose.orientation = quat_from_euler({0.5, 0, 0});
    save_rig(rig, dir_ / "rig.json");
  }
  std::string rig() const { return " rig=" + dir_ / "rig.json"; }
  std::string node(const std::string& name, const std::string& cameras, const std::string& to,
                   const std::string& more = "") const {
    return " r. ! queue ! " + name + ".request  lfcameranode name=" + name + " max-skew=0 cameras=" + cameras + rig() +
           " " + more + " ! queue ! " + to;
  }
  std::string rack(const std::string& name, const std::string& to) const {
    return " r. ! queue ! " + name + ".request  lfcompositor name=" + name + " latency=2000000000 partial=true" +
           rig() + " ! queue ! " + to;
  }

  // Runs until all cameras have had a few turns.
  void watch(const std::string& nodes, const std::string& compositor = "", const std::string& viewer = "") {
    constexpr uint64_t kTurns = 75;
    const std::string rate = kFallsBehind ? "10/1" : "100/1";  // a machine that falls behind skips probes
    const PipelinePtr pipeline = launch(
        "lfviewrequest name=v is-live=true framerate=" + rate + " width=64 height=48 focus-distance=2.2" + rig() + " " +
        viewer + " ! tee name=r  r. ! queue ! c.request  lfcompositor name=c latency=2000000000 monitor-interval=1" +
        rig() + " " + compositor + " ! fakesink sync=false" + nodes);
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    const ElementPtr c = child_of(pipeline.get(), "c");
    EXPECT_TRUE(eventually([&] { return stat(c.get(), "monitor-turns") >= kTurns; }));
    stats_ = stats_of(c.get());
  }
  uint64_t count(const char* field) const {
    guint64 value = 0;
    EXPECT_TRUE(gst_structure_get_uint64(stats_.get(), field, &value)) << field;
    return value;
  }
  std::vector<double> figures(const char* field) const {
    const GValue* array = gst_structure_get_value(stats_.get(), field);
    std::vector<double> figures;
    for (guint i = 0; array && i < gst_value_array_get_size(array); i++)
      figures.push_back(g_value_get_double(gst_value_array_get_value(array, i)));
    return figures;
  }
  Suspects suspects() const {
    Suspects suspects;
    const GValue* array = gst_structure_get_value(stats_.get(), "monitor-suspects");
    for (guint i = 0; array && i < gst_value_array_get_size(array); i++) {
      const GstStructure* suspect = gst_value_get_structure(gst_value_array_get_value(array, i));
      guint camera = 0;
      EXPECT_TRUE(gst_structure_get_uint(suspect, "camera", &camera));
      suspects[camera] = gst_structure_get_string(suspect, "fault");
    }
    return suspects;
  }

  TempDir dir_;
  StructurePtr stats_;
};

TEST_F(MonitoredArray, GoodCamerasHaveNoFindings) {
  film(false);
  watch(node("n", "0-24", "c.sink_0"));
  EXPECT_THAT(suspects(), IsEmpty());
  const std::vector<double> psnr = figures("monitor-psnr");
  ASSERT_EQ(psnr.size(), 25u);
  EXPECT_GT(psnr[12], 15);
  EXPECT_LT(psnr[12], 40);
  EXPECT_GE(std::ranges::count_if(psnr, [](double v) { return std::isfinite(v); }), 21) << "all but the corners";
  EXPECT_NEAR(figures("monitor-gain")[12], 1, 0.02);
  // Two 16-bit pictures of 80x60 per turn, plus turns without a result while cameras were starting.
  EXPECT_LT(count("monitor-bytes") / count("monitor-turns"), 2 * (2 * 80 * 60 * 2 * 3));
}

TEST_F(MonitoredArray, ExactlyTheBadCamerasAreFound) {
  film(true);
  const std::vector<std::pair<std::string, std::string>> ways = {
      {"", ""}, {"focus=surface focus-near=1 focus-far=6", "width=160 height=120"}};
  for (const auto& [compositor, viewer] : ways) {
    SCOPED_TRACE(compositor);
    watch(node("n", "0-24", "c.sink_0"), compositor, viewer);
    EXPECT_THAT(suspects(), ElementsAre(Pair(kTurned, "direction"), Pair(kBright, "colour")));
    EXPECT_NEAR(figures("monitor-gain")[kBright], 1.1, 0.02);
  }
}

TEST_F(MonitoredArray, ProbesWorkInTreesAndWithCommands) {
  film(true);
  watch(rack("a", "c.sink_0") + rack("b", "c.sink_1") + node("n0", "0-6", "a.sink_0", "node=0 codec=jpeg") +
        node("n1", "7-12", "a.sink_1", "node=1") + node("n2", "13-24", "b.sink_0", "node=2"));
  EXPECT_THAT(suspects(), ElementsAre(Pair(kTurned, "direction"), Pair(kBright, "colour")));
  watch(node("n", "0-24", "c.sink_0", "access=warp"), "", "access=warp");
  EXPECT_THAT(suspects(), ElementsAre(Pair(kTurned, "direction"), Pair(kBright, "colour")));
}

}  // namespace
}  // namespace lf::test
