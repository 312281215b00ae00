// SPDX-License-Identifier: LGPL-2.1-or-later
#include <sys/mount.h>

#include "bins/lfcameranode.h"
#include "gst/array_fixture.h"
#include "gst/loss_fixture.h"
#include "support/answers.h"
#include "support/recorded.h"
#include "support/temp_dir.h"
#include "wire/request_codec.h"

namespace lf::test {
namespace {

std::vector<std::string> cameras(int first, int last, const std::string& why) {
  std::vector<std::string> reasons;
  for (int id = first; id <= last; id++)
    reasons.push_back("rig.json: camera " + std::to_string(id) + ": rtsp://host/" + std::to_string(id) + ": " + why);
  return reasons;
}

TEST(GroupedReasons, EmptyWithoutReasons) { EXPECT_EQ(grouped_reasons({}, "; "), ""); }

TEST(GroupedReasons, FewReasonsAreListed) {
  EXPECT_EQ(grouped_reasons(cameras(0, 1, "it is gone"), "; "),
            "rig.json: camera 0: rtsp://host/0: it is gone; rig.json: camera 1: rtsp://host/1: it is gone");
  EXPECT_EQ(grouped_reasons(std::vector<std::string>{"no place"}, "; "), "no place");
}

TEST(GroupedReasons, EqualReasonsAreGrouped) {
  EXPECT_MENTIONS(grouped_reasons(cameras(0, 63, "it is gone"), "; "), "64 cameras", "it is gone",
                  "rig.json: camera 0: rtsp://host/0");
  EXPECT_MENTIONS(grouped_reasons(std::vector<std::string>(4, "no place"), "; "), "4 cameras", "no place");
}

TEST(GroupedReasons, DifferentReasonsStaySeparate) {
  std::vector<std::string> reasons = cameras(0, 0, "it is busy");
  for (const std::string& reason : cameras(1, 4, "it is gone")) reasons.push_back(reason);
  reasons.push_back("rig.json: camera 5: no such file");
  const std::string told = grouped_reasons(reasons, "\n");
  EXPECT_EQ(std::ranges::count(told, '\n'), 2);
  EXPECT_MENTIONS(told, "rig.json: camera 0: rtsp://host/0: it is busy");
  EXPECT_MENTIONS(told, "4 cameras", "it is gone", "rig.json: camera 1: rtsp://host/1");
  EXPECT_MENTIONS(told, "rig.json: camera 5: no such file");
}

class LfCameraNodeTest : public testing::Test {
 protected:
  GstElement* make(const std::function<void(GstElement*)>& set = [](GstElement*) {}) {
    node_ = make_element("lfcameranode");
    g_object_set(node_.get(), "rig", array_.rig_path().c_str(), "node", 7u, "framerate", 10, 1, nullptr);
    set(node_.get());
    return node_.get();
  }
  void play() {
    harness_.reset(gst_harness_new_with_element(node_.get(), "request", "src"));
    gst_harness_set_live(harness_.get(), FALSE);  // answers wait for their frames
    gst_harness_set_src_caps_str(harness_.get(), "application/x-lightfield-request,framerate=10/1");
  }
  wire::Answer ask(uint32_t sequence, std::optional<uint64_t> rig_hash = {}) {
    const uint64_t time = sequence * 100 * GST_MSECOND;
    ViewRequest asked = array_.request(sequence, time);
    asked.rig_hash = rig_hash.value_or(asked.rig_hash);
    GstBuffer* buffer = to_buffer(wire::encode_request(asked));
    GST_BUFFER_PTS(buffer) = time;
    EXPECT_EQ(gst_harness_push(harness_.get(), buffer), GST_FLOW_OK);
    const BufferPtr answer(gst_harness_pull(harness_.get()));
    std::string reason = "no answer";
    const auto decoded = answer ? wire::decode_answer(to_bytes(answer.get()), &reason) : std::nullopt;
    EXPECT_TRUE(decoded) << reason;
    return decoded.value_or(wire::Answer{});
  }
  // Changes the state of a pipeline with the node. Returns "" or the text of the error message.
  static std::string error_of(const std::string& properties, GstStateChangeReturn* result) {
    const PipelinePtr pipeline = launch("lfcameranode name=n " + properties + " ! fakesink");
    *result = gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline.get());
    const MessagePtr message(gst_bus_timed_pop_filtered(bus, 5 * GST_SECOND, GST_MESSAGE_ERROR));
    return message ? text_of(message.get()) : "";
  }

  ArrayFixture array_;
  ElementPtr node_;
  HarnessPtr harness_;  // destroyed first, which stops the node
};

TEST_F(LfCameraNodeTest, AnswersWithAllItsCameras) {
  make();
  play();
  for (uint32_t sequence = 0; sequence < 3; ++sequence) {
    const wire::Answer answer = ask(sequence);
    EXPECT_EQ(answer.node, 7u);
    EXPECT_EQ(answer.sequence, sequence);
    EXPECT_EQ(answer.rig_hash, array_.rig().hash());
    EXPECT_EQ(answer.actual_time, sequence * 100 * GST_MSECOND) << "frame at the requested time";
    EXPECT_THAT(seeing(answer), ElementsAre(0, 1, 2, 3));
  }
  EXPECT_EQ(stat(node_.get(), "answers"), 3u);
}

TEST_F(LfCameraNodeTest, ElementsThatMayWriteFilesNeedTrust) {
  const ModifiedRig described(array_.rig(), [](Rig& rig) {
    for (Camera& camera : rig.cameras) camera.source = "videotestsrc ! tee name=t t. ! queue";
  });
  GstStateChangeReturn result;
  EXPECT_THAT(error_of("rig=" + described.path(), &result), mentions("source", "tee"));
  EXPECT_EQ(error_of("trusted=true rig=" + described.path(), &result), "");
  EXPECT_NE(result, GST_STATE_CHANGE_FAILURE);
  for (const char* factory : {"lfnodesink", "lfviewsrc"}) {
    const ElementPtr bin = make_element(factory);
    g_object_set(bin.get(), "trusted", TRUE, "rig", described.path().c_str(), nullptr);
    gst_element_set_state(bin.get(), GST_STATE_READY);
    const ElementPtr node = child_of(bin.get(), "node");
    EXPECT_TRUE(node && get<gboolean>(node.get(), "trusted")) << factory;
    gst_element_set_state(bin.get(), GST_STATE_NULL);
  }
}

TEST_F(LfCameraNodeTest, FurtherClientsHaveSeparatePads) {
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
    EXPECT_EQ(seeing(ask(static_cast<uint32_t>(i))).size(), 4u);
  }
  EXPECT_FALSE(pad_of(node_.get(), "src_5")) << "released with the harness";
}

TEST_F(LfCameraNodeTest, AnswersWithTheListedCameras) {
  make([](GstElement* node) { g_object_set(node, "cameras", "1,3", nullptr); });
  play();
  EXPECT_THAT(seeing(ask(0)), ElementsAre(1, 3));
}

TEST_F(LfCameraNodeTest, PropertiesReachTheCameras) {
  GstElement* node = make([](GstElement* element) {
    g_object_set(element, "framerate", 7, 2, "is-live", TRUE, "loop", TRUE, "cameras", "2", nullptr);
  });
  ASSERT_EQ(gst_element_set_state(node, GST_STATE_READY), GST_STATE_CHANGE_SUCCESS);
  const ElementPtr camera = child_of(node, "camera2");
  ASSERT_TRUE(camera);
  gint numerator = 0, denominator = 0;
  g_object_get(camera.get(), "framerate", &numerator, &denominator, nullptr);
  EXPECT_EQ(get<guint>(camera.get(), "camera"), 2u);
  EXPECT_EQ(get<std::string>(camera.get(), "rig"), array_.rig_path());
  EXPECT_EQ(numerator, 7);
  EXPECT_EQ(denominator, 2);
  EXPECT_TRUE(get<gboolean>(camera.get(), "is-live"));
  EXPECT_TRUE(get<gboolean>(camera.get(), "loop"));
  gst_element_set_state(node, GST_STATE_NULL);
}

TEST_F(LfCameraNodeTest, EndOfRequestsEndsAnswers) {
  make();
  play();
  ask(0);
  EXPECT_TRUE(gst_harness_push_event(harness_.get(), gst_event_new_eos()));
  EXPECT_TRUE(reaches_eos(harness_.get()));
}

// The cameras block in lffragment because no requests arrive.
TEST_F(LfCameraNodeTest, StopsWhileItsCamerasAreBlocked) {
  GstElement* node = make();
  for (int i = 0; i < 30; ++i) {
    for (const GstState state :
         {GST_STATE_PAUSED, GST_STATE_PLAYING, GST_STATE_PAUSED, GST_STATE_READY, GST_STATE_PLAYING, GST_STATE_NULL}) {
      gst_element_set_state(node, state);
      ASSERT_NE(gst_element_get_state(node, nullptr, nullptr, 10 * GST_SECOND), GST_STATE_CHANGE_FAILURE);
      if (i % 3 == 0) g_usleep(2000);
    }
    ASSERT_EQ(GST_BIN_NUMCHILDREN(node), 1) << "only lffragment stays";
  }
  const ElementPtr fragment = child_of(node, "fragment");
  EXPECT_EQ(fragment->numsinkpads, 1) << "camera pads are released";
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
  EXPECT_THAT(seeing(ask(0)), ElementsAre(0, 1));
}

TEST_F(LfCameraNodeTest, FilesLoop) {
  const CameraFiles files;
  const std::string rig = files.save("rig.json", 3, [](Camera& camera) { camera.source = "mjpeg.mkv"; });
  const PipelinePtr pipeline =
      launch("lfviewrequest name=r num-buffers=20 framerate=15/1 width=64 height=48 ! lfcameranode rig=" + rig +
             " loop=true name=n ! fakesink sync=false");
  ASSERT_EQ(run(pipeline.get()), "");
  const ElementPtr node = child_of(pipeline.get(), "n");
  EXPECT_EQ(stat(node.get(), "answers"), 20u) << "of 6 frames in each file";
  EXPECT_EQ(stat(node.get(), "missing-frames"), 0u);
}

// Frames stay compressed until they are rendered; stops at every stage of starting.
TEST_F(LfCameraNodeTest, JpegCamerasStartAndStop) {
  const CameraFiles files;
  for (const std::string source : {"mjpeg.mkv", "jpeg_%02d.jpg", "mjpeg.avi"}) {
    const std::string rig = files.save("rig.json", 3, [&](Camera& camera) { camera.source = source; });
    const PipelinePtr pipeline =
        launch("lfviewrequest rig=" + rig +
               " is-live=true framerate=30/1 ! tee name=r  r. ! queue ! n.request  "
               "lfcameranode name=n is-live=true loop=true rig=" +
               rig + " ! queue ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c ! fakesink");
    for (int i = 0; i < 12; ++i) {
      ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << source;
      g_usleep(static_cast<gulong>(4000 * i));
      if (i == 11) {
        const ElementPtr node = child_of(pipeline.get(), "n");
        const ElementPtr compositor = child_of(pipeline.get(), "c");
        EXPECT_TRUE(eventually([&] { return stat(compositor.get(), "pictures") > 12; })) << source;
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

// Views of a real array do not show the built-in scene, so they would be black without a reason.
TEST_F(LfCameraNodeTest, RigWithoutPicturesIsReportedOnce) {
  Rig rig = array_.rig();
  const auto warnings = [](const std::string& rig_path) {
    const PipelinePtr pipeline = launch("lfcameranode rig=" + rig_path + " ! fakesink");
    gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline.get());
    return all_warnings_on(bus);
  };
  EXPECT_THAT(warnings(array_.rig_path()),
              ElementsAre(AllOf(HasSubstr(array_.rig_path()), HasSubstr("built-in scene"))));
  const TempDir dir;
  for (Camera& camera : rig.cameras) camera.source = "videotestsrc is-live=true";
  save_rig(rig, dir / "rig.json");
  EXPECT_THAT(warnings(dir / "rig.json"), IsEmpty());
}

TEST_F(LfCameraNodeTest, RigWithTheSameCamerasIsAcceptedWhileRunning) {
  const ModifiedRig calibrated(array_.rig(), [](Rig& rig) { rig.cameras[0].lens = Lens::pinhole(31, 15, 12); });
  const ModifiedRig moved(array_.rig(), [](Rig& rig) { rig.cameras[1].source = "elsewhere.mkv"; });
  const ModifiedRig smaller(array_.rig(), [](Rig& rig) {
    rig.cameras.pop_back();
    rig.topology = {};
  });
  make();
  play();
  const ElementBus bus(node_.get());
  EXPECT_EQ(seeing(ask(0)).size(), 4u);
  g_object_set(node_.get(), "rig", calibrated.path().c_str(), nullptr);
  EXPECT_EQ(seeing(ask(1, calibrated.hash())).size(), 4u);
  for (const ModifiedRig* other : {&moved, &smaller}) {
    g_object_set(node_.get(), "rig", other->path().c_str(), nullptr);
    EXPECT_THAT(bus.warnings(), AllOf(HasSubstr(other->path()), HasSubstr("restart this node")));
    EXPECT_EQ(get<std::string>(node_.get(), "rig"), calibrated.path());
    EXPECT_EQ(seeing(ask(2, calibrated.hash())).size(), 4u);
  }
}

TEST_F(LfCameraNodeTest, LiveCamerasMakeALiveNode) {
  GstElement* node = make([](GstElement* element) { g_object_set(element, "is-live", TRUE, nullptr); });
  EXPECT_EQ(gst_element_set_state(node, GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  gst_element_set_state(node, GST_STATE_NULL);
}

class LfCameraNodeRecordingTest : public LossTest {
 protected:
  std::string folder() const { return dir_ / "recording"; }
  std::string file(int camera) const { return folder() + "/camera" + std::to_string(camera) + ".mkv"; }
  std::string line_of(const std::string& rig, const std::string& more = "") const {
    return line(rig, 1, "is-live=true loop=true record=" + folder() + " " + more);
  }
  static uint64_t count(GstElement* node, int id, const char* field) {
    const StructurePtr stats = stats_of(node);
    const auto inner = [](const GstStructure* outer, const std::string& name) {
      return gst_value_get_structure(gst_structure_get_value(outer, name.c_str()));
    };
    guint64 value = 0;
    const GstStructure* camera = inner(inner(stats.get(), "cameras"), "camera-" + std::to_string(id));
    EXPECT_TRUE(gst_structure_get_uint64(camera, field, &value));
    return value;
  }
  static uint64_t recorded(GstElement* node, int id) { return count(node, id, "recorded"); }

  TempDir dir_;
};

TEST_F(LfCameraNodeRecordingTest, FilesContainTheFramesOfTheCameras) {
  const WatchedPipeline pipeline(line_of(rig(3, [](guint) { return "mjpeg.mkv"; }), "cameras=0,2"));
  const ElementPtr node = pipeline.child("n");
  EXPECT_TRUE(eventually([&] { return recorded(node.get(), 0) > 20 && recorded(node.get(), 2) > 20; }));
  EXPECT_EQ(count(node.get(), 0, "unrecorded"), 0u);
  pipeline.set_state(GST_STATE_NULL);
  for (const int camera : {0, 2}) {
    const RecordedFile film = read_recorded(file(camera));
    EXPECT_GT(film.times.size(), 20u);
    EXPECT_LT(film.times.front(), GST_SECOND);
    EXPECT_TRUE(std::ranges::is_sorted(film.times));
  }
  EXPECT_FALSE(std::filesystem::exists(file(1))) << "camera of another node";
  EXPECT_EQ(load_rig(folder() + "/rig.json").cameras[1].source, "camera1.mkv");
  EXPECT_THAT(pipeline.errors(), IsEmpty());
}

// A looping live file: each round is recorded from its key frame on, unchanged.
TEST_F(LfCameraNodeRecordingTest, CodedPicturesAreStoredUnchanged) {
  if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  const auto film = slices_of(read_recorded(files->path("h264.mkv")));
  ASSERT_EQ(film.size(), size_t{CameraFiles::kFrames});
  const WatchedPipeline pipeline(line_of(rig(2, [](guint id) { return id ? "h264.mp4" : "h264.mkv"; })));
  const ElementPtr node = pipeline.child("n");
  EXPECT_TRUE(eventually([&] { return recorded(node.get(), 0) > 20 && recorded(node.get(), 1) > 20; }));
  pipeline.stop();
  std::vector<double> ends;
  for (const int camera : {0, 1}) {
    const RecordedFile recording = read_recorded(file(camera));
    EXPECT_EQ(recording.kind, "video/x-h264");
    ends.push_back(static_cast<double>(recording.end));
    EXPECT_GT(recording.end, recording.times.back());
    const auto slices = slices_of(recording);
    ASSERT_GT(slices.size(), 20u);
    for (size_t i = 0; i < slices.size(); i++) EXPECT_EQ(slices[i], film[i % film.size()]) << camera << " " << i;
    for (size_t i = 0; i + 1 < slices.size(); i++) EXPECT_EQ(recording.keys[i], i % film.size() == 0) << i;
    for (size_t i = 1; i < slices.size(); i++)
      EXPECT_NEAR(static_cast<double>(recording.times[i] - recording.times[i - 1]) / GST_SECOND, 1.0 / 15, 2e-3) << i;
  }
  EXPECT_NEAR(ends[0], ends[1], 4e4) << "all cameras loop together";
}

TEST_F(LfCameraNodeRecordingTest, ExistingRecordingIsNotOverwritten) {
  const std::string line = line_of(devices(2));
  for (const bool first : {true, false}) {
    const WatchedPipeline pipeline(line, GST_STATE_NULL);
    EXPECT_EQ(pipeline.set_state(GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE, !first);
    const ElementPtr node = pipeline.child("n");
    if (first)
      EXPECT_TRUE(eventually([&] { return recorded(node.get(), 0) > 5; }));
    else
      EXPECT_THAT(pipeline.errors(), ElementsAre(mentions(folder(), "recording")));
    pipeline.set_state(GST_STATE_NULL);
    EXPECT_GT(read_recorded(file(0)).times.size(), 4u);
  }
}

// In PAUSED nothing more is written, so the file is in the state that a killed process would leave.
TEST_F(LfCameraNodeRecordingTest, AllFramesButTheNewestAreOnDisk) {
  const PipelinePtr pipeline = launch(line_of(rig(2, [](guint) { return "mjpeg.mkv"; })));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child_of(pipeline.get(), "n");
  EXPECT_TRUE(eventually([&] { return recorded(node.get(), 0) > 20 && recorded(node.get(), 1) > 20; }));
  gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
  g_usleep(200000);
  for (const int camera : {0, 1}) {
    const uint64_t frames = recorded(node.get(), camera);
    EXPECT_TRUE(eventually([&] {
      std::filesystem::copy_file(file(camera), dir_ / "copy.mkv", std::filesystem::copy_options::overwrite_existing);
      return read_recorded(dir_ / "copy.mkv").times.size() >= frames - 1;
    })) << frames;
  }
}

TEST_F(LfCameraNodeRecordingTest, ReturningCameraContinuesItsFile) {
  const WatchedPipeline pipeline(line_of(devices(2)));
  const ElementPtr node = pipeline.child("n");
  EXPECT_TRUE(eventually([&] { return recorded(node.get(), 1) > 10; }));
  failing_device(1).broken = true;
  EXPECT_TRUE(eventually([&] { return pipeline.lost(1) == 1; }));
  g_usleep(1000000);
  const uint64_t before = recorded(node.get(), 1), other = recorded(node.get(), 0);
  failing_device(1).broken = false;
  EXPECT_TRUE(eventually([&] { return pipeline.found(1) == 1 && recorded(node.get(), 1) > before + 10; }));
  pipeline.stop();
  const std::vector<GstClockTime> times = read_recorded(file(1)).times;
  ASSERT_GT(times.size(), before);
  EXPECT_GT(times[before] - times[before - 1], GST_SECOND) << "no frames without a camera";
  const std::vector<GstClockTime> meanwhile = read_recorded(file(0)).times;
  ASSERT_GT(meanwhile.size(), other);
  EXPECT_LT(meanwhile[other - 1], times[before]) << "the cameras stay in step";
}

TEST_F(LfCameraNodeRecordingTest, FullDiskEndsOnlyTheRecording) {
  std::filesystem::create_directories(dir_ / "disk");
  if (mount("none", (dir_ / "disk").c_str(), "tmpfs", 0, "size=64k") != 0)
    GTEST_SKIP() << "a small disk can't be mounted here";
  {
    const WatchedPipeline pipeline(line(devices(2), 1, "is-live=true record=" + dir_ / "disk/r"), GST_STATE_NULL);
    const ElementPtr bus_owner = pipeline.child("n");
    Pictures pictures(pipeline);
    pipeline.set_state(GST_STATE_PLAYING);
    const auto has_stopped = [&] {
      const std::vector<std::string> warnings = pipeline.warnings();
      return std::ranges::count_if(warnings, [&](const std::string& text) {
        return contains(text, dir_ / "disk/r" + ": recording has stopped: ") && contains(text, "No space left");
      });
    };
    EXPECT_TRUE(eventually([&] { return has_stopped() == 1; }));
    EXPECT_TRUE(pictures.has_more(10));
    EXPECT_EQ(has_stopped(), 1) << "one message only";
    pipeline.stop();
    EXPECT_GT(read_recorded(dir_ / "disk/r/camera0.mkv").times.size(), 10u);
  }
  EXPECT_EQ(umount((dir_ / "disk").c_str()), 0);
}

// A non-live file is recorded at the speed of the requests, with its own timestamps.
TEST_F(LfCameraNodeRecordingTest, FileSourceIsRecordedUnchanged) {
  const std::string film = rig(2, [](guint) { return "mjpeg.mkv"; });
  EXPECT_EQ(run("lfviewrequest rig=" + film +
                " framerate=15/1 num-buffers=6 width=64 height=48 ! tee name=r  r. ! queue ! "
                "n.request lfcameranode name=n rig=" +
                film + " record=" + folder() + " ! c.sink_0  r. ! queue ! c.request lfcompositor name=c ! fakesink"),
            "");
  const std::vector<GstClockTime> times = read_recorded(file(0)).times;
  ASSERT_GE(times.size(), 6u);
  EXPECT_EQ(times[0], 0u);
  EXPECT_NEAR(static_cast<double>(times[5]), 5.0 * GST_SECOND / 15, 1e6);
}

TEST_F(LfCameraNodeRecordingTest, LfviewsrcRecordsItsCameras) {
  const std::string source =
      "lfviewsrc name=v trusted=true rig=" + devices(2) + " width=64 height=48 record=" + folder();
  const PipelinePtr pipeline = launch(source + " ! fakesink sync=false");
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child_of(pipeline.get(), "node");
  EXPECT_TRUE(eventually([&] { return recorded(node.get(), 0) > 5 && recorded(node.get(), 1) > 5; }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_GT(read_recorded(file(1)).times.size(), 4u);

  const WatchedPipeline elsewhere(source + "2 nodes=127.0.0.1:27433:27434 ! fakesink", GST_STATE_NULL);
  EXPECT_EQ(elsewhere.set_state(GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(elsewhere.errors(), ElementsAre(mentions("record", "other hosts")));
}

}  // namespace
}  // namespace lf::test
