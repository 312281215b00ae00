// SPDX-License-Identifier: LGPL-2.1-or-later
//
// lfviewsrc shows the same pictures as a pipeline of its single elements.
#include <gst/video/navigation.h>

#include "gst/gst_test.h"
#include "pipelines/gst_launch.h"
#include "support/photographs.h"
#include "support/process.h"
#include "view/navigator.h"

namespace lf::test {
namespace {

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
    std::vector<View> views;
    for (int i = 0; i < 6; i++) {
      Viewpoint at = default_viewpoint(rig);
      at.pose.position += Vec3(0.01, -0.005, -0.02) * double(i);
      at.focus_distance = 1.5 + 0.2 * i;
      views.push_back(make_view(at, 100, 75));
    }
    save_views(path_of(views, 0), dir_ / "views.json");
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
    expect_runs("lfviewrequest rig=" + rig() + " location=" + views +
                " ! tee name=r  r. ! queue ! n.request  lfcameranode name=n rig=" + rig() +
                " ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c rig=" + rig() + " focus=" + focus +
                raw("long.rgb"));
    expect_outcome(
        gst_launch("lfviewsrc is-live=false rig=" + rig() + " location=" + views + " focus=" + focus + raw("one.rgb")),
        0, "");
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
  const PipelinePtr player = launch("playbin name=p flags=video uri=lf://" + rig() + " video-sink=\"fakesink\"");
  ElementPtr source;
  g_signal_connect(player.get(), "source-setup", G_CALLBACK(+[](GstElement*, GstElement* made, gpointer out) {
                     static_cast<ElementPtr*>(out)->reset(GST_ELEMENT(gst_object_ref(made)));
                   }),
                   &source);
  std::atomic<int> shown = 0;
  const ElementPtr sink(get<GstElement*>(player.get(), "video-sink"));
  on_buffers(sink.get(), "sink", [&](GstBuffer*) { ++shown; });
  ASSERT_NE(gst_element_set_state(player.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  ASSERT_TRUE(eventually([&] { return shown >= 5; })) << shown;
  // The player can move the viewpoint.
  const auto before = get<gdouble>(source.get(), "x");
  gst_pad_push_event(pad_of(sink.get(), "sink").get(),
                     gst_navigation_event_new_key_press("d", GST_NAVIGATION_MODIFIER_NONE));
  EXPECT_GT(get<gdouble>(source.get(), "x"), before);
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
  PipelinePtr hosts[2];
  for (int i : {0, 1}) {
    hosts[i] = launch("pipeline. ( lfnodesink rig=" + rig() + " cameras=" + (i ? "5-8" : "0-4") + " framerate=15/1" +
                      " node=" + std::to_string(i) + " listen=" + std::to_string(there[i]) +
                      " answers=localhost:" + std::to_string(here[i]) + " )");
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
}

}  // namespace
}  // namespace lf::test
