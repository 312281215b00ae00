// SPDX-License-Identifier: LGPL-2.1-or-later
//
// lfviewsrc shows the same pictures as its elements linked one by one.
#include <gst/video/navigation.h>

#include "gst/gst_test.h"
#include "image/image.h"
#include "pipelines/gst_launch.h"
#include "support/photographs.h"
#include "support/process.h"
#include "view/navigator.h"
#include "view/view_path.h"

namespace lf::test {
namespace {

std::vector<uint8_t> read_bytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class OneLine : public testing::Test {
 protected:
  void SetUp() override {
    Rig rig = scene_rig(3, 3, 80, 60);
    save_photographs(rig, dir_, 0, 1);
    for (Camera& camera : rig.cameras) {
      camera.image.clear();
      camera.source = "videotestsrc is-live=true";
    }
    save_rig(rig, dir_ / "live.json");
    std::vector<NamedView> views;
    for (int i = 0; i < 6; i++) {
      Viewpoint at = default_viewpoint(rig);
      at.pose.position += Vec3(0.01 * i, -0.005 * i, -0.02 * i);
      at.focus_distance = 1.5 + 0.2 * i;
      views.push_back({"view_" + std::to_string(i), 0, make_view(at, 100, 75)});
    }
    save_views(views, dir_ / "views.json");
  }
  std::string rig() const { return dir_ / "rig.json"; }
  std::string raw(const std::string& name) const {
    return " ! videoconvert ! video/x-raw,format=RGB ! filesink location=" + (dir_ / name);
  }

  TempDir dir_;
};

TEST_F(OneLine, MakesThePicturesOfItsElements) {
  const std::string views = dir_ / "views.json";
  for (const std::string focus : {"plane", "surface", "auto"}) {
    Outcome run = gst_launch("lfviewrequest rig=" + rig() + " location=" + views +
                             " ! tee name=r  r. ! queue ! n.request  lfcameranode name=n rig=" + rig() +
                             " ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c rig=" + rig() +
                             " focus=" + focus + raw("long.rgb"));
    ASSERT_EQ(run.status, 0) << run.output;
    run =
        gst_launch("lfviewsrc is-live=false rig=" + rig() + " location=" + views + " focus=" + focus + raw("one.rgb"));
    ASSERT_EQ(run.status, 0) << run.output;
    EXPECT_EQ(run.output, "");
    const std::vector<uint8_t> pictures = read_bytes(dir_ / "long.rgb");
    EXPECT_EQ(pictures.size(), 6u * 100 * 75 * 3);
    EXPECT_EQ(pictures, read_bytes(dir_ / "one.rgb")) << focus;
  }
}

// As in the document, without the window. The cameras are test sources, because decoders of stills log messages.
TEST_F(OneLine, RunsLiveWithoutWarnings) {
  const Outcome run =
      gst_launch("lfviewsrc rig=" + dir_ / "live.json" + " num-buffers=20 ! videoconvert ! fakesink sync=true", "",
                 "GST_DEBUG=2 GST_DEBUG_NO_COLOR=1");
  EXPECT_EQ(run.status, 0) << run.output;
  for (const char* word : {"ERROR", "CRITICAL"}) EXPECT_THAT(run.output, Not(HasSubstr(word)));
  if (kFallsBehind) return;
  for (const char* word : {"WARN", "lf"}) EXPECT_THAT(run.output, Not(HasSubstr(word)));
}

TEST_F(OneLine, PlayersOpenARigAsUri) {
  const ElementPtr player = launch("playbin name=p flags=video uri=lf://" + rig() + " video-sink=\"fakesink\"");
  ASSERT_TRUE(player);
  ElementPtr source;
  g_signal_connect(player.get(), "source-setup", G_CALLBACK(+[](GstElement*, GstElement* made, gpointer out) {
                     static_cast<ElementPtr*>(out)->reset(GST_ELEMENT(gst_object_ref(made)));
                   }),
                   &source);
  std::atomic<int> shown = 0;
  GstElement* in = nullptr;
  g_object_get(player.get(), "video-sink", &in, nullptr);
  const ElementPtr sink(in);
  const std::unique_ptr<GstPad, Unref<gst_object_unref>> pad(gst_element_get_static_pad(sink.get(), "sink"));
  const auto count = [](GstPad*, GstPadProbeInfo*, gpointer counter) {
    ++*static_cast<std::atomic<int>*>(counter);
    return GST_PAD_PROBE_OK;
  };
  gst_pad_add_probe(pad.get(), GST_PAD_PROBE_TYPE_BUFFER, count, &shown, nullptr);
  ASSERT_NE(gst_element_set_state(player.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  for (int i = 0; i < 300 && shown < 5; i++) g_usleep(100000);
  ASSERT_GE(shown, 5);
  // The player can move the viewpoint.
  gdouble before = 0, after = 0;
  g_object_get(source.get(), "x", &before, nullptr);
  gst_pad_push_event(pad.get(), gst_navigation_event_new_key_press("d", GST_NAVIGATION_MODIFIER_NONE));
  g_object_get(source.get(), "x", &after, nullptr);
  EXPECT_GT(after, before);
  EXPECT_EQ(gst_element_set_state(player.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
}

TEST_F(OneLine, NothingLeaks) {
  const std::string two = " num-buffers=8 v.src ! fakesink  v.src_0 ! fakesink num-buffers=6";
  const std::string port = std::to_string(free_port(SOCK_DGRAM)), other = std::to_string(free_port(SOCK_DGRAM));
  const std::string nodes = " nodes=localhost:" + port + ":" + other;
  for (const std::string& line :
       {"lfviewsrc name=v rig=" + rig() + two, "lfviewsrc name=v rig=" + rig() + nodes + two}) {
    const Outcome run = gst_launch(line, "-q", "GST_TRACERS=leaks GST_DEBUG=GST_TRACER:7,leaks:7 GST_DEBUG_NO_COLOR=1");
    EXPECT_EQ(run.status, 0) << run.output;
    EXPECT_THAT(run.output, HasSubstr("object-alive, type-name=(string)%s"));
    EXPECT_THAT(run.output, Not(ContainsRegex("object-alive, type-name=.string.[A-Za-z]"))) << line;
  }
}

TEST_F(OneLine, TwoHostsAndAViewer) {
  const int there[] = {free_port(SOCK_DGRAM), free_port(SOCK_DGRAM)};
  const int here[] = {free_port(SOCK_DGRAM), free_port(SOCK_DGRAM)};
  ElementPtr hosts[2];
  for (int i : {0, 1}) {
    hosts[i] = launch("pipeline. ( lfnodesink rig=" + rig() + " cameras=" + (i ? "5-8" : "0-4") + " framerate=15/1" +
                      " node=" + std::to_string(i) + " listen=" + std::to_string(there[i]) +
                      " answers=localhost:" + std::to_string(here[i]) + " )");
    ASSERT_TRUE(hosts[i]);
    ASSERT_NE(gst_element_set_state(hosts[i].get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  }
  std::string nodes = " nodes=";
  for (int i : {0, 1})
    nodes += (i ? "," : "") + std::string("localhost:") + std::to_string(there[i]) + ":" + std::to_string(here[i]);
  const Outcome run = gst_launch(
      "lfviewsrc rig=" + rig() + nodes + " num-buffers=40 latency=1000000000 post-messages=true ! fakesink sync=false",
      "-m");
  EXPECT_EQ(run.status, 0) << run.output;
  size_t complete = 0;
  for (size_t at = 0; (at = run.output.find("complete=(boolean)true", at + 1)) != std::string::npos;) complete++;
  EXPECT_GE(complete, 30u) << "the first may come before the hosts are up";
  for (ElementPtr& host : hosts) gst_element_set_state(host.get(), GST_STATE_NULL);
}

}  // namespace
}  // namespace lf::test
