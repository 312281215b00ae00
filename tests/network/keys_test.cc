// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Access to the cameras of a host on a shared network: pipelines/ with and without keys.
#include <signal.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "network/array_network.h"
#include "rig/rig_json.h"
#include "support/run_program.h"

namespace lf::test {
namespace {

constexpr char kComplete[] = "complete=(boolean)true";
constexpr char kAnybody[] = "anyone on this network";

class Keys : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string reason = Network::unavailable(); !reason.empty()) GTEST_SKIP() << reason;
    network_ = std::make_unique<Network>(std::vector<std::string>{"cameras", "viewer", "stranger"});
    expect_outcome(
        run_program("lf-scene", "--out . --grid 2x2 --frames 1 --samples 1 --width 80 --height 60", folder_.path()), 0);
    Rig rig = load_rig(folder_ / "rig.json");
    for (Camera& camera : rig.cameras) camera.source.clear();  // use the first frame, a still image, forever
    save_rig(rig, folder_ / "rig.json");
    folder_.write_secret("key", std::string(kSecret) + "\n");
    folder_.write_secret("other-key", "another secret of thirty-two or more\n");
  }
  std::unique_ptr<Process> start(const std::string& host, std::vector<std::string> command) {
    command.insert(command.begin(), {"env", "GST_PLUGIN_PATH=" LF_PLUGIN_DIR,
                                     "GST_REGISTRY=" LF_PLUGIN_DIR "/test-registry.bin", "GST_DEBUG=srtp*:5"});
    return network_->start(host, command);
  }
  std::unique_ptr<Process> launch(const std::string& host, const std::string& line) {
    return start(host, {"sh", "-c", "exec gst-launch-1.0 -m " + line});
  }
  std::string with(const std::string& key) const { return " rig=" + folder_ / "rig.json" + sealed(key); }
  std::string sealed(const std::string& key) const { return key.empty() ? "" : " key-file=" + folder_ / key; }
  std::unique_ptr<Process> start_cameras(const std::string& key, const std::string& peers = "",
                                         const std::string& to = "viewer") {
    return launch("cameras", "lfnodesink" + with(key) + " listen=6000 answers=" + address(to) + ":6100" +
                                 (peers.empty() ? "" : " peers=" + peers));
  }
  std::unique_ptr<Process> start_viewer(const std::string& key, const std::string& place,
                                        const std::string& host = "viewer", const std::string& port = "6100",
                                        const std::string& more = "") {
    return launch(host, "lfviewsrc" + with(key) + " nodes=" + place + ":" + port +
                            " framerate=15/1 capture-delay=100000000 post-messages=true" + more +
                            " ! fakesink sync=false");
  }
  std::string cameras() const { return address("cameras") + ":6000"; }
  const std::string& address(const std::string& host) const { return network_->address(host); }

  static constexpr char kSecret[] = "a secret that only these two hosts know";
  TempDir folder_;
  std::unique_ptr<Network> network_;
};

TEST_F(Keys, HostsWithTheSameKeyCommunicate) {
  const auto node = start_cameras("key");
  auto viewer = start_viewer("key", cameras());
  EXPECT_TRUE(viewer->wait_for(kComplete, 10)) << viewer->text() << node->text();
  for (const Process* process : {node.get(), viewer.get()})
    EXPECT_THAT(process->text(), AllOf(Not(HasSubstr(kSecret)), Not(HasSubstr(kAnybody)), Not(HasSubstr("dropped"))));
  viewer.reset();
  auto again = start_viewer("key", cameras(), "viewer", address("viewer") + ":6100");
  EXPECT_TRUE(again->wait_for(kComplete, 10)) << again->text();
}

// The administrator replaces the key on one host after another, while a viewer shows pictures.
TEST_F(Keys, AreReplacedWithoutLosingAPicture) {
  const std::string first(40, '1'), second(40, '2');
  for (const char* host : {"of-cameras", "of-viewer"}) folder_.write_secret(host, first);
  const auto node = start_cameras("of-cameras");
  // The deadline of the answers is long, so that only lost packets make a picture incomplete.
  const auto viewer = start_viewer("of-viewer", cameras(), "viewer", "6100", " latency=1000000000");
  ASSERT_TRUE(viewer->wait_for(kComplete, 10)) << viewer->text() << node->text();
  const size_t begun = viewer->lines().size();
  for (const std::string& text : {first + "\n" + second, second + "\n" + first, second})
    for (const char* host : {"of-viewer", "of-cameras"}) {
      const std::string fresh = folder_.write_secret(std::string(host) + ".new", text);
      std::filesystem::rename(fresh, folder_ / host);
      std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    }
  int pictures = 0, lost = 0;
  for (const Process::Line& line : viewer->lines(begun)) {
    if (line.text.find("lightfield-view,") == line.text.npos) continue;
    pictures++;
    lost += line.text.find(kComplete) == line.text.npos;
  }
  EXPECT_GE(pictures, 100);
  EXPECT_EQ(lost, 0) << viewer->text() << node->text();
  for (const Process* process : {node.get(), viewer.get()}) EXPECT_THAT(process->text(), Not(HasSubstr("dropped:")));
  folder_.write_secret("old", first);
  const auto late = start_viewer("old", cameras(), "stranger");
  EXPECT_TRUE(node->wait_for("are dropped")) << node->text();
}

class WrongKeys : public Keys, public testing::WithParamInterface<std::pair<const char*, const char*>> {};

TEST_P(WrongKeys, CannotRead) {
  const auto [of_cameras, of_viewer] = GetParam();
  const auto node = start_cameras(of_cameras), viewer = start_viewer(of_viewer, cameras());
  // Hosts without the key cannot read an encrypted request and count it as unreadable.
  if (*of_cameras) {
    EXPECT_TRUE(node->wait_for(address("viewer") + " are dropped")) << node->text();
  } else {
    EXPECT_TRUE(node->wait_for(kAnybody)) << node->text();
  }
  EXPECT_TRUE(viewer->wait_for("lightfield-view,", 20)) << viewer->text();
  EXPECT_THAT(viewer->text(), Not(HasSubstr(kComplete)));
}
INSTANTIATE_TEST_SUITE_P(Each, WrongKeys,
                         testing::Values(std::pair{"key", "other-key"}, std::pair{"key", ""}, std::pair{"", "key"}));

TEST_F(Keys, WithoutAKeyTheReceiverOfAnswersMaySendRequests) {
  const auto node = start_cameras(""), viewer = start_viewer("", cameras());
  EXPECT_TRUE(node->wait_for(kAnybody)) << node->text();
  EXPECT_TRUE(viewer->wait_for(kComplete, 5)) << viewer->text() << node->text();
  EXPECT_THAT(node->text(), Not(HasSubstr("dropped")));
  const auto stranger = start_viewer("", cameras(), "stranger");
  EXPECT_TRUE(node->wait_for(address("stranger") + " are dropped: unknown")) << node->text();
  EXPECT_TRUE(viewer->wait_for(kComplete, 30)) << viewer->text();
}

TEST_F(Keys, PeersMaySendRequests) {
  const auto refused = start_cameras("", "10.77.0.0/31," + address("stranger")), viewer = start_viewer("", cameras());
  EXPECT_TRUE(refused->wait_for(address("viewer") + " are dropped")) << refused->text();
  EXPECT_THAT(viewer->text(), Not(HasSubstr(kComplete)));
  refused->signal(SIGKILL);
  const auto node = start_cameras("", "10.77.0.2/31");
  EXPECT_TRUE(viewer->wait_for(kComplete, 3)) << viewer->text();
}

// An intermediate host without the key forwards requests, then repeated or truncated copies.
class ManInTheMiddle : public Keys, public testing::WithParamInterface<std::pair<const char*, const char*>> {};

TEST_P(ManInTheMiddle, CannotTamper) {
  const auto [again, words] = GetParam();
  const std::string to = " ! udpsink sync=false async=false port=6000 host=" + address("cameras");
  const auto between = start("stranger", {"sh", "-c",
                                          "exec gst-launch-1.0 -q udpsrc port=7000 ! tee name=t  t. ! queue" + to +
                                              "  t. ! queue min-threshold-buffers=2 ! " + again + to});
  const auto node = start_cameras("key"), viewer = start_viewer("key", address("stranger") + ":7000");
  EXPECT_TRUE(viewer->wait_for(kComplete, 10)) << viewer->text() << node->text();
  EXPECT_TRUE(node->wait_for(address("stranger") + " are dropped: " + words)) << node->text();
  EXPECT_TRUE(viewer->wait_for(kComplete, 20)) << viewer->text();
  EXPECT_TRUE(between->is_running()) << between->text();
}
INSTANTIATE_TEST_SUITE_P(Each, ManInTheMiddle,
                         testing::Values(std::pair{"identity", "replayed"},
                                         std::pair{"rndbuffersize min=30 max=31", "not RTP"},
                                         std::pair{"rndbuffersize min=300 max=301", "not encrypted: "}));

TEST_F(Keys, CompositorHostsAndViewersShareAKey) {
  const auto node = start_cameras("key", "", "stranger");
  const std::string seal = " ! lfrtpseal" + sealed("key") + " ! udpsink sync=false async=false host=",
                    shown = folder_ / "shown";
  const auto compositor =
      launch("stranger", "lfviewsrc name=v post-messages=true listen=6200 nodes=" + cameras() + ":6100" + with("key") +
                             " v.src_2 ! queue ! videoconvert ! video/x-raw,format=I420 ! jpegenc ! rtpjpegpay" + seal +
                             address("viewer") + " port=6300");
  const auto viewer =
      launch("viewer",
             "lfviewrequest view-id=3 navigation-element=pictures is-live=true capture-delay=100000000 framerate=30/1 "
             "rig=" +
                 folder_ / "rig.json" + " ! rtplfpay" + seal + address("stranger") + " port=6200  udpsrc " +
                 "port=6300 caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=JPEG,payload=26 ! " +
                 "lfrtpgate" + sealed("key") + " ! rtpjpegdepay ! jpegdec name=pictures ! videoconvert ! filesink " +
                 "buffer-mode=unbuffered sync=false async=false location=" + shown);
  EXPECT_TRUE(compositor->wait_for(kComplete, 10)) << compositor->text();
  EXPECT_THAT(compositor->text(), AllOf(HasSubstr("view-id=(uint)3"), Not(HasSubstr(kAnybody))));
  EXPECT_TRUE(eventually([&] { return !read_binary(shown).empty(); })) << viewer->text();
  for (const Process* process : {node.get(), compositor.get(), viewer.get()})
    EXPECT_THAT(process->text(), AllOf(Not(HasSubstr(kSecret)), Not(HasSubstr("are dropped"))));
}

TEST_F(Keys, AnswersArriveAtTheGivenAddress) {
  const auto viewer = start_viewer("key", cameras(), "viewer", address("viewer") + ":6100");
  const auto everywhere = start_viewer("key", cameras(), "stranger");
  EXPECT_TRUE(viewer->wait_for("lightfield-view,")) << viewer->text();
  EXPECT_TRUE(everywhere->wait_for("lightfield-view,")) << everywhere->text();
  const auto sockets = start("viewer", {"sh", "-c", "cat /proc/net/udp /proc/net/udp6; echo end"}),
             others = start("stranger", {"sh", "-c", "cat /proc/net/udp /proc/net/udp6; echo end"});
  ASSERT_TRUE(sockets->wait_for("end"));
  ASSERT_TRUE(others->wait_for("end"));
  EXPECT_THAT(sockets->text(), AllOf(HasSubstr(" 02004D0A:17D4 "), Not(HasSubstr("00000000:17D4 "))));
  EXPECT_THAT(others->text(), HasSubstr("00000000:17D4 "));
}

}  // namespace
}  // namespace lf::test
