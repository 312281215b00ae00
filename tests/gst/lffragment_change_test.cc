// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include "gst/fragment_fixture.h"
#include "gst/other_rig.h"
#include "support/seeing.h"

// Cameras and requesters that come and go, and rigs that are replaced, while lffragment runs.
namespace lf::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class LfFragmentChangeTest : public LfFragmentTest {
 protected:
  void start(int cameras, const char* format = "RGB", bool live = false) {
    LfFragmentTest::start(cameras, format, live);
    listen();
  }
  HarnessPtr join(int camera) {
    HarnessPtr harness(
        gst_harness_new_with_element(element_.get(), ("sink_" + std::to_string(camera)).c_str(), nullptr));
    gst_harness_set_live(harness.get(), FALSE);
    gst_harness_set_src_caps_str(harness.get(), ArrayFixture::caps("RGB").c_str());
    return harness;
  }
  HarnessPtr requester(int number) {
    const std::string n = std::to_string(number);
    HarnessPtr harness(gst_harness_new_with_element(element_.get(), ("request_" + n).c_str(), ("src_" + n).c_str()));
    gst_harness_set_live(harness.get(), FALSE);
    gst_harness_set_src_caps_str(harness.get(), "application/x-lightfield-request");
    return harness;
  }
  static GstFlowReturn push(const HarnessPtr& to, const ViewRequest& request) {
    return gst_harness_push(to.get(), to_buffer(wire::encode_request(request)));
  }
  std::vector<CameraIndex> cameras_in(const ViewRequest& asked) {
    EXPECT_EQ(request(asked), GST_FLOW_OK);
    return seeing(pull());
  }
};

TEST_F(LfFragmentChangeTest, ACameraJoinsWithItsFirstFrame) {
  start(3);
  push_frames(60, 0);
  gst_harness_set_live(harness_.get(), TRUE);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(harness_.get(), gst_event_new_segment(&segment));  // of a live stream: nobody is waited for
  cameras_.push_back(join(3));
  EXPECT_THAT(cameras_in(array_.request(0, 0)), ElementsAre(0, 1, 2));
  gst_harness_push(cameras_[3].get(), ArrayFixture::frame("RGB", 60, 0));
  EXPECT_THAT(cameras_in(array_.request(1, 0)), ElementsAre(0, 1, 2, 3));
}

TEST_F(LfFragmentChangeTest, ACameraLeavesWhileARequestWaitsForItAndComesBack) {
  start(4);
  push_frames(60, 0);
  std::vector<CameraIndex> answered;
  std::thread asking([&] { answered = cameras_in(array_.request(0, kFrame)); });
  for (int i = 0; i < 3; i++) gst_harness_push(cameras_[i].get(), ArrayFixture::frame("RGB", 60, kFrame));
  g_usleep(20000);
  cameras_.pop_back();
  asking.join();
  EXPECT_THAT(answered, ElementsAre(0, 1, 2));
  EXPECT_THAT(cameras_in(array_.request(1, kFrame)), ElementsAre(0, 1, 2));
  cameras_.push_back(join(3));
  gst_harness_push(cameras_[3].get(), ArrayFixture::frame("RGB", 60, kFrame));
  EXPECT_THAT(cameras_in(array_.request(2, kFrame)), ElementsAre(0, 1, 2, 3));
}

TEST_F(LfFragmentChangeTest, ACameraLeavesWhileItsStreamWaitsForRequests) {
  start(1);
  GstFlowReturn flow = GST_FLOW_OK;
  std::atomic<uint64_t> pushed = 0;
  std::thread streaming([&] {
    for (; flow == GST_FLOW_OK && pushed < 10; pushed++)
      flow = gst_harness_push(cameras_[0].get(), ArrayFixture::frame("RGB", 60, pushed * kFrame));
  });
  for (int i = 0; i < 5000 && pushed == 0; i++) g_usleep(1000);
  g_usleep(20000);
  GstPad* pad = gst_element_get_static_pad(element_.get(), "sink_0");
  gst_element_release_request_pad(element_.get(), pad);
  streaming.join();
  EXPECT_EQ(flow, GST_FLOW_FLUSHING);
  gst_object_unref(pad);
}

TEST_F(LfFragmentChangeTest, ARequesterLeavesWhileItsRequestWaits) {
  start(4);
  push_frames(60, 0);
  HarnessPtr other = requester(3);
  std::thread asking([&] { EXPECT_EQ(push(other, array_.request(0, kFrame)), GST_FLOW_FLUSHING); });
  for (int i = 0; i < 5000 && stat(element_.get(), "requests") == 0; i++) g_usleep(1000);
  g_usleep(20000);
  GstPad* pad = gst_element_get_static_pad(element_.get(), "request_3");
  gst_element_release_request_pad(element_.get(), pad);
  asking.join();
  gst_object_unref(pad);
  EXPECT_EQ(gst_element_get_static_pad(element_.get(), "src_3"), nullptr);
  EXPECT_EQ(cameras_in(array_.request(0, 0)).size(), 4u);
}

TEST_F(LfFragmentChangeTest, CamerasEndWhenTheLastRequesterThatHadNotEndedLeaves) {
  start(1);
  HarnessPtr other = requester(3);
  gst_harness_push_event(harness_.get(), gst_event_new_eos());
  EXPECT_EQ(gst_harness_push(cameras_[0].get(), ArrayFixture::frame("RGB", 1, 0)), GST_FLOW_OK);
  other.reset();
  EXPECT_EQ(gst_harness_push(cameras_[0].get(), ArrayFixture::frame("RGB", 1, kFrame)), GST_FLOW_EOS);
}

TEST_F(LfFragmentChangeTest, CamerasAndRequestersComeAndGoWhileOthersAsk) {
  start(3);
  push_frames(60, 0);
  std::atomic<bool> done = false;
  std::thread cameras([&] {
    while (!done) {
      const HarnessPtr camera = join(3);
      gst_harness_push(camera.get(), ArrayFixture::frame("RGB", 60, 0));
    }
  });
  std::thread requesters([&] {
    while (!done) {
      const HarnessPtr other = requester(3);
      EXPECT_EQ(push(other, array_.request(0, 0)), GST_FLOW_OK);
      const BufferPtr answer(gst_harness_pull(other.get()));
      EXPECT_TRUE(answer);
    }
  });
  for (uint32_t i = 0; i < 200; i++) EXPECT_GE(cameras_in(array_.request(i, 0)).size(), 3u);
  done = true;
  cameras.join();
  requesters.join();
}

// ------------------------------------------------------------------------------------------------------------ rigs

class LfFragmentRigTest : public LfFragmentChangeTest {
 protected:
  // Cameras of unlike brightness, at time 0.
  void push_unlike_frames() {
    for (size_t i = 0; i < cameras_.size(); i++)
      ASSERT_EQ(gst_harness_push(cameras_[i].get(), ArrayFixture::frame("RGB", static_cast<uint8_t>(50 + 60 * i), 0)),
                GST_FLOW_OK);
  }
  // The bytes of the answer to a request that is for any rig.
  std::vector<uint8_t> ask() {
    ViewRequest asked = array_.request(0, 0);
    asked.rig_hash = 0;
    EXPECT_EQ(request(asked), GST_FLOW_OK);
    const BufferPtr buffer(gst_harness_pull(harness_.get()));
    return buffer ? to_bytes(buffer.get()) : std::vector<uint8_t>{};
  }
  // What a node answers that was started with this rig.
  std::vector<uint8_t> answer_with(const std::string& rig) {
    LfFragmentRigTest::start(4);
    gst_element_set_state(element_.get(), GST_STATE_READY);
    set("rig", rig.c_str());
    gst_element_set_state(element_.get(), GST_STATE_PLAYING);
    for (const HarnessPtr& camera : cameras_)
      gst_harness_set_src_caps_str(camera.get(), ArrayFixture::caps("RGB").c_str());
    push_unlike_frames();
    const std::vector<uint8_t> answer = ask();
    cameras_.clear();
    harness_.reset();
    return answer;
  }
};

TEST_F(LfFragmentRigTest, AReplacedRigServesFromTheNextRequestOn) {
  const OtherRig longer(array_.rig(), [](Rig& rig) {
    for (Camera& camera : rig.cameras) camera.lens = Lens::pinhole(33, 15, 12);
  });
  const OtherRig turned(array_.rig(), [](Rig& rig) {  // the same ids, in another order
    std::swap(rig.cameras[0].id, rig.cameras[3].id);
  });
  for (const OtherRig* other : {&longer, &turned}) {
    const std::vector<uint8_t> before = answer_with(array_.rig_path()), after = answer_with(other->path());
    ASSERT_NE(before, after);
    start(4);
    push_unlike_frames();
    EXPECT_EQ(ask(), before);
    set("rig", other->path().c_str());
    EXPECT_EQ(ask(), after);
    set("rig", array_.rig_path().c_str());
    EXPECT_EQ(ask(), before);
    EXPECT_THAT(warnings(), IsEmpty());
    cameras_.clear();
    harness_.reset();
  }
}

TEST_F(LfFragmentRigTest, RequestsForAnotherRigAreCountedAndSaidOnce) {
  const OtherRig other(array_.rig(), [](Rig& rig) { rig.cameras[0].lens = Lens::pinhole(33, 15, 12); });
  start(4);
  push_frames(60, 0);
  set("rig", other.path().c_str());
  for (uint32_t i = 0; i < 3; i++) EXPECT_THAT(cameras_in(array_.request(i, 0)), IsEmpty());
  EXPECT_EQ(stat(element_.get(), "rig-mismatches"), 3u);
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("another rig")));
  ViewRequest asked = array_.request(3, 0);
  asked.rig_hash = other.hash();
  EXPECT_EQ(cameras_in(asked).size(), 4u);
}

TEST_F(LfFragmentRigTest, ACameraThatTheNewRigLacksGivesNothingUntilItIsBack) {
  const OtherRig without(array_.rig(), [](Rig& rig) {
    rig.cameras.erase(rig.cameras.begin() + 1);
    rig.topology = {};
  });
  start(4);
  push_frames(60, 0);
  set("rig", without.path().c_str());
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("no camera 1,")));
  ViewRequest asked = array_.request(0, 0);
  asked.rig_hash = without.hash();
  EXPECT_THAT(cameras_in(asked), ElementsAre(0, 1, 2));  // its places
  EXPECT_EQ(gst_harness_push(cameras_[1].get(), ArrayFixture::frame("RGB", 60, kFrame)), GST_FLOW_OK);
  set("rig", array_.rig_path().c_str());
  EXPECT_THAT(cameras_in(array_.request(1, 0)), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(warnings(), IsEmpty());
}

TEST_F(LfFragmentRigTest, ACameraOfAnotherSizeThanTheNewRigsIsMissingUntilItsVideoFits) {
  const OtherRig larger(array_.rig(), [](Rig& rig) {
    rig.cameras[2].width = 48;
    rig.cameras[2].lens = Lens::pinhole(30, 23.5, 11.5);
  });
  start(4);
  push_frames(60, 0);
  set("rig", larger.path().c_str());
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("another image size for camera 2,")));
  ViewRequest asked = array_.request(0, 0);
  asked.rig_hash = larger.hash();
  EXPECT_THAT(cameras_in(asked), ElementsAre(0, 1, 3));
  EXPECT_EQ(stat(element_.get(), "missing-frames"), 1u);
  gst_harness_set_src_caps_str(cameras_[2].get(), "video/x-raw,format=RGB,width=48,height=24,framerate=10/1");
  for (size_t i = 0; i < 4; i++) {
    GstBuffer* frame = i == 2 ? to_buffer(std::vector<uint8_t>(48 * 24 * 3, 60)) : ArrayFixture::frame("RGB", 60, 0);
    GST_BUFFER_PTS(frame) = kFrame;
    ASSERT_EQ(gst_harness_push(cameras_[i].get(), frame), GST_FLOW_OK);
  }
  asked.target_time = kFrame;
  EXPECT_THAT(cameras_in(asked), ElementsAre(0, 1, 2, 3));
}

// Its stream begins anew, as after a loss: that it does not fit has been told, and the other cameras go on.
TEST_F(LfFragmentRigTest, ACameraThatDoesNotFitTheNewRigMayBeginAnew) {
  const OtherRig larger(array_.rig(), [](Rig& rig) {
    rig.cameras[2].width = 48;
    rig.cameras[2].lens = Lens::pinhole(30, 23.5, 11.5);
  });
  start(4);
  push_frames(60, 0);
  set("rig", larger.path().c_str());
  const CapsPtr caps(gst_pad_get_current_caps(cameras_[2]->srcpad));
  gst_harness_push_event(cameras_[2].get(), gst_event_new_caps(caps.get()));
  push_frames(60, kFrame);
  ViewRequest asked = array_.request(0, kFrame);
  asked.rig_hash = larger.hash();
  EXPECT_THAT(cameras_in(asked), ElementsAre(0, 1, 3));
}

TEST_F(LfFragmentRigTest, VideoThatChangesItsSizeIsAnError) {
  start(4);
  push_frames(60, 0);
  gst_harness_set_src_caps_str(cameras_[2].get(), "video/x-raw,format=RGB,width=48,height=24,framerate=10/1");
  EXPECT_EQ(gst_harness_push(cameras_[2].get(), to_buffer(std::vector<uint8_t>(48 * 24 * 3, 60))),
            GST_FLOW_NOT_NEGOTIATED);
  EXPECT_THAT(warnings(GST_MESSAGE_ERROR), ElementsAre(HasSubstr("the video of camera 2 has 48x24 pixels")));
}

TEST_F(LfFragmentRigTest, AFileThatCannotBeReadChangesNothing) {
  const TempFile broken({'{', '}'}, ".json");
  start(4);
  push_frames(60, 0);
  for (const std::string& path : {std::string("/nowhere/rig.json"), broken.path()}) {
    set("rig", path.c_str());
    EXPECT_THAT(warnings(), ElementsAre(HasSubstr(path)));
    g_autofree gchar* kept = nullptr;
    g_object_get(element_.get(), "rig", &kept, nullptr);
    EXPECT_EQ(kept, array_.rig_path());
    EXPECT_EQ(cameras_in(array_.request(0, 0)).size(), 4u);
  }
}

TEST_F(LfFragmentRigTest, AFileThatHasChangedIsReadAgain) {
  const OtherRig other(array_.rig(), [](Rig& rig) { rig.cameras[0].lens = Lens::pinhole(33, 15, 12); });
  start(4);
  push_frames(60, 0);
  std::filesystem::copy_file(other.path(), array_.rig_path(), std::filesystem::copy_options::overwrite_existing);
  set("rig", array_.rig_path().c_str());
  ViewRequest asked = array_.request(0, 0);
  asked.rig_hash = other.hash();
  EXPECT_EQ(cameras_in(asked).size(), 4u);
}

TEST_F(LfFragmentRigTest, EveryAnswerIsOfOneRig) {
  const OtherRig other(array_.rig(), [](Rig& rig) {
    std::swap(rig.cameras[0].id, rig.cameras[3].id);
    rig.cameras[1].lens = Lens::pinhole(33, 15, 12);
  });
  const std::vector<uint8_t> before = answer_with(array_.rig_path()), after = answer_with(other.path());
  start(4);
  push_unlike_frames();
  std::atomic<bool> done = false;
  std::thread reloading([&] {
    for (int i = 0; !done; i++) set("rig", i % 2 ? array_.rig_path().c_str() : other.path().c_str());
  });
  for (int i = 0; i < 300; i++) EXPECT_THAT(ask(), testing::AnyOf(before, after));
  done = true;
  reloading.join();
}

}  // namespace
}  // namespace lf::test
