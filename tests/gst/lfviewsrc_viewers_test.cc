// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Viewers of an lfviewsrc that are added, removed, stalled and left unlinked while others play.

#include "gst/lfviewsrc_fixture.h"
#include "scene/scene.h"
#include "support/process.h"
#include "support/run_program.h"

namespace lf::test {
namespace {

std::set<std::string> child_names(GstElement* bin) {
  std::set<std::string> names;
  GST_OBJECT_LOCK(bin);
  for (GList* item = GST_BIN_CHILDREN(bin); item; item = item->next) names.insert(GST_OBJECT_NAME(item->data));
  GST_OBJECT_UNLOCK(bin);
  return names;
}

// Returns the share of dark values in the last picture of a sink.
double dark_share(GstElement* sink) {
  g_autoptr(GstSample) sample = get<GstSample*>(sink, "last-sample");
  if (!sample) return 1;
  const std::vector<uint8_t> levels = to_bytes(gst_sample_get_buffer(sample));
  return static_cast<double>(std::ranges::count_if(levels, [](uint8_t level) { return level < 8; })) / levels.size();
}

TEST_F(LfViewSrcTest, ViewersAreAddedAndRemovedWhilePlaying) {
  play("");
  ASSERT_TRUE(more("s"));
  const std::set<std::string> before = child_names(child("v").get());
  for (int i = 0; i < 10; i++) {
    const PadPtr pad = add_viewer("t");
    EXPECT_STREQ(GST_PAD_NAME(pad.get()), "src_0");
    EXPECT_TRUE(i % 3 == 2 || more("t")) << i;
    close_viewer(pad.get(), "t");
    EXPECT_EQ(child_names(child("v").get()), before) << i;
    EXPECT_TRUE(more("s", 2)) << i;
  }
  const ElementPtr fragment = child("fragment");
  EXPECT_TRUE(eventually([&] {
    GST_OBJECT_LOCK(fragment.get());
    const guint pads = fragment->numsinkpads;
    GST_OBJECT_UNLOCK(fragment.get());
    return pads == 5;
  }));
}

TEST_F(LfViewSrcTest, RemovedViewersLeakNothing) {
  play("");
  const ElementPtr v = child("v");
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_.get());
  long warm = 0;
  for (int i = 0; i < 100; i++) {
    if (i == 25) warm = resident_kib();
    const PadPtr pads[] = {PadPtr(gst_element_request_pad_simple(v.get(), "src_%u")),
                           PadPtr(gst_element_request_pad_simple(v.get(), "src_%u"))};
    g_usleep(static_cast<gulong>(10000 * (i % 4)));
    for (const PadPtr& pad : pads) gst_element_release_request_pad(v.get(), pad.get());
    // Messages on the bus hold references to their sources.
    while (MessagePtr(gst_bus_pop(bus))) continue;
  }
  EXPECT_TRUE(more("s"));
  if (!kKeepsFreedMemory) {
    EXPECT_LT(resident_kib() - warm, 8 * 1024) << "after 150 viewers";
  }
}

TEST_F(LfViewSrcTest, ViewerIsAddedAfterAllHaveEnded) {
  play("num-buffers=3");
  const PadPtr last = add_viewer("l");
  const PadPtr end = pad_of(child("s").get(), "sink");
  ASSERT_TRUE(eventually([&] { return GST_PAD_IS_EOS(end.get()); }));
  ASSERT_TRUE(more("l"));
  close_viewer(last.get(), "l");
  g_usleep(1000000);
  const PadPtr later = add_viewer("t");
  EXPECT_TRUE(more("t", 45));  // old frames are shown for a while
  EXPECT_LT(dark_share(child("t").get()), 0.05);
}

// The home view of half of the array must not be at the edge that the missing host leaves.
TEST_F(LfViewSrcTest, HalfOfTheArrayShowsTheHomeView) {
  const ModifiedRig half(scene_rig(4, 4, 64, 48), [](Rig& rig) {
    for (size_t i = 8; i < 16; i++) rig.cameras[i].source = "nowhere.mkv";
  });
  play("rig=" + half.path() + " width=64 height=48 framerate=15/1 focus=plane",
       "v.src ! video/x-raw,format=RGB ! fakesink name=s sync=false");
  const auto stat = [&](const char* field, double of_none) {
    g_autoptr(GstStructure) stats = get<GstStructure*>("v", "stats");
    const GValue* value = gst_structure_get_value(stats, field);
    GValue number = G_VALUE_INIT;
    g_value_init(&number, G_TYPE_DOUBLE);
    return value && g_value_transform(value, &number) ? g_value_get_double(&number) : of_none;
  };
  ASSERT_TRUE(eventually([&] { return stat("out-of-service", 0) == 8; }));
  ASSERT_TRUE(eventually([&] { return stat("coverage", 0) > 0.5 && stat("coverage", 1) < 0.95; }))
      << stat("coverage", -1);
  const double incomplete = stat("incomplete", -1);
  ASSERT_TRUE(more("s", 10));
  // An answer can be late on a busy machine. If the missing host counted, all ten pictures would be incomplete.
  EXPECT_LT(stat("incomplete", -1), incomplete + 5) << "known to be out of service";
  EXPECT_LT(dark_share(child("s").get()), 0.05);
}

TEST_F(LfViewSrcTest, ViewerIsClosedByItsOwnThread) {
  play("");
  const PadPtr pad = add_viewer("t");
  ASSERT_TRUE(more("t"));
  const auto blocked = [](GstPad* blocked_pad, GstPadProbeInfo*, gpointer closed) {
    GstElement* bin = gst_pad_get_parent_element(blocked_pad);
    gst_element_release_request_pad(bin, blocked_pad);
    gst_object_unref(bin);
    *static_cast<std::atomic<bool>*>(closed) = true;
    return GST_PAD_PROBE_REMOVE;
  };
  std::atomic<bool> closed = false;
  gst_pad_add_probe(pad.get(), GST_PAD_PROBE_TYPE_BLOCK_DOWNSTREAM, blocked, &closed, nullptr);
  EXPECT_TRUE(eventually([&] { return closed.load(); }));
  EXPECT_TRUE(more("s"));
  EXPECT_FALSE(pad_of(child("v").get(), "src_0"));
}

TEST_F(LfViewSrcTest, ViewerStartsWhenLinked) {
  play("");
  ASSERT_TRUE(more("s"));
  ASSERT_NE(gst_element_set_state(pipeline_.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  const auto start = [](GstBin* bin, GstElement* added, gpointer) {
    if (!g_str_has_prefix(GST_OBJECT_NAME(added), "view_")) return;
    gst_element_set_state(GST_ELEMENT(GST_OBJECT_PARENT(bin)), GST_STATE_PLAYING);
    g_usleep(200000);
  };
  g_signal_connect(child("v").get(), "element-added", G_CALLBACK(+start), nullptr);
  const PadPtr pad = add_viewer("t");
  EXPECT_TRUE(more("t"));
  close_viewer(pad.get(), "t");
  EXPECT_TRUE(more("s"));
}

TEST_F(LfViewSrcTest, UnlinkedPadsDoNotDisturbOtherViewers) {
  play("", "v.src_0 ! fakesink name=t sync=false");
  EXPECT_TRUE(more("t"));
  const ElementPtr v = child("v"), t = child("t");
  const PadPtr src = pad_of(v.get(), "src_0"), sink = pad_of(t.get(), "sink");
  const PadPtr third(gst_element_request_pad_simple(v.get(), "src_%u"));
  EXPECT_TRUE(eventually([&] { return stat(child("compositor_1").get(), "pictures") > 3; }));
  EXPECT_TRUE(gst_pad_unlink(src.get(), sink.get()));
  EXPECT_TRUE(eventually([&, from = stat(child("compositor").get(), "pictures")] {
    return stat(child("compositor").get(), "pictures") > from + 3;
  }));
  EXPECT_EQ(gst_pad_link(src.get(), sink.get()), GST_PAD_LINK_OK);
  EXPECT_TRUE(more("t")) << "linked again";
  gst_element_release_request_pad(v.get(), third.get());
}

TEST_F(LfViewSrcTest, DepthsComeWithThePictures) {
  play("", "v.src ! fakesink name=s sync=false  v.depth_src ! fakesink name=t sync=false  v.confidence_src ! fakesink");
  EXPECT_TRUE(more("s"));
  EXPECT_TRUE(more("t"));
  const ElementPtr v = child("v"), t = child("t");
  const PadPtr sink = pad_of(t.get(), "sink");
  for (int i = 0; i < 3; i++) {
    const PadPtr pad = pad_of(v.get(), "depth_src");
    ASSERT_TRUE(pad);
    gst_element_release_request_pad(v.get(), pad.get());
    EXPECT_TRUE(more("s"));
    const PadPtr again(gst_element_request_pad_simple(v.get(), "depth_src"));
    ASSERT_TRUE(again);
    ASSERT_EQ(gst_pad_link(again.get(), sink.get()), GST_PAD_LINK_OK);
    EXPECT_TRUE(more("t")) << "requested again";
  }
}

TEST_F(LfViewSrcTest, DepthsEndWithThePictures) {
  for (const char* with : {"v.src ! fakesink", ""}) {
    const std::string line = "lfviewsrc name=v rig=" + array_.rig_path() +
                             " is-live=false num-buffers=5 framerate=30/1 " + with +
                             " v.depth_src ! fakesink name=t  v.confidence_src ! fakesink";
    const PipelinePtr pipeline = launch(line);
    int depths = 0;
    on_buffers(child_of(pipeline.get(), "t").get(), "sink", [&](GstBuffer*) { depths++; });
    EXPECT_EQ(run(pipeline.get()), "") << line;
    EXPECT_EQ(depths, 5) << line;
  }
}

TEST_F(LfViewSrcTest, StalledViewerDoesNotStallOthers) {
  play("", "v.src ! fakesink name=s sync=false  v.src_0 ! fakesink name=t sync=false");
  ASSERT_TRUE(more("t"));
  const PadPtr sink = pad_of(child("t").get(), "sink");
  std::atomic<bool> blocked = false;
  const gulong probe = gst_pad_add_probe(
      sink.get(), GST_PAD_PROBE_TYPE_BLOCK_DOWNSTREAM,
      [](GstPad*, GstPadProbeInfo*, gpointer data) {
        *static_cast<std::atomic<bool>*>(data) = true;
        return GST_PAD_PROBE_OK;
      },
      &blocked, nullptr);
  ASSERT_TRUE(eventually([&] { return blocked.load(); }));
  EXPECT_TRUE(more("s", 30));
  // Feedback of the stalled viewer must not stall others either when its sink resumes.
  EXPECT_TRUE(eventually([&, from = stat(child("compositor_0").get(), "pictures")] {
    return stat(child("compositor_0").get(), "pictures") > from + 20;
  }));
  gst_pad_remove_probe(sink.get(), probe);
  EXPECT_TRUE(more("t"));
}

// lfviewsrc listen=...: shows the views that remote viewers request, with keys on both sides.
class LfViewSrcListenTest : public LfViewSrcTest {
 protected:
  PipelinePtr ask(guint view_id, int width, const std::string& with = "") {
    PipelinePtr viewer = launch("lfviewrequest is-live=true framerate=30/1 rig=" + array_.rig_path() +
                                " view-id=" + std::to_string(view_id) + " width=" + std::to_string(width) +
                                " height=20 capture-delay=100000000 ! rtplfpay ! lfrtpseal " + with +
                                " ! udpsink host=127.0.0.1 sync=false async=false port=" + std::to_string(port_));
    use_realtime(viewer.get());
    EXPECT_NE(gst_element_set_state(viewer.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
    return viewer;
  }
  static void use_realtime(GstElement* pipeline) {
    g_autoptr(GstClock) clock = GST_CLOCK(
        gst_object_ref_sink(g_object_new(GST_TYPE_SYSTEM_CLOCK, "clock-type", GST_CLOCK_TYPE_REALTIME, nullptr)));
    gst_pipeline_use_clock(GST_PIPELINE(pipeline), clock);
  }
  static void end(PipelinePtr& pipeline) {
    EXPECT_EQ(gst_element_set_state(pipeline.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
    pipeline.reset();
  }
  std::string listen() const { return "listen=127.0.0.1:" + std::to_string(port_) + " "; }
  std::string with_key() const { return "key-file=" + key_.path(); }
  uint64_t complete(const char* compositor) { return stat(child(compositor).get(), "complete"); }
  std::string caps(const char* sink) { return caps_of(pad_of(child(sink).get(), "sink").get()); }

  const int port_ = free_port(SOCK_DGRAM);
  const TempFile key_{std::string(40, 'k')};
};

TEST_F(LfViewSrcListenTest, EachPadShowsTheRequestedView) {
  // Sinks with async=false, because a view may never be requested.
  play(listen(), "v.src ! fakesink name=s sync=false async=false  v.src_6 ! fakesink name=t sync=false async=false");
  PipelinePtr seventh = ask(7, 36), nobody = ask(3, 48);
  EXPECT_TRUE(more("t"));
  EXPECT_TRUE(eventually([&] { return complete("compositor_6") > 5; }));
  EXPECT_THAT(caps("t"), HasSubstr("width=(int)36"));
  EXPECT_EQ(shown_["s"], 0) << "no requests for view 0";
  PipelinePtr first = ask(0, 30);
  EXPECT_TRUE(more("s"));
  EXPECT_THAT(caps("s"), HasSubstr("width=(int)30"));
  end(seventh);
  EXPECT_TRUE(more("s"));
  seventh = ask(7, 36);
  EXPECT_TRUE(more("t"));
  const PadPtr pad = add_viewer("u");
  PipelinePtr another = ask(1, 42);
  EXPECT_TRUE(more("u"));
  close_viewer(pad.get(), "u");
  EXPECT_TRUE(more("t"));
  stop();
  for (PipelinePtr* each : {&first, &seventh, &nobody, &another}) end(*each);
}

TEST_F(LfViewSrcListenTest, RequestsNeedTheKey) {
  play(listen() + with_key());
  PipelinePtr stranger = ask(0, 30);
  EXPECT_TRUE(eventually([&] { return stat(child("listen_gate").get(), "unsealed") > 5; }));
  EXPECT_EQ(shown_["s"], 0);
  PipelinePtr viewer = ask(0, 36, with_key());
  EXPECT_TRUE(more("s"));
  EXPECT_THAT(caps("s"), HasSubstr("width=(int)36"));
  stop();
  end(stranger);
  end(viewer);
}

TEST_F(LfViewSrcListenTest, EncryptedRequestsWithoutAKeyAreReported) {
  play(listen());
  PipelinePtr viewer = ask(0, 36, with_key());
  EXPECT_TRUE(eventually([&] { return contains(warnings_of(pipeline_.get()), "sender only"); }));
  EXPECT_EQ(shown_["s"], 0);
  stop();
  end(viewer);
}

// A partial compositor sends answers, like a node.
TEST_F(LfViewSrcListenTest, PartialOutputActsLikeANode) {
  play(listen() + "partial=true node=5", "v.src ! application/x-lightfield-answer ! fakesink name=s sync=false");
  PipelinePtr viewer = ask(0, 30);
  EXPECT_TRUE(more("s"));
  stop();
  end(viewer);
}

TEST_F(LfViewSrcListenTest, StopsListening) {
  play(listen());
  ASSERT_EQ(gst_element_set_state(pipeline_.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  g_object_set(child("v").get(), "listen", nullptr, nullptr);
  ASSERT_NE(gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  EXPECT_TRUE(more("s")) << "separate view";
  EXPECT_FALSE(child("listen_gate"));
}

TEST_F(LfViewSrcListenTest, PortInUseIsAnError) {
  play(listen());
  PipelinePtr other = launch("lfviewsrc rig=" + array_.rig_path() + " " + listen() + " ! fakesink");
  EXPECT_EQ(gst_element_set_state(other.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  std::swap(pipeline_, other);
  EXPECT_THAT(error(), AllOf(HasSubstr("UDP port " + std::to_string(port_)), HasSubstr("already in use")));
  drop();
  std::swap(pipeline_, other);
  PipelinePtr viewer = ask(0, 30);
  EXPECT_TRUE(more("s")) << "the first viewer continues";
  stop();
  end(viewer);
}

TEST_F(LfViewSrcListenTest, ErrorsNameTheProblem) {
  struct Case {
    std::string properties, words;
  };
  for (const Case& c :
       {Case{"listen=here", "listen: here:"}, Case{"listen=1,2", "one port"}, Case{"listen=7 is-live=false", "is-live"},
        Case{"listen=7 key-file=/nobody", "key-file: /nobody:"}, Case{"key-file=/nobody", "nodes or listen"},
        Case{"peers=localhost", "without listen"}, Case{"listen=7 peers=nobody.invalid", "peers: nobody.invalid: "}}) {
    pipeline_ = launch("lfviewsrc name=v rig=" + array_.rig_path() + " " + c.properties + " ! fakesink");
    EXPECT_EQ(gst_element_set_state(pipeline_.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE) << c.properties;
    EXPECT_THAT(error(), HasSubstr(c.words));
    drop();
  }
}

}  // namespace
}  // namespace lf::test
