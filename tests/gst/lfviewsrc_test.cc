// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gst/video/navigation.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <atomic>
#include <fstream>
#include <functional>
#include <map>
#include <set>

#include "gst/array_fixture.h"
#include "gst/gst_test.h"
#include "gst/other_rig.h"
#include "support/free_port.h"

namespace lf::test {
namespace {

using testing::HasSubstr;
using PadPtr = std::unique_ptr<GstPad, Unref<gst_object_unref>>;

constexpr double kPatience = 30;  // seconds; loaded machines are slow

// Whether it comes true.
bool comes(const std::function<bool()>& what) {
  for (double t = 0; t < kPatience; t += 0.01) {
    if (what()) return true;
    g_usleep(10000);
  }
  return what();
}

ElementPtr make(const char* factory) {
  return ElementPtr(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make(factory, nullptr))));
}

// A pipeline also of one element.
ElementPtr launch_pipeline(const std::string& line) {
  ElementPtr launched = launch(line);
  if (!launched || GST_IS_PIPELINE(launched.get())) return launched;
  GstElement* pipeline = gst_pipeline_new(nullptr);
  gst_bin_add(GST_BIN(pipeline), launched.release());
  return ElementPtr(pipeline);
}

// The small array, of the built-in scene.
class LfViewSrcTest : public testing::Test {
 protected:
  // A pipeline with an lfviewsrc, "v". `properties` are of it, `behind` is what comes then.
  void play(const std::string& properties, const std::string& behind = "v.src ! fakesink name=s sync=false") {
    pipeline_ = launch("lfviewsrc name=v rig=" + array_.rig_path() + " framerate=30/1 " + properties + " " + behind);
    ASSERT_TRUE(pipeline_);
    for (const char* sink : {"s", "t"})
      if (const ElementPtr element = child(sink)) count(element.get(), sink);
    ASSERT_NE(gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << error();
  }
  void TearDown() override { stop(); }
  void stop() {
    if (!pipeline_) return;
    EXPECT_EQ(gst_element_set_state(pipeline_.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
    EXPECT_EQ(error(), "");
    pipeline_.reset();
  }

  // A pipeline that never started keeps what is on its bus.
  void drop() {
    gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
    GstBus* bus = gst_element_get_bus(pipeline_.get());
    gst_bus_set_flushing(bus, TRUE);
    gst_object_unref(bus);
    pipeline_.reset();
  }

  // The first error on the bus, or "".
  std::string error() {
    GstBus* bus = gst_element_get_bus(pipeline_.get());
    GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR);
    gst_object_unref(bus);
    if (!message) return "";
    g_autoptr(GError) error = nullptr;
    gst_message_parse_error(message, &error, nullptr);
    gst_message_unref(message);
    return error->message;
  }
  ElementPtr child(const std::string& name) const {
    return ElementPtr(gst_bin_get_by_name(GST_BIN(pipeline_.get()), name.c_str()));
  }
  template <typename T = double>
  T get(const std::string& element, const char* property) const {
    T value{};
    g_object_get(child(element).get(), property, &value, nullptr);
    return value;
  }
  void count(GstElement* sink, const std::string& name) {
    const PadPtr pad(gst_element_get_static_pad(sink, "sink"));
    const auto probe = [](GstPad*, GstPadProbeInfo*, gpointer counter) {
      ++*static_cast<std::atomic<int>*>(counter);
      return GST_PAD_PROBE_OK;
    };
    gst_pad_add_probe(pad.get(), GST_PAD_PROBE_TYPE_BUFFER, probe, &shown_[name], nullptr);
  }
  // Whether so many more pictures come there.
  bool more(const std::string& sink, int pictures = 5) {
    const int before = shown_[sink];
    return comes([&] { return shown_[sink] >= before + pictures; });
  }
  // One more viewer and its sink, while everything plays: the pad.
  PadPtr add_viewer(const std::string& sink_name) {
    const ElementPtr v = child("v");
    PadPtr pad(gst_element_request_pad_simple(v.get(), "src_%u"));
    GstElement* sink = gst_element_factory_make("fakesink", sink_name.c_str());
    g_object_set(sink, "sync", FALSE, "async", FALSE, nullptr);
    gst_bin_add(GST_BIN(pipeline_.get()), sink);
    count(sink, sink_name);
    const PadPtr in(gst_element_get_static_pad(sink, "sink"));
    gst_element_sync_state_with_parent(sink);
    EXPECT_EQ(gst_pad_link(pad.get(), in.get()), GST_PAD_LINK_OK);
    return pad;
  }
  void close_viewer(GstPad* pad, const std::string& sink_name) {
    const ElementPtr v = child("v"), sink = child(sink_name);
    gst_element_release_request_pad(v.get(), pad);
    gst_element_set_state(sink.get(), GST_STATE_NULL);
    gst_bin_remove(GST_BIN(pipeline_.get()), sink.get());
  }

  ArrayFixture array_;
  ElementPtr pipeline_;
  std::map<std::string, std::atomic<int>> shown_;
};

void press(GstElement* sink, const char* key) {
  const PadPtr pad(gst_element_get_static_pad(sink, "sink"));
  gst_pad_push_event(pad.get(), gst_navigation_event_new_key_press(key, GST_NAVIGATION_MODIFIER_NONE));
}

std::set<std::string> child_names(GstElement* bin) {
  std::set<std::string> names;
  GST_OBJECT_LOCK(bin);
  for (GList* item = GST_BIN_CHILDREN(bin); item; item = item->next) names.insert(GST_OBJECT_NAME(item->data));
  GST_OBJECT_UNLOCK(bin);
  return names;
}

TEST_F(LfViewSrcTest, PropertiesAreThoseOfItsChildren) {
  const ElementPtr bin = make("lfviewsrc");
  size_t copies = 0;
  for (const char* name : {"view", "compositor"}) {
    const ElementPtr element(gst_bin_get_by_name(GST_BIN(bin.get()), name));
    ASSERT_TRUE(element) << name;
    guint count = 0;
    g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element.get()), &count);
    for (guint i = 0; i < count; i++) {
      GParamSpec* of_child = specs[i];
      GParamSpec* own = g_object_class_find_property(G_OBJECT_GET_CLASS(bin.get()), of_child->name);
      const std::set<std::string> differ = {"name", "parent", "rig", "is-live"};
      if (!own || differ.contains(own->name)) continue;
      copies++;
      EXPECT_STREQ(g_param_spec_get_blurb(own), g_param_spec_get_blurb(of_child)) << own->name;
      EXPECT_STREQ(g_param_spec_get_nick(own), g_param_spec_get_nick(of_child)) << own->name;
      EXPECT_EQ(own->value_type, of_child->value_type) << own->name;
      constexpr int kMutable = GST_PARAM_MUTABLE_READY | GST_PARAM_MUTABLE_PAUSED | GST_PARAM_MUTABLE_PLAYING;
      EXPECT_EQ(own->flags & kMutable, of_child->flags & kMutable) << own->name;
      if (G_IS_PARAM_SPEC_BOXED(own)) continue;
      const GValue *own_default = g_param_spec_get_default_value(own),
                   *child_default = g_param_spec_get_default_value(of_child);
      EXPECT_EQ(g_param_values_cmp(own, own_default, child_default), 0) << own->name;
    }
  }
  EXPECT_GT(copies, 30u);
  for (const char* name : {"x", "fov", "focus-distance", "width", "framerate", "location", "focus", "focus-near",
                           "stats", "post-messages", "latency", "num-buffers"})
    EXPECT_TRUE(g_object_class_find_property(G_OBJECT_GET_CLASS(bin.get()), name)) << name;
}

TEST_F(LfViewSrcTest, PropertiesReachTheChildrenAndBack) {
  const ElementPtr bin = make("lfviewsrc");
  std::string notified;
  g_signal_connect(bin.get(), "notify", G_CALLBACK(+[](GObject*, GParamSpec* spec, gpointer text) {
                     *static_cast<std::string*>(text) += std::string(spec->name) + " ";
                   }),
                   &notified);
  g_object_set(bin.get(), "x", 0.25, "width", 320, "framerate", 25, 2, "background", 0xff112233, nullptr);
  EXPECT_EQ(notified, "background framerate width x ");
  g_autofree gchar* rig = nullptr;
  gdouble x = 0;
  guint background = 0;
  gboolean live = FALSE;
  gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), "view::x", &x, "compositor::background", &background, "node::is-live",
                      &live, nullptr);
  EXPECT_EQ(x, 0.25);
  EXPECT_EQ(background, 0xff112233);
  EXPECT_TRUE(live);
  notified.clear();
  gst_child_proxy_set(GST_CHILD_PROXY(bin.get()), "view::yaw", 7.0, "compositor::max-missed", 9u, "node::cameras",
                      "0-2", nullptr);
  EXPECT_EQ(notified, "yaw max-missed ") << "once each";
  guint missed = 0;
  g_object_get(bin.get(), "max-missed", &missed, nullptr);
  EXPECT_EQ(missed, 9u);

  // A further viewer has the settings, but a view of its own.
  GstPad* pad = gst_element_request_pad_simple(bin.get(), "src_7");
  ASSERT_TRUE(pad);
  EXPECT_STREQ(GST_PAD_NAME(pad), "src_7");
  gint width = 0;
  gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), "view_7::x", &x, "view_7::width", &width, "compositor_7::max-missed",
                      &missed, nullptr);
  EXPECT_EQ(x, 0);
  EXPECT_EQ(width, 320);
  EXPECT_EQ(missed, 9u);
  g_object_set(bin.get(), "rig", array_.rig_path().c_str(), "is-live", FALSE, nullptr);
  for (const char* name : {"view::rig", "compositor::rig", "node::rig", "view_7::rig", "compositor_7::rig"}) {
    g_autofree gchar* path = nullptr;
    gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), name, &path, nullptr);
    EXPECT_EQ(path, array_.rig_path()) << name;
  }
  for (const char* name : {"view::is-live", "view_7::is-live", "node::is-live"}) {
    gst_child_proxy_get(GST_CHILD_PROXY(bin.get()), name, &live, nullptr);
    EXPECT_FALSE(live) << name;
  }
  gst_element_release_request_pad(bin.get(), pad);
  gst_object_unref(pad);
  EXPECT_EQ(gst_element_get_static_pad(bin.get(), "src_7"), nullptr);
}

TEST_F(LfViewSrcTest, EndsWithItsViews) {
  const ElementPtr pipeline = launch("lfviewsrc rig=" + array_.rig_path() +
                                     " is-live=false num-buffers=20 name=v ! fakesink name=s sync=false");
  ASSERT_TRUE(pipeline);
  for (int i = 0; i < 2; i++) EXPECT_EQ(run(pipeline.get(), kPatience), "") << i;
}

TEST_F(LfViewSrcTest, FliesByNavigation) {
  play("width=64 height=48 keep-visible=false v.src ! videoconvert ! fakesink name=s sync=false",
       "v.src_0 ! queue ! fakesink name=t sync=false");
  ASSERT_TRUE(more("s"));
  ASSERT_TRUE(more("t"));
  const double x = get("v", "x"), x0 = get("view_0", "x");
  EXPECT_EQ(x, x0) << "both stand in the middle";
  std::atomic<int> notified = 0;
  g_signal_connect(child("v").get(), "notify::x",
                   G_CALLBACK(+[](GObject*, GParamSpec*, gpointer n) { ++*static_cast<std::atomic<int>*>(n); }),
                   &notified);
  press(child("s").get(), "d");
  EXPECT_GT(get("v", "x"), x);
  EXPECT_EQ(notified, 1);
  EXPECT_EQ(get("view_0", "x"), x0);
  const double flown = get("v", "x");
  EXPECT_TRUE(
      gst_element_send_event(child("v").get(), gst_navigation_event_new_key_press("a", GST_NAVIGATION_MODIFIER_NONE)));
  EXPECT_LT(get("v", "x"), flown) << "by the application itself";
  press(child("t").get(), "a");
  EXPECT_LT(get("view_0", "x"), x0);
}

TEST_F(LfViewSrcTest, ActionsSetTheView) {
  play("");
  ASSERT_TRUE(more("s"));
  gboolean done = FALSE;
  GstStructure* view = gst_structure_new("view", "x", G_TYPE_DOUBLE, 0.07, nullptr);
  g_signal_emit_by_name(child("v").get(), "set-view", view, &done);
  gst_structure_free(view);
  EXPECT_TRUE(done);
  EXPECT_EQ(get("v", "x"), 0.07);
  g_signal_emit_by_name(child("v").get(), "focus-at", 10.0, 10.0, &done);
  EXPECT_TRUE(done);
  g_signal_emit_by_name(child("v").get(), "focus-at", double{NAN}, 10.0, &done);
  EXPECT_FALSE(done);
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
#ifndef __SANITIZE_ADDRESS__  // which keeps what was freed
  EXPECT_LT(resident_kib() - warm, 8 * 1024) << "150 viewers came and went";
#endif
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
  gst_pad_remove_probe(sink.get(), probe);
  EXPECT_TRUE(more("t"));
}

TEST_F(LfViewSrcTest, StartsAndStopsAtEveryStage) {
  play("", "v.src ! fakesink name=s  v.src_0 ! queue ! fakesink name=t");
  const ElementPtr v = child("v");
  for (int i = 0; i < 20; i++) {
    for (const GstState state :
         {GST_STATE_PAUSED, GST_STATE_READY, GST_STATE_PLAYING, GST_STATE_NULL, GST_STATE_PLAYING}) {
      ASSERT_NE(gst_element_set_state(pipeline_.get(), state), GST_STATE_CHANGE_FAILURE) << error();
      ASSERT_NE(gst_element_get_state(pipeline_.get(), nullptr, nullptr, GST_CLOCK_TIME_NONE),
                GST_STATE_CHANGE_FAILURE);
      g_usleep(static_cast<gulong>(1000 * (i % 5)));
    }
  }
  EXPECT_TRUE(more("s"));
  EXPECT_TRUE(more("t"));
}

TEST_F(LfViewSrcTest, ErrorsSayWhatIsWrong) {
  struct Case {
    std::string properties, words;
    const char* cameras = "";
  };
  const std::string rig = "rig=" + array_.rig_path();
  for (const Case& c : {Case{"", "rig: not set"}, Case{"rig=/nowhere/rig.json", "/nowhere/rig.json"},
                        Case{rig + " nodes=here", "nodes: here: must be HOST:PORT-THERE"},
                        Case{rig + " nodes=localhost:1:2 is-live=false", "is-live must be true"},
                        Case{rig + " nodes=nobody.invalid:1:2", "nobody.invalid"}, Case{rig, "cameras \"9\"", "9"},
                        Case{rig + " location=none.json", "none.json"}}) {
    pipeline_ = launch("lfviewsrc name=v " + c.properties + " ! fakesink");
    ASSERT_TRUE(pipeline_);
    // (Not in the line: gst_parse_launch() of 1.22 forgets a reference to the child.)
    if (c.cameras[0]) gst_child_proxy_set(GST_CHILD_PROXY(child("v").get()), "node::cameras", c.cameras, nullptr);
    EXPECT_EQ(gst_element_set_state(pipeline_.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE) << c.properties;
    EXPECT_THAT(error(), HasSubstr(c.words));
    drop();
  }
}

TEST_F(LfViewSrcTest, ARigIsTakenWhileRunningByAllOrNobody) {
  const OtherRig calibrated(array_.rig(), [](Rig& rig) { rig.cameras[0].lens = Lens::pinhole(31, 15, 12); });
  const OtherRig moved(array_.rig(), [](Rig& rig) { rig.cameras[1].source = "elsewhere.mkv"; });
  play("", "v.src ! fakesink name=s  v.src_0 ! fakesink name=t");
  ASSERT_TRUE(more("t"));
  const auto expect_rig = [&](const std::string& path) {
    for (const char* name : {"v", "view", "compositor", "node", "view_0", "compositor_0"}) {
      g_autofree gchar* rig = get<gchar*>(name, "rig");
      EXPECT_EQ(rig, path) << name;
    }
  };
  g_object_set(child("v").get(), "rig", calibrated.path().c_str(), nullptr);
  expect_rig(calibrated.path());
  EXPECT_TRUE(more("t"));
  g_object_set(child("v").get(), "rig", moved.path().c_str(), nullptr);
  expect_rig(calibrated.path());
  EXPECT_TRUE(more("s"));
}

TEST_F(LfViewSrcTest, AUriNamesTheRig) {
  GError* error = nullptr;
  const ElementPtr bin(gst_element_make_from_uri(GST_URI_SRC, ("lf://" + array_.rig_path()).c_str(), nullptr, &error));
  ASSERT_TRUE(bin) << error->message;
  gst_object_ref_sink(bin.get());
  g_autofree gchar* rig = nullptr;
  g_object_get(bin.get(), "rig", &rig, nullptr);
  EXPECT_EQ(rig, array_.rig_path());
  g_autofree gchar* uri = gst_uri_handler_get_uri(GST_URI_HANDLER(bin.get()));
  EXPECT_EQ(uri, "lf://" + array_.rig_path());
  EXPECT_FALSE(gst_uri_handler_set_uri(GST_URI_HANDLER(bin.get()), "lf://rig.json", &error));
  EXPECT_THAT(error->message, HasSubstr("lf:///path"));
  g_clear_error(&error);
}

// Two hosts with half of the cameras each, in pipelines of their own.
class LfViewSrcOnHostsTest : public LfViewSrcTest {
 protected:
  ElementPtr start_host(int number) {
    ElementPtr host = launch_pipeline(
        "lfnodesink name=n rig=" + array_.rig_path() + " framerate=30/1 cameras=" + (number == 0 ? "0-1" : "2-3") +
        " node=" + std::to_string(number) + " listen=" + std::to_string(there_[number]) + "," +
        std::to_string(extra_[number]) + " answers=127.0.0.1:" + std::to_string(here_[number]) +
        ",127.0.0.1:" + std::to_string(nobody_[number]));
    EXPECT_NE(gst_element_set_state(host.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
    return host;
  }
  static void stop_host(ElementPtr& host) {
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

TEST_F(LfViewSrcOnHostsTest, ShowsTheirCamerasToEachViewer) {
  ElementPtr hosts[2] = {start_host(0), start_host(1)};
  play(nodes(), "v.src ! fakesink name=s sync=false  v.src_0 ! fakesink name=t sync=false");
  for (const char* compositor : {"compositor", "compositor_0"})
    EXPECT_TRUE(comes([&] { return complete(compositor) > 5; })) << compositor;
  const GstClock* clock = gst_pipeline_get_clock(GST_PIPELINE(pipeline_.get()));
  const double off = (static_cast<double>(gst_clock_get_time(const_cast<GstClock*>(clock))) / 1e3 -
                      static_cast<double>(g_get_real_time())) /
                     1e6;
  gst_object_unref(const_cast<GstClock*>(clock));
  EXPECT_NEAR(off, 0, 60) << "the time of day";
  EXPECT_EQ(child("node").get(), nullptr);

  const PadPtr pad = add_viewer("u");
  EXPECT_TRUE(comes([&] { return complete("compositor_1") > 5; }));
  close_viewer(pad.get(), "u");
  const uint64_t before = complete("compositor");
  EXPECT_TRUE(comes([&] { return complete("compositor") > before + 5; }));

  // A host that goes and comes.
  stop_host(hosts[1]);
  EXPECT_TRUE(more("s", 20));
  hosts[1] = start_host(1);
  const uint64_t without = complete("compositor");
  EXPECT_TRUE(comes([&] { return complete("compositor") > without + 20; }));
  stop();
  for (ElementPtr& host : hosts) stop_host(host);
}

TEST_F(LfViewSrcOnHostsTest, CamerasChangeBetweenRuns) {
  ElementPtr hosts[2] = {start_host(0), start_host(1)};
  play("", "v.src ! fakesink name=s sync=false  v.src_0 ! fakesink name=t sync=false");
  ASSERT_TRUE(more("t"));
  for (int i = 0; i < 4; i++) {
    ASSERT_EQ(gst_element_set_state(pipeline_.get(), i < 2 ? GST_STATE_NULL : GST_STATE_READY),
              GST_STATE_CHANGE_SUCCESS);
    g_object_set(child("v").get(), "nodes", i % 2 ? "" : nodes().substr(6).c_str(), nullptr);
    ASSERT_NE(gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << i << error();
    EXPECT_TRUE(comes([&] { return complete("compositor") > 3 && complete("compositor_0") > 3; })) << i;
    EXPECT_EQ(bool(child("node")), i % 2 == 1);
  }
  stop();
  for (ElementPtr& host : hosts) stop_host(host);
}

TEST_F(LfViewSrcOnHostsTest, HostsSayWhatIsWrong) {
  const std::string rig = "lfnodesink name=n rig=" + array_.rig_path();
  struct Case {
    std::string line, words;
  };
  for (const Case& c : {Case{rig, "listen: not set"}, Case{rig + " listen=5000", "as many items"},
                        Case{rig + " listen=5000 answers=6000", "answers: 6000: must be HOST:PORT"},
                        Case{rig + " listen=here answers=a:6000", "here: must be PORT"},
                        Case{rig + " listen=5000 answers=nobody.invalid:6000", "nobody.invalid"},
                        Case{"lfnodesink listen=5000 answers=localhost:6000", "rig: not set"}}) {
    pipeline_ = launch_pipeline(c.line);
    ASSERT_TRUE(pipeline_);
    EXPECT_EQ(gst_element_set_state(pipeline_.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE) << c.line;
    EXPECT_THAT(error(), HasSubstr(c.words));
    drop();
  }
}

TEST_F(LfViewSrcOnHostsTest, TheOtherEndHasThePropertiesOfItsNode) {
  const ElementPtr bin = make("lfnodesink");
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
