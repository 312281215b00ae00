// SPDX-License-Identifier: LGPL-2.1-or-later
// A place of the view is kept in focus as the scene moves.
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <set>
#include <vector>

#include "gst/gst_test.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/temp_dir.h"
#include "wire/request_codec.h"

namespace lf::test {
namespace {

// Lets a request of lfviewrequest leave when everything that it sent before has been answered: pictures have reached
// the sink, and news of sweeps have been taken in. So the run is the same however busy the machine is.
// A test that hangs fails, whatever a machine is busy with.
constexpr std::chrono::seconds kLongest{90};

class Lockstep {
 public:
  Lockstep(GstElement* viewer, GstElement* sink) : src_(gst_element_get_static_pad(viewer, "src")) {
    g_object_set(sink, "signal-handoffs", TRUE, nullptr);
    g_signal_connect(sink, "handoff", G_CALLBACK(on_picture), this);
    gst_pad_add_probe(src_, GST_PAD_PROBE_TYPE_BUFFER, on_request, this, nullptr);
    take_event_ = GST_PAD_EVENTFUNC(src_);
    gst_pad_set_event_function(src_, on_event);
    gst_pad_set_element_private(src_, this);
  }
  ~Lockstep() { gst_object_unref(src_); }
  Lockstep(const Lockstep&) = delete;

 private:
  static void on_picture(GstElement*, GstBuffer*, GstPad*, gpointer data) {
    auto* self = static_cast<Lockstep*>(data);
    const std::lock_guard lock(self->mutex_);
    self->pictures_awaited_--;
    self->changed_.notify_all();
  }
  // After the element has taken it.
  static gboolean on_event(GstPad* pad, GstObject* parent, GstEvent* event) {
    auto* self = static_cast<Lockstep*>(gst_pad_get_element_private(pad));
    guint sequence = 0;
    const bool news = gst_event_has_name(event, "lightfield-feedback") &&
                      gst_structure_get_uint(gst_event_get_structure(event), "sequence", &sequence);
    const gboolean done = self->take_event_(pad, parent, event);
    if (news) {
      const std::lock_guard lock(self->mutex_);
      self->sweeps_awaited_.erase(sequence);
      self->changed_.notify_all();
    }
    return done;
  }
  static GstPadProbeReturn on_request(GstPad*, GstPadProbeInfo* info, gpointer data) {
    auto* self = static_cast<Lockstep*>(data);
    const auto request = wire::decode_request(to_bytes(GST_PAD_PROBE_INFO_BUFFER(info)));
    if (!request || request->rehearsal) return GST_PAD_PROBE_OK;  // of a rehearsal comes no picture
    std::unique_lock lock(self->mutex_);
    if (request->probe) {  // leaves right behind its request
      self->sweeps_awaited_.insert(request->sequence);
      return GST_PAD_PROBE_OK;
    }
    const auto is_answered = [self] { return self->pictures_awaited_ == 0 && self->sweeps_awaited_.empty(); };
    EXPECT_TRUE(self->changed_.wait_for(lock, kLongest, is_answered)) << request->sequence;
    self->pictures_awaited_++;
    return GST_PAD_PROBE_OK;
  }

  GstPad* src_;
  GstPadEventFunction take_event_;
  std::mutex mutex_;
  std::condition_variable changed_;
  int pictures_awaited_ = 0;
  std::set<uint32_t> sweeps_awaited_;
};

// The figure walks past the wall at this place of the view, which is kept in focus.
class FollowedPlace : public testing::TestWithParam<const char*> {
 protected:
  static void note(GObject* viewer, GParamSpec*, gpointer data) {
    double distance = 0;
    g_object_get(viewer, "focus-distance", &distance, nullptr);
    static_cast<std::vector<double>*>(data)->push_back(distance);
  }
  TempDir dir_;
};

TEST_P(FollowedPlace, IsInFocusAsItMoves) {
  save_rig(scene_rig(2, 2, 120, 90), dir_ / "rig.json");
  const std::string rig = " rig=" + dir_ / "rig.json", small = " ! queue max-size-buffers=1 ! ";
  const ElementPtr pipeline = launch(
      "lfviewrequest name=v focus-continuous=true focus-distance=30 x=0 y=0 fov=33.4 framerate=8/1 num-buffers=58" +
      rig + " ! tee name=r  r." + small + "n.request  lfcameranode name=n" + rig + small + "c.sink_0  r." + small +
      "c.request  lfcompositor name=c" + rig + " " + GetParam() + " ! fakesink name=s sync=false");
  ASSERT_TRUE(pipeline);
  const ElementPtr viewer(gst_bin_get_by_name(GST_BIN(pipeline.get()), "v"));
  const ElementPtr sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "s"));
  const Lockstep lockstep(viewer.get(), sink.get());
  std::vector<double> distances;
  g_signal_connect(viewer.get(), "notify::focus-distance", G_CALLBACK(note), &distances);
  gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
  ASSERT_EQ(gst_element_get_state(pipeline.get(), nullptr, nullptr, 20 * GST_SECOND), GST_STATE_CHANGE_SUCCESS);
  gboolean done = FALSE;
  g_signal_emit_by_name(viewer.get(), "focus-at", 51.0, 39.0, &done);
  EXPECT_TRUE(done);
  EXPECT_EQ(run(pipeline.get(), 100), "");
  // From 1.2 s to 3.1 s and from 5.2 s to 7.1 s the figure is there, 2 m away; else the wall, 5 m away. The end, at
  // 7.25 s, may come before the wall is seen again.
  int changes = 0;
  bool near = false;
  for (const double distance : distances) {
    EXPECT_GT(distance, 1.7);
    EXPECT_LT(distance, 6.5);
    if (distance < 2.4 && !near) changes++, near = true;
    if (distance > 3.7 && near) changes++, near = false;
  }
  EXPECT_GE(changes, 3) << testing::PrintToString(distances);
}

INSTANTIATE_TEST_SUITE_P(Focus, FollowedPlace,
                         testing::Values("focus=plane", "focus=surface focus-near=1 focus-far=6"));

}  // namespace
}  // namespace lf::test
