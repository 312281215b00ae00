// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view_request.h"
#include "support/test.h"

namespace lf {
namespace {

ViewRequest extra(uint64_t rig_hash, CameraSet out = {}) {
  ViewRequest request;
  request.rig_hash = rig_hash;
  request.out_of_service = std::move(out);
  request.probe = true;
  return request;
}

TEST(ExtraRequests, AreSentOnceWithTheViewId) {
  ExtraRequests requests;
  requests.ask({extra(7, {1, 4}), extra(7)});
  ViewRequest beside = extra(7, {2, 4});
  beside.view_id = 3;
  beside.target_time = 99;
  beside.absolute_time = true;
  beside.quality = 55;
  uint32_t next = 0xffffffff;
  const std::vector<ViewRequest> made = requests.take_for(beside, next);
  ASSERT_EQ(made.size(), 2u);
  EXPECT_EQ(next, 1u) << "numbers wrap";
  EXPECT_EQ(made[0].sequence, 0xffffffffu);
  EXPECT_EQ(made[1].sequence, 0u);
  EXPECT_EQ(made[0].out_of_service, CameraSet({1, 2, 4}));
  for (const ViewRequest& request : made) {
    EXPECT_TRUE(request.probe);
    EXPECT_EQ(request.view_id, 3u);
    EXPECT_EQ(request.target_time, 99u);
    EXPECT_TRUE(request.absolute_time);
    EXPECT_EQ(request.quality, 55);
  }
  EXPECT_TRUE(requests.take_for(beside, next).empty());
}

TEST(ExtraRequests, RequestsForAnotherRigAreDropped) {
  ExtraRequests requests;
  requests.ask({extra(7), extra(8), extra(0)});
  uint32_t next = 0;
  EXPECT_EQ(requests.take_for(extra(7), next).size(), 2u) << "for view 7, and without a view id";
  requests.ask({extra(8)});
  requests.ask({extra(7)});
  EXPECT_EQ(requests.take_for(extra(0), next).at(0).rig_hash, 0u);
  requests.ask({extra(7)});
  requests.clear();
  EXPECT_TRUE(requests.take_for(extra(7), next).empty());
}

TEST(OutOfServiceRegistry, EachViewHasItsOwnCameras) {
  OutOfServiceRegistry out;
  out.announce(1, {2, 5});
  EXPECT_EQ(out.with_announced(1, {3, 5}), CameraSet({2, 3, 5}));
  EXPECT_EQ(out.with_announced(2, {3}), CameraSet({3}));
  out.announce(1, {7});
  EXPECT_EQ(out.with_announced(1, {}), CameraSet({7})) << "replaces the earlier set";
  out.announce(1, {});
  EXPECT_EQ(out.with_announced(1, {}), CameraSet());
  out.announce(2, {1});
  out.clear();
  EXPECT_EQ(out.with_announced(2, {}), CameraSet());
}

TEST(OutOfServiceRegistry, OldViewsAreForgotten) {
  OutOfServiceRegistry out;
  for (uint32_t view = 0; view < 3000; view++) out.announce(view, {1});
  EXPECT_EQ(out.with_announced(2999, {}), CameraSet({1}));
  EXPECT_EQ(out.with_announced(0, {}), CameraSet());
}

constexpr uint64_t kSecond = 1'000'000'000;
constexpr RequestCost kSmall{640, 480, 0, 2};

TEST(RequestLimiter, LimitsTheCost) {
  RequestLimiter gate;
  const RequestLimits limits;
  const auto check = [&](const RequestCost& cost, double extent = 0.5) {
    return gate.check(1, cost, limits, extent, kSecond);
  };
  EXPECT_EQ(check(kSmall), RequestLimiter::kNone);
  EXPECT_EQ(check({4096, 2304, 0, 16}), RequestLimiter::kNone);
  EXPECT_EQ(check({4096, 2305, 0, 0}), RequestLimiter::kPixels);
  EXPECT_EQ(check({65535, 65535, 0, 0}), RequestLimiter::kPixels);
  EXPECT_EQ(check({640, 480, 0.5, 0}), RequestLimiter::kNone);
  EXPECT_EQ(check({640, 480, 0.51, 0}), RequestLimiter::kAperture);
  EXPECT_EQ(check({640, 480, 0.51, 0}, 0), RequestLimiter::kNone) << "unknown array";
  EXPECT_EQ(check({640, 480, 0, 17}), RequestLimiter::kHypotheses);
  EXPECT_EQ(check({420, 560, 0, 0, 8, 6}), RequestLimiter::kNone) << "a set is one picture";
  EXPECT_EQ(check({4096, 2304, 0, 0, 2, 2}), RequestLimiter::kNone);
  EXPECT_EQ(check({4096, 2304, 0, 0, 5, 1}), RequestLimiter::kPixels);
  EXPECT_EQ(check({65535, 65535, 0, 0, 255, 255}), RequestLimiter::kPixels);
}

// A view's lens determines the cost per pixel.
TEST(RequestLimiter, LimitsTheWorkOfTheLens) {
  RequestLimiter gate;
  const RequestLimits limits;
  const auto check = [&](int width, int height, double steps) {
    return gate.check(1, {.width = width, .height = height, .lens_steps = steps}, limits, 0, kSecond);
  };
  EXPECT_EQ(check(4096, 2304, 16), RequestLimiter::kNone);
  EXPECT_EQ(check(4096, 2304, 16.1), RequestLimiter::kLens);
  EXPECT_EQ(check(2048, 1152, 60), RequestLimiter::kNone) << "a quarter of the pixels";
  EXPECT_EQ(check(2048, 1152, 70), RequestLimiter::kLens);
  EXPECT_THAT(refusal_text(RequestLimiter::kLens, {.width = 4096, .height = 2304, .lens_steps = 55.3}, limits, 0),
              mentions("55 steps", "4096x2304", "max-pixels"));
}

TEST(RequestLimiter, LimitsTheRateOfEachView) {
  RequestLimiter gate;
  RequestLimits limits;
  limits.requests_per_second = 10;
  const auto served = [&](uint64_t view, uint64_t from, int count, uint64_t interval) {
    int served = 0;
    for (int i = 0; i < count; i++)
      served +=
          gate.check(view, kSmall, limits, 0, from + static_cast<uint64_t>(i) * interval) == RequestLimiter::kNone;
    return served;
  };
  EXPECT_EQ(served(1, kSecond, 100, 0), 10) << "burst of one second";
  EXPECT_EQ(served(2, kSecond, 10, 0), 10) << "other views keep their rate";
  EXPECT_NEAR(served(1, 2 * kSecond, 1000, kSecond / 100), 110, 2) << "ten seconds at ten times the rate";
  EXPECT_EQ(served(3, kSecond, 500, kSecond / 9), 500);
}

TEST(RequestLimiter, LimitsTheNumberOfViews) {
  RequestLimiter gate;
  RequestLimits limits;
  limits.views = 4;
  uint64_t now = kSecond;
  const auto check = [&](uint64_t view) { return gate.check(view, kSmall, limits, 0, now); };
  for (uint64_t view = 0; view < 4; view++) EXPECT_EQ(check(view), RequestLimiter::kNone);
  for (uint64_t view = 4; view < 1000; view++) EXPECT_EQ(check(view), RequestLimiter::kViews);
  EXPECT_EQ(check(2), RequestLimiter::kNone);
  EXPECT_EQ(gate.views(), 4u);
  now += RequestLimiter::kViewTimeout + 1;
  EXPECT_EQ(check(2), RequestLimiter::kNone);
  EXPECT_EQ(check(500), RequestLimiter::kNone) << "other views have ended";
}

TEST(RequestLimiter, RefusalNamesTheLimit) {
  const RequestLimits limits;
  EXPECT_THAT(refusal_text(RequestLimiter::kPixels, {16384, 16384, 0, 0}, limits, 0),
              mentions("16384x16384", "9437184 of max-pixels"));
  EXPECT_THAT(refusal_text(RequestLimiter::kAperture, {1, 1, 2.5, 0}, limits, 0.7),
              mentions("2.5 m", "0.7 m", "max-aperture"));
  EXPECT_THAT(refusal_text(RequestLimiter::kPixels, {4096, 2304, 0, 0, 5, 1}, limits, 0),
              mentions("4096x2304", "5 times", "set 4 times"));
  EXPECT_THAT(refusal_text(RequestLimiter::kRate, kSmall, limits, 0), mentions("500 requests"));
}

TEST(RequestLimits, ExtentIsTheDiagonalOfTheArray) {
  Rig rig;
  EXPECT_EQ(array_extent(rig), 0);
  rig.cameras.resize(3);
  rig.cameras[1].pose.position = {3, 0, 0};
  rig.cameras[2].pose.position = {3, 4, 0};
  EXPECT_DOUBLE_EQ(array_extent(rig), 5);
}

TEST(RequestLimits, WorkDependsOnTheRequest) {
  EXPECT_GT(estimated_work({640, 480, 0.1, 0}), 5 * estimated_work({640, 480, 0, 0}));
  EXPECT_GT(estimated_work({640, 480, 0, 8}), estimated_work({640, 480, 0, 0}));
  EXPECT_DOUBLE_EQ(estimated_work({1280, 960, 0, 0}), 4 * estimated_work({640, 480, 0, 0}));
  const RequestCost plain{.width = 640, .height = 480};
  RequestCost distorted = plain, strange = plain, by_angle = plain;
  distorted.lens_steps = 6;
  strange.lens_steps = 60;
  by_angle.by_angle = true;
  EXPECT_GT(estimated_work(distorted), 5 * estimated_work(plain));
  EXPECT_GT(estimated_work(strange), 5 * estimated_work(distorted));
  EXPECT_GT(estimated_work(by_angle), estimated_work(plain));
  EXPECT_GT(estimated_work(by_angle, 10'000), 5 * estimated_work(by_angle, 100))
      << "cost per grid point grows with the cameras";
  EXPECT_GT(estimated_work(plain, 65'000), estimated_work(plain, 100));
}

// A rate of 0 is unlimited. It applies until the view turns out to be live.
TEST(RequestLimiter, NewRateLimitAppliesToKnownViews) {
  RequestLimiter gate;
  RequestLimits limits;
  limits.requests_per_second = 0;
  for (int i = 0; i < 1000; i++) ASSERT_EQ(gate.check(1, {}, limits, 0, 5), RequestLimiter::kNone);
  limits.requests_per_second = 10;
  for (int i = 0; i < 10; i++) EXPECT_EQ(gate.check(1, {}, limits, 0, 5), RequestLimiter::kNone) << i;
  EXPECT_EQ(gate.check(1, {}, limits, 0, 5), RequestLimiter::kRate);
}

}  // namespace
}  // namespace lf
