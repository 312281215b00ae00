// SPDX-License-Identifier: LGPL-2.1-or-later
// Camera paths of lf-serve: one rendered and encoded video for all viewers of a path.
#include "web/offers.h"
#include "web/served.h"
#include "web/whep_client.h"

namespace lf::test {
namespace {

class LfServeFlights : public testing::Test {
 protected:
  std::vector<std::string> options(std::vector<std::string> more) {
    std::string views;
    for (int i = 0; i < 20; i++)
      views += (i > 0 ? ", {" : "{") + (R"("time": )" + std::to_string(i / 20.0)) + R"(, "position": [)" +
               std::to_string(0.002 * i) +
               R"(, 0, 0], "orientation": [1, 0, 0, 0], "width": 128, "height": 96, "fov_y": 30, "focus_distance": 2})";
    tour_ = R"({"format": "lightfield-views", "version": 1, "views": [)" + views + "]}";
    dir_.write("tour.json", tour_);
    more.insert(more.end(), {"--path", "tour=" + (dir_ / "tour.json"), "--address-views", "400", "--connects", "1000"});
    return more;
  }
  static std::unique_ptr<WhepClient> watch(const Served& served, bool vp8 = false) {
    return std::make_unique<WhepClient>(WhepClient::Options{.url = served.url(), .vp8 = vp8, .query = "&path=tour"});
  }
  static bool receives_pictures(const WhepClient& client, uint64_t pictures = 10) {
    const uint64_t before = client.pictures();
    return becomes([&] { return client.pictures() >= before + pictures; });
  }
  static Response offer(const Served& served, const std::string& query) {
    return served.ask("POST", "whep" + query, browser_offer());
  }

  TempDir dir_;
  std::string tour_;
};

// LF_WATCHERS=200 for the slow test.
TEST_F(LfServeFlights, WatchersShareOneVideo) {
  const char* setting = std::getenv("LF_WATCHERS");
  const size_t count = setting ? std::stoul(setting) : 6;
  Served served(options({"--viewers", "1", "--watchers", std::to_string(count)}));
  const auto view = std::make_unique<WhepClient>(WhepClient::Options{.url = served.url()});
  const Response full = offer(served, "");
  EXPECT_EQ(full.status, 503u) << "the only seat is taken";
  EXPECT_THAT(full.body, HasSubstr("\"path\":\"tour\"")) << "a viewer without a seat can watch the path";
  std::vector<std::unique_ptr<WhepClient>> watchers;
  for (size_t i = 0; i < count; i++) watchers.push_back(watch(served));
  EXPECT_EQ(served.metric("watchers"), std::to_string(count));
  EXPECT_EQ(served.metric("viewers"), std::to_string(count + 1));
  EXPECT_EQ(served.metric("flights"), "1");
  const Response late = offer(served, "?path=tour");
  EXPECT_EQ(late.status, 503u) << "there is a maximum number of watchers";
  EXPECT_THAT(late.body, Not(HasSubstr("\"path\"")));

  const auto sum = [&] {
    uint64_t pictures = 0;
    for (const auto& watcher : watchers) pictures += watcher->pictures();
    return static_cast<double>(pictures);
  };
  const auto made = [&] { return std::stod(served.metric("pictures_total")) - static_cast<double>(view->pictures()); };
  const double received = sum(), before = made();
  EXPECT_TRUE(receives_pictures(*watchers.back(), 60));
  const double delivered = sum() - received, rendered = made() - before;
  std::printf("%zu watchers: %.0f pictures rendered, %.0f received\n", count, rendered, delivered);
  EXPECT_GT(delivered, 0.5 * static_cast<double>(count) * rendered);
  for (const auto& watcher : watchers) EXPECT_TRUE(receives_pictures(*watcher, 2));
  watchers.clear();
  EXPECT_TRUE(becomes([&] { return served.metric("flights") == "0"; }));
  EXPECT_TRUE(receives_pictures(*watch(served))) << "the flight starts again";
}

TEST_F(LfServeFlights, EachCodecHasAVideo) {
  Served served(options({}));
  const auto h264 = watch(served), vp8 = watch(served, true), late = watch(served, true);
  EXPECT_THAT(h264->answer(), HasSubstr("H264/90000"));
  EXPECT_THAT(vp8->answer(), HasSubstr("VP8/90000"));
  for (const WhepClient* client : {h264.get(), vp8.get(), late.get()}) EXPECT_TRUE(receives_pictures(*client));
  EXPECT_EQ(served.metric("flights"), "2");
  EXPECT_EQ(offer(served, "?path=tour&eye-distance=0.06").status, 201u);
  EXPECT_EQ(served.metric("watchers"), "3") << "stereo viewers have their own video";
}

// Sends receiver reports (RFC 3550, 6.4.1), in which the number of lost packets grows with this rate.
class Reports {
 public:
  void send(WhepClient& client, double loss) {
    constexpr uint32_t kPackets = 100;
    highest_ += kPackets;
    lost_ += static_cast<uint32_t>(loss * kPackets);
    std::vector<uint8_t> block;
    for (const uint32_t word : {lost_ & 0xffffffu, highest_, 0u, 0u, 0u})
      for (const int shift : {24, 16, 8, 0}) block.push_back(static_cast<uint8_t>(word >> shift));
    client.send_feedback(201, 1, block);
  }

 private:
  uint32_t highest_ = 1 << 20, lost_ = 0;
};

// If one watcher loses packets, the other watchers still get the full size.
TEST_F(LfServeFlights, WatcherWithASlowNetworkGetsHalfTheSize) {
  Served served(options({}));
  const auto good = watch(served), bad = watch(served);
  const auto divisor = [](const WhepClient& client) {
    int last = 0;
    for (const std::string& message : client.messages())
      if (const size_t at = message.find("\"sizeDivisor\":"); at != message.npos) last = message[at + 14] - '0';
    return last;
  };
  const auto bytes = [](const WhepClient& client) {
    const uint64_t pictures = client.pictures(), bytes = client.bytes();
    EXPECT_TRUE(receives_pictures(client, 40));
    return static_cast<double>(client.bytes() - bytes) / static_cast<double>(client.pictures() - pictures);
  };
  const auto encoded = [&served](const std::string& size) {
    return std::stoul(served.metric("flight_pictures_total{size=\"" + size + "\"}"));
  };
  EXPECT_TRUE(receives_pictures(*good));
  EXPECT_GT(encoded("full"), 0u);
  EXPECT_EQ(encoded("half"), 0u) << "nobody watches the half size";
  Reports reports;
  for (const int expected : {2, 1}) {
    EXPECT_TRUE(becomes([&] {
      reports.send(*bad, expected == 2 ? 0.3 : 0);
      g_usleep(300000);
      return divisor(*bad) == expected;
    })) << bad->messages().back();
    EXPECT_TRUE(receives_pictures(*bad)) << "in the new size";
    EXPECT_EQ(divisor(*good), 1);
    const double changed = bytes(*bad), full = bytes(*good);
    std::printf("bytes per picture: %.0f at 1/%d of the size, %.0f in full size\n", changed, expected, full);
    EXPECT_LT(changed, expected == 2 ? 0.9 * full : 1.3 * full);
    const uint64_t half = encoded("half");
    EXPECT_TRUE(receives_pictures(*good, 40));
    EXPECT_EQ(encoded("half") > half + 1, expected == 2) << "the half size is encoded only for its watchers";
  }
}

// The file of the path is damaged while the first watcher connects, so the flight fails. The next watcher comes before
// the server has closed the first session.
TEST_F(LfServeFlights, FailedFlightGetsNoMoreWatchers) {
  Served served(options({}));
  EXPECT_TRUE(receives_pictures(*watch(served)));
  EXPECT_TRUE(becomes([&] { return served.metric("flights") == "0"; }));
  const double pictures = std::stod(served.metric("pictures_total"));
  dir_.write("tour.json", "damaged");
  std::thread first([&] {
    const WhepClient::Options options{
        .url = served.url(), .patience = 10, .query = "&path=tour", .first_message = "connected"};
    EXPECT_THROW(WhepClient{options}, std::runtime_error);
  });
  EXPECT_TRUE(becomes([&] { return served.metric("refused_messages_total") == "1"; })) << "the watcher is connected";
  dir_.write("tour.json", tour_);
  EXPECT_TRUE(receives_pictures(*watch(served)));
  EXPECT_TRUE(served.says({"closes: ", "tour.json"}));
  first.join();
  EXPECT_GT(std::stod(served.metric("pictures_total")), pictures) << "closed flights count";
}

TEST_F(LfServeFlights, WatchersControlNothing) {
  Served served(options({"--monitor", "1"}));
  const auto client = watch(served);
  client->send(R"({"id":1,"request":{"type":"navigationEvent","event":{"event":"MouseMove","x":1,"y":2}}})");
  EXPECT_TRUE(becomes([&] { return served.metric("refused_messages_total") == "1"; }));
  EXPECT_TRUE(becomes([&] { return contains(served.get("monitor.json"), "\"cam"); })) << "flights check cameras, too";
  for (int i = 0; i < 20; i++) client->ask_for_key_frame();
  EXPECT_TRUE(receives_pictures(*client));
}

}  // namespace
}  // namespace lf::test
