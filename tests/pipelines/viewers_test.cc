// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Several viewers of one node in one process, and pipelines that start and stop.
#include <gst/video/video.h>

#include "gst/gst_test.h"
#include "image/image.h"
#include "pipelines/gst_launch.h"
#include "support/photographs.h"
#include "support/process.h"
#include "view/navigator.h"
#include "view/view_path.h"

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
           ".request  lfcompositor name=c" + n + " view-id=" + n + " ! fakesink name=s" + n +
           " sync=false signal-handoffs=true";
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
    std::vector<NamedView> views;
    for (int i = 0; i < frames; i++) {
      Viewpoint v;
      v.pose.position.x = 1e-4 * i;
      views.push_back({"view_" + std::to_string(i), i / 75.0, make_view(v, 64, 48)});
    }
    save_views(views, file);
    return " lfviewrequest location=" + file;
  };
  const auto view = [](const std::string& id) {
    return " r. ! queue ! c" + id + ".request  t. ! queue ! c" + id + ".sink_0  lfcompositor name=c" + id +
           " view-id=" + id + " ! queue ! fakesink name=s" + id + " sync=false async=false";
  };
  const ElementPtr pipeline =
      launch("funnel name=f ! tee name=r" + path(3) + " view-id=0 ! f." + path(300) +
             " view-id=1 ! f.  r. ! queue ! n.request  lfcameranode name=n rig=" + dir_ / "rig.json" + " ! tee name=t" +
             view("0") + view("1"));
  ASSERT_TRUE(pipeline);
  EXPECT_EQ(run(pipeline.get(), 60), "");
  for (const auto& [name, expected] : {std::pair("c0", 3u), std::pair("c1", 300u)}) {
    const ElementPtr compositor(gst_bin_get_by_name(GST_BIN(pipeline.get()), name));
    EXPECT_EQ(stat(compositor.get(), "pictures"), expected) << name;
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
      const ElementPtr pipeline =
          launch("funnel name=f ! tee name=r  r. ! queue ! n.request  lfcameranode name=n rig=" + dir_ / "rig.json" +
                 " ! tee name=t" + view("0", first) + view("1", "fakesink" + sink));
      ASSERT_TRUE(pipeline);
      const ElementPtr other(gst_bin_get_by_name(GST_BIN(pipeline.get()), "c1"));
      gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
      for (int i = 0; i < 12000 && stat(other.get(), "pictures") < kEnough; i++) g_usleep(10000);
      EXPECT_GE(stat(other.get(), "pictures"), kEnough) << end << ", live: " << live;
      gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    }
  }
}

ElementPtr child(GstElement* bin, const char* name) { return ElementPtr(gst_bin_get_by_name(GST_BIN(bin), name)); }

void count_handoff(GstElement*, GstBuffer*, GstPad*, gpointer counter) { ++*static_cast<std::atomic<int>*>(counter); }

int pictures_in(std::atomic<int>& counter, double seconds) {
  const int before = counter;
  g_usleep(static_cast<gulong>(seconds * 1e6));
  return counter - before;
}

// Returns true if this many more pictures arrive, regardless of the time a busy machine takes.
bool has_more(const std::atomic<int>& counter, int more) {
  const int wanted = counter + more;
  for (int i = 0; i < 600 && counter < wanted; i++) g_usleep(100000);
  return counter >= wanted;
}

TEST_F(ViewersTest, ViewersMoveAndStallIndependently) {
  const ElementPtr pipeline =
      launch(requests(1) + requests(2) +
             " funnel name=f ! tee name=r  r. ! queue ! n.request  lfcameranode name=n rig=" + dir_ / "rig.json" +
             " ! tee name=t " + viewer(1) + viewer(2));
  ASSERT_TRUE(pipeline);
  std::atomic<int> shown[2] = {0, 0};
  for (int i : {0, 1}) {
    const ElementPtr sink = child(pipeline.get(), i == 0 ? "s1" : "s2");
    g_signal_connect(sink.get(), "handoff", G_CALLBACK(count_handoff), &shown[i]);
  }
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  ASSERT_EQ(gst_element_get_state(pipeline.get(), nullptr, nullptr, 60 * GST_SECOND), GST_STATE_CHANGE_SUCCESS);
  for (const int i : {0, 1}) EXPECT_TRUE(has_more(shown[i], 8)) << i;

  const ElementPtr v1 = child(pipeline.get(), "v1"), v2 = child(pipeline.get(), "v2"), c1 = child(pipeline.get(), "c1");
  const auto x_of = [](const ElementPtr& element) {
    gdouble x = 0;
    g_object_get(element.get(), "x", &x, nullptr);
    return x;
  };
  const double x1 = x_of(v1), x2 = x_of(v2);
  GstPad* src = gst_element_get_static_pad(c1.get(), "src");
  gst_pad_send_event(src,
                     gst_event_new_navigation(gst_structure_new("application/x-gst-navigation", "event", G_TYPE_STRING,
                                                                "key-press", "key", G_TYPE_STRING, "Right", nullptr)));
  gst_object_unref(src);
  EXPECT_NE(x_of(v1), x1);
  EXPECT_EQ(x_of(v2), x2);

  // A stalled viewer must not reduce the rate of the first. Both rates are from one run; external load may disturb a
  // second of the run, so a later second counts as well.
  const int before = pictures_in(shown[0], 1);
  const ElementPtr s2 = child(pipeline.get(), "s2");
  GstPad* stalled = gst_element_get_static_pad(s2.get(), "sink");
  const gulong probe = gst_pad_add_probe(
      stalled, GST_PAD_PROBE_TYPE_BLOCK_DOWNSTREAM,
      [](GstPad*, GstPadProbeInfo*, gpointer) { return GST_PAD_PROBE_OK; }, nullptr, nullptr);
  pictures_in(shown[1], 0.3);
  const int stalled_before = shown[1];
  bool keeps_rate = false;
  for (int i = 0; i < 20 && !keeps_rate; i++) keeps_rate = pictures_in(shown[0], 1) >= before / 2;
  EXPECT_TRUE(keeps_rate) << before << " pictures a second before";
  EXPECT_LE(shown[1] - stalled_before, 1);
  gst_pad_remove_probe(stalled, probe);
  gst_object_unref(stalled);
  EXPECT_TRUE(has_more(shown[1], 3)) << "the rate recovers";
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

// LF_CYCLES=1000 for the long run.
TEST_F(ViewersTest, StartsAndStopsWithoutGrowing) {
  const char* setting = std::getenv("LF_CYCLES");
  const int cycles = setting ? std::atoi(setting) : 40;
  const ElementPtr pipeline =
      launch(requests(1) + " funnel name=f ! tee name=r  r. ! queue ! n.request  lfcameranode name=n rig=" +
             dir_ / "rig.json" + " ! tee name=t " + viewer(1));
  ASSERT_TRUE(pipeline);
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
