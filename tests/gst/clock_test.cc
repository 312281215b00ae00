// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Pipelines that share a clock and nothing else: each has its own base time.
#include <gmock/gmock.h>
#include <gst/app/gstappsrc.h>
#include <gst/net/net.h>
#include <gtest/gtest.h>

#include <mutex>
#include <string>
#include <vector>

#include "base/schedule.h"
#include "gst/array_fixture.h"
#include "gst/gst_test.h"
#include "support/free_port.h"
#include "wire/answer_codec.h"

namespace lf::test {
namespace {

using testing::HasSubstr;

using ClockPtr = std::unique_ptr<GstClock, Unref<gst_object_unref>>;

// A clock like that of `clockselect clock-id=realtime`, but of this test alone: the default one of the process stays
// monotonic.
ClockPtr realtime_clock() {
  return ClockPtr(GST_CLOCK(gst_object_ref_sink(
      g_object_new(GST_TYPE_SYSTEM_CLOCK, "name", "realtime", "clock-type", GST_CLOCK_TYPE_REALTIME, nullptr))));
}

bool play(GstElement* pipeline) {
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  return gst_element_get_state(pipeline, nullptr, nullptr, 20 * GST_SECOND) != GST_STATE_CHANGE_FAILURE;
}

struct Answers {
  std::mutex mutex;
  std::vector<wire::Answer> seen;
};

GstPadProbeReturn note_answer(GstPad*, GstPadProbeInfo* info, gpointer data) {
  auto* answers = static_cast<Answers*>(data);
  auto answer = wire::decode_answer(to_bytes(GST_PAD_PROBE_INFO_BUFFER(info)));
  std::lock_guard lock(answers->mutex);
  if (answer) answers->seen.push_back(std::move(*answer));
  return GST_PAD_PROBE_OK;
}

// What leaves `pad` goes into `appsrc` too.
GstPadProbeReturn relay(GstPad*, GstPadProbeInfo* info, gpointer appsrc) {
  gst_app_src_push_buffer(GST_APP_SRC(appsrc), gst_buffer_copy(GST_PAD_PROBE_INFO_BUFFER(info)));  // it stamps it anew
  return GST_PAD_PROBE_OK;
}

void probe(GstElement* pipeline, const char* element, const char* pad_name, GstPadProbeCallback callback,
           gpointer data) {
  const ElementPtr owner(gst_bin_get_by_name(GST_BIN(pipeline), element));
  GstPad* pad = gst_element_get_static_pad(owner.get(), pad_name);
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, callback, data, nullptr);
  gst_object_unref(pad);
}

// A viewer on a realtime clock gives it to a node that began earlier, at another base time, in a process whose own
// clock is monotonic. The cameras film at the instants of the schedule, so that skew is 0 but for frames that were
// late.
TEST(NetClock, NodeAndViewerMeetOnTheSchedule) {
  const ArrayFixture array;
  const std::string port = std::to_string(free_port(SOCK_DGRAM));
  const ElementPtr viewer =
      launch("lfviewrequest name=r is-live=true framerate=5/1 capture-delay=1000000000 net-clock-port=" + port +
             " rig=" + array.rig_path() + " ! fakesink sync=false");
  const ElementPtr node = launch(
      "appsrc name=in is-live=true format=time caps=application/x-lightfield-request ! lfcameranode name=n "
      "is-live=true framerate=5/1 net-clock-address=127.0.0.1 net-clock-port=" +
      port + " rig=" + array.rig_path() + " ! fakesink sync=false async=false");
  ASSERT_TRUE(viewer && node);
  const ClockPtr clock = realtime_clock();
  gst_pipeline_use_clock(GST_PIPELINE(viewer.get()), clock.get());
  ASSERT_TRUE(play(viewer.get()));
  ASSERT_TRUE(play(node.get()));

  const ClockPtr followed(gst_pipeline_get_clock(GST_PIPELINE(node.get())));
  ASSERT_TRUE(GST_IS_NET_CLIENT_CLOCK(followed.get())) << "gst-launch-1.0 has it from the element";
  EXPECT_NE(gst_element_get_base_time(viewer.get()), gst_element_get_base_time(node.get()));

  Answers answers;
  const ElementPtr in(gst_bin_get_by_name(GST_BIN(node.get()), "in"));
  probe(node.get(), "n", "src", note_answer, &answers);
  probe(viewer.get(), "r", "src", relay, in.get());
  const uint64_t half = Schedule(5, 1).period() / 2;
  size_t near = 0;
  for (int i = 0; i < 200 && near < 10; i++) {
    g_usleep(50000);
    std::lock_guard lock(answers.mutex);
    near = 0;
    for (const wire::Answer& answer : answers.seen)
      near += answer.fragments.size() > 0 && answer.actual_time != kNoTime &&
              time_between(answer.actual_time, answer.target_time) <= half;
  }
  EXPECT_GE(near, 10u);
  gst_element_set_state(viewer.get(), GST_STATE_NULL);
  gst_element_set_state(node.get(), GST_STATE_NULL);
}

// What gst-launch-1.0 has for production: all elements are on the realtime clock.
TEST(ClockSelect, RealtimeReachesRequestsAndFrames) {
  const ArrayFixture array;
  const std::string rig = " rig=" + array.rig_path() + " is-live=true framerate=5/1 ";
  const ElementPtr pipeline = launch("clockselect. ( clock-id=realtime lfviewrequest capture-delay=1000000000" + rig +
                                     "! lfcameranode name=n" + rig + "! fakesink sync=false )");
  ASSERT_TRUE(pipeline);
  Answers answers;
  probe(pipeline.get(), "n", "src", note_answer, &answers);
  const auto before = static_cast<uint64_t>(g_get_real_time()) * GST_USECOND;
  ASSERT_TRUE(play(pipeline.get()));
  size_t near = 0;
  for (int i = 0; i < 200 && near < 5; i++) {
    g_usleep(50000);
    std::lock_guard lock(answers.mutex);
    near = 0;
    for (const wire::Answer& answer : answers.seen) {
      EXPECT_GT(answer.target_time + GST_SECOND, before);
      near += answer.actual_time == answer.target_time;  // the scene is filmed at the instants of the schedule
    }
  }
  EXPECT_GE(near, 5u);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

TEST(NetClock, EachElementFollowsAndGivesUpAgain) {
  const ArrayFixture array;
  const int port = free_port(SOCK_DGRAM);
  const ClockPtr clock = realtime_clock();
  GstNetTimeProvider* provider = gst_net_time_provider_new(clock.get(), "127.0.0.1", port);
  ASSERT_TRUE(provider);
  const std::string properties = " rig=" + array.rig_path() +
                                 " is-live=true net-clock-address=127.0.0.1 net-clock-port=" + std::to_string(port) +
                                 " ! fakesink async=false";
  for (const std::string element : {"lfcamsrc", "lfcameranode", "lfviewrequest"}) {
    const ElementPtr pipeline = launch(element + " name=e" + properties);
    ASSERT_TRUE(pipeline);
    for (int i = 0; i < 3; i++) {
      ASSERT_TRUE(play(pipeline.get())) << element;
      const ClockPtr followed(gst_pipeline_get_clock(GST_PIPELINE(pipeline.get())));
      ASSERT_TRUE(GST_IS_NET_CLIENT_CLOCK(followed.get())) << element;
      // Loosely: what the network clock is worth is not for us to test.
      EXPECT_LT(time_between(gst_clock_get_time(followed.get()), gst_clock_get_time(clock.get())), GST_SECOND)
          << element;
      gst_element_set_state(pipeline.get(), GST_STATE_READY);
      const ElementPtr e(gst_bin_get_by_name(GST_BIN(pipeline.get()), "e"));
      EXPECT_EQ(gst_element_provide_clock(e.get()), nullptr) << element;
    }
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  }
  gst_object_unref(provider);
}

TEST(NetClock, ErrorsNameThePlace) {
  const ArrayFixture array;
  const std::string rig = " rig=" + array.rig_path();
  const std::string nobody = std::to_string(free_port(SOCK_DGRAM));
  const struct {
    std::string properties, message;
  } cases[] = {
      {"net-clock-address=127.0.0.1", "needs net-clock-port"},
      {"net-clock-address=127.0.0.1 net-clock-port=" + nobody, "no clock answers at 127.0.0.1:" + nobody},
  };
  for (const auto& test : cases) {
    const ElementPtr pipeline = launch("lfcamsrc is-live=true " + test.properties + rig + " ! fakesink");
    ASSERT_TRUE(pipeline);
    EXPECT_THAT(run(pipeline.get()), HasSubstr(test.message));
  }
}

}  // namespace
}  // namespace lf::test
