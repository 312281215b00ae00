// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/client.h"
#include "support/test.h"

namespace lf {
namespace {

std::shared_ptr<AnswerJob> job(uint64_t time, int side = 100) {
  ViewRequest request;
  request.target_time = time;
  request.view.width = request.view.height = side;
  request.place = {.layout = ViewSetLayout::kRow, .columns = 9, .rows = 1, .index = 1};
  return std::make_shared<AnswerJob>(AnswerJob{request, 0, 0, {}});
}

using Jobs = std::vector<std::shared_ptr<AnswerJob>>;

TEST(AnswerJobQueue, JobsOfASetAreTakenTogether) {
  AnswerJobQueue waiting;
  const auto a = job(1), b = job(2), c = job(1), d = job(1);
  for (const auto& each : {a, b, c}) waiting.add(each);
  EXPECT_EQ(waiting.take_with(d, false), Jobs()) << "not waiting";
  EXPECT_EQ(waiting.take_with(a, false), (Jobs{a, c}));
  EXPECT_EQ(waiting.take_with(c, false), Jobs()) << "no longer waiting";
  waiting.add(d);
  EXPECT_EQ(waiting.take_with(b, false), (Jobs{b}));
  EXPECT_EQ(waiting.take_with(d, false), (Jobs{d}));
}

TEST(AnswerJobQueue, JobIsTakenAloneOnRequest) {
  AnswerJobQueue waiting;
  const auto a = job(1), b = job(1);
  for (const auto& each : {a, b}) waiting.add(each);
  EXPECT_EQ(waiting.take_with(b, true), (Jobs{b}));
  EXPECT_EQ(waiting.take_with(a, true), (Jobs{a}));
}

TEST(AnswerJobQueue, ReleasedJobsAreForgotten) {
  AnswerJobQueue waiting;
  const auto a = job(1), b = job(1);
  waiting.add(a);
  waiting.add(job(1));
  waiting.add(b);
  EXPECT_EQ(waiting.forget_dropped(), 1u);
  EXPECT_EQ(waiting.forget_dropped(), 0u);
  waiting.add(job(1));
  EXPECT_EQ(waiting.take_with(b, false), (Jobs{b, a}));
}

TEST(AnswerJobQueue, BatchesHaveLimitedPixels) {
  AnswerJobQueue waiting;
  constexpr int kSide = 2000;  // four jobs reach the limit
  Jobs all;
  for (int i = 0; i < 9; i++) waiting.add(all.emplace_back(job(1, kSide)));
  EXPECT_EQ(waiting.take_with(all[0], false), (Jobs{all[0], all[1], all[2], all[3]}));
  EXPECT_EQ(waiting.take_with(all[4], false), (Jobs{all[4], all[5], all[6], all[7]}));
  EXPECT_EQ(waiting.take_with(all[8], false), (Jobs{all[8]}));
  const auto huge = job(1, 30000);
  waiting.add(huge);
  EXPECT_EQ(waiting.take_with(huge, false), (Jobs{huge})) << "a single job is always taken";
}

TEST(AnswerJobQueue, EachJobIsTakenOnce) {
  AnswerJobQueue waiting;
  Jobs all;
  for (int i = 0; i < 300; i++) all.push_back(job(static_cast<uint64_t>(i / 9)));
  std::jthread adding([&] {
    for (const auto& each : all) waiting.add(each);
  });
  std::map<std::shared_ptr<AnswerJob>, int> taken;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (taken.size() < all.size() && std::chrono::steady_clock::now() < end)
    for (const auto& each : all)
      for (const auto& one : waiting.take_with(each, false)) taken[one]++;
  EXPECT_EQ(taken.size(), all.size());
  for (const auto& [one, times] : taken) EXPECT_EQ(times, 1);
}

GstSegment from(GstClockTime start) {
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = segment.time = segment.position = start;
  return segment;
}

TEST(RequestPosition, CamerasSeekIfASegmentGoesBack) {
  RequestPosition place;
  place.begin(false);
  EXPECT_FALSE(place.moves(from(0), 50));
  EXPECT_FALSE(place.moves(from(0), 20)) << "the same segment";
  EXPECT_FALSE(place.moves(from(10), 30)) << "continuous";
  EXPECT_TRUE(place.moves(from(0), 20));
  EXPECT_FALSE(place.moves(from(0), 20)) << "once";
}

TEST(RequestPosition, CamerasSeekAfterAFlush) {
  RequestPosition place;
  place.moves(from(0), 50);
  place.flush();
  EXPECT_TRUE(place.moves(from(0), 90));
  EXPECT_FALSE(place.moves(from(0), 91));
  place.flush();
  place.clear();
  EXPECT_FALSE(place.moves(from(0), 10));
}

TEST(RequestPosition, LiveCamerasDoNotSeek) {
  RequestPosition place;
  place.begin(true);
  EXPECT_TRUE(place.is_live());
  place.flush();
  EXPECT_FALSE(place.moves(from(0), 90));
  place.begin(false);
  EXPECT_FALSE(place.moves(from(0), 91)) << "the flush is over";
}

}  // namespace
}  // namespace lf
