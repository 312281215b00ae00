// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/seats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lf::serve {
namespace seats_test {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr int64_t kSecond = 1000000;

class SeatsTest : public testing::Test {
 protected:
  // Seats one if it can, and lets those leave that must.
  Seats::Answer come(const std::string& session, const std::string& address, const std::string& ticket = "",
                     int views = 1) {
    const Seats::Answer answer = seats_.ask(address, views, ticket, "ticket of " + session, now_);
    for (const std::string& leaves : answer.leave) seats_.leave(leaves);
    if (answer.verdict == Seats::Answer::kSeat) seats_.take(session, address, views, now_);
    now_ += kSecond / 1000;
    return answer;
  }
  bool connects(const std::string& session, const std::string& address, const std::string& ticket = "", int views = 1) {
    if (come(session, address, ticket, views).verdict != Seats::Answer::kSeat) return false;
    seats_.connected(session);
    return true;
  }
  Seats seats_{8, 2};
  int64_t now_ = 1000 * kSecond;
};

TEST_F(SeatsTest, AnAddressHasTwo) {
  EXPECT_TRUE(connects("a", "1"));
  EXPECT_TRUE(connects("b", "1"));
  EXPECT_EQ(come("c", "1").verdict, Seats::Answer::kAddress);
  EXPECT_TRUE(connects("d", "2", "", 2)) << "two eyes";
  EXPECT_EQ(come("e", "2").verdict, Seats::Answer::kAddress);
  EXPECT_EQ(come("f", "3", "", 3).verdict, Seats::Answer::kAddress);
  seats_.leave("a");
  EXPECT_TRUE(connects("c", "1"));
  EXPECT_EQ(seats_.taken(), 4);
  EXPECT_EQ(seats_.waiting(), 0u) << "who may not wait does not";
}

TEST_F(SeatsTest, WhoDoesNotConnectGivesItsSeatUp) {
  come("a", "1");
  come("b", "1");
  EXPECT_EQ(come("c", "1").verdict, Seats::Answer::kAddress) << "they may still connect";
  now_ += Seats::kPatience;
  EXPECT_THAT(come("c", "1").leave, ElementsAre("a"));
  EXPECT_THAT(come("d", "2").leave, ElementsAre("b")) << "the quarter is used up";
  seats_.connected("c");
  now_ += Seats::kPatience;
  EXPECT_THAT(come("e", "3").leave, IsEmpty());
}

TEST_F(SeatsTest, OneAddressDoesNotKeepOthersFromConnecting) {
  for (int i = 0; i < 20; i++) {
    const std::string n = std::to_string(i);
    come("x" + n, "evil");
    come("y" + n, "evil");
    const Seats::Answer answer = come("good" + n, "good");
    EXPECT_EQ(answer.verdict, Seats::Answer::kSeat);
    seats_.leave("good" + n);
    now_ += kSecond / 2;
  }
}

TEST_F(SeatsTest, ThoseWhoConnectAtOnceDoNotPushEachOtherOut) {
  come("a", "1");
  come("b", "2");
  const Seats::Answer third = come("c", "3");
  EXPECT_EQ(third.verdict, Seats::Answer::kFull);
  EXPECT_EQ(third.place, 1u);
  seats_.connected("a");
  EXPECT_EQ(come("c", "3", third.ticket).verdict, Seats::Answer::kSeat);
}

TEST_F(SeatsTest, TheQueueKeepsItsOrder) {
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
  now_ += Seats::kForgotten / 2;
  come("c", "c", "ticket of c");
  now_ += Seats::kForgotten / 2;
  EXPECT_TRUE(connects("c", "c", "ticket of c")) << "who does not show a ticket has none any more";
  EXPECT_EQ(seats_.waiting(), 0u);
  EXPECT_EQ(come("d", "d", "a ticket that nobody has").place, 1u);
}

TEST_F(SeatsTest, TheQueueIsNotForOneAddressNorWithoutEnd) {
  for (int i = 0; i < 8; i++) ASSERT_TRUE(connects(std::to_string(i), std::to_string(i)));
  come("a", "evil");
  come("b", "evil");
  EXPECT_EQ(come("c", "evil").verdict, Seats::Answer::kAddress);
  for (size_t i = 2; i < Seats::kMostWaiting; i++) come("w", "w" + std::to_string(i));
  EXPECT_EQ(seats_.waiting(), Seats::kMostWaiting);
  const Seats::Answer last = come("z", "z");
  EXPECT_EQ(last.verdict, Seats::Answer::kFull);
  EXPECT_EQ(last.ticket, "");
  EXPECT_EQ(last.place, 0u);
}

}  // namespace seats_test
}  // namespace lf::serve
