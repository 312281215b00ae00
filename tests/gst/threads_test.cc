// SPDX-License-Identifier: LGPL-2.1-or-later
// One thread uses elements while another thread stops the pipeline. A bug hangs the test or reads freed memory, which
// sanitizers detect (tests/sanitize.sh).

#include <future>

#include "gst/gst_test.h"

namespace lf::test {
namespace {

// A slow signal handler watches the view while its viewer is removed.
struct Watching {
  std::promise<void> begun, gone;
  std::atomic<int> times = 0;

  static void on_change(GObject*, GParamSpec*, gpointer data) {
    auto& self = *static_cast<Watching*>(data);
    if (self.times++ > 0) return;
    self.begun.set_value();
    self.gone.get_future().wait();
  }
};

TEST(Threads, ViewerIsRemovedDuringNavigation) {
  PipelinePtr pipeline = launch(
      "lfviewrequest name=v is-live=true navigation-element=pictures ! fakesink  videotestsrc is-live=true ! "
      "identity name=pictures ! fakesink");
  ElementPtr pictures = child_of(pipeline.get(), "pictures");
  const PadPtr pad = pad_of(pictures.get(), "src");
  ElementPtr view = child_of(pipeline.get(), "v");
  GWeakRef alive;
  g_weak_ref_init(&alive, view.get());
  ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  gst_element_get_state(pipeline.get(), nullptr, nullptr, 10 * GST_SECOND);
  Watching watching;
  for (const char* property : {"notify::x", "notify::y", "notify::z"})
    g_signal_connect(view.get(), property, G_CALLBACK(Watching::on_change), &watching);
  std::thread window([&] {
    GstStructure* view_event = gst_structure_new("lightfield-view-request", "x", G_TYPE_DOUBLE, 1.0, "y", G_TYPE_DOUBLE,
                                                 2.0, "z", G_TYPE_DOUBLE, 3.0, nullptr);
    gst_pad_send_event(pad.get(), gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM, view_event));
  });
  watching.begun.get_future().wait();
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  view.reset();
  pictures.reset();
  pipeline.reset();
  watching.gone.set_value();
  window.join();
  EXPECT_EQ(watching.times, 3) << "all three notifications arrive";
  const ElementPtr left(static_cast<GstElement*>(g_weak_ref_get(&alive)));
  EXPECT_FALSE(left);
  g_weak_ref_clear(&alive);
}

gboolean answer_query(GstPad*, GstObject*, GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY) return FALSE;
  gst_query_set_latency(query, TRUE, GST_MSECOND, GST_CLOCK_TIME_NONE);
  return TRUE;
}

class Asking {
 public:
  explicit Asking(GstPad* pad) : pad_(GST_PAD(gst_object_ref(pad))), thread_([this] { ask(); }) {}
  ~Asking() {
    done_ = true;
    thread_.join();
  }
  Asking(const Asking&) = delete;
  Asking& operator=(const Asking&) = delete;

 private:
  void ask() {
    while (!done_) {
      g_autoptr(GstQuery) query = gst_query_new_latency();
      gst_pad_query(pad_.get(), query);
      if (GST_PAD_IS_SINK(pad_.get())) continue;
      gst_pad_send_event(pad_.get(), gst_event_new_navigation(gst_structure_new_empty("application/x-gst-navigation")));
    }
  }
  PadPtr pad_;
  std::atomic<bool> done_ = false;
  std::thread thread_;
};

TEST(Threads, RelayPadIsReleasedDuringQueries) {
  const ElementPtr relay = make_element("lfviewrequest");
  g_object_set(relay.get(), "is-live", TRUE, nullptr);
  gst_element_set_state(relay.get(), GST_STATE_PAUSED);
  const PadPtr src = pad_of(relay.get(), "src");
  {
    const Asking asking(src.get());
    for (int i = 0; i < 300; i++) {
      const PadPtr upstream(GST_PAD(gst_object_ref_sink(gst_pad_new("src", GST_PAD_SRC))));
      gst_pad_set_query_function(upstream.get(), answer_query);
      gst_pad_set_active(upstream.get(), TRUE);
      const PadPtr sink(gst_element_request_pad_simple(relay.get(), "sink"));
      ASSERT_TRUE(sink);
      gst_pad_link(upstream.get(), sink.get());
      g_thread_yield();
      gst_element_release_request_pad(relay.get(), sink.get());
    }
  }
  gst_element_set_state(relay.get(), GST_STATE_NULL);
}

TEST(Threads, ClientIsRemovedDuringRequests) {
  const ElementPtr node = make_element("lffragment");
  for (int i = 0; i < 100; i++) {
    const PadPtr request(gst_element_request_pad_simple(node.get(), "request_%u"));
    ASSERT_TRUE(request);
    const std::string number = std::string(GST_PAD_NAME(request.get())).substr(sizeof("request") - 1);
    const PadPtr src = pad_of(node.get(), ("src" + number).c_str());
    const Asking of_answers(src.get()), of_requests(request.get());
    g_thread_yield();
    gst_element_release_request_pad(node.get(), request.get());
  }
}

}  // namespace
}  // namespace lf::test
