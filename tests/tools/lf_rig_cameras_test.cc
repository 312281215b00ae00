// SPDX-License-Identifier: LGPL-2.1-or-later
// Runs the lf-rig commands that open cameras, with simulated cameras: elements, files and RTSP servers.
#include <ctime>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "calibration/tracks.h"
#include "cameras/guided_recording.h"
#include "cameras/mosaic.h"
#include "cameras/recorder.h"
#include "gst/rtsp_server.h"
#include "mjpeg_writer.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/recorded.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

Outcome lf_rig(const std::string& arguments, const TempDir& dir) {
  return run_program("lf-rig", arguments, dir.path());
}

void write_rig(const TempDir& dir, const std::vector<std::string>& sources) {
  Rig rig = make_grid_rig({1, static_cast<int>(sources.size()), 0.1, 60, 64, 48});
  for (size_t i = 0; i < sources.size(); i++) rig.cameras[i].source = sources[i];
  save_rig(rig, dir / "rig.json");
}

const std::string kGood = "videotestsrc is-live=true pattern=smpte ! video/x-raw,framerate=15/1";

// Each JPEG file of 64 cameras takes about 30 ms. Measures the time of the calling thread, like lf-serve's main thread.
TEST(Mosaic, ManyRequestsAreCheap) {
  Rig rig = make_grid_rig({8, 8, 0.1, 60, 320, 240});
  cameras::Mosaic mosaic(rig);
  const auto seconds = [] {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  };
  const std::vector<uint8_t> first = mosaic.jpeg(0);
  ASSERT_GT(first.size(), 2u);
  EXPECT_EQ(first[0] << 8 | first[1], 0xffd8) << "a JPEG file even without frames";
  const double began = seconds();
  for (int i = 0; i < 1000; i++) EXPECT_FALSE(mosaic.jpeg(0.001 * i).empty());
  EXPECT_LT(seconds() - began, 1);
}

TEST(LfRigNew, MakesLinesArcsAndRings) {
  const TempDir dir;
  const std::string rest = " --fov 60 --out rig.json";
  ASSERT_EQ(lf_rig("new --line 5 --pitch 0.1" + rest, dir).status, 0);
  EXPECT_EQ(load_rig(dir / "rig.json").topology.columns, 5);
  ASSERT_EQ(lf_rig("new --arc 5 --pitch 0.1 --radius 2" + rest, dir).status, 0);
  EXPECT_NEAR(glm::length(load_rig(dir / "rig.json").cameras[0].pose.position - Vec3(0, 0, 2)), 2, 1e-9);
  EXPECT_EQ(lf_rig("check rig.json", dir).status, 0);
  ASSERT_EQ(lf_rig("new --ring 6 --radius 0.2" + rest, dir).status, 0);
  EXPECT_EQ(load_rig(dir / "rig.json").cameras.size(), 6u);
  EXPECT_EQ(lf_rig("check rig.json", dir).status, 0);
  EXPECT_THAT(lf_rig("new --ring 6 --radius 0.2 --pitch 1" + rest, dir).output, HasSubstr("--pitch"));
  EXPECT_THAT(lf_rig("new --grid 2x2 --pitch 0.1 --radius 1" + rest, dir).output, HasSubstr("--radius"));
  EXPECT_NE(lf_rig("new --grid 2x2 --line 3 --pitch 0.1" + rest, dir).status, 0);
  EXPECT_NE(lf_rig("new --pitch 0.1" + rest, dir).status, 0);
}

TEST(LfRigDoctor, ReportsGoodCameras) {
  const TempDir dir;
  write_rig(dir, {kGood, kGood});
  const Outcome outcome = lf_rig("doctor rig.json --seconds 2 --json", dir);
  EXPECT_EQ(outcome.status, 0) << outcome.output;
  const auto report = nlohmann::json::parse(outcome.output);
  ASSERT_EQ(report["cameras"].size(), 2u);
  for (const auto& camera : report["cameras"]) {
    EXPECT_EQ(camera["problem"], "");
    EXPECT_NEAR(camera["frames_per_second"], 15, 0.5);
    EXPECT_EQ(camera["width"], 64);
    EXPECT_GT(camera["brightness"], 50);
    EXPECT_GT(camera["bytes_per_second"], 0);
    EXPECT_FALSE(camera["format"].get<std::string>().empty());
  }
  const Outcome page = lf_rig("doctor rig.json --seconds 1", dir);
  EXPECT_THAT(page.output, AllOf(HasSubstr("0 (cam_00_00)"), mentions("2 cameras", "0 errors")));
}

TEST(LfRigCheck, NamesTruncatedFilms) {
  const test::CameraFiles films;
  const TempDir dir;
  const auto check = [&](const std::vector<std::string>& sources) {
    write_rig(dir, sources);
    const Outcome outcome = lf_rig("check rig.json", dir);
    EXPECT_EQ(outcome.status, 0) << outcome.output;
    return outcome.output;
  };
  const auto cut = [&](const std::string& name) {
    std::filesystem::copy_file(films.path(name), dir / name);
    std::filesystem::resize_file(dir / name, std::filesystem::file_size(dir / name) * 6 / 10);
    return dir / name;
  };
  const std::string mkv = films.path("mjpeg.mkv"), stream = films.path("pictures.mjpeg"), avi = films.path("mjpeg.avi");
  EXPECT_THAT(check({mkv, mkv, stream, avi}), Not(HasSubstr("frames")));
  EXPECT_THAT(check({mkv, mkv, cut("mjpeg.mkv"), mkv}),
              mentions("warning", "cameras[2].source", dir / "mjpeg.mkv", "truncated"));
  EXPECT_THAT(check({stream, cut("pictures.mjpeg"), stream}),
              AllOf(HasSubstr("warning: cameras[1].source: " + dir / "pictures.mjpeg"), mentions("others have 6")));
  EXPECT_THAT(check({avi, avi, cut("mjpeg.avi")}), HasSubstr("warning: cameras[2].source: " + dir / "mjpeg.avi"));
  dir.write("list.m3u8", "#EXTM3U\n#EXT-X-TARGETDURATION:4\n#EXTINF:4,\nhttp://127.0.0.1:1/a.ts\n#EXT-X-ENDLIST\n");
  EXPECT_THAT(check({mkv, "list.m3u8"}), Not(HasSubstr("frames"))) << "not opened";
  EXPECT_THAT(check({mkv, films.path("sound.mkv")}), mentions("sound.mkv", "no video"));
  for (const int i : {0, 1, 2, 3})
    std::filesystem::copy_file(films.path("jpeg_00.jpg"), dir / format_text("%d.jpg", i));
  EXPECT_THAT(check({stream, stream, "%d.jpg"}), mentions("%d.jpg", "4 frames", "6"));
}

TEST(LfRigDoctor, NamesEachProblemAndItsCamera) {
  const TempDir dir;
  write_rig(dir, {kGood, "videotestsrc is-live=true pattern=black ! video/x-raw,framerate=15/1",
                  "videotestsrc is-live=true ! video/x-raw,width=32,height=24", "v4l2:///dev/video-none", "none.mkv",
                  "nosuchelement ! queue", "rtsp://127.0.0.1:1/none", "rtsp://127.0.0.1:1/none", "gap_%d.png"});
  for (const char* name : {"gap_0.png", "gap_1.png", "gap_3.png"})
    save_image(Image(PixelFamily::kRgb, 64, 48), dir / name);
  const Outcome outcome = lf_rig("doctor rig.json --seconds 1", dir);
  EXPECT_EQ(outcome.status, 1);
  const std::vector<std::string> findings[] = {{"error: camera 1 (cam_00_01):", "black"},
                                               {"error: camera 2 (cam_00_02):"},
                                               {"no pictures", "64x48"},
                                               {"error: camera 3 (cam_00_03):"},
                                               {"error: camera 4 (cam_00_04):"},
                                               {"none.mkv", "no such"},
                                               {"error: camera 5 (cam_00_05):"},
                                               {"nosuchelement"},
                                               {"error: camera 6 (cam_00_06):"},
                                               {"error: camera 7 (cam_00_07):", "same device", "camera 6"},
                                               {"gap_2.png", "missing"},
                                               {"renumber"}};
  for (const std::vector<std::string>& facts : findings) EXPECT_THAT(outcome.output, mentions(facts));
  EXPECT_THAT(outcome.output, Not(HasSubstr("camera 0 (cam_00_00): "))) << "no message about working cameras";
}

std::string write_rig_that_writes(const TempDir& dir) {
  const std::string mark = dir / "written-by-the-rig";
  write_rig(dir,
            {"videotestsrc is-live=true ! video/x-raw,format=RGB,width=64,height=48,framerate=15/1 ! tee name=t t. "
             "! queue ! filesink location=" +
                 mark + " t. ! queue",
             kGood});
  return mark;
}

constexpr const char* kCommandsThatOpenCameras[] = {
    "doctor rig.json --seconds 1 --patience 3",
    "snapshot rig.json --out stills --warm-up 0",
    "identify rig.json --port 0",
    "lock rig.json --settle 0.1 --no-check",
    "record rig.json --out films --seconds 0.3",
};

TEST(LfRigTrust, NoCommandRunsUnlistedElements) {
  const TempDir dir;
  const std::string mark = write_rig_that_writes(dir);
  for (const char* command : {"info rig.json", "check rig.json"}) {
    EXPECT_EQ(lf_rig(command, dir).status, 0) << command << " opens no camera";
    EXPECT_FALSE(std::filesystem::exists(mark)) << command;
  }
  for (const char* command : kCommandsThatOpenCameras) {
    const Outcome outcome = lf_rig(std::string(command), dir);
    EXPECT_EQ(outcome.status, 1) << command;
    EXPECT_THAT(outcome.output, AllOf(mentions("source", "tee"), HasSubstr("--trust-rig"))) << command;
    EXPECT_FALSE(std::filesystem::exists(mark)) << command;
  }
  EXPECT_EQ(lf_rig("doctor rig.json --seconds 1 --trust-rig", dir).status, 0);
  EXPECT_TRUE(std::filesystem::exists(mark)) << "otherwise the test proves nothing";
}

// Commands that open a copy must check the original file.
TEST(LfRigTrust, NoCommandTrustsAWritableRig) {
  const TempDir dir;
  const std::string mark = write_rig_that_writes(dir);
  std::filesystem::permissions(dir / "rig.json", std::filesystem::perms::others_write,
                               std::filesystem::perm_options::add);
  for (const char* command : kCommandsThatOpenCameras) {
    const Outcome outcome = lf_rig(std::string(command) + " --trust-rig", dir);
    EXPECT_EQ(outcome.status, 1) << command;
    EXPECT_THAT(outcome.output, mentions("written", "other users")) << command;
    EXPECT_FALSE(std::filesystem::exists(mark)) << command;
  }
}

TEST(LfRigTrust, NoCommandRevealsPasswords) {
  const TempDir dir;
  write_rig(dir, {"rtsp://admin:Hunter2Secret@127.0.0.1:1/none", "rtsp://admin:Hunter2Secret@127.0.0.1:1/none"});
  std::vector<std::string> commands(std::begin(kCommandsThatOpenCameras), std::end(kCommandsThatOpenCameras));
  commands.erase(commands.begin() + 2);  // identify does not terminate
  commands.insert(commands.end(), {"info rig.json", "check rig.json", "doctor rig.json --seconds 1 --patience 3 --json",
                                   "subset rig.json --cameras 7 --out other.json"});
  for (const std::string& command : commands)
    EXPECT_THAT(lf_rig(command, dir).output, Not(HasSubstr("Hunter2Secret"))) << command;
  EXPECT_EQ(lf_rig("subset rig.json --cameras 0 --out other.json", dir).status, 0);
  EXPECT_THAT(read_text_file(dir / "other.json"), HasSubstr("Hunter2Secret")) << "rigs keep their sources";
}

TEST(LfRigDoctor, ReportsNetworkCameras) {
  if (test::kRtspServerMissing) GTEST_SKIP() << test::kRtspServerMissing;
  const TempDir dir;
  {
    const test::RtspServer server;
    write_rig(dir, {server.uri("/jpeg")});
    const auto report = nlohmann::json::parse(lf_rig("doctor rig.json --seconds 2 --json", dir).output);
    const auto& camera = report["cameras"][0];
    EXPECT_EQ(camera["format"], "JPEG by RTP");
    EXPECT_GT(camera["frames"], 10);
    EXPECT_GT(camera["bytes_per_second"], 0);
    EXPECT_EQ(report["links"]["measured"][0]["link"], "network lo");
  }
  test::RtspServer::clean_up();
}

TEST(LfRigSnapshot, SavesAStillOfEachWorkingCamera) {
  const TempDir dir;
  write_rig(dir, {"videotestsrc is-live=true pattern=red ! video/x-raw,framerate=30/1",
                  "videotestsrc is-live=true pattern=blue ! video/x-raw,framerate=30/1 ! jpegenc", "none.mkv"});
  const Outcome outcome = lf_rig("snapshot rig.json --out stills --warm-up 0.3", dir);
  EXPECT_EQ(outcome.status, 1) << "one is missing";
  EXPECT_THAT(outcome.output,
              AllOf(HasSubstr("camera 2 (cam_00_02): "), mentions("2 stills"), HasSubstr("check the path")));
  const Rig rig = load_rig(dir / "stills/rig.json");
  EXPECT_EQ(rig.cameras[0].image, "cam_00_00.png");
  EXPECT_EQ(rig.cameras[2].image, "");
  EXPECT_EQ(rig.cameras[2].source, "../none.mkv");
  const Image red = load_image(dir / "stills/cam_00_00.png"), blue = load_image(dir / "stills/cam_00_01.png");
  EXPECT_EQ(red.width(), 64);
  EXPECT_GT(red.pixel(32, 24)[0], 200);
  EXPECT_LT(red.pixel(32, 24)[2], 60);
  EXPECT_GT(blue.pixel(32, 24)[2], 200);

  const Outcome one = lf_rig("snapshot rig.json --cameras 0 --out one --warm-up 0", dir);
  EXPECT_EQ(one.status, 0) << one.output;
  EXPECT_TRUE(std::filesystem::exists(dir / "one/cam_00_00.png"));
}

TEST(LfRigSnapshot, KeepsOldStillsIfNoCameraWorks) {
  const TempDir dir;
  write_rig(dir, {kGood});
  ASSERT_EQ(lf_rig("snapshot rig.json --out stills --warm-up 0", dir).status, 0);
  const std::string before = read_text_file(dir / "stills/rig.json");
  write_rig(dir, {"none.mkv"});
  test::expect_outcome(lf_rig("snapshot rig.json --out stills --warm-up 0", dir), 1, mentions("stills", "unchanged"));
  EXPECT_EQ(read_text_file(dir / "stills/rig.json"), before);
  EXPECT_TRUE(std::filesystem::exists(dir / "stills/cam_00_00.png"));
}

// Brightness encodes the time of each frame: all stills must show the same instant.
TEST(LfRigSnapshot, UsesTheFramesNearestToOneInstant) {
  const TempDir dir;
  write_rig(dir, std::vector<std::string>(3, "videotestsrc is-live=true ! video/x-raw,framerate=20/1"));
  const Outcome outcome = lf_rig("snapshot rig.json --out stills --warm-up 0.2", dir);
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  std::vector<double> offsets;
  for (size_t at = outcome.output.find(".png, "); at != std::string::npos; at = outcome.output.find(".png, ", at + 1))
    offsets.push_back(std::stod(outcome.output.substr(at + 6)));
  ASSERT_EQ(offsets.size(), 3u) << outcome.output;
  for (const double offset : offsets) EXPECT_LE(std::abs(offset), 25.1) << "half the time between frames, ms";
}

// Returns the frame timestamps of a film in seconds, as read by calibration.
std::vector<double> stamps_of(const std::string& film) {
  const test::RecordedFile file = test::read_recorded(film);
  EXPECT_EQ(file.kind, "image/jpeg");
  std::vector<double> stamps;
  for (const GstClockTime time : file.times) stamps.push_back(static_cast<double>(time) / GST_SECOND);
  return stamps;
}

TEST(LfRigRecord, RecordsAllCamerasOnOneClock) {
  const TempDir dir;
  const std::string live = "videotestsrc is-live=true pattern=red ! video/x-raw,framerate=";
  write_rig(dir, {live + "30/1", live + "15/1 ! jpegenc", "none.mkv"});
  Rig rig = load_rig(dir / "rig.json");
  rig.cameras[1].time_offset = 5;  // set by an earlier calibration; films have the camera's own timestamps
  save_rig(rig, dir / "rig.json");
  std::filesystem::create_directory(dir / "films");
  dir.write("films/cam_00_02.mkv", "of last week");
  const Outcome outcome = lf_rig("record rig.json --out films --seconds 2", dir);
  EXPECT_EQ(outcome.status, 1) << "one is missing";
  EXPECT_THAT(outcome.output, AllOf(mentions("camera 2 (cam_00_02)", "0 frames"), mentions("films", "2 of 3 cameras")));
  EXPECT_FALSE(std::filesystem::exists(dir / "films/cam_00_02.mkv")) << "older than the recording session";
  for (const auto& [name, rate] : {std::pair("cam_00_00", 30.0), std::pair("cam_00_01", 15.0)}) {
    const std::vector<double> stamps = stamps_of(dir / "films/" + name + ".mkv");
    ASSERT_GT(stamps.size(), 5u) << outcome.output;
    EXPECT_LE(stamps.front(), 1);
    EXPECT_LE(stamps.back(), 2);
    for (size_t i = 1; i < stamps.size(); i++) EXPECT_GT(stamps[i], stamps[i - 1]);
    EXPECT_NEAR(static_cast<double>(stamps.size() - 1) / (stamps.back() - stamps.front()), rate, 0.5 * rate);
  }
}

TEST(LfRigRecord, KeepsOldFilmsUntilNewOnesAreComplete) {
  const TempDir dir;
  write_rig(dir, {"none.mkv", "rtsp://127.0.0.1:1/none"});
  for (const char* name : {"films/cam_00_00.mkv", "films/cam_00_01.mkv"}) dir.write(name, "of last week");
  const Outcome nothing = lf_rig("record rig.json --out films --seconds 0.3", dir);
  EXPECT_EQ(nothing.status, 1);
  for (const char* name : {"films/cam_00_00.mkv", "films/cam_00_01.mkv"})
    EXPECT_EQ(read_text_file(dir / name), "of last week") << nothing.output;
  write_rig(dir, {"videotestsrc is-live=true ! video/x-raw,framerate=15/1", "none.mkv"});
  const Outcome one = lf_rig("record rig.json --out films --seconds 0.5", dir);
  EXPECT_EQ(one.status, 1);
  EXPECT_GT(std::filesystem::file_size(dir / "films/cam_00_00.mkv"), 100u) << one.output;
  EXPECT_FALSE(std::filesystem::exists(dir / "films/cam_00_01.mkv")) << "older than the new recording";
  EXPECT_EQ(read_text_file(dir / "films/earlier/cam_00_01.mkv"), "of last week");
  EXPECT_THAT(one.output, HasSubstr("films/earlier/cam_00_01.mkv"));
}

// The first frame of each unsynchronised camera comes some time after the start of the recording.
TEST(LfRigRecord, FilmsShareOneStartTime) {
  const TempDir dir;
  const std::vector<double> times = {0.0217, 0.0884, 0.1551, 1.1};
  MjpegWriter writer(dir / "film.mkv", 64, 48, FrameRate{0, 1}, 90);
  for (const double time : times)
    writer.add(Image(PixelFamily::kRgb, 64, 48), static_cast<GstClockTime>(time * GST_SECOND));
  writer.finish();
  const std::vector<double> stamps = stamps_of(dir / "film.mkv");
  ASSERT_EQ(stamps.size(), times.size());
  for (size_t i = 0; i < times.size(); i++) EXPECT_NEAR(stamps[i], times[i], 2e-5);
}

// The first sender report shifts the timestamps of a network camera: its film starts after the report.
TEST(LfRigRecord, WaitsForTheTimesOfNetworkCameras) {
  if (test::kRtspServerMissing) GTEST_SKIP() << test::kRtspServerMissing;
  const TempDir dir;
  {
    const test::RtspServer server;
    write_rig(dir, {server.uri("/jpeg"), server.uri("/undated")});
    const Outcome outcome = lf_rig("record rig.json --out films --seconds 4", dir);
    ASSERT_EQ(outcome.status, 0) << outcome.output;
    const size_t undated = outcome.output.find("camera 1 (cam_00_01)"), note = outcome.output.find("are arrival times");
    ASSERT_NE(note, std::string::npos) << outcome.output;
    EXPECT_LT(undated, note) << outcome.output;
    EXPECT_EQ(outcome.output.find("are arrival times", note + 1), std::string::npos) << outcome.output;
    const std::vector<double> stamps = stamps_of(dir / "films/cam_00_00.mkv");
    ASSERT_GT(stamps.size(), 10u);
    for (const double stamp : stamps)
      EXPECT_LE(std::abs(std::remainder(stamp - stamps.back(), 1.0 / 30)), 0.0025) << "at " << stamp << " s";
  }
  test::RtspServer::clean_up();
}

TEST(LfRigRecord, PortInUseIsAnError) {
  const TempDir dir;
  write_rig(dir, {kGood});
  const int taken = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  socklen_t size = sizeof address;
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(bind(taken, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(listen(taken, 1), 0);
  ASSERT_EQ(getsockname(taken, reinterpret_cast<sockaddr*>(&address), &size), 0);
  const std::string port = std::to_string(ntohs(address.sin_port));
  const Outcome outcome = lf_rig("record rig.json --out films --seconds 1 --page " + port, dir);
  close(taken);
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.output, HasSubstr("port " + port + ": "));
}

TEST(LfRigRecord, NamesBecomeFileNames) {
  const TempDir dir;
  write_rig(dir, {kGood, kGood});
  Rig rig = load_rig(dir / "rig.json");
  rig.cameras[1].name = "../up";
  save_rig(rig, dir / "rig.json");
  test::expect_outcome(lf_rig("record rig.json --out films --seconds 1", dir), 1,
                       mentions("cameras[1].name", "../up", "file name"));
}

TEST(LfRigLock, NeedsACameraThatReportsControls) {
  const TempDir dir;
  write_rig(dir, {kGood});
  EXPECT_THAT(lf_rig("lock rig.json --settle 0.2", dir).output,
              mentions("camera 0", "cam_00_00", "exposure", "gain", "white balance", "focus"));
  EXPECT_THAT(lf_rig("lock rig.json --camera 4", dir).output, mentions("rig.json", "camera 4"));
}

// Uses films of a moving bar as cameras. Checks the detected positions during filming, and the cost.
class Watching : public testing::Test {
 protected:
  void film(const Rig& rig, const std::string& arguments) {
    save_rig(rig, dir_ / "rig.json");
    test::expect_outcome(run_program("lf-scene", "lights --rig rig.json --out lights " + arguments, dir_.path()), 0);
  }
  const TempDir dir_;
};

TEST_F(Watching, TracksTheLightsOfARecording) {
  ASSERT_NO_FATAL_FAILURE(film(scene_rig(2, 2, 640, 480), "--framerate 30 --seconds 8"));
  const std::string path = dir_ / "lights/rig.json";
  const auto rig = std::make_shared<const Rig>(load_rig(path));
  cameras::LightTracker watch(*rig, 2);
  const std::vector<cameras::RecordedCamera> recorded = cameras::record_cameras(
      rig, path, dir_ / "films", {.seconds = 6, .shown = [&](const cameras::CameraFrame& frame) { watch.see(frame); }},
      [](double) { return true; });
  for (const cameras::RecordedCamera& one : recorded) EXPECT_EQ(one.problem, "");
  const uint64_t looks = watch.frames_processed();
  EXPECT_GT(looks, 4u * 10);
  EXPECT_LE(looks, 4u * 32) << "five a second";
  std::printf("%.2f ms of CPU time per 640x480 frame\n", 1e3 * watch.busy() / static_cast<double>(looks));
  // At most as many positions as the lights visited, and only a few fewer.
  const auto truth = parse_light_detections(read_text_file(dir_ / "lights/lights.json"), "lights.json");
  ASSERT_TRUE(truth);
  for (CameraIndex i = 0; i < 4; i++) {
    CoverageGrid places(640, 480);
    for (const LightDetections::Frame& frame : truth->cameras[i].frames)
      for (const LightDetection& sight : frame.sights) places.come(sight.pixel);
    EXPECT_LE(watch.places(i).share(), places.share() + 1.5 / 12);
    EXPECT_GE(watch.places(i).share(), 0.5 * places.share());
  }
  EXPECT_THAT(watch.summary(), AllOf(mentions("light", "covered"), HasSubstr("Next: ")));
}

TEST_F(Watching, LfRigRecordReportsCoverage) {
  ASSERT_NO_FATAL_FAILURE(film(scene_rig(1, 2, 320, 240), "--framerate 15 --seconds 6"));
  test::expect_outcome(run_program("lf-rig", "record lights/rig.json --out films --seconds 5 --lights 2", dir_.path()),
                       0,
                       AllOf(mentions("left", "right"), mentions("light", "covered"), HasSubstr("Next: "),
                             mentions("films", "2 of 2 cameras")));
  EXPECT_NE(run_program("lf-rig", "record lights/rig.json --out films --lights 3", dir_.path()).status, 0);
}

}  // namespace
}  // namespace lf
