// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Who shows pictures says that they come too late: requests that can't be in time are left out first.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gst/fragment_fixture.h"

namespace lf::test {
namespace {

GstEvent* late_by(GstClockTimeDiff diff, GstClockTime timestamp) {
  return gst_event_new_qos(GST_QOS_TYPE_UNDERFLOW, 2, diff, timestamp);
}

GstEvent* for_view(GstEvent* event, guint view_id) {
  gst_structure_set(gst_event_writable_structure(event), "lightfield-view-id", G_TYPE_UINT, view_id, nullptr);
  return event;
}

using LfFragmentQosTest = LfFragmentTest;

TEST_F(LfFragmentQosTest, LateRequestsAreAnsweredWithoutFragments) {
  start(4);
  push_frames(100, 0);
  for (const HarnessPtr& camera : cameras_) gst_harness_push_event(camera.get(), gst_event_new_eos());
  const auto answer_to = [&](uint32_t sequence, uint32_t view_id) {
    EXPECT_EQ(request(array_.request(sequence, sequence * kFrame, view_id)), GST_FLOW_OK);
    return pull();
  };
  EXPECT_FALSE(answer_to(0, 3).fragments.empty());
  gst_harness_push_upstream_event(harness_.get(),
                                  for_view(late_by(kFrame, 0), 3));  // two frames until it is made up for
  const wire::Answer skipped = answer_to(1, 3);
  EXPECT_TRUE(skipped.fragments.empty());
  EXPECT_EQ(skipped.sequence, 1u);
  EXPECT_EQ(skipped.rig_hash, array_.rig().hash());
  EXPECT_FALSE(answer_to(1, 4).fragments.empty()) << "another view is not late";
  EXPECT_FALSE(answer_to(2, 3).fragments.empty());
  EXPECT_EQ(stat(element_.get(), "skipped"), 1u);
  EXPECT_EQ(stat(element_.get(), "answers"), 4u);
  EXPECT_EQ(stat(element_.get(), "missing-frames"), 0u);
}

}  // namespace
}  // namespace lf::test
