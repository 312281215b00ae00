// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Several viewers of one node in one process, and pipelines that start and stop.
#include <gst/video/navigation.h>

#include "gst/gst_test.h"
#include "pipelines/gst_launch.h"
#include "support/photographs.h"
#include "support/process.h"
#include "view/navigator.h"

namespace lf::test {
namespace {

class ViewersTest : public testing::Test {
 protected:
  void SetUp() override {
    Rig rig = scene_rig(2, 2, 64, 48);
    save_photographs(rig, dir_, 0, 1);
  }

  std::string viewer(int id) const {
    const std::string n = std::to_string(id);
    return " t. ! queue leaky=downstream ! c" + n + ".sink_0  r. ! queue leaky=downstream ! c" + n +
           ".request  lfcompositor name=c" + n + " view-id=" + n + " ! fakesink name=s" + n + " sync=false";
  }
  std::string requests(int id) const {
    return " lfviewrequest name=v" + std::to_string(id) + " view-id=" + std::to_string(id) +
           " rig=" + dir_ / "rig.json" + " is-live=true framerate=20/1 ! f.";
  }

  TempDir dir_;
};

// Plain queues: neither ended nor idle viewers may block the rest.
TEST_F(ViewersTest, PathsOfDifferentLengthsEnd) {
  const auto path = [&](int frames) {
    const std::string file = dir_ / (std::to_string(frames) + ".json");
    std::vector<View> views;
    Viewpoint v;
    for (int i = 0; i < frames; i++, v.pose.position.x += 1e-4) views.push_back(make_view(v, 64, 48));
    save_views(path_of(views, 1 / 75.0), file);
    return " lfviewrequest location=" + file;
  };
  const auto view = [](const std::string& id) {
    return " r. ! queue ! c" + id + ".request  t. ! queue ! c" + id + ".sink_0  lfcompositor name=c" + id +
           " view-id=" + id + " ! queue ! fakesink name=s" + id + " sync=false async=false";
  };
  const PipelinePtr pipeline =
      launch("funnel name=f ! tee name=r" + path(3) + " view-id=0 ! f." + path(300) +
             " view-id=1 ! f.  r. ! queue ! n.request  lfcameranode name=n rig=" + dir_ / "rig.json" + " ! tee name=t" +
             view("0") + view("1"));
  EXPECT_EQ(run(pipeline.get(), 60), "");
  for (const auto& [name, expected] : {std::pair("c0", 3u), std::pair("c1", 300u)}) {
    EXPECT_EQ(stat(child_of(pipeline.get(), name).get(), "pictures"), expected) << name;
  }
}

// A viewer ends because its sink has enough, or because an element after it fails.
TEST_F(ViewersTest, EndingOrFailingViewerDoesNotAffectOthers) {
  constexpr guint64 kEnough = kFallsBehind ? 60 : 300;
  for (const char* end : {"identity eos-after=3", "identity error-after=3", "fakesink num-buffers=3"}) {
    for (const char* live : {"false", "true"}) {
      const auto view = [&](const std::string& id, const std::string& behind) {
        return " lfviewrequest view-id=" + id + " rig=" + dir_ / "rig.json" + " framerate=50/1 is-live=" + live +
               " ! f.  r. ! queue ! c" + id + ".request  t. ! queue ! c" + id + ".sink_0  lfcompositor name=c" + id +
               " view-id=" + id + " ! queue ! " + behind;
      };
      const std::string sink = " sync=false async=false";
      const std::string first = std::string(end).starts_with("fakesink") ? end + sink : end + (" ! fakesink" + sink);
      const PipelinePtr pipeline =
          launch("funnel name=f ! tee name=r  r. ! queue ! n.request  lfcameranode name=n rig=" + dir_ / "rig.json" +
                 " ! tee name=t" + view("0", first) + view("1", "fakesink" + sink));
      const ElementPtr other = child_of(pipeline.get(), "c1");
      gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
      EXPECT_TRUE(eventually([&] { return stat(other.get(), "pictures") >= kEnough; }, 120))
          << end << ", live: " << live;
    }
  }
}

int pictures_in(std::atomic<int>& counter, double seconds) {
  const int before = counter;
  g_usleep(static_cast<gulong>(seconds * 1e6));
  return counter - before;
}

// Returns true if this many more pictures arrive, regardless of the time a busy machine takes.
bool has_more(const std::atomic<int>& counter, int more) {
  return eventually([&, wanted = counter + more] { return counter >= wanted; });
}

TEST_F(ViewersTest, ViewersMoveAndStallIndependently) {
  const PipelinePtr pipeline =
      launch(requests(1) + requests(2) +
             " funnel name=f ! tee name=r  r. ! queue ! n.request  lfcameranode name=n rig=" + dir_ / "rig.json" +
             " ! tee name=t " + viewer(1) + viewer(2));
  std::atomic<int> shown[2] = {0, 0};
  for (int i : {0, 1})
    on_buffers(child_of(pipeline.get(), i == 0 ? "s1" : "s2").get(), "sink", [&, i](GstBuffer*) { ++shown[i]; });
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  ASSERT_EQ(gst_element_get_state(pipeline.get(), nullptr, nullptr, 60 * GST_SECOND), GST_STATE_CHANGE_SUCCESS);
  for (const int i : {0, 1}) EXPECT_TRUE(has_more(shown[i], 8)) << i;

  const auto child = [&](const char* name) { return child_of(pipeline.get(), name); };
  const ElementPtr v1 = child("v1"), v2 = child("v2");
  const auto x_of = [](const ElementPtr& element) { return get<gdouble>(element.get(), "x"); };
  const double x1 = x_of(v1), x2 = x_of(v2);
  gst_pad_send_event(pad_of(child("c1").get(), "src").get(),
                     gst_navigation_event_new_key_press("Right", GST_NAVIGATION_MODIFIER_NONE));
  EXPECT_NE(x_of(v1), x1);
  EXPECT_EQ(x_of(v2), x2);

  // A stalled viewer must not reduce the rate of the first. The test measures both rates in the same run. A later second
  // counts as well, because other processes may disturb a single second.
  const int before = pictures_in(shown[0], 1);
  const PadPtr stalled = pad_of(child("s2").get(), "sink");
  const gulong probe = gst_pad_add_probe(
      stalled.get(), GST_PAD_PROBE_TYPE_BLOCK_DOWNSTREAM,
      [](GstPad*, GstPadProbeInfo*, gpointer) { return GST_PAD_PROBE_OK; }, nullptr, nullptr);
  pictures_in(shown[1], 0.3);
  const int stalled_before = shown[1];
  bool keeps_rate = false;
  for (int i = 0; i < 20 && !keeps_rate; i++) keeps_rate = pictures_in(shown[0], 1) >= before / 2;
  EXPECT_TRUE(keeps_rate) << before << " pictures a second before";
  EXPECT_LE(shown[1] - stalled_before, 1);
  gst_pad_remove_probe(stalled.get(), probe);
  EXPECT_TRUE(has_more(shown[1], 3)) << "the rate recovers";
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

// LF_CYCLES=1000 for the long run.
TEST_F(ViewersTest, StartsAndStopsWithoutGrowing) {
  const char* setting = std::getenv("LF_CYCLES");
  const int cycles = setting ? std::atoi(setting) : 40;
  const PipelinePtr pipeline =
      launch(requests(1) + " funnel name=f ! tee name=r  r. ! queue ! n.request  lfcameranode name=n rig=" +
             dir_ / "rig.json" + " ! tee name=t " + viewer(1));
  long warm = 0;
  for (int i = 0; i < cycles; i++) {
    if (i == cycles / 4) warm = resident_kib();
    ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << i;
    g_usleep(static_cast<gulong>(1000 * (i % 7)));  // stops at every stage of starting
    ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_NULL), GST_STATE_CHANGE_FAILURE) << i;
  }
  const long grown = resident_kib() - warm;
  std::printf("%d cycles: resident memory grew by %ld KiB after the first quarter, to %ld KiB\n", cycles, grown,
              resident_kib());
  if (kKeepsFreedMemory) GTEST_SKIP() << "freed memory stays resident under a sanitizer";
  EXPECT_LT(grown, 8 * 1024);
}

}  // namespace
}  // namespace lf::test
