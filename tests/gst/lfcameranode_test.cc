// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "gst/array_fixture.h"
#include "gst/camera_files.h"
#include "gst/gst_test.h"
#include "gst/other_rig.h"
#include "support/answer_codec.h"
#include "support/seeing.h"
#include "wire/request_codec.h"

namespace lf::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// lfcameranode in a harness: requests in, answers out. The cameras of the array have no files: they film the scene.
class LfCameraNodeTest : public testing::Test {
 protected:
  GstElement* make(const std::function<void(GstElement*)>& set = [](GstElement*) {}) {
    node_.reset(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make("lfcameranode", nullptr))));
    g_object_set(node_.get(), "rig", array_.rig_path().c_str(), "node", 7u, "framerate", 10, 1, nullptr);
    set(node_.get());
    return node_.get();
  }
  void play() {
    harness_.reset(gst_harness_new_with_element(node_.get(), "request", "src"));
    gst_harness_set_live(harness_.get(), FALSE);  // answers wait for the frames they need
    gst_harness_set_src_caps_str(harness_.get(), "application/x-lightfield-request,framerate=10/1");
  }
  wire::Answer ask(uint32_t sequence) { return ask(sequence, array_.rig().hash()); }
  wire::Answer ask(uint32_t sequence, uint64_t rig_hash) {
    const uint64_t time = sequence * 100 * GST_MSECOND;
    ViewRequest asked = array_.request(sequence, time);
    asked.rig_hash = rig_hash;
    GstBuffer* buffer = to_buffer(wire::encode_request(asked));
    GST_BUFFER_PTS(buffer) = time;
    EXPECT_EQ(gst_harness_push(harness_.get(), buffer), GST_FLOW_OK);
    const BufferPtr answer(gst_harness_pull(harness_.get()));
    std::string reason = "no answer";
    const auto decoded = answer ? wire::decode_answer(to_bytes(answer.get()), &reason) : std::nullopt;
    EXPECT_TRUE(decoded) << reason;
    return decoded.value_or(wire::Answer{});
  }
  static std::vector<CameraIndex> cameras_of(const wire::Answer& answer) { return seeing(answer); }

  // Puts the node into a pipeline of its own and changes its state: "" or the text of the error it posted.
  static std::string error_of(const std::string& properties, GstStateChangeReturn* result) {
    const ElementPtr pipeline = launch("lfcameranode name=n " + properties + " ! fakesink");
    *result = gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
    GstBus* bus = gst_element_get_bus(pipeline.get());
    GstMessage* message = gst_bus_timed_pop_filtered(bus, 5 * GST_SECOND, GST_MESSAGE_ERROR);
    gst_object_unref(bus);
    std::string text;
    if (message) {
      g_autoptr(GError) error = nullptr;
      gst_message_parse_error(message, &error, nullptr);
      text = error->message;
      gst_message_unref(message);
    }
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    return text;
  }

  ArrayFixture array_;
  ElementPtr node_;
  HarnessPtr harness_;  // goes first: it stops the node
};

TEST_F(LfCameraNodeTest, AnswersWithAllItsCameras) {
  make();
  play();
  for (uint32_t sequence = 0; sequence < 3; ++sequence) {
    const wire::Answer answer = ask(sequence);
    EXPECT_EQ(answer.node, 7u);
    EXPECT_EQ(answer.sequence, sequence);
    EXPECT_EQ(answer.rig_hash, array_.rig().hash());
    EXPECT_EQ(answer.actual_time, sequence * 100 * GST_MSECOND) << "the frame of that time";
    EXPECT_THAT(cameras_of(answer), ElementsAre(0, 1, 2, 3));
  }
  EXPECT_EQ(stat(node_.get(), "answers"), 3u);
}

TEST_F(LfCameraNodeTest, ElementsOfARigThatMayWriteNeedTrust) {
  const OtherRig described(array_.rig(), [](Rig& rig) {
    for (Camera& camera : rig.cameras) camera.source = "videotestsrc ! tee name=t t. ! queue";
  });
  GstStateChangeReturn result;
  EXPECT_THAT(error_of("rig=" + described.path(), &result), HasSubstr("its source has tee"));
  EXPECT_EQ(error_of("trusted=true rig=" + described.path(), &result), "");
  EXPECT_NE(result, GST_STATE_CHANGE_FAILURE);
  // Bins around it hand the property on.
  for (const char* factory : {"lfnodesink", "lfviewsrc"}) {
    const ElementPtr bin(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make(factory, nullptr))));
    g_object_set(bin.get(), "trusted", TRUE, "rig", described.path().c_str(), nullptr);
    gst_element_set_state(bin.get(), GST_STATE_READY);
    const ElementPtr node(gst_bin_get_by_name(GST_BIN(bin.get()), "node"));
    gboolean trusted = FALSE;
    if (node) g_object_get(node.get(), "trusted", &trusted, nullptr);
    EXPECT_TRUE(trusted) << factory;
    gst_element_set_state(bin.get(), GST_STATE_NULL);
  }
}

TEST_F(LfCameraNodeTest, FurtherRequestersHaveTheirOwnPads) {
  make();
  play();
  const auto further = [this] {
    HarnessPtr harness(gst_harness_new_with_element(node_.get(), "request_5", "src_5"));
    gst_harness_set_live(harness.get(), FALSE);
    gst_harness_set_src_caps_str(harness.get(), "application/x-lightfield-request,framerate=10/1");
    return harness;
  };
  for (int i = 0; i < 2; i++) {
    const HarnessPtr other = further();
    ASSERT_EQ(gst_harness_push(other.get(), to_buffer(wire::encode_request(array_.request(77, 0)))), GST_FLOW_OK);
    const BufferPtr answer(gst_harness_pull(other.get()));
    ASSERT_TRUE(answer);
    EXPECT_EQ(wire::decode_answer(to_bytes(answer.get())).value().sequence, 77u);
    EXPECT_EQ(cameras_of(ask(static_cast<uint32_t>(i))).size(), 4u);
  }
  EXPECT_EQ(gst_element_get_static_pad(node_.get(), "src_5"), nullptr) << "released with the harness";
}

TEST_F(LfCameraNodeTest, AnswersWithTheCamerasOfItsList) {
  make([](GstElement* node) { g_object_set(node, "cameras", "1,3", nullptr); });
  play();
  EXPECT_THAT(cameras_of(ask(0)), ElementsAre(1, 3));
}

TEST_F(LfCameraNodeTest, PropertiesReachTheCameras) {
  GstElement* node = make([](GstElement* element) {
    g_object_set(element, "framerate", 7, 2, "is-live", TRUE, "loop", TRUE, "cameras", "2", nullptr);
  });
  ASSERT_EQ(gst_element_set_state(node, GST_STATE_READY), GST_STATE_CHANGE_SUCCESS);
  const ElementPtr camera(gst_bin_get_by_name(GST_BIN(node), "camera2"));
  ASSERT_TRUE(camera);
  guint id = 0;
  gint numerator = 0, denominator = 0;
  gboolean live = FALSE, loop = FALSE;
  g_autofree gchar* rig = nullptr;
  g_object_get(camera.get(), "camera", &id, "is-live", &live, "loop", &loop, "rig", &rig, nullptr);
  GValue rate = G_VALUE_INIT;
  g_value_init(&rate, GST_TYPE_FRACTION);
  g_object_get_property(G_OBJECT(camera.get()), "framerate", &rate);
  numerator = gst_value_get_fraction_numerator(&rate);
  denominator = gst_value_get_fraction_denominator(&rate);
  g_value_unset(&rate);
  EXPECT_EQ(id, 2u);
  EXPECT_EQ(rig, array_.rig_path());
  EXPECT_EQ(numerator, 7);
  EXPECT_EQ(denominator, 2);
  EXPECT_TRUE(live);
  EXPECT_TRUE(loop);
  gst_element_set_state(node, GST_STATE_NULL);
}

TEST_F(LfCameraNodeTest, EndOfRequestsIsTheEndOfAnswers) {
  make();
  play();
  ask(0);
  EXPECT_TRUE(gst_harness_push_event(harness_.get(), gst_event_new_eos()));
  bool ended = false;
  for (int i = 0; i < 20 && !ended; ++i) {
    GstEvent* event = gst_harness_try_pull_event(harness_.get());
    if (!event) break;
    ended = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
    gst_event_unref(event);
  }
  EXPECT_TRUE(ended);
}

// The cameras wait in lffragment for requests that never come.
TEST_F(LfCameraNodeTest, StopsWhileItsCamerasAreBlocked) {
  GstElement* node = make();
  for (int i = 0; i < 30; ++i) {
    for (const GstState state :
         {GST_STATE_PAUSED, GST_STATE_PLAYING, GST_STATE_PAUSED, GST_STATE_READY, GST_STATE_PLAYING, GST_STATE_NULL}) {
      gst_element_set_state(node, state);
      ASSERT_NE(gst_element_get_state(node, nullptr, nullptr, 10 * GST_SECOND), GST_STATE_CHANGE_FAILURE);
      if (i % 3 == 0) g_usleep(2000);  // some get as far as to be blocked
    }
    ASSERT_EQ(GST_BIN_NUMCHILDREN(node), 1) << "only lffragment stays";
  }
  const ElementPtr fragment(gst_bin_get_by_name(GST_BIN(node), "fragment"));
  EXPECT_EQ(fragment->numsinkpads, 1) << "the pads of the cameras are given back";
}

TEST_F(LfCameraNodeTest, AnswersAgainAfterEachRestart) {
  make();
  for (int i = 0; i < 10; ++i) {
    play();
    ASSERT_EQ(seeing(ask(0)).size(), 4u) << i;
    harness_.reset();
    ASSERT_EQ(gst_element_set_state(node_.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  }
}

TEST_F(LfCameraNodeTest, PropertiesSetInReadyCount) {
  GstElement* node = make();
  ASSERT_EQ(gst_element_set_state(node, GST_STATE_READY), GST_STATE_CHANGE_SUCCESS);
  EXPECT_EQ(GST_BIN_NUMCHILDREN(node), 5);
  g_object_set(node, "cameras", "0-1", nullptr);
  play();
  EXPECT_THAT(cameras_of(ask(0)), ElementsAre(0, 1));
}

TEST_F(LfCameraNodeTest, FilesLoopUnderRequests) {
  const CameraFiles files;
  // The array's cameras, with films of another size.
  const std::string rig = files.save("rig.json", 3, [](Camera& camera) { camera.source = "mjpeg.mkv"; });
  const ElementPtr pipeline =
      launch("lfviewrequest name=r num-buffers=20 framerate=15/1 width=64 height=48 ! lfcameranode rig=" + rig +
             " loop=true name=n ! fakesink sync=false");
  ASSERT_TRUE(pipeline);
  ASSERT_EQ(run(pipeline.get()), "");
  const ElementPtr node(gst_bin_get_by_name(GST_BIN(pipeline.get()), "n"));
  EXPECT_EQ(stat(node.get(), "answers"), 20u) << "of 6 frames in each file";
  EXPECT_EQ(stat(node.get(), "missing-frames"), 0u);
}

// Frames stay compressed up to the view; at every stage of starting.
TEST_F(LfCameraNodeTest, JpegCamerasStartAndStop) {
  const CameraFiles files;
  for (const std::string source : {"mjpeg.mkv", "jpeg_%02d.jpg", "mjpeg.avi"}) {
    const std::string rig = files.save("rig.json", 3, [&](Camera& camera) { camera.source = source; });
    const ElementPtr pipeline =
        launch("lfviewrequest rig=" + rig +
               " is-live=true framerate=30/1 ! tee name=r  r. ! queue ! n.request  "
               "lfcameranode name=n is-live=true loop=true rig=" +
               rig + " ! queue ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c ! fakesink");
    ASSERT_TRUE(pipeline);
    for (int i = 0; i < 12; ++i) {
      ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << source;
      g_usleep(static_cast<gulong>(4000 * i));
      if (i == 11) {
        const ElementPtr node(gst_bin_get_by_name(GST_BIN(pipeline.get()), "n"));
        const ElementPtr compositor(gst_bin_get_by_name(GST_BIN(pipeline.get()), "c"));
        for (int k = 0; k < 100 && stat(compositor.get(), "pictures") <= 12; k++) g_usleep(50000);
        EXPECT_GT(stat(compositor.get(), "pictures"), 12u) << source;
        EXPECT_EQ(stat(node.get(), "damaged-frames"), 0u) << source;
        EXPECT_GT(stat(node.get(), "decode-ns-p99"), 0u) << source;
      }
      ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_NULL), GST_STATE_CHANGE_FAILURE) << source;
    }
  }
}

TEST_F(LfCameraNodeTest, ErrorsNameThePlace) {
  const CameraFiles files;
  const std::string missing =
      files.save("m.json", 2, [](Camera& camera) { camera.source = "nowhere_" + std::to_string(camera.id) + ".mkv"; });
  struct Case {
    std::string properties;
    std::vector<std::string> words;
  };
  for (const Case& c :
       {Case{"", {"rig: not set"}}, Case{"rig=" + files.path("none.json"), {"none.json", "no such file"}},
        Case{"rig=" + missing + " cameras=0-5", {missing, "0-5"}},
        Case{"rig=" + missing + " cameras=one", {missing, "one"}},
        Case{"rig=" + missing,
             {"No camera works", "camera 0", "nowhere_0.mkv", "camera 1", "nowhere_1.mkv", "no such file"}}}) {
    GstStateChangeReturn result = GST_STATE_CHANGE_SUCCESS;
    const std::string text = error_of(c.properties, &result);
    EXPECT_EQ(result, GST_STATE_CHANGE_FAILURE) << c.properties;
    for (const std::string& word : c.words) EXPECT_THAT(text, HasSubstr(word)) << c.properties;
  }
}

TEST_F(LfCameraNodeTest, ARigWithTheSameCamerasIsTakenWhileRunning) {
  const OtherRig calibrated(array_.rig(), [](Rig& rig) { rig.cameras[0].lens = Lens::pinhole(31, 15, 12); });
  const OtherRig moved(array_.rig(), [](Rig& rig) { rig.cameras[1].source = "elsewhere.mkv"; });
  const OtherRig smaller(array_.rig(), [](Rig& rig) {
    rig.cameras.pop_back();
    rig.topology = {};
  });
  make();
  play();
  const std::unique_ptr<GstBus, Unref<gst_object_unref>> bus(gst_bus_new());
  gst_element_set_bus(node_.get(), bus.get());
  EXPECT_EQ(seeing(ask(0)).size(), 4u);
  g_object_set(node_.get(), "rig", calibrated.path().c_str(), nullptr);
  EXPECT_EQ(seeing(ask(1, calibrated.hash())).size(), 4u);
  for (const OtherRig* other : {&moved, &smaller}) {
    g_object_set(node_.get(), "rig", other->path().c_str(), nullptr);
    GstMessage* message = gst_bus_pop_filtered(bus.get(), GST_MESSAGE_WARNING);
    ASSERT_TRUE(message);
    g_autoptr(GError) error = nullptr;
    gst_message_parse_warning(message, &error, nullptr);
    EXPECT_THAT(error->message, testing::AllOf(HasSubstr(other->path()), HasSubstr("started anew")));
    gst_message_unref(message);
    g_autofree gchar* kept = nullptr;
    g_object_get(node_.get(), "rig", &kept, nullptr);
    EXPECT_EQ(kept, calibrated.path());
    EXPECT_EQ(seeing(ask(2, calibrated.hash())).size(), 4u);
  }
}

TEST_F(LfCameraNodeTest, LiveCamerasMakeALiveNode) {
  GstElement* node = make([](GstElement* element) { g_object_set(element, "is-live", TRUE, nullptr); });
  EXPECT_EQ(gst_element_set_state(node, GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  gst_element_set_state(node, GST_STATE_NULL);
}

}  // namespace
}  // namespace lf::test
