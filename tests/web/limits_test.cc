// SPDX-License-Identifier: LGPL-2.1-or-later
// Who may ask, how often, and for what.
#include "serve/limits.h"

#include <gtest/gtest.h>

#include <chrono>

#include "base/error.h"
#include "serve/access.h"
#include "serve/connections.h"
#include "serve/pace.h"
#include "serve/packet_loss.h"
#include "serve/processor_load.h"
#include "serve/quality_control.h"
#include "serve/rate_limit.h"
#include "serve/shedding.h"

namespace lf::serve {
namespace {

constexpr int64_t kSecond = 1000000;

TEST(Wish, EyeDistances) {
  EXPECT_EQ(eye_distance(nullptr), 0);
  EXPECT_EQ(eye_distance(""), 0);
  EXPECT_EQ(eye_distance("0.063"), 0.063);
  for (const char* wrong : {"x", "-0.1", "nan", "inf", "1e9", "0.1m"}) EXPECT_FALSE(eye_distance(wrong)) << wrong;
}

TEST(Access, Secrets) {
  EXPECT_TRUE(is_same_secret("abc", "abc"));
  for (const char* wrong : {"", "ab", "abd", "abcc", "ABC"}) EXPECT_FALSE(is_same_secret(wrong, "abc")) << wrong;
}

TEST(Access, Tokens) {
  const Access open("", {}, {}), closed("secret", {}, {});
  EXPECT_TRUE(open.has_token(nullptr));
  EXPECT_TRUE(closed.has_token("Bearer secret"));
  EXPECT_TRUE(closed.has_token("bearer secret"));
  for (const char* wrong : {"", "Bearer", "Bearer ", "Bearer secre", "Bearer secret ", "Basic secret", "secret"})
    EXPECT_FALSE(closed.has_token(wrong)) << wrong;
  EXPECT_FALSE(closed.has_token(nullptr));
}

TEST(Access, Loopback) {
  for (const char* address : {"127.0.0.1", "127.1.2.3", "::1", "localhost", "LOCALHOST"})
    EXPECT_TRUE(is_loopback(address)) << address;
  for (const char* address : {"0.0.0.0", "::", "10.0.0.1", "example.org", "", "127.0.0.1.example.org"})
    EXPECT_FALSE(is_loopback(address)) << address;
}

TEST(Access, Hosts) {
  const Access access("", {}, {"Cameras.example"});
  for (const char* host : {"127.0.0.1:8080", "127.0.0.1", "localhost:8080", "[::1]:8080", "192.0.2.7", "LOCALHOST",
                           "cameras.example", "cameras.example:8080"})
    EXPECT_TRUE(access.allows_host(host)) << host;
  for (const char* host : {"evil.org:8080", "", "127.0.0.1.evil.org", "cameras.example.evil.org", "[evil]", ":80"})
    EXPECT_FALSE(access.allows_host(host)) << host << ": a name made to point here";
  EXPECT_FALSE(access.allows_host(nullptr));
}

TEST(Access, Origins) {
  const Access local("", {"https://example.org"}, {}), named("", {}, {"cameras.example"}), any("", {"*"}, {});
  EXPECT_TRUE(local.allows_origin(nullptr, "127.0.0.1:8080"));
  EXPECT_TRUE(local.allows_origin("http://localhost:8080", "localhost:8080"));
  EXPECT_TRUE(local.allows_origin("http://[::1]:8080", "[::1]:8080"));
  EXPECT_TRUE(local.allows_origin("https://example.org", "127.0.0.1:8080"));
  EXPECT_FALSE(local.allows_origin("http://localhost:9090", "localhost:8080"));
  EXPECT_FALSE(local.allows_origin("https://evil.org", "127.0.0.1:8080"));
  EXPECT_FALSE(local.allows_origin("null", "127.0.0.1:8080"));
  EXPECT_TRUE(named.allows_origin("https://cameras.example", "127.0.0.1:8080")) << "behind a proxy";
  EXPECT_FALSE(named.allows_origin("https://cameras.example.evil.org", "127.0.0.1:8080"));
  EXPECT_TRUE(any.allows_origin("https://anything", "cameras.example"));
}

TEST(Access, OriginsAndHostsOfTheOperatorAreBroughtToOneForm) {
  for (const char* same :
       {"https://example.org", "https://Example.ORG", "https://example.org/", "HTTPS://example.org:443"})
    EXPECT_EQ(normal_origin(same), "https://example.org") << same;
  EXPECT_EQ(normal_origin("http://example.org:80"), "http://example.org");
  EXPECT_EQ(normal_origin("http://example.org:8080"), "http://example.org:8080");
  EXPECT_EQ(normal_origin("http://[::1]:8080"), "http://[::1]:8080");
  EXPECT_EQ(normal_origin("null"), "null");
  EXPECT_EQ(normal_origin("*"), "*");
  for (const char* wrong : {"", "example.org", "https://", "https://example.org/page", "https://a b", "://example.org",
                            "https://*.example.org", "https://user@example.org"})
    EXPECT_THROW(normal_origin(wrong), Error) << wrong;
  for (const char* same : {"example.org", "Example.org", "example.org:8080"})
    EXPECT_EQ(normal_host(same), "example.org") << same;
  for (const char* wrong : {"", ":8080", "https://example.org", "a b", "example.org/"})
    EXPECT_THROW(normal_host(wrong), Error) << wrong;
  EXPECT_TRUE(Access("", {"https://Example.org/"}, {}).allows_origin("https://example.org", "127.0.0.1"));
  EXPECT_TRUE(Access("", {}, {"Example.org:8080"}).allows_host("example.org:8080"));
}

TEST(Access, Sites) {
  const Access access("", {"https://example.org"}, {}), any("", {"*"}, {});
  constexpr char kHost[] = "127.0.0.1:8080";
  for (const char* site : {"none", "same-origin"}) EXPECT_TRUE(access.allows_site(site, nullptr, kHost)) << site;
  EXPECT_TRUE(access.allows_site(nullptr, nullptr, kHost)) << "not a browser";
  for (const char* site : {"cross-site", "same-site", "", "new-kind"}) {
    EXPECT_FALSE(access.allows_site(site, nullptr, kHost)) << site << ": an <img> of another page";
    EXPECT_FALSE(access.allows_site(site, "https://evil.org", kHost)) << site;
    EXPECT_TRUE(access.allows_site(site, "https://example.org", kHost)) << site;
    EXPECT_TRUE(any.allows_site(site, nullptr, kHost)) << site;
  }
}

class Eviction : public testing::Test {
 protected:
  using Progress = Connections::Progress;

  void add(const std::string& subscriber, double seconds_ago, Progress progress) {
    all_.push_back({subscriber, kNow - static_cast<int64_t>(seconds_ago * kSecond), progress});
  }
  const Connections::Standing& victim() const { return all_.at(Connections::choose_victim(all_, kNow)); }

  static constexpr int64_t kNow = 1000 * kSecond;
  std::vector<Connections::Standing> all_;
};

// However the addresses sort.
TEST_F(Eviction, TheOldestIdleOneGoes) {
  for (const char* honest : {"127.0.0.1", "9.9.9.9"}) {
    all_.clear();
    add(honest, 2, Progress::kSome);
    for (int i = 0; i < 200; i++) add("127.1.0." + std::to_string(i), 1.5 + 0.001 * i, Progress::kNothing);
    EXPECT_EQ(victim().subscriber, "127.1.0.199");
  }
}

TEST_F(Eviction, ARequestIsAnsweredBeforeAnotherIsRead) {
  add("a", 20, Progress::kRequest);
  add("b", 0.5, Progress::kNothing);
  add("c", 0.7, Progress::kSome);
  EXPECT_EQ(victim().subscriber, "c") << "of those without a whole request the oldest";
  add("d", 1.1, Progress::kNothing);
  EXPECT_EQ(victim().subscriber, "d") << "no honest client connects and says nothing";
  all_.resize(1);
  EXPECT_EQ(victim().subscriber, "a");
}

TEST_F(Eviction, WhoHasManyLosesOneFirst) {
  for (size_t i = 0; i <= Connections::kFair; i++)
    add("greedy", 0.1 + 0.001 * static_cast<double>(i), Progress::kRequest);
  for (int i = 0; i < 30; i++) add("slow" + std::to_string(i), 9, Progress::kNothing);
  EXPECT_EQ(victim().subscriber, "greedy");
  EXPECT_EQ(victim().since, all_[Connections::kFair].since) << "its oldest";
  all_.erase(all_.begin());
  EXPECT_NE(victim().subscriber, "greedy") << "a browser may have a few";
}

TEST(RateLimit, BucketsFillWithTime) {
  TokenBucket bucket(2, 4);
  int64_t now = 100 * kSecond;
  for (int i = 0; i < 4; i++) EXPECT_TRUE(bucket.take(now)) << i;
  EXPECT_FALSE(bucket.take(now));
  now += kSecond / 2;
  EXPECT_TRUE(bucket.take(now));
  EXPECT_FALSE(bucket.take(now));
  now += 100 * kSecond;
  EXPECT_TRUE(bucket.full(now));
  for (int i = 0; i < 4; i++) EXPECT_TRUE(bucket.take(now)) << "no more than the burst";
  EXPECT_FALSE(bucket.take(now));
}

TEST(RateLimit, ARateMayChange) {
  TokenBucket bytes(1000, 5000);
  EXPECT_FALSE(bytes.take(kSecond, 5001));
  EXPECT_TRUE(bytes.take(kSecond, 5000));
  bytes.set_rate(100, 200, kSecond);
  EXPECT_FALSE(bytes.take(2 * kSecond, 101));
  EXPECT_TRUE(bytes.take(2 * kSecond, 100));
  EXPECT_TRUE(bytes.take(100 * kSecond, 200));
  EXPECT_FALSE(bytes.take(100 * kSecond, 1)) << "no more than the burst";
}

TEST(RateLimit, AddressesHaveTheirOwnAndAreForgotten) {
  AddressLimit limit(1, 1);
  const int64_t now = kSecond;
  EXPECT_TRUE(limit.take("a", now));
  EXPECT_FALSE(limit.take("a", now));
  EXPECT_TRUE(limit.take("b", now));
  for (size_t i = 0; i < 2 * AddressLimit::kMaxAddresses; i++) limit.take(std::to_string(i), now);
  EXPECT_LE(limit.size(), AddressLimit::kMaxAddresses);
  EXPECT_TRUE(limit.take("one more", now)) << "a flood from many addresses does not limit a new one";
  EXPECT_FALSE(limit.take("one more", now));
  EXPECT_FALSE(limit.take(std::to_string(2 * AddressLimit::kMaxAddresses - 1), now)) << "the latest are remembered";
  EXPECT_LE(limit.size(), AddressLimit::kMaxAddresses);
  EXPECT_TRUE(limit.take("one more", now + 10 * kSecond));
  limit.take("another", now + 20 * kSecond);
  EXPECT_LE(limit.size(), 10u);
}

TEST(Pace, TellsWhatPartIsMade) {
  Pace pace(1);
  EXPECT_EQ(pace.kept(), 1);
  pace.set_interval(10);
  EXPECT_TRUE(pace.begin(0));
  EXPECT_FALSE(pace.begin(5)) << "too soon: nobody wanted it";
  EXPECT_FALSE(pace.begin(10));
  EXPECT_EQ(pace.kept(), 0.5);
  pace.end(0);
  EXPECT_TRUE(pace.begin(20));
  EXPECT_EQ(pace.kept(), 1);
}

TEST(Pace, WaitsForPicturesButNotForEver) {
  Pace pace(2);
  EXPECT_TRUE(pace.begin(10));
  EXPECT_TRUE(pace.begin(20));
  EXPECT_FALSE(pace.begin(30));
  pace.end(10);
  EXPECT_TRUE(pace.begin(40));
  EXPECT_FALSE(pace.begin(50));
  pace.end(40);  // that of 20 was left out
  EXPECT_TRUE(pace.begin(60));
  EXPECT_TRUE(pace.begin(70));
  EXPECT_FALSE(pace.begin(60 + Pace::kPatience));
  EXPECT_TRUE(pace.begin(61 + Pace::kPatience));
  pace.end(60);
  EXPECT_FALSE(pace.begin(62 + Pace::kPatience)) << "what comes too late gives no credit";
  pace.end(70 + Pace::kPatience);
  pace.set_interval(100);
  EXPECT_FALSE(pace.begin(160 + Pace::kPatience));
  EXPECT_TRUE(pace.begin(161 + Pace::kPatience));
}

TEST(Limits, SizesOfViews) {
  const Limits limits{.max_width = 1281, .max_height = 720};
  const auto expect = [&](const char* width, const char* height, int w, int h) {
    const auto size = view_size(width, height, limits);
    ASSERT_TRUE(size) << width << " x " << height;
    EXPECT_EQ(size->width, w) << width << " x " << height;
    EXPECT_EQ(size->height, h) << width << " x " << height;
  };
  expect(nullptr, "", 640, 480);
  expect("321", "240", 320, 240);
  expect("1", "1", Limits::kMinSize, Limits::kMinSize);
  expect("780", "1688", 332, 720);  // a telephone: its shape stays
  expect("2560", "1440", 1280, 720);
  expect("99999", "99", 1280, Limits::kMinSize);
  for (const char* wrong : {"0", "-1", "nan", "inf", "1e9", "10x", "x", " "}) {
    EXPECT_FALSE(view_size(wrong, "480", limits)) << wrong;
    EXPECT_FALSE(view_size("640", wrong, limits)) << wrong;
  }
}

TEST(QualityControl, FallsWithLossAndDelayAndComesBack) {
  QualityControl quality(300000, 6000000, 0);
  EXPECT_EQ(quality.bits_per_second(), 6000000);
  EXPECT_FALSE(quality.update(0, 0.01));
  EXPECT_TRUE(quality.update(0.1, 0.01));
  EXPECT_EQ(quality.bits_per_second(), 4500000);
  EXPECT_FALSE(quality.update(0.03, 0.01)) << "stays where some is lost";
  EXPECT_TRUE(quality.update(0, 0.2)) << "packets queue up";
  EXPECT_LT(quality.bits_per_second(), 4500000);
  for (int i = 0; i < 100; i++) quality.update(0.5, 0);
  EXPECT_EQ(quality.bits_per_second(), 300000);
  for (int i = 0; i < 100; i++) quality.update(0, 0.01);
  EXPECT_EQ(quality.bits_per_second(), 6000000);
}

TEST(QualityControl, LeavesOutPicturesAndThenPixels) {
  QualityControl quality(100000, 1000000, 640 * 480 * 30);
  const auto lossy = [&](int times) {
    for (int i = 0; i < times; i++) quality.update(0.1, 0);
  };
  EXPECT_EQ(quality.pictures_left_out(), 0);
  lossy(2);  // 562 kbit/s
  EXPECT_EQ(quality.pictures_left_out(), 0);
  lossy(1);  // 422: 0.046 bits a pixel
  EXPECT_EQ(quality.pictures_left_out(), 1);
  EXPECT_EQ(quality.size_divisor(), 1);
  lossy(3);  // 178
  EXPECT_EQ(quality.pictures_left_out(), 1);
  EXPECT_EQ(quality.size_divisor(), 2);
  // Back, a little later than it fell.
  for (int i = 0; i < 5; i++) quality.update(0, 0);  // 262
  EXPECT_EQ(quality.size_divisor(), 2);
  for (int i = 0; i < 2; i++) quality.update(0, 0);  // 305
  EXPECT_EQ(quality.size_divisor(), 1);
  EXPECT_EQ(quality.pictures_left_out(), 1);
  for (int i = 0; i < 30; i++) quality.update(0, 0);
  EXPECT_EQ(quality.pictures_left_out(), 0);
}

TEST(Limits, BitRatesFollowSizes) {
  Limits limits;
  EXPECT_EQ(best_bit_rate(1280, 720, limits), limits.bit_rate);
  EXPECT_LT(best_bit_rate(640, 480, limits), 2100000);
  EXPECT_GT(best_bit_rate(640, 480, limits), 1900000);
  EXPECT_EQ(best_bit_rate(64, 64, limits), 300000);
  limits.bit_rate = 100000;
  EXPECT_EQ(best_bit_rate(64, 64, limits), 100000);
}

class SheddingTest : public testing::Test {
 protected:
  // Seconds until something changes, at most `most`.
  int seconds(double busy, double kept, int most = 1000) {
    for (int i = 1; i <= most; i++)
      if (shedding_.update(busy, kept)) return i;
    return most + 1;
  }
  Shedding shedding_;
};

TEST_F(SheddingTest, TrialsGoFirstThenRateThenSize) {
  struct Step {
    unsigned trials;
    int left_out, divisor;
  };
  for (const Step& step : {Step{3, 0, 1}, Step{8, 0, 1}, Step{8, 1, 1}, Step{8, 1, 2}}) {
    EXPECT_EQ(seconds(1, 0.5), Shedding::kPatience);
    EXPECT_EQ(shedding_.trial_interval(), step.trials);
    EXPECT_EQ(shedding_.pictures_left_out(), step.left_out);
    EXPECT_EQ(shedding_.size_divisor(), step.divisor);
  }
  EXPECT_EQ(seconds(1, 0.5, 100), 101) << "there is nothing else";
  for (int step = 3; step >= 0; step--) {
    seconds(0.3, 1);
    EXPECT_EQ(shedding_.step(), step);
  }
  EXPECT_EQ(shedding_.trial_interval(), 1u);
}

TEST_F(SheddingTest, OnlyWhereProcessorsAreWhatIsMissing) {
  EXPECT_EQ(seconds(0.5, 0.1, 100), 101) << "cameras on other hosts may be slow";
  EXPECT_EQ(seconds(1, 1, 100), 101) << "all pictures are made";
  for (int i = 0; i < 50; i++) {
    shedding_.update(1, 0.5);
    EXPECT_FALSE(shedding_.update(1, 1)) << "a moment is none";
  }
}

TEST_F(SheddingTest, AStepBackThatWasWrongIsTriedLessOften) {
  seconds(1, 0.5);
  int before = 0;
  for (int i = 0; i < 4; i++) {
    const int rest = seconds(0.5, 1);
    EXPECT_GT(rest, before);
    before = rest;
    EXPECT_EQ(shedding_.step(), 0);
    EXPECT_EQ(seconds(1, 0.5), Shedding::kPatience);
  }
  EXPECT_EQ(seconds(0.8, 1, 1000), 1001) << "there would not be enough";
}

TEST(ProcessorLoad, IsAShare) {
  ProcessorLoad load;
  load.update();
  const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(100);
  while (std::chrono::steady_clock::now() < until) {
  }
  const double busy = load.update();
  EXPECT_GT(busy, 0);
  EXPECT_LE(busy, 1);
}

TEST(PacketLoss, IsThatBetweenReports) {
  PacketLoss loss;
  EXPECT_EQ(loss.update({}), 0);
  EXPECT_EQ(loss.update({{1, 70000, 25}}), 0) << "the first one only says where streams are";
  EXPECT_EQ(loss.update({{1, 70100, 50}}), 0.25);
  EXPECT_EQ(loss.update({{1, 70100, 50}}), 0.25) << "nothing new";
  EXPECT_EQ(loss.update({}), 0.25);
  EXPECT_EQ(loss.update({{1, 70200, 50}}), 0);
  EXPECT_EQ(loss.update({{1, 70300, 45}}), 0) << "some came after all";
  EXPECT_EQ(loss.update({{1, 70310, 90}}), 1) << "and others were late";
  EXPECT_EQ(loss.update({{1, 70350, 100}, {2, 0xfffffff0, 3}}), 0.25) << "of the new one nothing is known";
  EXPECT_EQ(loss.update({{1, 70400, 100}, {2, 34, 28}}), 0.25) << "both, and numbers begin again";
}
TEST(QualityControl, RepeatsTheKeyFrameOfANewSizeWherePacketsAreLost) {
  QualityControl quality(100000, 1000000, 640 * 480 * 30);
  while (quality.size_divisor() == 1) {
    quality.update(0.3, 0);
    EXPECT_FALSE(quality.wants_key_frame()) << "the new size has one of its own";
  }
  for (int i = 0; i < QualityControl::kRepeats; i++) {
    quality.update(i == 2 ? 0 : 0.3, 0);
    EXPECT_EQ(quality.wants_key_frame(), i != 2) << i;
  }
  quality.update(0.3, 0);
  EXPECT_FALSE(quality.wants_key_frame());
  while (quality.size_divisor() == 2) quality.update(0, 0);
  quality.update(0.1, 0);
  EXPECT_TRUE(quality.wants_key_frame()) << "the larger size, too";
}
TEST(QualityControl, ABestRateThatIsLittleIsUsedAsWellAsCanBe) {
  EXPECT_EQ(QualityControl(100000, 200000, 640 * 480 * 30).size_divisor(), 2);
  QualityControl quality(100000, 480000, 640 * 480 * 30);
  EXPECT_EQ(quality.pictures_left_out(), 0);
  quality.update(0.1, 0);
  EXPECT_EQ(quality.pictures_left_out(), 1);
  for (int i = 0; i < 10; i++) quality.update(0, 0);
  EXPECT_EQ(quality.pictures_left_out(), 0) << "there is no more to wait for";
}

}  // namespace
}  // namespace lf::serve
