// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/limits.h"
#include "serve/histogram.h"
#include "support/test.h"

namespace lf::serve {
namespace {

constexpr int64_t kSecond = 1000000;

TEST(ViewParams, EyeDistances) {
  EXPECT_EQ(eye_distance(nullptr), 0);
  EXPECT_EQ(eye_distance(""), 0);
  EXPECT_EQ(eye_distance("0.063"), 0.063);
  for (const char* wrong : {"x", "-0.1", "nan", "inf", "1e9", "0.1m"}) EXPECT_FALSE(eye_distance(wrong)) << wrong;
}

TEST(Histogram, CountsAreCumulative) {
  Histogram histogram;
  for (const double seconds : {0.005, 0.01, 0.03, 5.0, -1.0}) histogram.add(seconds);
  const std::string text = histogram.text("age_seconds", "Age.");
  for (const char* line :
       {"# TYPE age_seconds histogram\n", "age_seconds_bucket{le=\"0.01\"} 3\n", "age_seconds_bucket{le=\"0.02\"} 3\n",
        "age_seconds_bucket{le=\"0.05\"} 4\n", "age_seconds_bucket{le=\"2\"} 4\n",
        "age_seconds_bucket{le=\"+Inf\"} 5\n", "age_seconds_sum 5.045\n", "age_seconds_count 5\n"})
    EXPECT_THAT(text, HasSubstr(line));
}

TEST(RateLimit, BucketsRefill) {
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

TEST(RateLimit, RateMayChange) {
  TokenBucket bytes(1000, 5000);
  EXPECT_FALSE(bytes.take(kSecond, 5001));
  EXPECT_TRUE(bytes.take(kSecond, 5000));
  bytes.set_rate(100, 200, kSecond);
  EXPECT_FALSE(bytes.take(2 * kSecond, 101));
  EXPECT_TRUE(bytes.take(2 * kSecond, 100));
  EXPECT_TRUE(bytes.take(100 * kSecond, 200));
  EXPECT_FALSE(bytes.take(100 * kSecond, 1)) << "no more than the burst";
}

TEST(RateLimit, AddressesAreIndependentAndForgotten) {
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

TEST(Limits, ScalesSizesOfViews) {
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
  expect("780", "1688", 332, 720);  // a phone; keeps the aspect ratio
  expect("2560", "1440", 1280, 720);
  expect("99999", "99", 1280, Limits::kMinSize);
  for (const char* wrong : {"0", "-1", "nan", "inf", "1e9", "10x", "x", " "}) {
    EXPECT_FALSE(view_size(wrong, "480", limits)) << wrong;
    EXPECT_FALSE(view_size("640", wrong, limits)) << wrong;
  }
}

TEST(Limits, BitRatesDependOnSizes) {
  Limits limits;
  EXPECT_EQ(best_bit_rate(1280, 720, limits), limits.bit_rate);
  EXPECT_LT(best_bit_rate(640, 480, limits), 2100000);
  EXPECT_GT(best_bit_rate(640, 480, limits), 1900000);
  EXPECT_EQ(best_bit_rate(64, 64, limits), 300000);
  limits.bit_rate = 100000;
  EXPECT_EQ(best_bit_rate(64, 64, limits), 100000);
}

class AdmissionControlTest : public testing::Test {
 protected:
  AdmissionControl::Answer come(const std::string& session, const std::string& address, const std::string& ticket = "",
                                int views = 1) {
    const AdmissionControl::Answer answer = seats_.ask(address, views, ticket, "ticket of " + session, now_);
    for (const std::string& leaves : answer.leave) seats_.leave(leaves);
    if (answer.verdict == AdmissionControl::Answer::kAdmitted) seats_.take(session, address, views, now_);
    now_ += kSecond / 1000;
    return answer;
  }
  bool connects(const std::string& session, const std::string& address, const std::string& ticket = "", int views = 1) {
    if (come(session, address, ticket, views).verdict != AdmissionControl::Answer::kAdmitted) return false;
    seats_.connected(session);
    return true;
  }
  AdmissionControl seats_{8, 2};
  int64_t now_ = 1000 * kSecond;
};

TEST_F(AdmissionControlTest, LimitsViewsPerAddress) {
  EXPECT_TRUE(connects("a", "1"));
  EXPECT_TRUE(connects("b", "1"));
  EXPECT_EQ(come("c", "1").verdict, AdmissionControl::Answer::kAddress);
  EXPECT_TRUE(connects("d", "2", "", 2)) << "two eyes";
  EXPECT_EQ(come("e", "2").verdict, AdmissionControl::Answer::kAddress);
  EXPECT_EQ(come("f", "3", "", 3).verdict, AdmissionControl::Answer::kAddress);
  seats_.leave("a");
  EXPECT_TRUE(connects("c", "1"));
  EXPECT_EQ(seats_.taken(), 4);
  EXPECT_EQ(seats_.waiting(), 0u) << "not queued";
}

TEST_F(AdmissionControlTest, UnconnectedViewersLoseTheirSeats) {
  come("a", "1");
  come("b", "1");
  EXPECT_EQ(come("c", "1").verdict, AdmissionControl::Answer::kAddress) << "they may still connect";
  now_ += AdmissionControl::kConnectTimeout;
  EXPECT_THAT(come("c", "1").leave, ElementsAre("a"));
  EXPECT_THAT(come("d", "2").leave, ElementsAre("b")) << "the quarter is used up";
  seats_.connected("c");
  now_ += AdmissionControl::kConnectTimeout;
  EXPECT_THAT(come("e", "3").leave, IsEmpty());
}

TEST_F(AdmissionControlTest, OneAddressCannotBlockOthers) {
  for (int i = 0; i < 20; i++) {
    const std::string n = std::to_string(i);
    come("x" + n, "evil");
    come("y" + n, "evil");
    const AdmissionControl::Answer answer = come("good" + n, "good");
    EXPECT_EQ(answer.verdict, AdmissionControl::Answer::kAdmitted);
    seats_.leave("good" + n);
    now_ += kSecond / 2;
  }
}

TEST_F(AdmissionControlTest, SimultaneousViewersKeepTheirSeats) {
  come("a", "1");
  come("b", "2");
  const AdmissionControl::Answer third = come("c", "3");
  EXPECT_EQ(third.verdict, AdmissionControl::Answer::kFull);
  EXPECT_EQ(third.place, 1u);
  seats_.connected("a");
  EXPECT_EQ(come("c", "3", third.ticket).verdict, AdmissionControl::Answer::kAdmitted);
}

TEST_F(AdmissionControlTest, QueueKeepsItsOrder) {
  for (int i = 0; i < 8; i++) ASSERT_TRUE(connects(std::to_string(i), std::to_string(i)));
  const std::string first = come("a", "a").ticket, second = come("b", "b").ticket;
  EXPECT_EQ(first, "ticket of a");
  EXPECT_EQ(come("b", "b", second).place, 2u);
  EXPECT_EQ(seats_.waiting(), 2u);
  seats_.leave("3");
  EXPECT_EQ(come("c", "c").place, 3u) << "the free seat is the first ticket's";
  EXPECT_EQ(come("b", "b", second).place, 2u);
  EXPECT_TRUE(connects("a", "a", first));
  EXPECT_EQ(come("b", "b", second).place, 1u);
  seats_.leave("4");
  now_ += AdmissionControl::kTicketTimeout / 2;
  come("c", "c", "ticket of c");
  now_ += AdmissionControl::kTicketTimeout / 2;
  EXPECT_TRUE(connects("c", "c", "ticket of c")) << "who does not show a ticket has none any more";
  EXPECT_EQ(seats_.waiting(), 0u);
  EXPECT_EQ(come("d", "d", "an unknown ticket").place, 1u);
}

TEST_F(AdmissionControlTest, QueueIsLimited) {
  for (int i = 0; i < 8; i++) ASSERT_TRUE(connects(std::to_string(i), std::to_string(i)));
  come("a", "evil");
  come("b", "evil");
  EXPECT_EQ(come("c", "evil").verdict, AdmissionControl::Answer::kAddress);
  for (size_t i = 2; i < AdmissionControl::kMaxQueued; i++) come("w", "w" + std::to_string(i));
  EXPECT_EQ(seats_.waiting(), AdmissionControl::kMaxQueued);
  const AdmissionControl::Answer last = come("z", "z");
  EXPECT_EQ(last.verdict, AdmissionControl::Answer::kFull);
  EXPECT_EQ(last.ticket, "");
  EXPECT_EQ(last.place, 0u);
}

}  // namespace
}  // namespace lf::serve
