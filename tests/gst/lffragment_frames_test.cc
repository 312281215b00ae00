// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/video/video.h>

#include "common/custom_events.h"
#include "common/wall_clock.h"
#include "gst/fragment_fixture.h"

namespace lf::test {
namespace {

TEST_F(LfFragmentTest, UsesTheFrameNearestToTheRequestedTime) {
  start_showing(10);
  push_frames(250, kFrame);
  const ViewRequest early = array_.request(0, kFrame * 4 / 10), late = array_.request(1, kFrame * 6 / 10);
  const wire::Answer first = answer_to(early);
  EXPECT_EQ(first.actual_time, 0u);
  EXPECT_LE(picture_range(early, first).second, 11);
  const wire::Answer second = answer_to(late);
  EXPECT_EQ(second.actual_time, kFrame);
  EXPECT_GE(picture_range(late, second).first, 248);
}

TEST_F(LfFragmentTest, WaitsForTheFrameOfAFile) {
  start_showing(10);
  std::thread cameras([this] {
    g_usleep(50000);
    push_frames(90, kFrame);
  });
  ASSERT_EQ(request(array_.request(0, kFrame)), GST_FLOW_OK);
  cameras.join();
  EXPECT_EQ(pull().actual_time, kFrame);
}

TEST_F(LfFragmentTest, WaitsForCamerasWithoutFrames) {
  start(3);
  const HarnessPtr late(gst_harness_new_with_element(element_.get(), "sink_3", nullptr));
  gst_harness_set_live(late.get(), FALSE);
  push_frames(60, 0);
  std::thread camera([&late] {
    g_usleep(50000);
    gst_harness_set_src_caps_str(late.get(), ArrayFixture::caps("RGB").c_str());
    gst_harness_push(late.get(), ArrayFixture::frame("RGB", 60, 0));
  });
  ASSERT_EQ(request(array_.request(0, 0)), GST_FLOW_OK);
  camera.join();
  EXPECT_EQ(seeing(pull()).size(), 4u);
}

TEST_F(LfFragmentTest, FilesAreReadAtTheSpeedOfRequests) {
  start(1);
  std::atomic<int> pushed{0};
  std::thread camera([this, &pushed] {
    for (int i = 0; i < 6; i++, pushed++) push_frame(cameras_[0], 9, static_cast<uint64_t>(i) * kFrame);
  });
  g_usleep(100000);
  EXPECT_LE(pushed, 2);
  ASSERT_EQ(request(array_.request(0, 5 * kFrame)), GST_FLOW_OK);
  camera.join();
  EXPECT_EQ(pull().actual_time, 5 * kFrame);
}

TEST_F(LfFragmentTest, LastFrameOfAFileRepeats) {
  start_showing(10);
  end_cameras();
  const wire::Answer answer = answer_to(array_.request(0, 50 * kFrame));
  EXPECT_EQ(seeing(answer).size(), 4u);
  EXPECT_EQ(answer.actual_time, 0u);
}

TEST_F(LfFragmentTest, LiveCamerasAreNeverWaitedFor) {
  start(4, "RGB", true);
  set("max-skew", "0");
  for (int i = 0; i < 20; i++) push_frames(static_cast<uint8_t>(i), static_cast<uint64_t>(i) * kFrame);
  EXPECT_EQ(answer_to(array_.request(0, 100 * kFrame)).actual_time, 19 * kFrame);
  EXPECT_EQ(answer_to(array_.request(1, 18 * kFrame)).actual_time, 18 * kFrame);
}

// The frames of a still are copies of one buffer, with the same memory.
TEST_F(LfFragmentTest, FramesOfAStillAreOnePicture) {
  start(4, "RGB", true);
  const BufferPtr dark(ArrayFixture::frame("RGB", 10, 0)), light(ArrayFixture::frame("RGB", 250, 0));
  uint32_t frames = 0;
  for (const auto& [still, least, most] : {std::tuple(&dark, 9, 11), {&light, 248, 250}, {&dark, 9, 11}}) {
    GstMemory* const memory = gst_buffer_peek_memory(still->get(), 0);
    for (int i = 0; i < 6; i++, frames++)
      for (const auto& camera : cameras_) {
        GstBuffer* frame = gst_buffer_copy(still->get());
        GST_BUFFER_PTS(frame) = frames * kFrame;
        ASSERT_EQ(gst_harness_push(camera.get(), frame), GST_FLOW_OK);
      }
    const ViewRequest request = array_.request(frames, (frames - 1) * kFrame);
    const auto [darkest, lightest] = picture_range(request, answer_to(request));
    EXPECT_GE(darkest, least);
    EXPECT_LE(lightest, most);
    EXPECT_EQ(GST_MINI_OBJECT_REFCOUNT_VALUE(memory), 1 + static_cast<gint>(cameras_.size()));
  }
}

// V4L2 cameras stall if downstream holds all of their few buffers.
TEST_F(LfFragmentTest, CameraWithAFixedPoolNeverRunsOutOfBuffers) {
  for (const guint size : {3u, 4u, 8u, 32u}) {
    cameras_.clear();
    start(1, "RGB", true);
    GstBufferPool* pool = gst_buffer_pool_new();
    const BufferPtr picture(ArrayFixture::frame("RGB", 77, 0));
    GstStructure* config = gst_buffer_pool_get_config(pool);
    const CapsPtr caps(gst_caps_from_string(ArrayFixture::caps("RGB").c_str()));
    gst_buffer_pool_config_set_params(config, caps.get(), static_cast<guint>(gst_buffer_get_size(picture.get())), size,
                                      size);
    ASSERT_TRUE(gst_buffer_pool_set_config(pool, config));
    ASSERT_TRUE(gst_buffer_pool_set_active(pool, TRUE));
    GstBufferPoolAcquireParams dont_wait{};
    dont_wait.flags = GST_BUFFER_POOL_ACQUIRE_FLAG_DONTWAIT;
    for (uint64_t i = 0; i < 40; i++) {
      GstBuffer* buffer = nullptr;
      ASSERT_EQ(gst_buffer_pool_acquire_buffer(pool, &buffer, &dont_wait), GST_FLOW_OK)
          << "all " << size << " are held after " << i << " frames";
      gst_buffer_fill(buffer, 0, to_bytes(picture.get()).data(), gst_buffer_get_size(picture.get()));
      GST_BUFFER_PTS(buffer) = i * kFrame;
      ASSERT_EQ(gst_harness_push(cameras_[0].get(), buffer), GST_FLOW_OK);
    }
    EXPECT_EQ(answer_to(array_.request(0, 37 * kFrame)).actual_time, 37 * kFrame) << "frames unchanged by copying";
    gst_buffer_pool_set_active(pool, FALSE);
    gst_object_unref(pool);
  }
}

TEST_F(LfFragmentTest, AllocationAnswerStatesTheNumberOfKeptFrames) {
  for (const bool live : {true, false}) {
    cameras_.clear();
    start(1, "RGB", live);
    const CapsPtr caps(gst_caps_from_string(ArrayFixture::caps("RGB").c_str()));
    GstQuery* query = gst_query_new_allocation(caps.get(), TRUE);
    ASSERT_TRUE(gst_pad_peer_query(cameras_[0]->srcpad, query));
    ASSERT_EQ(gst_query_get_n_allocation_pools(query), 1u);
    GstBufferPool* pool = nullptr;
    guint size = 0, least = 0, most = 1;
    gst_query_parse_nth_allocation_pool(query, 0, &pool, &size, &least, &most);
    EXPECT_FALSE(pool);
    EXPECT_EQ(least, live ? 5u : 3u);
    EXPECT_EQ(most, 0u);
    EXPECT_TRUE(gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr));
    gst_query_unref(query);
  }
}

TEST_F(LfFragmentTest, ShutsDownWhileARequestWaits) {
  start(4);
  std::thread requester([this] { request(array_.request(0, kFrame)); });
  g_usleep(30000);
  gst_element_set_state(element_.get(), GST_STATE_NULL);
  requester.join();
}

// --- Live frames -----------------------------------------------------------------------------------------------------

class LfFragmentClockTest : public LfFragmentTest {
 protected:
  static constexpr uint64_t kEpoch = 1'700'000'000ull * GST_SECOND;  // a realtime clock's reading

  void start_at(uint64_t base, int cameras) {
    start(cameras, "RGB", true);
    listen();
    gst_element_set_base_time(element_.get(), base);
    base_ = base;
  }
  void push_taken(size_t camera, uint64_t clock_time) { push_frame(cameras_[camera], 200, clock_time - base_); }
  wire::Answer ask(uint32_t sequence, uint64_t clock_time) {
    ViewRequest asked = array_.request(sequence, clock_time);
    asked.absolute_time = true;
    return answer_to(asked);
  }
  uint64_t base_ = 0;
};

TEST_F(LfFragmentClockTest, CaptureTimesDoNotDependOnTheBaseTime) {
  for (const uint64_t base : {kEpoch - 3 * GST_SECOND, kEpoch - 3600 * GST_SECOND + 12345, uint64_t{0}}) {
    start_at(base, 4);
    for (uint64_t k = 0; k < 4; k++)
      for (size_t i = 0; i < 4; i++) push_taken(i, kEpoch + k * kFrame + 7 * GST_MSECOND);
    const wire::Answer answer = ask(0, kEpoch + kFrame);
    EXPECT_EQ(answer.target_time, kEpoch + kFrame);
    EXPECT_EQ(answer.actual_time, kEpoch + kFrame + 7 * GST_MSECOND) << base;
    EXPECT_EQ(seeing(answer).size(), 4u);
  }
}

// A time server has set the time of day back by 40 s since the frames' pipeline started: requests carry the new time.
TEST_F(LfFragmentClockTest, RequestsFollowStepsOfTheTimeOfDay) {
  g_autoptr(GstClock) clock = new_wall_clock();
  GstClockTime internal, external, numerator, denominator;
  gst_clock_get_calibration(clock, &internal, &external, &numerator, &denominator);
  gst_clock_set_calibration(clock, internal, external + 40 * GST_SECOND, numerator, denominator);
  start_at(kEpoch - 3 * GST_SECOND, 4);
  gst_element_set_clock(element_.get(), clock);
  const GstClockTimeDiff offset = wall_offset(clock);
  ASSERT_NEAR(static_cast<double>(offset), -40e9, 1e7);
  for (uint64_t k = 0; k < 4; k++)
    for (size_t i = 0; i < 4; i++) push_taken(i, kEpoch + k * kFrame + 7 * GST_MSECOND);
  const wire::Answer answer = ask(0, kEpoch + kFrame + static_cast<uint64_t>(offset));
  EXPECT_EQ(answer.target_time, kEpoch + kFrame + static_cast<uint64_t>(offset));
  EXPECT_EQ(answer.actual_time, kEpoch + kFrame + 7 * GST_MSECOND + static_cast<uint64_t>(offset));
  EXPECT_EQ(seeing(answer).size(), 4u);
}

// Unsynchronised cameras: each has its own rate, phase and latency and loses frames. The nearest frame is at most half
// a frame interval away, or a whole one next to a lost frame.
TEST_F(LfFragmentClockTest, FreeRunningCamerasStayWithinHalfAFrame) {
  const double rates[] = {29.7, 29.9, 30.1, 30.3};
  // delay from the requested time to the request; frames take up to 70 ms
  constexpr uint64_t kDelay = 110 * GST_MSECOND;
  std::mt19937 random(5);
  const auto chance = [&random] { return std::uniform_real_distribution<>(0, 1)(random); };
  for (const double loss : {0.0, 0.03}) {
    start_at(kEpoch - 1234567891, 4);
    struct Event {
      uint64_t when;
      size_t camera;
      uint64_t time;
    };
    std::vector<Event> events;
    std::vector<uint64_t> taken[4];
    for (size_t i = 0; i < 4; i++) {
      uint64_t arrived = 0;
      const double phase = chance(), latency = 40e6 * chance();
      for (int k = 0; k < 400; k++) {
        const auto time = kEpoch + static_cast<uint64_t>((k + phase) * 1e9 / rates[i]);
        if (chance() < loss) continue;
        arrived = std::max(arrived, time + static_cast<uint64_t>(latency + 30e6 * chance()));
        taken[i].push_back(time);
        events.push_back({arrived, i, time});
      }
    }
    const Schedule schedule(30, 1);
    const uint64_t first = schedule.first_from(kEpoch + GST_SECOND);
    for (uint64_t k = first; k < first + 330; k++)
      events.push_back({schedule.instant(k) + kDelay, 4, schedule.instant(k)});
    std::stable_sort(events.begin(), events.end(), [](const Event& a, const Event& b) { return a.when < b.when; });

    const auto slowest = static_cast<uint64_t>(1e9 / rates[0]);
    uint64_t worst = 0;
    size_t requests = 0, within_half = 0;
    for (const Event& event : events) {
      if (event.camera < 4) {
        push_taken(event.camera, event.time);
        continue;
      }
      const wire::Answer answer = ask(static_cast<uint32_t>(requests++), event.time);
      ASSERT_EQ(seeing(answer).size(), 4u);
      uint64_t expected = 0, gap = 0;
      for (const std::vector<uint64_t>& times : taken) {
        const auto after = std::lower_bound(times.begin(), times.end(), event.time);
        ASSERT_TRUE(after != times.begin() && after != times.end());
        expected = std::max(expected, std::min(*after - event.time, event.time - *(after - 1)));
        gap = std::max(gap, *after - *(after - 1));
      }
      const uint64_t skew = time_between(answer.actual_time, event.time);
      ASSERT_EQ(skew, expected) << requests;
      ASSERT_LE(skew, gap / 2 + 1) << requests;
      within_half += skew <= slowest / 2 + 1;
      worst = std::max(worst, skew);
    }
    std::printf(
        "%.0f %% of frames lost: worst skew of an answer %.2f ms, %.1f %% of answers within half a frame time\n",
        100 * loss, static_cast<double>(worst) / 1e6, 100.0 * within_half / requests);
    EXPECT_EQ(stat(element_.get(), "max-skew-ns"), worst);
    if (loss == 0) {
      EXPECT_EQ(within_half, requests);
    }
    EXPECT_LT(worst, 3 * slowest);
    EXPECT_TRUE(warnings().empty()) << "no warning about lost frames";
  }
}

// The reported capture delay is the latency of the slowest camera plus half a frame interval.
TEST_F(LfFragmentClockTest, ReportsTheCaptureDelayOfTheCameras) {
  start_at(kEpoch, 2);
  make_live();
  gst_harness_use_testclock(harness_.get());
  for (uint64_t k = 0; k < 5; k++) {
    gst_harness_set_time(harness_.get(), kEpoch + k * kFrame + 20 * GST_MSECOND);
    push_taken(0, kEpoch + k * kFrame);
    gst_harness_set_time(harness_.get(), kEpoch + k * kFrame + 70 * GST_MSECOND);
    push_taken(1, kEpoch + k * kFrame);
  }
  ask(0, kEpoch + 4 * kFrame);
  GstClockTime told = 0, delay = 0;
  while (const EventPtr event{gst_harness_try_pull_upstream_event(harness_.get())})
    if (parse_capture_delay(event.get(), &delay)) told = delay;
  EXPECT_EQ(told, 70 * GST_MSECOND + kFrame / 2);
}

TEST_F(LfFragmentClockTest, StoppedCameraIsBlind) {
  start_at(kEpoch, 4);
  const auto at = [](uint64_t k) { return kEpoch + k * kFrame; };
  for (uint64_t k = 0; k < 5; k++)
    for (size_t i = 0; i < 4; i++) push_taken(i, at(k));
  for (uint64_t k = 5; k < 20; k++) {
    for (const size_t i : {0, 1, 3}) push_taken(i, at(k));
    const wire::Answer answer = ask(static_cast<uint32_t>(k), at(k));
    const bool stale = k > 4 + 5;
    EXPECT_EQ(answer.cameras.size(), 4u) << k;
    EXPECT_EQ(answer.blind.contains(2), stale) << k;
    EXPECT_EQ(answer.actual_time, stale ? at(k) : at(4)) << k;
  }
  EXPECT_EQ(stat(element_.get(), "stale-frames"), 10u);
  EXPECT_EQ(stat(element_.get(), "missing-frames"), 10u);
  EXPECT_THAT(warnings(),
              ElementsAre(AllOf(mentions("node 7"), HasSubstr("camera 2 "), mentions("100 ms"), HasSubstr("too old"))));
  ViewRequest without = array_.request(20, at(19));
  without.absolute_time = true;
  without.out_of_service = {2};
  ASSERT_EQ(request(without), GST_FLOW_OK);
  EXPECT_EQ(pull().blind, CameraRanges(CameraSet{2})) << "back in service only with frames";
  set("max-skew", "0");
  EXPECT_TRUE(ask(20, at(20)).blind.empty()) << "any frame is accepted";
}

TEST_F(LfFragmentClockTest, UnsynchronisedNodeIsReportedOnce) {
  start_at(kEpoch, 4);
  for (uint64_t k = 0; k < 30; k++) {  // its clock is ahead of the viewer's
    for (size_t i = 0; i < 4; i++) push_taken(i, kEpoch + k * kFrame + 700 * GST_MSECOND);
    ask(static_cast<uint32_t>(k), kEpoch + k * kFrame);
  }
  EXPECT_THAT(warnings(), ElementsAre(AllOf(mentions("node 7"), mentions("camera 0, 1, 2, 3"), HasSubstr("too new"))));
}

// --- Cameras and clients that come and go, and rigs that are replaced ------------------------------------------------

class LfFragmentChangeTest : public LfFragmentTest {
 protected:
  void start(int cameras, const char* format = "RGB", bool live = false) override {
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
  std::vector<CameraIndex> cameras_in(const ViewRequest& asked) { return seeing(answer_to(asked)); }
};

TEST_F(LfFragmentChangeTest, CameraJoinsWithItsFirstFrame) {
  start_showing(60, 3);
  make_live();
  cameras_.push_back(join(3));
  EXPECT_THAT(cameras_in(array_.request(0, 0)), ElementsAre(0, 1, 2));
  push_frame(cameras_[3], 60, 0);
  EXPECT_THAT(cameras_in(array_.request(1, 0)), ElementsAre(0, 1, 2, 3));
}

TEST_F(LfFragmentChangeTest, CameraLeavesDuringARequestAndReturns) {
  start_showing(60);
  std::vector<CameraIndex> answered;
  std::thread asking([&] { answered = cameras_in(array_.request(0, kFrame)); });
  for (int i = 0; i < 3; i++) push_frame(cameras_[i], 60, kFrame);
  g_usleep(20000);
  cameras_.pop_back();
  asking.join();
  EXPECT_THAT(answered, ElementsAre(0, 1, 2));
  EXPECT_THAT(cameras_in(array_.request(1, kFrame)), ElementsAre(0, 1, 2));
  cameras_.push_back(join(3));
  push_frame(cameras_[3], 60, kFrame);
  EXPECT_THAT(cameras_in(array_.request(2, kFrame)), ElementsAre(0, 1, 2, 3));
}

TEST_F(LfFragmentChangeTest, CameraLeavesWhileItsStreamIsBlocked) {
  start(1);
  GstFlowReturn flow = GST_FLOW_OK;
  std::atomic<uint64_t> pushed = 0;
  std::thread streaming([&] {
    for (; flow == GST_FLOW_OK && pushed < 10; pushed++)
      flow = gst_harness_push(cameras_[0].get(), ArrayFixture::frame("RGB", 60, pushed * kFrame));
  });
  EXPECT_TRUE(eventually([&] { return pushed > 0; }));
  g_usleep(20000);
  gst_element_release_request_pad(element_.get(), pad_of(element_.get(), "sink_0").get());
  streaming.join();
  EXPECT_EQ(flow, GST_FLOW_FLUSHING);
}

TEST_F(LfFragmentChangeTest, ClientLeavesWhileItsRequestWaits) {
  start_showing(60);
  HarnessPtr other = requester(3);
  std::thread asking([&] { EXPECT_EQ(push(other, array_.request(0, kFrame)), GST_FLOW_FLUSHING); });
  EXPECT_TRUE(eventually([&] { return stat(element_.get(), "requests") > 0; }));
  g_usleep(20000);
  gst_element_release_request_pad(element_.get(), pad_of(element_.get(), "request_3").get());
  asking.join();
  EXPECT_FALSE(pad_of(element_.get(), "src_3"));
  EXPECT_EQ(cameras_in(array_.request(0, 0)).size(), 4u);
}

TEST_F(LfFragmentChangeTest, CamerasEndWithTheLastClient) {
  start(1);
  HarnessPtr other = requester(3);
  gst_harness_push_event(harness_.get(), gst_event_new_eos());
  EXPECT_EQ(gst_harness_push(cameras_[0].get(), ArrayFixture::frame("RGB", 1, 0)), GST_FLOW_OK);
  other.reset();
  EXPECT_EQ(gst_harness_push(cameras_[0].get(), ArrayFixture::frame("RGB", 1, kFrame)), GST_FLOW_EOS);
}

TEST_F(LfFragmentChangeTest, CamerasAndClientsAreAddedAndRemovedWhilePlaying) {
  start_showing(60, 3);
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

// --- Rigs ------------------------------------------------------------------------------------------------------------

class LfFragmentRigTest : public LfFragmentChangeTest {
 protected:
  void push_unlike_frames() {
    for (size_t i = 0; i < cameras_.size(); i++) push_frame(cameras_[i], static_cast<uint8_t>(50 + 60 * i), 0);
  }
  std::vector<uint8_t> ask() {
    ViewRequest asked = array_.request(0, 0);
    asked.rig_hash = 0;
    EXPECT_EQ(request(asked), GST_FLOW_OK);
    const BufferPtr buffer(gst_harness_pull(harness_.get()));
    return buffer ? to_bytes(buffer.get()) : std::vector<uint8_t>{};
  }
  ViewRequest request_with(const ModifiedRig& rig, uint32_t sequence, uint64_t time) const {
    ViewRequest asked = array_.request(sequence, time);
    asked.rig_hash = rig.hash();
    return asked;
  }
  std::vector<uint8_t> answer_with(const std::string& rig) {
    LfFragmentRigTest::start(4);
    gst_element_set_state(element_.get(), GST_STATE_READY);
    set("rig", rig.c_str());
    gst_element_set_state(element_.get(), GST_STATE_PLAYING);
    for (const HarnessPtr& camera : cameras_)
      gst_harness_set_src_caps_str(camera.get(), ArrayFixture::caps("RGB").c_str());
    push_unlike_frames();
    return ask();
  }

  const ModifiedRig calibrated_{array_.rig(), [](Rig& rig) { rig.cameras[0].lens = Lens::pinhole(33, 15, 12); }};
  const ModifiedRig larger_{array_.rig(), [](Rig& rig) {
                              rig.cameras[2].width = 48;
                              rig.cameras[2].lens = Lens::pinhole(30, 23.5, 11.5);
                            }};
};

TEST_F(LfFragmentRigTest, NewRigIsUsedFromTheNextRequest) {
  const ModifiedRig longer(array_.rig(), [](Rig& rig) {
    for (Camera& camera : rig.cameras) camera.lens = Lens::pinhole(33, 15, 12);
  });
  const ModifiedRig turned(array_.rig(), [](Rig& rig) {  // the same ids in another order
    std::swap(rig.cameras[0].id, rig.cameras[3].id);
  });
  for (const ModifiedRig* other : {&longer, &turned}) {
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
  }
}

TEST_F(LfFragmentRigTest, RequestsForAnotherRigAreCountedAndReportedOnce) {
  start_showing(60);
  set("rig", calibrated_.path().c_str());
  for (uint32_t i = 0; i < 3; i++) EXPECT_THAT(cameras_in(array_.request(i, 0)), IsEmpty());
  EXPECT_EQ(stat(element_.get(), "rig-mismatches"), 3u);
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("another rig")));
  EXPECT_EQ(cameras_in(request_with(calibrated_, 3, 0)).size(), 4u);
}

TEST_F(LfFragmentRigTest, CameraMissingInTheNewRigDoesNotContribute) {
  const ModifiedRig without(array_.rig(), [](Rig& rig) {
    rig.cameras.erase(rig.cameras.begin() + 1);
    rig.topology = {};
  });
  start_showing(60);
  set("rig", without.path().c_str());
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("no camera 1,")));
  EXPECT_THAT(cameras_in(request_with(without, 0, 0)), ElementsAre(0, 1, 2));
  push_frame(cameras_[1], 60, kFrame);
  set("rig", array_.rig_path().c_str());
  EXPECT_THAT(cameras_in(array_.request(1, 0)), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(warnings(), IsEmpty());
}

TEST_F(LfFragmentRigTest, CameraOfAnotherSizeIsMissingUntilItsVideoFits) {
  start_showing(60);
  set("rig", larger_.path().c_str());
  EXPECT_THAT(warnings(), ElementsAre(mentions("image size", "camera 2")));
  EXPECT_THAT(cameras_in(request_with(larger_, 0, 0)), ElementsAre(0, 1, 3));
  EXPECT_EQ(stat(element_.get(), "missing-frames"), 1u);
  gst_harness_set_src_caps_str(cameras_[2].get(), "video/x-raw,format=RGB,width=48,height=24,framerate=10/1");
  for (size_t i = 0; i < 4; i++) {
    GstBuffer* frame = i == 2 ? to_buffer(std::vector<uint8_t>(48 * 24 * 3, 60)) : ArrayFixture::frame("RGB", 60, 0);
    GST_BUFFER_PTS(frame) = kFrame;
    ASSERT_EQ(gst_harness_push(cameras_[i].get(), frame), GST_FLOW_OK);
  }
  EXPECT_THAT(cameras_in(request_with(larger_, 0, kFrame)), ElementsAre(0, 1, 2, 3));
}

// The camera's stream restarts after a loss: the mismatch was reported already.
TEST_F(LfFragmentRigTest, CameraThatDoesNotFitTheNewRigMayRestart) {
  start_showing(60);
  set("rig", larger_.path().c_str());
  const CapsPtr caps(gst_pad_get_current_caps(cameras_[2]->srcpad));
  gst_harness_push_event(cameras_[2].get(), gst_event_new_caps(caps.get()));
  push_frames(60, kFrame);
  EXPECT_THAT(cameras_in(request_with(larger_, 0, kFrame)), ElementsAre(0, 1, 3));
}

TEST_F(LfFragmentRigTest, ChangeOfVideoSizeIsAnError) {
  start_showing(60);
  gst_harness_set_src_caps_str(cameras_[2].get(), "video/x-raw,format=RGB,width=48,height=24,framerate=10/1");
  EXPECT_EQ(gst_harness_push(cameras_[2].get(), to_buffer(std::vector<uint8_t>(48 * 24 * 3, 60))),
            GST_FLOW_NOT_NEGOTIATED);
  EXPECT_THAT(warnings(GST_MESSAGE_ERROR), ElementsAre(mentions("camera 2", "48x24")));
}

TEST_F(LfFragmentRigTest, UnreadableRigChangesNothing) {
  const TempFile broken("{}", ".json");
  start_showing(60);
  for (const std::string& path : {std::string("/nowhere/rig.json"), broken.path()}) {
    set("rig", path.c_str());
    EXPECT_THAT(warnings(), ElementsAre(HasSubstr(path)));
    EXPECT_EQ(get<std::string>(element_.get(), "rig"), array_.rig_path());
    EXPECT_EQ(cameras_in(array_.request(0, 0)).size(), 4u);
  }
}

TEST_F(LfFragmentRigTest, ChangedRigFileIsReadAgain) {
  start_showing(60);
  std::filesystem::copy_file(calibrated_.path(), array_.rig_path(), std::filesystem::copy_options::overwrite_existing);
  set("rig", array_.rig_path().c_str());
  EXPECT_EQ(cameras_in(request_with(calibrated_, 0, 0)).size(), 4u);
}

TEST_F(LfFragmentRigTest, EveryAnswerUsesOneRig) {
  const ModifiedRig other(array_.rig(), [](Rig& rig) {
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
  for (int i = 0; i < 300; i++) EXPECT_THAT(ask(), AnyOf(before, after));
  done = true;
  reloading.join();
}

}  // namespace
}  // namespace lf::test
