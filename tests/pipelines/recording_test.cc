// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Played recordings show the same pictures as live, repeatedly, and also after the recording process was killed.
#include <signal.h>
#include <spawn.h>

#include "gst/camera_files.h"
#include "rig/rig_json.h"
#include "support/recorded.h"
#include "support/run_program.h"
#include "support/temp_dir.h"
#include "view/navigator.h"
#include "view/view_path.h"

extern char** environ;

namespace lf::test {
namespace {

constexpr int kRate = 15;

struct Picture {
  GstClockTime pts = GST_CLOCK_TIME_NONE, captured = GST_CLOCK_TIME_NONE;
  std::vector<uint8_t> bytes;
  bool operator==(const Picture&) const = default;
};

Picture picture_of(GstSample* sample) {
  GstBuffer* buffer = gst_sample_get_buffer(sample);
  const CapsPtr reference(gst_caps_from_string("timestamp/x-lightfield-capture"));
  const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(buffer, reference.get());
  return {GST_BUFFER_PTS(buffer), meta ? meta->timestamp : GST_CLOCK_TIME_NONE, to_bytes(buffer)};
}

// Returns the pictures up to EOS, or at most this many.
std::vector<Picture> pictures_of(const PipelinePtr& pipeline, size_t most = SIZE_MAX) {
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr sink = child_of(pipeline.get(), "s");
  std::vector<Picture> pictures;
  while (pictures.size() < most) {
    g_autoptr(GstSample) sample = gst_app_sink_try_pull_sample(GST_APP_SINK(sink.get()), 20 * GST_SECOND);
    if (!sample) break;
    pictures.push_back(picture_of(sample));
  }
  return pictures;
}

// Returns the PTS of complete pictures according to the compositor: each camera has answered with its nearest frame. If
// a busy machine answers exceptionally late, the node has dropped that frame and shows the next.
std::set<GstClockTime> timestamps_of_whole(const PipelinePtr& pipeline) {
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline.get());
  std::set<GstClockTime> whole;
  while (const MessagePtr message{gst_bus_pop_filtered(bus, GST_MESSAGE_ELEMENT)}) {
    const GstStructure* view = gst_message_get_structure(message.get());
    gboolean complete = FALSE;
    guint64 pts = 0, skew = 0;
    if (gst_structure_get(view, "complete", G_TYPE_BOOLEAN, &complete, "pts", G_TYPE_UINT64, &pts, "skew-ns",
                          G_TYPE_UINT64, &skew, nullptr) &&
        complete && skew < GST_SECOND / kRate / 2)
      whole.insert(pts);
  }
  return whole;
}

// The parameter is the cameras' video format: JPEG, or H.264 with a key frame every ten frames.
class RecordingReplayTest : public testing::TestWithParam<const char*> {
 protected:
  static bool is_coded() { return GetParam() == std::string("h264"); }
  void SetUp() override {
    if (is_coded() && CameraFiles::h264_encoder().empty())
      GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  }
  // Nine synchronised cameras, with files of both formats.
  static void SetUpTestSuite() {
    scene = new TempDir;
    expect_outcome(
        run_program("lf-scene",
                    "--out s --grid 3x3 --width 48 --height 36 --frames 20 --framerate " + std::to_string(kRate),
                    scene->path()),
        0);
    if (CameraFiles::h264_encoder().empty()) return;
    const std::string folder = *scene / "h264";
    std::filesystem::create_directory(folder);
    for (const auto& file : std::filesystem::directory_iterator(*scene / "s")) {
      const std::string to = folder + "/" + file.path().filename().string();
      if (file.path().extension() == ".json") std::filesystem::copy_file(file, to);
      if (file.path().extension() == ".mkv")
        run_to_end("filesrc location=" + file.path().string() + " ! matroskademux ! jpegdec ! videoconvert ! " +
                   "x264enc tune=zerolatency key-int-max=10 ! video/x-h264,profile=main ! h264parse ! matroskamux ! " +
                   "filesink location=" + to);
    }
  }
  static void TearDownTestSuite() {
    delete scene;
    scene = nullptr;
  }
  static std::string rig() { return *scene / (is_coded() ? "h264/rig.json" : "s/rig.json"); }
  std::string folder() const { return dir_ / "recording"; }
  std::string line(const std::string& requests, const std::string& node, const std::string& compositor = "") const {
    return "lfviewrequest " + requests + " ! tee name=r  r. ! queue ! n.request  lfcameranode name=n " + node +
           " ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c focus=plane " + compositor +
           " ! appsink name=s sync=false";
  }
  std::string replay(const std::string& views) const {
    return line("location=" + views, "rig=" + folder() + "/rig.json", "rig=" + folder() + "/rig.json");
  }
  std::string save(const std::vector<double>& times) const {
    std::vector<NamedView> views;
    const View view = make_view(default_viewpoint(load_rig(rig())), 64, 48);
    for (const double time : times) views.push_back({"view_" + std::to_string(views.size()), time, view});
    save_views(views, dir_ / "views.json");
    return dir_ / "views.json";
  }
  // Returns the duration of the recording in which all cameras have frames, in seconds.
  double length() const {
    GstClockTime end = GST_CLOCK_TIME_NONE;
    for (int camera = 0; camera < 9; camera++) {
      const RecordedFile file = read_recorded(folder() + "/camera" + std::to_string(camera) + ".mkv");
      EXPECT_FALSE(file.times.empty()) << camera;
      if (!file.times.empty()) end = std::min(end, file.times.back());
    }
    return static_cast<double>(end) / GST_SECOND;
  }
  std::string path() const {
    std::vector<double> times;
    for (double time = 0, end = length(); time < end; time += 0.1) times.push_back(time);
    return save(times);
  }
  void record(double seconds) const {
    const PipelinePtr pipeline = launch("lfcameranode name=n is-live=true loop=true rig=" + rig() +
                                        " record=" + folder() + " ! fakesink async=false");
    const ElementPtr node = child_of(pipeline.get(), "n");
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    const auto enough = static_cast<uint64_t>(seconds * kRate);
    EXPECT_TRUE(eventually([&] { return least_recorded(node.get()) >= enough; })) << least_recorded(node.get());
  }
  static uint64_t least_recorded(GstElement* node) {
    const StructurePtr all = stats_of(node);
    const GValue* cameras = gst_structure_get_value(all.get(), "cameras");
    uint64_t least = G_MAXUINT64;
    for (int camera = 0; camera < 9; camera++) {
      const std::string name = "camera-" + std::to_string(camera);
      const GValue* one = cameras ? gst_structure_get_value(gst_value_get_structure(cameras), name.c_str()) : nullptr;
      guint64 frames = 0;
      if (one) gst_structure_get_uint64(gst_value_get_structure(one), "recorded", &frames);
      least = std::min<uint64_t>(least, frames);
    }
    return least;
  }

  static inline TempDir* scene = nullptr;
  TempDir dir_;
};

TEST_P(RecordingReplayTest, ShowsTheLivePictures) {
  std::vector<Picture> live;
  guint64 begin = 0;
  {
    const PipelinePtr pipeline =
        launch(line("is-live=true capture-delay=500000000 loop=true framerate=15/1 location=" + save({0}),
                    "is-live=true loop=true rig=" + rig() + " record=" + folder(),
                    "post-messages=true latency=1000000000 rig=" + rig()));
    live = pictures_of(pipeline, 60);
    const std::set<GstClockTime> whole = timestamps_of_whole(pipeline);
    ASSERT_EQ(live.size(), 60u);
    std::erase_if(live, [&](const Picture& picture) { return !whole.contains(picture.pts); });
    const StructurePtr stats = stats_of(child_of(pipeline.get(), "n").get());
    const GstStructure* recording = gst_value_get_structure(gst_structure_get_value(stats.get(), "recording"));
    ASSERT_TRUE(gst_structure_get_uint64(recording, "begin", &begin));
  }
  // The first pictures may contain cameras that had just started.
  std::erase_if(live, [&](const Picture& picture) { return picture.captured < begin + GST_SECOND; });
  ASSERT_GT(live.size(), 20u);
  std::vector<double> times;
  for (const Picture& picture : live) times.push_back(static_cast<double>(picture.captured - begin) / GST_SECOND);
  const std::string views = save(times);
  const std::vector<Picture> first = pictures_of(launch(replay(views))), second = pictures_of(launch(replay(views)));
  EXPECT_TRUE(first == second) << "a replay is the same each time";
  ASSERT_EQ(first.size(), live.size());
  size_t other = 0, changes = 0;
  for (size_t i = 0; i < live.size(); i++) {
    other += first[i].bytes != live[i].bytes;
    changes += i > 0 && first[i].bytes != first[i - 1].bytes;
  }
  EXPECT_EQ(other, 0u) << "of " << live.size() << " pictures";
  EXPECT_GT(changes, 10u) << "something moves";
}

TEST_P(RecordingReplayTest, IsSeekable) {
  record(4);
  const std::string views = path();
  const std::vector<Picture> truth = pictures_of(launch(replay(views)));
  ASSERT_GT(truth.size(), 20u);
  const PipelinePtr player = launch(replay(views));
  const ElementPtr sink = child_of(player.get(), "s");
  for (const size_t to : {20u, 3u, 11u}) {
    gst_element_set_state(player.get(), GST_STATE_PAUSED);
    ASSERT_EQ(gst_element_get_state(player.get(), nullptr, nullptr, 20 * GST_SECOND), GST_STATE_CHANGE_SUCCESS);
    ASSERT_TRUE(gst_element_seek_simple(player.get(), GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                                        static_cast<gint64>(to) * 100 * GST_MSECOND));
    g_autoptr(GstSample) sample = gst_app_sink_try_pull_preroll(GST_APP_SINK(sink.get()), 20 * GST_SECOND);
    ASSERT_TRUE(sample);
    EXPECT_TRUE(pictures_of(player) == std::vector(truth.begin() + static_cast<ptrdiff_t>(to), truth.end())) << to;
  }
}

// All cameras loop with a common period.
TEST_P(RecordingReplayTest, LoopsInStep) {
  record(2.5);
  GstClockTime round = 0;
  for (int camera = 0; camera < 9; camera++) {
    const RecordedFile file = read_recorded(folder() + "/camera" + std::to_string(camera) + ".mkv");
    if (camera == 0) round = file.end;
    EXPECT_NEAR(static_cast<double>(file.end), static_cast<double>(round), 1e5) << camera;
  }
  ASSERT_GT(round, 2 * GST_SECOND);
  const double seconds = static_cast<double>(round) / GST_SECOND;
  const std::string views = save({0.5, 1.0, 0.5 + seconds, 1.0 + seconds, 0.5 + 2 * seconds});
  const std::vector<Picture> shown = pictures_of(
      launch(line("location=" + views, "loop=true rig=" + folder() + "/rig.json", "rig=" + folder() + "/rig.json")));
  ASSERT_EQ(shown.size(), 5u);
  EXPECT_TRUE(shown[0].bytes == shown[2].bytes && shown[0].bytes == shown[4].bytes);
  EXPECT_TRUE(shown[1].bytes == shown[3].bytes);
  EXPECT_FALSE(shown[0].bytes == shown[1].bytes);
}

TEST_P(RecordingReplayTest, IsCompleteAfterAKill) {
  const std::string of_rig = "rig=" + rig(), record = "record=" + folder();
  const char* argv[] = {"gst-launch-1.0", "-q",           "lfcameranode", "is-live=true",
                        "loop=true",      of_rig.c_str(), record.c_str(), nullptr};
  pid_t process = 0;
  ASSERT_EQ(posix_spawnp(&process, argv[0], nullptr, nullptr, const_cast<char**>(argv), environ), 0);
  const auto size = [&](int camera) {
    std::error_code error;
    const auto bytes = std::filesystem::file_size(folder() + "/camera" + std::to_string(camera) + ".mkv", error);
    return error ? uintmax_t{0} : bytes;
  };
  const uintmax_t frame = std::filesystem::file_size(std::filesystem::path(rig()).parent_path() / "cam_00_00.mkv") / 20;
  EXPECT_TRUE(eventually([&] { return size(8) >= 40 * frame; }));
  kill(process, SIGKILL);
  int status = 0;
  waitpid(process, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_GT(length(), 2.0);
  const std::string views = path();
  const std::vector<Picture> first = pictures_of(launch(replay(views))), second = pictures_of(launch(replay(views)));
  EXPECT_GT(first.size(), 20u);
  EXPECT_TRUE(first == second);
}

INSTANTIATE_TEST_SUITE_P(Of, RecordingReplayTest, testing::Values("jpeg", "h264"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace
}  // namespace lf::test
