// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/http.h"

#include "support/test.h"

namespace lf::serve {
namespace {

constexpr int64_t kSecond = 1000000;

class ChooseVictim : public testing::Test {
 protected:
  using Progress = HttpListener::Progress;

  void add(const std::string& subscriber, double seconds_ago, Progress progress) {
    all_.push_back({subscriber, kNow - static_cast<int64_t>(seconds_ago * kSecond), progress});
  }
  const HttpListener::ConnectionInfo& victim() const { return all_.at(HttpListener::choose_victim(all_, kNow)); }

  static constexpr int64_t kNow = 1000 * kSecond;
  std::vector<HttpListener::ConnectionInfo> all_;
};

TEST_F(ChooseVictim, ClosesTheOldestIdleConnection) {
  for (const char* honest : {"127.0.0.1", "9.9.9.9"}) {
    all_.clear();
    add(honest, 2, Progress::kSome);
    for (int i = 0; i < 200; i++) add("127.1.0." + std::to_string(i), 1.5 + 0.001 * i, Progress::kNothing);
    EXPECT_EQ(victim().subscriber, "127.1.0.199");
  }
}

TEST_F(ChooseVictim, KeepsConnectionsWithACompleteRequest) {
  add("a", 20, Progress::kRequest);
  add("b", 0.5, Progress::kNothing);
  add("c", 0.7, Progress::kSome);
  EXPECT_EQ(victim().subscriber, "c") << "the oldest without a complete request";
  add("d", 1.1, Progress::kNothing);
  EXPECT_EQ(victim().subscriber, "d") << "silent connections go first";
  all_.resize(1);
  EXPECT_EQ(victim().subscriber, "a");
}

TEST_F(ChooseVictim, ClosesConnectionsOfGreedySubscribersFirst) {
  for (size_t i = 0; i <= HttpListener::kFairShare; i++)
    add("greedy", 0.1 + 0.001 * static_cast<double>(i), Progress::kRequest);
  for (int i = 0; i < 30; i++) add("slow" + std::to_string(i), 9, Progress::kNothing);
  EXPECT_EQ(victim().subscriber, "greedy");
  EXPECT_EQ(victim().since, all_[HttpListener::kFairShare].since) << "the oldest connection of that address";
  all_.erase(all_.begin());
  EXPECT_NE(victim().subscriber, "greedy") << "browsers open several connections";
}

}  // namespace
}  // namespace lf::serve
