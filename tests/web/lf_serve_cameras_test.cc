// SPDX-License-Identifier: LGPL-2.1-or-later
// Camera failures: lf-serve and its viewers continue without the failed camera.
#include "gst/rtsp_server.h"
#include "pipelines/gst_launch.h"
#include "web/served.h"
#include "web/whep_client.h"

namespace lf::test {
namespace {

class LfServeCameras : public testing::Test {
 protected:
  static bool receives_pictures(const WhepClient& client) {
    const uint64_t before = client.pictures();
    return becomes([&] { return client.pictures() >= before + 15; });
  }
  static bool has_message(const WhepClient& client, const std::string& text) {
    return becomes([&] {
      const std::vector<std::string> messages = client.messages();
      const auto last = std::find_if(messages.rbegin(), messages.rend(),
                                     [](const std::string& message) { return contains(message, "\"statistics\""); });
      return last != messages.rend() && contains(*last, text);
    });
  }
  static void expect_one_viewer_and_clean_exit(Served& served) {
    EXPECT_EQ(served.metric("viewers"), "1");
    EXPECT_EQ(served.metric("viewers_total"), "1") << "no viewer had to reconnect";
    EXPECT_EQ(served.stop(), 0);
  }
  CameraFiles files_;
};

TEST_F(LfServeCameras, MissingAndDamagedFilesDoNotEndTheServer) {
  std::string film = read_binary(files_.path("mjpeg.mkv"));
  std::fill(film.begin() + static_cast<long>(film.size() / 2), film.begin() + static_cast<long>(film.size() * 3 / 4),
            '\x5a');
  std::ofstream(files_.path("damaged.mkv"), std::ios::binary) << film;
  // Larger than the readers' buffers.
  expect_runs(
      "videotestsrc pattern=snow num-buffers=150 ! video/x-raw,format=I420,width=64,height=48,framerate=15/1 "
      "! jpegenc quality=100 ! matroskamux ! filesink location=" +
      files_.path("emptied.mkv"));
  Served served({}, [this](Rig& rig) {
    rig.cameras[0].source = files_.path("mjpeg.mkv");
    rig.cameras[1].source = files_.path("nowhere.mkv");
    rig.cameras[2].source = files_.path("damaged.mkv");
    rig.cameras[3].source = files_.path("emptied.mkv");
  });
  ASSERT_NE(served.url(), "") << served.said();
  EXPECT_TRUE(served.says({"nowhere.mkv", "no such", "out of service"}));
  const WhepClient client({.url = served.url()});
  EXPECT_TRUE(receives_pictures(client));
  std::filesystem::resize_file(files_.path("emptied.mkv"), 0);
  EXPECT_TRUE(served.says({"emptied.mkv"})) << served.said();
  EXPECT_TRUE(receives_pictures(client));
  std::filesystem::copy(files_.path("mjpeg.mkv"), files_.path("nowhere.mkv"));
  EXPECT_TRUE(served.says({"camera1 is back"})) << served.said();
  EXPECT_TRUE(receives_pictures(client));
  expect_one_viewer_and_clean_exit(served);
}

TEST_F(LfServeCameras, NeverRevealsPasswords) {
  Served served({}, [this](Rig& rig) {
    for (Camera& camera : rig.cameras) camera.source = files_.path("mjpeg.mkv");
    rig.cameras[0].source = "rtsp://admin:Hunter2Secret@127.0.0.1:1/stream";
    rig.cameras[1].source = "rtspsrc location=rtsp://127.0.0.1:1/ user-pw=Hunter2Secret ! decodebin";
  });
  ASSERT_NE(served.url(), "") << served.said();
  EXPECT_TRUE(served.says({"127.0.0.1:1/stream"}));
  EXPECT_TRUE(becomes([&] { return contains(served.get("mosaic.json"), "127.0.0.1:1/stream"); }));
  const WhepClient client({.url = served.url()});
  EXPECT_TRUE(has_message(client, "\"cameras\""));
  for (const char* path : {"", "mosaic.json", "metrics", "healthz", "array.json", "rig.json"})
    EXPECT_THAT(served.get(path), Not(HasSubstr("Hunter2"))) << path;
  for (const std::string& message : client.messages()) EXPECT_THAT(message, Not(HasSubstr("Hunter2")));
  EXPECT_EQ(served.stop(), 0);
  EXPECT_THAT(served.said(), Not(HasSubstr("Hunter2")));
}

TEST_F(LfServeCameras, ReadablePasswordsCauseAWarning) {
  using std::filesystem::perm_options, std::filesystem::perms;
  const auto edit = [this](Rig& rig) {
    for (Camera& camera : rig.cameras) camera.source = files_.path("mjpeg.mkv");
    rig.cameras[1].source = "rtsp://admin:Hunter2Secret@127.0.0.1:1/stream";
  };
  Served served({}, edit);
  EXPECT_EQ(served.stop(), 0);
  std::filesystem::permissions(served.rig(), perms::owner_read | perms::owner_write);
  Served closed(Served::ExistingRig{served.rig()});
  ASSERT_NE(closed.url(), "") << closed.said();
  EXPECT_EQ(closed.stop(), 0);
  EXPECT_THAT(closed.said(), Not(HasSubstr("chmod")));
  std::filesystem::permissions(served.rig(), perms::others_read, perm_options::add);
  expect_outcome(run_program("lf-rig", "check " + served.rig()), 0,
                 AllOf(mentions("rig.json", "warning", "cameras[1]", "password"), mentions("chmod 600", served.rig())));
  Served again(Served::ExistingRig{served.rig()});
  ASSERT_NE(again.url(), "") << again.said();
  EXPECT_TRUE(again.says({"chmod 600", served.rig()})) << again.said();
  EXPECT_EQ(again.stop(), 0);
}

TEST_F(LfServeCameras, UnlistedElementsNeedTrust) {
  const std::string mark = files_.path("written-by-the-rig");
  const auto edit = [&](Rig& rig) {
    rig.cameras[0].source =
        "videotestsrc is-live=true ! video/x-raw,format=RGB,width=64,height=48,framerate=15/1 ! tee name=t t. ! queue "
        "! filesink location=" +
        mark + " t. ! queue";
  };
  Served refused({}, edit);
  EXPECT_EQ(refused.url(), "");
  EXPECT_EQ(refused.stop(), 1);
  EXPECT_THAT(refused.said(), AllOf(mentions("source", "tee"), HasSubstr("--trust-rig")));
  EXPECT_FALSE(std::filesystem::exists(mark));
  Served served({"--trust-rig"}, edit);
  EXPECT_NE(served.url(), "") << served.said();
  EXPECT_TRUE(becomes([&] { return std::filesystem::exists(mark); }));
}

TEST_F(LfServeCameras, CameraServerMayRestart) {
  if (kRtspServerMissing) GTEST_SKIP() << kRtspServerMissing;
  auto server = std::make_unique<RtspServer>();
  const int port = server->port();
  Served served({}, [&](Rig& rig) {
    for (Camera& camera : rig.cameras) camera.source = files_.path("mjpeg.mkv");
    rig.cameras[2].source = server->uri("/jpeg");
  });
  ASSERT_NE(served.url(), "") << served.said();
  const WhepClient client({.url = served.url()});
  EXPECT_TRUE(receives_pictures(client));
  server.reset();
  EXPECT_TRUE(served.says({"/jpeg"})) << served.said();
  EXPECT_THAT(served.said(), HasSubstr("out of service"));
  EXPECT_TRUE(has_message(client, "\"cameras\":{\"count\":4,\"working\":3}"));
  EXPECT_TRUE(receives_pictures(client));
  server = std::make_unique<RtspServer>(port);
  EXPECT_TRUE(served.says({"camera2 is back"})) << served.said();
  EXPECT_TRUE(receives_pictures(client));
  expect_one_viewer_and_clean_exit(served);
}

TEST_F(LfServeCameras, AllCameraServersMayRestart) {
  if (kRtspServerMissing) GTEST_SKIP() << kRtspServerMissing;
  auto server = std::make_unique<RtspServer>();
  const int port = server->port();
  Served served({}, [&](Rig& rig) {
    for (Camera& camera : rig.cameras) camera.source = server->uri("/jpeg");
  });
  ASSERT_NE(served.url(), "") << served.said();
  const WhepClient client({.url = served.url()});
  EXPECT_TRUE(has_message(client, "\"cameras\":{\"count\":4,\"working\":4}"));
  server.reset();
  EXPECT_TRUE(served.says({"No camera works"})) << served.said();
  EXPECT_TRUE(has_message(client, "\"cameras\":{\"count\":4,\"working\":0}"));
  EXPECT_TRUE(receives_pictures(client)) << "with the last picture";
  server = std::make_unique<RtspServer>(port);
  EXPECT_TRUE(has_message(client, "\"cameras\":{\"count\":4,\"working\":4}")) << served.said();
  EXPECT_TRUE(receives_pictures(client));
  expect_one_viewer_and_clean_exit(served);
}

// A calibration finishes, then other cameras are connected: viewers do not have to reload.
TEST_F(LfServeCameras, ChangedRigIsAppliedWithoutARestart) {
  const std::vector<std::string> options = {"--watch"};
  Served served(options);
  ASSERT_NE(served.url(), "") << served.said();
  const WhepClient client({.url = served.url()});
  const auto told = [&] {
    const std::vector<std::string> messages = client.messages();
    return std::ranges::count_if(messages, [](const std::string& text) { return contains(text, "\"rig\""); });
  };
  EXPECT_TRUE(receives_pictures(client));
  Rig rig = load_rig(served.rig());
  rig.cameras[0].pose.position.x += 0.01;
  save_rig(rig, served.rig());
  EXPECT_TRUE(becomes([&] { return told() == 1; })) << served.said();
  EXPECT_TRUE(receives_pictures(client));

  // Colours change as well, although weights do not depend on colours.
  rig.cameras[1].colour = ColourModel{.black = {1, 2, 3}};
  save_rig(rig, served.rig());
  EXPECT_TRUE(becomes([&] { return told() == 2; })) << served.said();
  EXPECT_TRUE(receives_pictures(client));

  write_text_file("{ not yet", served.rig());
  EXPECT_TRUE(served.says({"old rig"})) << served.said();
  EXPECT_TRUE(receives_pictures(client));

  for (Camera& camera : rig.cameras) camera.source = files_.path("mjpeg.mkv");
  save_rig(rig, served.rig());
  EXPECT_TRUE(served.says({"rig file", "other cameras"})) << served.said();
  EXPECT_TRUE(becomes([&] { return told() == 3; })) << served.said();
  EXPECT_TRUE(receives_pictures(client)) << served.said();

  for (Camera& camera : rig.cameras) camera.source = files_.path("nowhere.mkv");
  save_rig(rig, served.rig());
  EXPECT_TRUE(served.says({"no pictures", "rig file"})) << served.said();
  for (Camera& camera : rig.cameras) camera.source = files_.path("mjpeg.mkv");
  save_rig(rig, served.rig());
  EXPECT_TRUE(receives_pictures(client)) << served.said();
  expect_one_viewer_and_clean_exit(served);
}

TEST_F(LfServeCameras, ImpossibleOptionsAreErrors) {
  EXPECT_THAT(run_program("lf-serve", "--watch").output, HasSubstr("--watch: requires --rig"));
  EXPECT_THAT(run_program("lf-serve", "--key-file /nobody").output, HasSubstr("--key-file: requires --nodes"));
  EXPECT_THAT(run_program("lf-serve", "--focus-near 5 --focus-far 1").output, mentions("--focus-near", "--focus-far"));
}

class LfServeNodes : public testing::Test {
 protected:
  void start_host(const std::string& rig, const TempFile& key) {
    host_ = launch("lfnodesink name=n rig=" + rig + " listen=127.0.0.1:" + std::to_string(there_) +
                   " answers=127.0.0.1:" + std::to_string(here_) + " key-file=" + key.path());
    ASSERT_NE(gst_element_set_state(host_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  }
  void stop_host() { host_.reset(); }
  uint64_t requests(const char* field) { return stat(child_of(host_.get(), "requests0_gate").get(), field); }
  std::vector<std::string> options(const TempFile& key) const {
    return {"--nodes", "127.0.0.1:" + std::to_string(there_) + ":127.0.0.1:" + std::to_string(here_), "--key-file",
            key.path()};
  }
  static double camera_bytes(const Served& served) { return std::stod(served.metric("camera_bytes_total")); }

  const int there_ = free_port(SOCK_DGRAM), here_ = free_port(SOCK_DGRAM);
  const TempFile key_{std::string(40, 'k')}, other_{std::string(40, 'o')};
  PipelinePtr host_;
};

TEST_F(LfServeNodes, ServeClientsWithTheKey) {
  Served served(options(key_));
  ASSERT_NE(served.url(), "") << served.said();
  start_host(served.rig(), key_);
  const WhepClient client({.url = served.url()});
  EXPECT_TRUE(becomes([&] { return requests("passed") > 5 && camera_bytes(served) > 0; }));
  EXPECT_EQ(requests("forged"), 0u);
  stop_host();
  start_host(served.rig(), other_);
  EXPECT_TRUE(becomes([&] { return requests("forged") > 5; }));
  EXPECT_EQ(requests("passed"), 0u);
  EXPECT_EQ(served.stop(), 0);
}

TEST_F(LfServeNodes, AreNamedWhenTheyDoNotAnswer) {
  Served served(options(key_));
  ASSERT_NE(served.url(), "") << served.said();
  const std::string name = "127.0.0.1:" + std::to_string(there_), metric = "node_silent{node=\"" + name + "\"}";
  start_host(served.rig(), key_);
  const WhepClient client({.url = served.url()});
  EXPECT_TRUE(becomes([&] { return camera_bytes(served) > 0 && served.metric(metric) == "0"; }));
  EXPECT_THAT(served.said(), Not(HasSubstr(name + " does not")));
  stop_host();
  EXPECT_TRUE(becomes([&] { return served.metric(metric) == "1"; }));
  EXPECT_TRUE(becomes([&] { return contains(served.said(), "cameras: " + name + " does not answer\n"); }));
  start_host(served.rig(), key_);
  EXPECT_TRUE(becomes([&] { return contains(served.said(), "cameras: " + name + " answers again\n"); }));
  EXPECT_EQ(served.metric(metric), "0");
}

TEST_F(LfServeNodes, PortInUseIsAnError) {
  Served served(options(key_)), second(options(key_));
  ASSERT_NE(served.url(), "") << served.said();
  EXPECT_EQ(second.stop(), 1);
  EXPECT_THAT(second.said(), HasSubstr("UDP port " + std::to_string(here_) + ": "));
}

TEST_F(LfServeNodes, KeyErrorsNameTheProblem) {
  const Served served({"--nodes", "127.0.0.1:6000:6100", "--key-file", "/nowhere/key"});
  EXPECT_EQ(served.url(), "");
  EXPECT_THAT(served.said(), mentions("/nowhere/key", "read"));
}

}  // namespace
}  // namespace lf::test
