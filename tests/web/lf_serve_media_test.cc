// SPDX-License-Identifier: LGPL-2.1-or-later
// Media of viewers, and the effect of viewers on each other.
#include "gst/camera_files.h"
#include "support/recorded.h"
#include "web/offers.h"
#include "web/served.h"
#include "web/whep_client.h"

namespace lf::test {
namespace {

class LfServeMedia : public testing::Test {
 protected:
  static std::unique_ptr<WhepClient> watch(const Served& served, WhepClient::Options options = {}) {
    options.url = served.url();
    return std::make_unique<WhepClient>(options);
  }
  static bool receives_pictures(const WhepClient& client, uint64_t pictures = 10) {
    const uint64_t before = client.pictures();
    return becomes([&] { return client.pictures() >= before + pictures; });
  }
};

// webrtcbin accepts any peer: a man in the middle could watch.
TEST_F(LfServeMedia, PeerWithAnotherCertificateGetsNothing) {
  Served served;
  WhepClient::Options stranger;
  stranger.patience = 5;
  for (const char* byte : {"00", "11"}) {
    stranger.fingerprint = std::string("sha-256 ") + byte;
    for (int i = 1; i < 32; i++) stranger.fingerprint += std::string(":") + byte;
    EXPECT_THROW(watch(served, stranger), std::runtime_error);
  }
  EXPECT_THAT(served.said(), mentions("certificate", "offer"));
  EXPECT_TRUE(becomes([&] { return served.metric("viewers") == "0"; }));
  EXPECT_TRUE(receives_pictures(*watch(served)));
}

TEST_F(LfServeMedia, UsesTheCodecOfTheOffer) {
  Served served;
  WhepClient::Options vp8;
  vp8.vp8 = true;
  const auto first = watch(served), second = watch(served, vp8);
  EXPECT_THAT(first->answer(), AllOf(HasSubstr("H264/90000"), HasSubstr("profile-level-id=42e01f")));
  EXPECT_THAT(second->answer(), HasSubstr("VP8/90000"));
  EXPECT_TRUE(receives_pictures(*first));
  EXPECT_TRUE(receives_pictures(*second));
  EXPECT_EQ(served.metric("viewers"), "2");
}

// With this extension, the sender requests display without delay. Other receivers get packets without the extension.
TEST_F(LfServeMedia, PlayoutDelayIsZero) {
  Served served;
  for (const bool vp8 : {false, true}) {
    WhepClient::Options knows;
    knows.vp8 = vp8;
    knows.playout_delay = true;
    const auto first = watch(served, knows);
    EXPECT_THAT(first->answer(), HasSubstr("a=extmap:7 http://www.webrtc.org/experiments/rtp-hdrext/playout-delay"));
    EXPECT_TRUE(receives_pictures(*first));
    EXPECT_GE(first->undelayed(), first->pictures());
  }
  const auto other = watch(served);
  EXPECT_THAT(other->answer(), Not(HasSubstr("extmap")));
  EXPECT_TRUE(receives_pictures(*other));
  EXPECT_EQ(other->undelayed(), 0u);
}

TEST_F(LfServeMedia, VanishedViewersAreRemoved) {
  Served served;
  const auto stays = watch(served), gone = watch(served);
  ASSERT_EQ(served.metric("viewers"), "2");
  gone->vanish();
  const gint64 began = g_get_monotonic_time();
  EXPECT_TRUE(becomes([&] { return served.metric("viewers") == "1"; }));
  std::printf("gone after %.1f s\n", static_cast<double>(g_get_monotonic_time() - began) * 1e-6);
  EXPECT_TRUE(receives_pictures(*stays));
}

TEST_F(LfServeMedia, LostPacketsAreRetransmitted) {
  Served served;
  WhepClient::Options lossy;
  lossy.loss = 0.1;
  const auto client = watch(served, lossy);
  EXPECT_TRUE(becomes([&] { return client->lost() >= 20; })) << client->lost();
  EXPECT_TRUE(receives_pictures(*client));
  EXPECT_LE(client->gaps(), client->lost() / 4) << "of " << client->lost() << " lost packets";
}

// A browser that repeatedly requests packets or key frames gets at most a few times the video bit rate.
TEST_F(LfServeMedia, RetransmissionsAreLimitedByTheBitRate) {
  constexpr int kBitRate = 500000;
  Served served({"--bitrate", std::to_string(kBitRate), "--address-views", "4"});
  const auto client = watch(served), other = watch(served);
  EXPECT_TRUE(receives_pictures(*client, 60)) << "packets to ask for";
  const auto rate = [&](const std::function<void()>& ask) {
    constexpr int kCalls = 1000;
    const uint64_t before = client->received();
    const gint64 began = g_get_monotonic_time();
    for (int i = 0; i < kCalls; i++) {
      ask();
      g_usleep(5000);
    }
    const double seconds = static_cast<double>(g_get_monotonic_time() - began) * 1e-6;
    return 8 * static_cast<double>(client->received() - before) / seconds;
  };
  const double quiet = rate([] {}), again = rate([&] { client->ask_again(); }),
               keys = rate([&] { client->ask_for_key_frame(); });
  std::printf("%.0f kbit/s; with requests for packets %.0f, for key frames %.0f\n", quiet / 1e3, again / 1e3,
              keys / 1e3);
  EXPECT_GT(client->repeated(), 0u) << "some packets are sent again";
  EXPECT_LT(again, quiet + 2.5 * kBitRate);
  EXPECT_LT(keys, quiet + 2.5 * kBitRate);
  EXPECT_TRUE(receives_pictures(*client));
  EXPECT_TRUE(receives_pictures(*other));
}

double last_statistic(const WhepClient& client, const std::string& name) {
  const auto messages = client.messages();
  const std::string key = "\"" + name + "\":";
  for (auto message = messages.rbegin(); message != messages.rend(); ++message)
    if (const size_t at = message->find(key); at != message->npos)
      return std::strtod(message->c_str() + at + key.size(), nullptr);
  return -1;
}

// Views use a focal surface unless a plane is requested by name. GStreamer 1.22 blocks forever on the first kind of
// feedback, and stores records of 65528 packets for each message of the second kind.
TEST_F(LfServeMedia, UnneededFeedbackIsDropped) {
  Served served;
  auto client = std::make_unique<WhepClient>(WhepClient::Options{.url = served.url()});
  client->send_feedback(205, 5, {});
  std::vector<uint8_t> congestion = {0, 0, 0xff, 0xf8, 0, 0, 0, 0};
  for (int i = 0; i < 8; i++) congestion.insert(congestion.end(), {0x1f, 0xff});
  for (int i = 0; i < 100; i++) client->send_feedback(205, 15, congestion);
  const uint64_t pictures = client->pictures();
  EXPECT_TRUE(becomes([&] { return client->pictures() > pictures + 10; })) << "the video goes on";
  client->ask_for_key_frame();
  client.reset();
  EXPECT_EQ(served.stop(), 0) << "the view is closed, and the server ends";
}

TEST_F(LfServeMedia, FocalSurfaceIsFoundByDefault) {
  Served served({"--focus-near", "1", "--focus-far", "6", "--gains", "on", "--resampling", "bilinear"});
  const auto client = watch(served);
  client->send("{}");
  EXPECT_TRUE(becomes([&] { return last_statistic(*client, "rounds") >= 6; }));
  EXPECT_GT(last_statistic(*client, "consistencyBytes"), 0);
  Served flat({"--focus-mode", "plane"});
  const auto other = watch(flat);
  other->send("{}");
  EXPECT_TRUE(becomes([&] { return last_statistic(*other, "pictures") >= 30; }));
  EXPECT_EQ(last_statistic(*other, "rounds"), 0);
  EXPECT_TRUE(becomes([&] { return last_statistic(*other, "sequence") >= 30; })) << "what the latest picture shows";
}

TEST_F(LfServeMedia, BitRateFollowsTheNetwork) {
  Served served({"--bitrate", "480000"});
  const auto client = watch(served, {.width = 480, .height = 360});  // same size as a view with half the size
  client->send("{}");
  EXPECT_TRUE(becomes([&] { return last_statistic(*client, "frameRate") == 30; }));
  client->set_loss(0.3);
  EXPECT_TRUE(becomes([&] { return last_statistic(*client, "frameRate") == 15; }));
  EXPECT_TRUE(becomes([&] { return last_statistic(*client, "sizeDivisor") == 2; }))
      << last_statistic(*client, "bitRate");
  EXPECT_LT(last_statistic(*client, "bitRate"), 240000);
  client->set_loss(0);
  EXPECT_TRUE(receives_pictures(*client)) << "in another size";
  EXPECT_TRUE(becomes([&] { return last_statistic(*client, "sizeDivisor") == 1; }));
  if (!kFallsBehind) {
    EXPECT_TRUE(becomes([&] { return last_statistic(*client, "frameRate") == 30; }));
  }
  EXPECT_TRUE(receives_pictures(*client));
  EXPECT_EQ(served.stop(), 0);
}

TEST_F(LfServeMedia, UsesTheEncoderWithTheHighestRank) {
  g_autoptr(GstElementFactory) factory = gst_element_factory_find("openh264enc");
  if (!factory) GTEST_SKIP() << "no openh264enc";
  g_setenv("GST_PLUGIN_FEATURE_RANK", "openh264enc:512", TRUE);
  Served served;
  g_unsetenv("GST_PLUGIN_FEATURE_RANK");
  const auto client = watch(served);
  client->send("{}");
  const auto says = [&](const char* text) {
    return becomes([&] {
      return std::ranges::any_of(client->messages(), [&](const std::string& m) { return contains(m, text); });
    });
  };
  EXPECT_TRUE(says("\"encoder\":\"openh264enc\""));
  EXPECT_TRUE(says("\"shed\":{"));
  EXPECT_TRUE(receives_pictures(*client));
}

// The data channel may open before there is video; earlier messages still count.
TEST_F(LfServeMedia, EarlyMessagesAreProcessed) {
  Served served;
  for (int i = 0; i < 5; i++) {
    WhepClient::Options options;
    options.first_message =
        R"({"id":1,"request":{"type":"customUpstreamEvent","structureName":"lightfield-view-request",)"
        R"("structure":{"yaw":1.5}}})";
    const auto client = watch(served, options);
    EXPECT_TRUE(becomes([&] { return last_statistic(*client, "yaw") == 1.5; })) << last_statistic(*client, "yaw");
  }
}

TEST_F(LfServeMedia, AStillViewOfPhotographsCostsLittle) {
  Served served({"--focus-mode", "plane"});
  const auto client = watch(served);
  ASSERT_TRUE(becomes([&] { return client->pictures() > 0; }));
  client->send("{}");
  const auto pictures_in = [&](int steps) {
    const uint64_t before = client->pictures();
    for (int i = 0; i < steps; i++) g_usleep(100000);
    return client->pictures() - before;
  };
  uint64_t resting = 0;
  EXPECT_TRUE(becomes([&] {
    resting = pictures_in(20);
    return resting > 0 && resting <= 10;
  })) << "four a second";
  int angle = 0;
  const auto pictures_while_moving = [&] {
    const uint64_t before = client->pictures();
    for (int i = 0; i < 20; i++, g_usleep(100000))
      client->send(R"({"id":1,"request":{"type":"customUpstreamEvent","structureName":"lightfield-view-request",)"
                   R"("structure":{"yaw":)" +
                   std::to_string(0.1 * (++angle % 20)) + "}}}");
    return client->pictures() - before;
  };
  EXPECT_TRUE(becomes([&] { return 2 * pictures_while_moving() > 3 * resting; })) << "the view moves";
}

// lf-serve --demo shows a photograph until the film is complete.
TEST_F(LfServeMedia, AFilmEndsTheRestOfAView) {
  Served served({"--watch", "--focus-mode", "plane"});
  const auto client = watch(served);
  ASSERT_TRUE(becomes([&] { return client->pictures() > 0; }));
  const auto pictures_in_two_seconds = [&] {
    const uint64_t before = client->pictures();
    g_usleep(2000000);
    return client->pictures() - before;
  };
  uint64_t resting = 0;
  EXPECT_TRUE(becomes([&] {
    resting = pictures_in_two_seconds();
    return resting > 0 && resting <= 10;
  })) << "four a second";
  const CameraFiles files;
  Rig rig = load_rig(served.rig());
  for (Camera& camera : rig.cameras) camera.source = files.path("mjpeg.mkv");
  save_rig(rig, served.rig());
  EXPECT_TRUE(becomes([&] { return 2 * pictures_in_two_seconds() > 3 * resting; })) << served.said();
}

TEST_F(LfServeMedia, UnconnectedViewersCauseNoRequests) {
  Served served;
  EXPECT_EQ(served.ask("POST", "whep", browser_offer()).status, 201u);
  EXPECT_EQ(served.metric("viewers"), "1");
  g_usleep(1000000);
  for (const char* name : {"pictures_total", "camera_bytes_total", "video_bytes_total"})
    EXPECT_EQ(served.metric(name), "0") << name;
}

TEST_F(LfServeMedia, UnknownDataChannelEndsTheViewer) {
  Served served;
  const auto stays = watch(served), greedy = watch(served);
  greedy->send("{}");
  ASSERT_EQ(served.metric("viewers"), "2");
  greedy->open_channel("another");
  EXPECT_TRUE(becomes([&] { return served.metric("viewers") == "1"; }));
  EXPECT_TRUE(becomes([&] { return greedy->ended(); })) << "its channels close";
  EXPECT_TRUE(receives_pictures(*stays));
  EXPECT_EQ(served.stop(), 0);
  EXPECT_THAT(served.said(), HasSubstr("data channel"));
}

TEST_F(LfServeMedia, SurfacesOfPicturesHaveTheirOwnChannel) {
  Served served;
  const auto client = watch(served);
  client->send("{}");
  EXPECT_EQ(served.metric("surface_bytes_total"), "0") << "nobody has opened the channel";
  client->open_channel("surface");
  EXPECT_TRUE(becomes([&] { return served.metric("surface_bytes_total") != "0"; }));
  EXPECT_TRUE(receives_pictures(*client));
  EXPECT_EQ(served.metric("viewers"), "1");
  client->open_channel("surface");
  EXPECT_TRUE(becomes([&] { return served.metric("viewers") == "0"; })) << "a second channel of this name";
}

TEST_F(LfServeMedia, AbortedConnectsDoNotDisturbOthers) {
  Served served({"--viewers", "200", "--address-views", "200", "--connects", "1000"});
  const auto client = watch(served);
  const std::string host = served.url().substr(7, served.url().size() - 8), body = browser_offer();
  const std::string request = "POST /whep HTTP/1.1\r\nHost: " + host + "\r\nContent-Type: application/sdp\r\n" +
                              "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
  const uint64_t before = client->pictures();
  for (int i = 0; i < 100; i++) {
    Client aborted(served);
    aborted.send(request.substr(0, request.size() * static_cast<size_t>(i % 3) / 2));
    g_usleep(static_cast<gulong>(i % 5) * 10000);
  }
  EXPECT_GT(client->pictures(), before) << "none meanwhile";
  EXPECT_TRUE(becomes([&] { return served.metric("viewers") == "1"; }));
  EXPECT_TRUE(receives_pictures(*client));
  EXPECT_EQ(served.stop(), 0);
}

TEST_F(LfServeMedia, InvalidMessagesAreRefused) {
  Served served;
  const auto client = watch(served);
  const std::string move =
      R"({"id":1,"request":{"type":"customUpstreamEvent","structureName":"lightfield-view-request",)"
      R"("structure":{"x":0.01}}})";
  std::vector<std::string> table = {" ",
                                    "x",
                                    "{}",
                                    "[]",
                                    "null",
                                    "{\"id\":-1}",
                                    "{\"id\":1e99,\"request\":{}}",
                                    std::string(3000, '['),
                                    std::string(60000, ' '),
                                    move.substr(0, move.size() / 2)};
  using Change = std::pair<const char*, const char*>;
  for (const auto& [from, to] :
       {Change("0.01", "1e999"), Change("0.01", "\"0\""), Change("0.01", "null"),
        Change("lightfield-view-request", "GstForceKeyUnit"), Change("\"x\"", "\"lightfield-view-id\""),
        Change("\"x\"", "\"\""), Change("{\"x\":0.01}", "[1]"), Change("customUpstreamEvent", "navigationEvent")})
    table.push_back(with(move, from, to));
  for (const std::string& text : table) client->send(text);
  client->send(move);
  EXPECT_TRUE(becomes([&] {
    return std::ranges::any_of(client->messages(), [](const std::string& m) { return contains(m, "applied"); });
  }));
  EXPECT_EQ(served.metric("refused_messages_total"), std::to_string(table.size()));
  for (int i = 0; i < 2000; i++) client->send(move);
  EXPECT_TRUE(receives_pictures(*client));
  EXPECT_EQ(served.stop(), 0);
  EXPECT_THAT(served.said(), HasSubstr("messages are ignored"));
}

std::string aperture_of(double metres, int id) {
  return "{\"id\":" + std::to_string(id) +
         ",\"request\":{\"type\":\"customUpstreamEvent\",\"structureName\":\"lightfield-view-request\",\"structure\":"
         "{\"aperture\":" +
         std::to_string(metres) + "}}}";
}
std::string answer_to(const WhepClient& client, int id) {
  const std::string what = "\"id\":" + std::to_string(id) + ",\"type\":\"ControlResponseMessage\"";
  for (const std::string& message : client.messages())
    if (message.find(what) != message.npos) return message;
  return "";
}

TEST_F(LfServeMedia, ApertureBeyondTheLimitIsRefused) {
  Served served({"--max-aperture", "0.01"});
  const auto client = watch(served);
  client->send(aperture_of(0.02, 5));
  client->send(aperture_of(0.005, 6));
  EXPECT_TRUE(becomes([&] { return !answer_to(*client, 6).empty(); }));
  EXPECT_THAT(answer_to(*client, 5), HasSubstr("aperture is larger"));
  EXPECT_THAT(answer_to(*client, 6), HasSubstr("\"error\":null"));
  EXPECT_TRUE(becomes([&] { return last_statistic(*client, "aperture") == 0.005; }))
      << last_statistic(*client, "aperture");
}

TEST_F(LfServeMedia, MoreMessagesThanAllowedAreDropped) {
  for (const bool few : {true, false}) {
    Served served({"--message-rate", few ? "2" : "1000"});
    const auto client = watch(served);
    for (int id = 1; id <= 40; id++) client->send(aperture_of(0, id));
    EXPECT_TRUE(becomes([&] { return !answer_to(*client, 1).empty(); }));
    if (!few) {
      EXPECT_TRUE(becomes([&] { return !answer_to(*client, 40).empty(); }));
    }
    EXPECT_TRUE(receives_pictures(*client));
    EXPECT_EQ(served.metric("refused_messages_total") == "0", !few) << served.metric("refused_messages_total");
    EXPECT_EQ(served.stop(), 0);
    EXPECT_EQ(contains(served.said(), "messages are ignored"), few);
  }
}

TEST_F(LfServeMedia, RecordsTheCameras) {
  const TempDir dir;
  const std::string folder = dir / "recording";
  {
    Served served({"--record", folder});
    EXPECT_TRUE(receives_pictures(*watch(served)));
    EXPECT_TRUE(becomes([&] {
      std::error_code error;
      return std::filesystem::file_size(folder + "/camera3.mkv", error) > 5000 && !error;
    }));
    EXPECT_EQ(served.stop(), 0);
  }
  EXPECT_EQ(load_rig(folder + "/rig.json").cameras.size(), 4u);
  for (int camera = 0; camera < 4; camera++)
    EXPECT_GT(read_recorded(folder + "/camera" + std::to_string(camera) + ".mkv").times.size(), 1u) << camera;
}

}  // namespace
}  // namespace lf::test
