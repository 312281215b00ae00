// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/asked_of_requests.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

ViewRequest extra(uint64_t rig_hash, CameraSet out = {}) {
  ViewRequest request;
  request.rig_hash = rig_hash;
  request.out_of_service = std::move(out);
  request.probe = true;
  return request;
}

TEST(ExtraRequests, LeaveOnceAsTheViewsOwn) {
  ExtraRequests requests;
  requests.ask({extra(7, {1, 4}), extra(7)});
  ViewRequest beside = extra(7, {2, 4});
  beside.view_id = 3;
  beside.target_time = 99;
  beside.absolute_time = true;
  beside.quality = 55;
  uint32_t next = 0xffffffff;
  const std::vector<ViewRequest> made = requests.take_beside(beside, next);
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
  EXPECT_TRUE(requests.take_beside(beside, next).empty());
}

TEST(ExtraRequests, ThoseOfAnotherRigAreLeftOut) {
  ExtraRequests requests;
  requests.ask({extra(7), extra(8), extra(0)});
  uint32_t next = 0;
  EXPECT_EQ(requests.take_beside(extra(7), next).size(), 2u) << "7, and the one that names none";
  requests.ask({extra(8)});
  requests.ask({extra(7)});
  EXPECT_EQ(requests.take_beside(extra(0), next).at(0).rig_hash, 0u);
  requests.ask({extra(7)});
  requests.clear();
  EXPECT_TRUE(requests.take_beside(extra(7), next).empty());
}

TEST(OutOfService, EachViewHasItsOwn) {
  OutOfService out;
  out.announce(1, {2, 5});
  EXPECT_EQ(out.with_announced(1, {3, 5}), CameraSet({2, 3, 5}));
  EXPECT_EQ(out.with_announced(2, {3}), CameraSet({3}));
  out.announce(1, {7});
  EXPECT_EQ(out.with_announced(1, {}), CameraSet({7})) << "in place of those before";
  out.announce(1, {});
  EXPECT_EQ(out.with_announced(1, {}), CameraSet());
  out.announce(2, {1});
  out.clear();
  EXPECT_EQ(out.with_announced(2, {}), CameraSet());
}

TEST(OutOfService, ViewersThatComeAndGoAreForgotten) {
  OutOfService out;
  for (uint32_t view = 0; view < 3000; view++) out.announce(view, {1});
  EXPECT_EQ(out.with_announced(2999, {}), CameraSet({1}));
  EXPECT_EQ(out.with_announced(0, {}), CameraSet());
}

}  // namespace
}  // namespace lf
