// SPDX-License-Identifier: LGPL-2.1-or-later
//
// lfnodesink, connected to lfviewsrc.

#include "gst/lfviewsrc_fixture.h"
#include "support/run_program.h"

namespace lf::test {
namespace {

// Returns a pipeline with one element.
PipelinePtr launch_alone(const std::string& element) {
  PipelinePtr pipeline(gst_pipeline_new(nullptr));
  gst_bin_add(GST_BIN(pipeline.get()), launch(element).release());
  return pipeline;
}

class LfViewSrcOnHostsTest : public LfViewSrcTest {
 protected:
  PipelinePtr start_host(int number) {
    PipelinePtr host = launch_alone(
        "lfnodesink name=n rig=" + array_.rig_path() + " framerate=30/1 cameras=" + (number == 0 ? "0-1" : "2-3") +
        " node=" + std::to_string(number) + " listen=" + std::to_string(there_[number]) + "," +
        std::to_string(extra_[number]) + " answers=127.0.0.1:" + std::to_string(here_[number]) +
        ",127.0.0.1:" + std::to_string(nobody_[number]));
    EXPECT_NE(gst_element_set_state(host.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
    return host;
  }
  static ElementPtr node_of(const PipelinePtr& host) { return child_of(host.get(), "n"); }
  static void stop_host(PipelinePtr& host) {
    EXPECT_EQ(gst_element_set_state(host.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
    host.reset();
  }
  std::string nodes() const {
    std::string list;
    for (int i : {0, 1})
      list +=
          (i ? "," : "nodes=") + std::string("127.0.0.1:") + std::to_string(there_[i]) + ":" + std::to_string(here_[i]);
    return list;
  }
  uint64_t complete(const char* compositor) { return stat(child(compositor).get(), "complete"); }

  const int there_[2] = {free_port(SOCK_DGRAM), free_port(SOCK_DGRAM)};
  const int here_[2] = {free_port(SOCK_DGRAM), free_port(SOCK_DGRAM)};
  const int extra_[2] = {free_port(SOCK_DGRAM), free_port(SOCK_DGRAM)};
  const int nobody_[2] = {free_port(SOCK_DGRAM), free_port(SOCK_DGRAM)};
};

TEST_F(LfViewSrcOnHostsTest, ShowsASetOfViews) {
  PipelinePtr hosts[2] = {start_host(0), start_host(1)};
  play(nodes() + " views=row columns=5 eye-distance=0.005 width=32 height=24");
  EXPECT_TRUE(eventually([&] { return complete("compositor") > 25; })) << "each view counts";
  EXPECT_TRUE(more("s"));
  for (PipelinePtr& host : hosts) stop_host(host);
}

TEST_F(LfViewSrcOnHostsTest, ShowsTheirCamerasToEachViewer) {
  PipelinePtr hosts[2] = {start_host(0), start_host(1)};
  play(nodes(), "v.src ! fakesink name=s sync=false  v.src_0 ! fakesink name=t sync=false");
  for (const char* compositor : {"compositor", "compositor_0"})
    EXPECT_TRUE(eventually([&] { return complete(compositor) > 5; })) << compositor;
  g_autoptr(GstClock) clock = gst_pipeline_get_clock(GST_PIPELINE(pipeline_.get()));
  const auto microseconds = static_cast<double>(gst_clock_get_time(clock)) / 1e3;
  EXPECT_NEAR(microseconds / 1e6, static_cast<double>(g_get_real_time()) / 1e6, 60) << "the time of day";
  EXPECT_EQ(child("node").get(), nullptr);

  const PadPtr pad = add_viewer("u");
  EXPECT_TRUE(eventually([&] { return complete("compositor_1") > 5; }));
  close_viewer(pad.get(), "u");
  const uint64_t before = complete("compositor");
  EXPECT_TRUE(eventually([&] { return complete("compositor") > before + 5; }));

  stop_host(hosts[1]);
  EXPECT_TRUE(more("s", 20));
  hosts[1] = start_host(1);
  const uint64_t without = complete("compositor");
  EXPECT_TRUE(eventually([&] { return complete("compositor") > without + 20; }));
  stop();
  for (PipelinePtr& host : hosts) stop_host(host);
}

TEST_F(LfViewSrcOnHostsTest, CamerasChangeBetweenRuns) {
  PipelinePtr hosts[2] = {start_host(0), start_host(1)};
  play("", "v.src ! fakesink name=s sync=false  v.src_0 ! fakesink name=t sync=false");
  ASSERT_TRUE(more("t"));
  for (int i = 0; i < 4; i++) {
    ASSERT_EQ(gst_element_set_state(pipeline_.get(), i < 2 ? GST_STATE_NULL : GST_STATE_READY),
              GST_STATE_CHANGE_SUCCESS);
    g_object_set(child("v").get(), "nodes", i % 2 ? "" : nodes().substr(6).c_str(), nullptr);
    ASSERT_NE(gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << i << error();
    EXPECT_TRUE(eventually([&] { return complete("compositor") > 3 && complete("compositor_0") > 3; })) << i;
    EXPECT_EQ(bool(child("node")), i % 2 == 1);
  }
  stop();
  for (PipelinePtr& host : hosts) stop_host(host);
}

TEST_F(LfViewSrcOnHostsTest, SilentHostIsNamed) {
  PipelinePtr host = start_host(0);
  play(nodes());
  const auto warns = [&] {
    const std::string told = warnings_of(pipeline_.get());
    EXPECT_THAT(told, Not(HasSubstr("127.0.0.1:" + std::to_string(there_[0]))));
    return contains(told, "127.0.0.1:" + std::to_string(there_[1]));
  };
  EXPECT_TRUE(eventually(warns));
  stop();
  stop_host(host);
}

uint64_t requests(GstElement* host, int index, const char* field) {
  const StructurePtr stats = stats_of(host);
  GstStructure *all = nullptr, *one = nullptr;
  gst_structure_get(stats.get(), "requests", GST_TYPE_STRUCTURE, &all, nullptr);
  const StructurePtr owner(all);
  gst_structure_get(all, ("requests" + std::to_string(index)).c_str(), GST_TYPE_STRUCTURE, &one, nullptr);
  const StructurePtr gate(one);
  guint64 count = 0;
  EXPECT_TRUE(gst_structure_get_uint64(one, field, &count)) << field;
  return count;
}

TEST_F(LfViewSrcOnHostsTest, HostsCountRejectedSenders) {
  const TempFile key(std::string(40, 'k'));
  PipelinePtr hosts[2] = {start_host(0), start_host(1)};
  g_object_set(node_of(hosts[1]).get(), "peers", "10.77.0.1", nullptr);
  EXPECT_EQ(gst_element_set_state(hosts[1].get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  EXPECT_NE(gst_element_set_state(hosts[1].get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  play(nodes());
  EXPECT_TRUE(eventually([&] {
    return requests(node_of(hosts[0]).get(), 0, "passed") > 5 &&
           requests(node_of(hosts[1]).get(), 0, "unknown-senders") > 5;
  }));
  EXPECT_EQ(requests(node_of(hosts[0]).get(), 1, "passed"), 0u);
  EXPECT_EQ(requests(node_of(hosts[1]).get(), 0, "passed"), 0u);
  stop();
  for (PipelinePtr& host : hosts) stop_host(host);

  // Hosts answer if the keys are equal.
  for (int i : {0, 1}) {
    hosts[i] = start_host(i);
    EXPECT_EQ(gst_element_set_state(hosts[i].get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
    g_object_set(node_of(hosts[i]).get(), "key-file", key.path().c_str(), nullptr);
    EXPECT_NE(gst_element_set_state(hosts[i].get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  }
  play(nodes() + " key-file=" + key.path());
  EXPECT_TRUE(eventually([&] { return complete("compositor") > 5; }));
  stop();
  for (PipelinePtr& host : hosts) stop_host(host);
}

TEST_F(LfViewSrcOnHostsTest, HostErrorsNameTheProblem) {
  const std::string rig = "lfnodesink name=n rig=" + array_.rig_path();
  struct Case {
    std::string line, words;
  };
  for (const Case& c :
       {Case{rig, "listen: not set"}, Case{rig + " listen=5000", "same number"},
        Case{rig + " listen=5000 answers=6000", "answers: 6000:"}, Case{rig + " listen=here answers=a:6000", "here:"},
        Case{rig + " listen=5000 answers=nobody.invalid:6000", "nobody.invalid"},
        Case{"lfnodesink listen=5000 answers=localhost:6000", "rig: not set"}}) {
    pipeline_ = launch_alone(c.line);
    EXPECT_EQ(gst_element_set_state(pipeline_.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE) << c.line;
    EXPECT_THAT(error(), HasSubstr(c.words));
    drop();
  }
}

// Raised limits apply inside the bins, and the stats count refused requests.
TEST_F(LfViewSrcOnHostsTest, LimitsApplyToReceivedRequests) {
  const auto pixels_of = [](GstElement* bin, const char* depay) {
    const ElementPtr inner = child_of(bin, depay);
    g_autoptr(GstStructure) limits = nullptr;
    guint64 pixels = 0;
    if (inner) g_object_get(inner.get(), "limits", &limits, nullptr);
    if (limits) gst_structure_get_uint64(limits, "max-pixels", &pixels);
    return pixels;
  };
  g_autoptr(GstStructure) more = gst_structure_new("limits", "max-pixels", G_TYPE_UINT64, guint64{33'177'600}, nullptr);
  const ElementPtr bin = make_element("lfnodesink");
  g_object_set(bin.get(), "rig", array_.rig_path().c_str(), "listen", std::to_string(there_[0]).c_str(), "answers",
               ("127.0.0.1:" + std::to_string(here_[0])).c_str(), "limits", more, nullptr);
  ASSERT_EQ(gst_element_set_state(bin.get(), GST_STATE_READY), GST_STATE_CHANGE_SUCCESS);
  EXPECT_EQ(pixels_of(bin.get(), "requests0_depay"), 33'177'600u);
  gst_util_set_object_arg(G_OBJECT(bin.get()), "limits", "limits,max-pixels=100");
  EXPECT_EQ(pixels_of(bin.get(), "requests0_depay"), 100u);
  EXPECT_EQ(requests(bin.get(), 0, "refused"), 0u);
  gst_element_set_state(bin.get(), GST_STATE_NULL);

  const ElementPtr viewer = make_element("lfviewsrc");
  const std::string port = std::to_string(there_[1]);
  g_object_set(viewer.get(), "rig", array_.rig_path().c_str(), "nodes",
               ("127.0.0.1:" + port + ":" + std::to_string(here_[1])).c_str(), "limits", more, nullptr);
  ASSERT_EQ(gst_element_set_state(viewer.get(), GST_STATE_READY), GST_STATE_CHANGE_SUCCESS);
  EXPECT_EQ(pixels_of(viewer.get(), "host0_depay"), 33'177'600u);
  gst_element_set_state(viewer.get(), GST_STATE_NULL);
  g_object_set(viewer.get(), "nodes", nullptr, nullptr);
  ASSERT_EQ(gst_element_set_state(viewer.get(), GST_STATE_READY), GST_STATE_CHANGE_SUCCESS);
  EXPECT_EQ(pixels_of(viewer.get(), "node"), 33'177'600u) << "these cameras accept the compositor's limits";
  gst_element_set_state(viewer.get(), GST_STATE_NULL);
}

TEST_F(LfViewSrcOnHostsTest, LfnodesinkHasThePropertiesOfItsNode) {
  const ElementPtr bin = make_element("lfnodesink");
  g_object_set(bin.get(), "rig", array_.rig_path().c_str(), "cameras", "1-2", "node", 3u, "mtu", 700u, nullptr);
  g_autofree gchar* cameras = nullptr;
  guint node = 0, mtu = 0;
  gboolean live = FALSE;
  gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), "node::cameras", &cameras, "node::node", &node, "node::is-live",
                      &live, nullptr);
  EXPECT_STREQ(cameras, "1-2");
  EXPECT_EQ(node, 3u);
  EXPECT_TRUE(live);
  g_object_set(bin.get(), "listen", std::to_string(there_[0]).c_str(), "answers",
               ("127.0.0.1:" + std::to_string(here_[0])).c_str(), nullptr);
  ASSERT_EQ(gst_element_set_state(bin.get(), GST_STATE_READY), GST_STATE_CHANGE_SUCCESS);
  gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), "answers0_pay::mtu", &mtu, nullptr);
  EXPECT_EQ(mtu, 700u);
  g_object_set(bin.get(), "mtu", 900u, nullptr);
  gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), "answers0_pay::mtu", &mtu, nullptr);
  EXPECT_EQ(mtu, 900u);
  for (int i = 0; i < 10; i++) {
    for (const GstState state : {GST_STATE_PAUSED, GST_STATE_PLAYING, GST_STATE_NULL}) {
      ASSERT_NE(gst_element_set_state(bin.get(), state), GST_STATE_CHANGE_FAILURE);
      ASSERT_NE(gst_element_get_state(bin.get(), nullptr, nullptr, GST_CLOCK_TIME_NONE), GST_STATE_CHANGE_FAILURE);
    }
  }
}

}  // namespace
}  // namespace lf::test
