// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Viewers of an lfviewsrc that come, go, stall and are left unlinked while others play.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <set>

#include "gst/lfviewsrc_fixture.h"
#include "gst/other_rig.h"
#include "gst/sanitizer.h"
#include "scene/scene.h"

namespace lf::test {
namespace {

std::set<std::string> child_names(GstElement* bin) {
  std::set<std::string> names;
  GST_OBJECT_LOCK(bin);
  for (GList* item = GST_BIN_CHILDREN(bin); item; item = item->next) names.insert(GST_OBJECT_NAME(item->data));
  GST_OBJECT_UNLOCK(bin);
  return names;
}

TEST_F(LfViewSrcTest, ViewersComeAndGoWhileOthersPlay) {
  play("");
  ASSERT_TRUE(more("s"));
  const std::set<std::string> before = child_names(child("v").get());
  for (int i = 0; i < 10; i++) {
    const PadPtr pad = add_viewer("t");
    EXPECT_STREQ(GST_PAD_NAME(pad.get()), "src_0");
    EXPECT_TRUE(i % 3 == 2 || more("t")) << i;  // or it is closed before its first picture
    close_viewer(pad.get(), "t");
    EXPECT_EQ(child_names(child("v").get()), before) << i;
    EXPECT_TRUE(more("s", 2)) << i;
  }
  const ElementPtr fragment = child("fragment");
  EXPECT_TRUE(comes([&] {
    GST_OBJECT_LOCK(fragment.get());
    const guint pads = fragment->numsinkpads;
    GST_OBJECT_UNLOCK(fragment.get());
    return pads == 5;  // of its cameras and of the viewer that is left
  }));
}

long resident_kib() {
  std::ifstream statm("/proc/self/statm");
  long size = 0, resident = 0;
  statm >> size >> resident;
  return resident * (sysconf(_SC_PAGESIZE) / 1024);
}

TEST_F(LfViewSrcTest, ViewersThatAreGoneLeaveNothing) {
  play("");
  const ElementPtr v = child("v");
  GstBus* bus = gst_element_get_bus(pipeline_.get());
  long warm = 0;
  for (int i = 0; i < 100; i++) {
    if (i == 25) warm = resident_kib();
    const PadPtr pads[] = {PadPtr(gst_element_request_pad_simple(v.get(), "src_%u")),
                           PadPtr(gst_element_request_pad_simple(v.get(), "src_%u"))};
    g_usleep(static_cast<gulong>(10000 * (i % 4)));
    for (const PadPtr& pad : pads) gst_element_release_request_pad(v.get(), pad.get());
    // What is on the bus keeps those that said it.
    while (GstMessage* message = gst_bus_pop(bus)) gst_message_unref(message);
  }
  gst_object_unref(bus);
  EXPECT_TRUE(more("s"));
  if (!kKeepsFreedMemory) {
    EXPECT_LT(resident_kib() - warm, 8 * 1024) << "150 viewers came and went";
  }
}

// The cameras film for whoever comes later, even if nobody is left in between.
TEST_F(LfViewSrcTest, AViewerComesAfterAllHaveEnded) {
  play("num-buffers=3");
  const PadPtr last = add_viewer("l");
  const PadPtr end(gst_element_get_static_pad(child("s").get(), "sink"));
  ASSERT_TRUE(comes([&] { return GST_PAD_IS_EOS(end.get()); }));
  ASSERT_TRUE(more("l"));
  close_viewer(last.get(), "l");
  g_usleep(1000000);  // of frames that nobody asks for
  const PadPtr later = add_viewer("t");
  EXPECT_TRUE(more("t", 45));  // frames of before are shown for a while
  g_autoptr(GstSample) sample = get<GstSample*>("t", "last-sample");
  ASSERT_TRUE(sample);
  GstMapInfo map;
  ASSERT_TRUE(gst_buffer_map(gst_sample_get_buffer(sample), &map, GST_MAP_READ));
  const auto dark = std::count_if(map.data, map.data + map.size, [](guint8 level) { return level < 8; });
  EXPECT_LT(static_cast<double>(dark), 0.05 * static_cast<double>(map.size));
  gst_buffer_unmap(gst_sample_get_buffer(sample), &map);
}

// Who is in the middle of the array is not at its border because the host of one half is gone.
TEST_F(LfViewSrcTest, HalfOfTheArrayShowsTheHomeView) {
  const OtherRig half(scene_rig(4, 4, 64, 48), [](Rig& rig) {
    for (size_t i = 8; i < 16; i++) rig.cameras[i].source = "nowhere.mkv";
  });
  play("rig=" + half.path() + " width=64 height=48 framerate=15/1 focus=plane",
       "v.src ! video/x-raw,format=RGB ! "
       "fakesink name=s sync=false");
  const auto stat = [&](const char* field, double of_none) {
    g_autoptr(GstStructure) stats = get<GstStructure*>("v", "stats");
    const GValue* value = gst_structure_get_value(stats, field);
    GValue number = G_VALUE_INIT;
    g_value_init(&number, G_TYPE_DOUBLE);
    return value && g_value_transform(value, &number) ? g_value_get_double(&number) : of_none;
  };
  ASSERT_TRUE(comes([&] { return stat("out-of-service", 0) == 8; }));
  ASSERT_TRUE(comes([&] { return stat("coverage", 0) > 0.5 && stat("coverage", 1) < 0.95; })) << stat("coverage", -1);
  const double incomplete = stat("incomplete", -1);
  ASSERT_TRUE(more("s", 10));
  EXPECT_EQ(stat("incomplete", -1), incomplete) << "it is known that they give nothing";
  g_autoptr(GstSample) sample = get<GstSample*>("s", "last-sample");
  ASSERT_TRUE(sample);
  GstMapInfo map;
  ASSERT_TRUE(gst_buffer_map(gst_sample_get_buffer(sample), &map, GST_MAP_READ));
  const auto dark = std::count_if(map.data, map.data + map.size, [](guint8 level) { return level < 8; });
  EXPECT_LT(static_cast<double>(dark), 0.05 * static_cast<double>(map.size));
  gst_buffer_unmap(gst_sample_get_buffer(sample), &map);
}

// An application that has blocked a pad closes it in the callback, in a thread of that viewer.
TEST_F(LfViewSrcTest, AViewerIsClosedByItsOwnThread) {
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
  EXPECT_TRUE(comes([&] { return closed.load(); }));
  EXPECT_TRUE(more("s"));
  EXPECT_EQ(gst_element_get_static_pad(child("v").get(), "src_0"), nullptr);
}

// The bin starts while another thread makes a viewer.
TEST_F(LfViewSrcTest, AViewerBeginsOnceItIsLinked) {
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

TEST_F(LfViewSrcTest, PadsThatNobodyTakesDisturbNobody) {
  play("", "v.src_0 ! fakesink name=t sync=false");
  EXPECT_TRUE(more("t"));
  const ElementPtr v = child("v"), t = child("t");
  const PadPtr src(gst_element_get_static_pad(v.get(), "src_0")), sink(gst_element_get_static_pad(t.get(), "sink"));
  const PadPtr third(gst_element_request_pad_simple(v.get(), "src_%u"));
  EXPECT_TRUE(comes([&] { return stat(child("compositor_1").get(), "pictures") > 3; }));
  EXPECT_TRUE(gst_pad_unlink(src.get(), sink.get()));
  EXPECT_TRUE(comes([&, from = stat(child("compositor").get(), "pictures")] {
    return stat(child("compositor").get(), "pictures") > from + 3;
  }));
  EXPECT_EQ(gst_pad_link(src.get(), sink.get()), GST_PAD_LINK_OK);
  EXPECT_TRUE(more("t")) << "linked again";
  gst_element_release_request_pad(v.get(), third.get());
}

TEST_F(LfViewSrcTest, AStalledViewerStallsNobody) {
  play("", "v.src ! fakesink name=s sync=false  v.src_0 ! fakesink name=t sync=false");
  ASSERT_TRUE(more("t"));
  const PadPtr sink(gst_element_get_static_pad(child("t").get(), "sink"));
  std::atomic<bool> blocked = false;
  const gulong probe = gst_pad_add_probe(
      sink.get(), GST_PAD_PROBE_TYPE_BLOCK_DOWNSTREAM,
      [](GstPad*, GstPadProbeInfo*, gpointer data) {
        *static_cast<std::atomic<bool>*>(data) = true;
        return GST_PAD_PROBE_OK;
      },
      &blocked, nullptr);
  ASSERT_TRUE(comes([&] { return blocked.load(); }));
  EXPECT_TRUE(more("s", 30));
  // Nor does it stall what is found out for itself by the time that its sink goes on.
  EXPECT_TRUE(comes([&, from = stat(child("compositor_0").get(), "pictures")] {
    return stat(child("compositor_0").get(), "pictures") > from + 20;
  }));
  gst_pad_remove_probe(sink.get(), probe);
  EXPECT_TRUE(more("t"));
}

}  // namespace
}  // namespace lf::test
