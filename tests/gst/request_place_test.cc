// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/request_place.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

GstSegment from(GstClockTime start) {
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = segment.time = segment.position = start;
  return segment;
}

TEST(RequestPlace, CamerasFollowWhereANewSegmentGoesBack) {
  RequestPlace place;
  place.begin(false);
  EXPECT_FALSE(place.moves(from(0), 50));
  EXPECT_FALSE(place.moves(from(0), 20)) << "the same segment";
  EXPECT_FALSE(place.moves(from(10), 30)) << "it goes on";
  EXPECT_TRUE(place.moves(from(0), 20));
  EXPECT_FALSE(place.moves(from(0), 20)) << "once";
}

TEST(RequestPlace, AfterAFlushTheyFollowInAnyCase) {
  RequestPlace place;
  place.moves(from(0), 50);
  place.flush();
  EXPECT_TRUE(place.moves(from(0), 90));
  EXPECT_FALSE(place.moves(from(0), 91));
  place.flush();
  place.clear();
  EXPECT_FALSE(place.moves(from(0), 10));
}

TEST(RequestPlace, LiveCamerasAreWhereTheyAre) {
  RequestPlace place;
  place.begin(true);
  EXPECT_TRUE(place.is_live());
  place.flush();
  EXPECT_FALSE(place.moves(from(0), 90));
  place.begin(false);
  EXPECT_FALSE(place.moves(from(0), 91)) << "that flush is over";
}

}  // namespace
}  // namespace lf
