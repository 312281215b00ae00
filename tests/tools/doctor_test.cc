// SPDX-License-Identifier: LGPL-2.1-or-later
#include "../../tools/cameras/doctor.h"
#include "../../tools/cameras/links.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf::cameras {
namespace {

struct Healthy {
  explicit Healthy(int count) : rig(make_grid_rig({1, count, 0.1, 60, 640, 480})) {
    for (int i = 0; i < count; i++) {
      CameraReport camera{.camera = static_cast<CameraIndex>(i), .delay = 0.03, .format = "JPEG", .stamps = "source"};
      camera.times = {.frames = 120, .period = 1 / 30.0, .first = 1, .jitter = 1e-4};
      camera.brightness = camera.darkest = camera.brightest = 100;
      camera.attachment.device = "/dev/video" + std::to_string(i);
      exam.cameras.push_back(camera);
    }
  }
  std::string findings() const {
    std::string text;
    for (const DoctorFinding& finding : find_problems(rig, exam))
      text += std::string(finding.error ? "error: " : "warning: ") + finding.cameras + ": " + finding.what + " | " +
              finding.remedy + "\n";
    return text;
  }
  CameraReport& operator[](size_t i) { return exam.cameras[i]; }
  Rig rig;
  DoctorReport exam;
};

TEST(Doctor, ReportsNoUsbLinkForOtherSources) { EXPECT_EQ(Healthy(4).findings(), ""); }

TEST(Doctor, DoesNotAdviseToPlugInFiles) {
  const struct {
    const char *source, *image, *problem, *remedy;
  } cases[] = {
      {"a.mkv", "", "a.mkv: no such file", "check the path"},
      {"file:///a.mkv", "", "/a.mkv: no such file", "check the path"},
      {"", "a.png", "a.png: no such file", "check the path"},
      {"a_%d.png", "", "a_%d.png: no such files (the first file must have number 0 or 1)", "check the path"},
      {"a.mkv", "", "file:///a.mkv: Could not determine type of stream", "complete"},
      {"a.mkv", "", "a.mkv: the source has no pictures", "complete"},
      {"a.mkv", "", "element jpegdec is not installed", "install"},
      {"v4l2:///dev/video9", "", "Cannot identify device '/dev/video9'", "plug it in"},
      {"/dev/video9", "", "/dev/video9: no such file", "plug it in"},
      {"rtsp://camera/x", "a.png", "rtsp://camera/x: gives nothing", "switched on"},
      {"v4l2src device=/dev/video9 ! image/jpeg", "", "gives nothing", "switched on"},
      {"http://h/x", "", "http://h/x: Not Found", "stream"},
      {"a_%d.png", "", "a_2.png: missing, while a_3.png exists: add the missing picture", "copy"},
  };
  for (const auto& c : cases) {
    Camera camera;
    camera.source = c.source;
    camera.image = c.image;
    EXPECT_THAT(remedy_for(camera, c.problem), HasSubstr(c.remedy)) << c.source << c.image << ": " << c.problem;
  }
}

TEST(Doctor, DistinguishesWrongFromMissingPasswords) {
  const struct {
    const char *source, *problem, *remedy;
  } cases[] = {
      {"http://user:wrong@host/x", "http://host/x: the camera refuses access (HTTP 401, Unauthorized)", "password"},
      {"http://host/x", "http://host/x: the camera refuses access (HTTP 401, Login)", "http://USER:PASSWORD@HOST/"},
      {"http://user:good@host/x", "http://host/x: the camera refuses access (HTTP 403, Forbidden)", "this user"},
      {"rtsp://user:wrong@host/x", "rtsp://host/x: Unauthorized", "password"},
      {"rtsps://host/x", "rtsps://host/x: Unauthorized", "rtsps://USER:PASSWORD@HOST/"},
      {"rtspsrc location=rtsp://host/x ! decodebin", "Unauthorized", "user-id=USER user-pw=PASSWORD"},
      {"rtspsrc location=rtsp://host/x user-id=u user-pw=p ! decodebin", "Unauthorized", "password"},
  };
  for (const auto& c : cases) {
    Camera camera;
    camera.source = c.source;
    EXPECT_THAT(remedy_for(camera, c.problem), HasSubstr(c.remedy)) << c.source;
  }
}

TEST(Doctor, NamesTheCameraAndTheRemedy) {
  const struct {
    void (*make_ill)(CameraReport&);
    std::vector<std::string> facts;  // including facts of the remedy
  } cases[] = {
      {[](CameraReport& c) {
         c.problem = "rig.json: camera 1 (cam_00_01): a.mkv: the picture is 320x240, the rig says 640x480";
       },
       {"error: camera 1 (cam_00_01):", "a.mkv", "320x240", "width", "height"}},
      {[](CameraReport& c) { c.problem = "Device '/dev/video1' is busy"; }, {"is busy", "another program"}},
      {[](CameraReport& c) { c.problem = "Could not connect to server"; }, {"Could not connect", "switched on"}},
      {[](CameraReport& c) { c.times = {}; }, {"error: camera 1 (cam_00_01):", "no frames", "unplug"}},
      {[](CameraReport& c) { c.times.missing = 12; },
       {"warning: camera 1 (cam_00_01):", "9 %", "missing", "12 of 132", "frame rate"}},
      {[](CameraReport& c) {
         c.times.missing = 12;
         c.left_undecoded = 5;
       },
       {"missing", "this machine", "decode"}},
      {[](CameraReport& c) {
         c.times.missing = 12;
         c.attachment.link = usb_link(1, 480);
       },
       {"missing", "MJPEG"}},
      {[](CameraReport& c) {
         c.times.missing = 12;
         c.attachment.link.kind = Link::Kind::kNetwork;
       },
       {"missing", "packet delay"}},
      {[](CameraReport& c) { c.times.period = 1 / 25.0; }, {"25.00 frames/s", "30.00", "dark"}},
      {[](CameraReport& c) { c.times.backwards = 2; }, {"2 frames", "timestamp", "clock"}},
      {[](CameraReport& c) { c.times.jitter = 0.008; }, {"jitter", "8.0 ms", "double"}},
      {[](CameraReport& c) { c.stamps = "arrival"; }, {"arrival times", "sender reports"}},
      {[](CameraReport& c) {
         c.decoded_frames = c.damaged = 4;
         c.damage = "no end";
       },
       {"error: camera 1 (cam_00_01):", "decoded", "no end", "image format"}},
      {[](CameraReport& c) {
         c.decoded_frames = 4;
         c.damaged = 1;
       },
       {"warning: camera 1 (cam_00_01):", "1 of 4", "damaged", "cable"}},
      {[](CameraReport& c) { c.brightest = c.darkest = 1; }, {"error: camera 1 (cam_00_01):", "black", "lens cap"}},
      {[](CameraReport& c) { c.brightest = c.darkest = 255; }, {"white", "exposure"}},
      {[](CameraReport& c) { c.darkest = 80; }, {"brightness", "80 to 100", "lf-rig lock"}},
      {[](CameraReport& c) {
         c.controls = {{"exposure", std::nullopt}, {"gain", 3}, {"white_balance", std::nullopt}};
       },
       {"exposure, white_balance", "lf-rig lock"}},
      {[](CameraReport& c) { c.unsupported_controls = {"gain"}; }, {"not support", "gain", "own menu"}},
      {[](CameraReport& c) { c.attachment.device = "/dev/video3"; },
       {"error: camera 3 (cam_00_03):", "same device", "camera 1", "own source"}},
  };
  for (const auto& c : cases) {
    Healthy array(4);
    c.make_ill(array[1]);
    const std::string findings = array.findings();
    EXPECT_THAT(findings, mentions(c.facts));
    EXPECT_EQ(std::count(findings.begin(), findings.end(), '\n'), 1) << findings;
  }
}

TEST(Doctor, CommonProblemsAreOneFinding) {
  Healthy array(4);
  for (CameraReport& camera : array.exam.cameras) camera.darkest = 70;
  EXPECT_THAT(array.findings(), mentions("warning", "array", "4 of 4", "brightness"));
}

TEST(Doctor, LargeArraysListOnlyFaultyCameras) {
  Healthy array(64);
  array[9].times.missing = 30;
  array.exam.findings = find_problems(array.rig, array.exam);
  const std::string page = text_report(array.rig, array.exam);
  EXPECT_LE(std::count(page.begin(), page.end(), '\n'), 10) << page;
  EXPECT_THAT(page, AllOf(HasSubstr("9 (cam_00_09)"), mentions("63 others", "JPEG 640x480", "30.00 to 30.00"),
                          mentions("64 cameras", "0 errors", "1 warning")));
}

// --- Links -----------------------------------------------------------------------------------------------------------

LinkLoad load_of(const Link& link, int cameras, double bytes, bool raw) {
  LinkLoad load{.link = link, .needed = cameras * bytes, .max_needed = bytes, .raw = raw};
  for (int i = 0; i < cameras; i++) load.cameras.push_back(static_cast<CameraIndex>(i));
  load.pixels = cameras * bytes / 2;
  return load;
}

TEST(Links, OverloadedUsbBusIsNamed) {
  const double vga = 640 * 480 * 2 * 30;
  EXPECT_TRUE(check_link(load_of(usb_link(3, 480), 2, vga, true)).empty()) << "36.9 of 48 MB/s";
  const std::vector<LinkWarning> four = check_link(load_of(usb_link(3, 480), 4, vga, true));
  ASSERT_EQ(four.size(), 1u);
  EXPECT_TRUE(four[0].overloaded);
  EXPECT_MENTIONS(four[0].what, "bus 3", "480 Mbit/s", "4 cameras", "74", "48 MB/s");
  EXPECT_MENTIONS(four[0].remedy, "MJPEG", "9.2 MB/s", "52 %", "2 of the");
  const std::vector<LinkWarning> hd = check_link(load_of(usb_link(3, 480), 1, 1280 * 720 * 2 * 30, true));
  ASSERT_EQ(hd.size(), 2u);
  EXPECT_THAT(hd[0].what, mentions("55 MB/s", "USB", "25"));
  EXPECT_TRUE(check_link(load_of(usb_link(2, 5000), 4, 1280 * 720 * 2 * 30, true)).empty());
  EXPECT_TRUE(check_link(load_of({}, 100, 1e12, true)).empty()) << "unknown device";
}

TEST(Links, NearlyFullNetworkIsAWarning) {
  const Link network{Link::Kind::kNetwork, "network eth0 (1000 Mbit/s)", 117.5e6, 0};
  const std::vector<LinkWarning> advice = check_link(load_of(network, 10, 11e6, false));
  ASSERT_EQ(advice.size(), 1u);
  EXPECT_FALSE(advice[0].overloaded);
  EXPECT_THAT(advice[0].remedy, HasSubstr("packet delay"));
}

TEST(Links, CameraIsOnTheBusOfItsDevice) {
  const TempDir dir;
  const std::string usb = "devices/pci0000:00/0000:00:14.0/usb1/1-2/1-2.3";
  dir.write(usb + "/busnum", "1\n");
  dir.write(usb + "/speed", "480\n");
  dir.write(usb + "/1-2.3:1.0/video4linux/video7/name", "webcam\n");
  std::filesystem::create_directories(dir / "class/video4linux/video7");
  std::filesystem::create_directory_symlink(dir / (usb + "/1-2.3:1.0"), dir / "class/video4linux/video7/device");
  const Rig rig = make_grid_rig({1, 1, 1, 60, 8, 6});
  Camera camera;
  for (const char* source : {"v4l2:///none/video7", "v4l2src device=/none/video7 ! image/jpeg",
                             "v4l2src device=\"/none/video7\" extra-controls=\"c,a=1\""}) {
    camera.source = source;
    const Attachment found = find_attachment(rig, camera, dir.path());
    EXPECT_EQ(found.device, "/none/video7") << source;
    EXPECT_EQ(found.link.name, "USB bus 1 (480 Mbit/s)");
    EXPECT_EQ(found.link.capacity, 48e6);
  }
  dir.write("class/net/lo/speed", "100\n");
  camera.source = "rtsp://user:secret@127.0.0.1:8554/a";
  const Attachment network = find_attachment(rig, camera, dir.path());
  EXPECT_EQ(network.device, camera.source);
  EXPECT_EQ(network.link.name, "network lo (100 Mbit/s)");
  EXPECT_NEAR(network.link.capacity, 11.75e6, 1);
  camera.source = "rtspsrc location=rtsp://127.0.0.1/b ! rtph264depay";
  EXPECT_EQ(find_attachment(rig, camera, dir.path()).device, "rtsp://127.0.0.1/b");
  camera.source = "libcamerasrc camera-name=\"/base/imx219@10\" ! queue";
  EXPECT_EQ(find_attachment(rig, camera, dir.path()).device, "/base/imx219@10");
  camera.source = "";
  EXPECT_EQ(find_attachment(rig, camera, dir.path()).device, "");
}

TEST(Links, PlannedLoadsUseTheSources) {
  Rig rig = make_grid_rig({1, 3, 1, 60, 640, 480});
  rig.cameras[0].source = "v4l2src ! video/x-raw,framerate=15/1";
  rig.cameras[1].source = "v4l2src ! image/jpeg,framerate=(fraction)60/1";
  std::vector<CameraReport> cameras;
  for (CameraIndex i = 0; i < 3; i++) {
    cameras.push_back({.camera = i});
    cameras.back().attachment.link = usb_link(static_cast<int>(i), 480);
  }
  const std::vector<LinkLoad> loads = planned_loads(rig, cameras, 0);
  ASSERT_EQ(loads.size(), 3u);
  EXPECT_NEAR(loads[0].needed, 640 * 480 * 2 * 15, 1);
  EXPECT_TRUE(loads[0].raw);
  EXPECT_NEAR(loads[1].needed, 640 * 480 * 60 * kJpegBytesPerPixel, 1);
  EXPECT_NEAR(loads[2].needed, 640 * 480 * 30 * kJpegBytesPerPixel, 1);
}

}  // namespace
}  // namespace lf::cameras
