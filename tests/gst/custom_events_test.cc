// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/custom_events.h"
#include "gst/array_fixture.h"

namespace lf::test {
namespace {

// Copies the event, as elements do to make it writable.
std::shared_ptr<const ViewFeedback> round_trip(const ViewFeedback& feedback) {
  const EventPtr event(view_feedback_event(feedback)), copy(gst_event_copy(event.get()));
  EXPECT_EQ(parse_view_feedback(copy.get()), parse_view_feedback(event.get())) << "shared";
  return parse_view_feedback(copy.get());
}

EventPtr custom_event(GstStructure* structure) {
  return EventPtr(gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM, structure));
}

ViewRequest example_request() {
  ViewRequest request;
  request.view_id = 7;
  request.sequence = 12;
  request.view.width = 64;
  request.view.height = 48;
  request.view.focus.plane = {{0, 0, 1}, 2.5};
  return request;
}

TEST(ViewFeedback, RoundTripsEachPart) {
  const ViewRequest request = example_request();
  DepthEstimator::Plan plan{
      .view = request.view, .hypotheses = {{DepthHypothesis::Kind::kPlane, 200}}, .on_plane = true};
  plan.plane = Plane{{0, 0, 1}, 1.5};
  plan.view.focus.map = flat_surface(request.view);
  ViewRequest probe = request;
  probe.probe = true;
  const ViewFeedback sent{.view_id = 7,
                          .focus = DepthEstimate{12, plan, {.use = true}},
                          .out_of_service = CameraSet{0, 5, 63},
                          .extra_requests = {request, probe}};
  const std::shared_ptr<const ViewFeedback> came = round_trip(sent);
  ASSERT_TRUE(came);
  EXPECT_EQ(came->view_id, 7u);
  ASSERT_TRUE(came->focus);
  EXPECT_EQ(came->focus->sequence, 12u);
  EXPECT_EQ(came->focus->plan.hypotheses, plan.hypotheses);
  EXPECT_EQ(came->focus->plan.on_plane, plan.on_plane);
  EXPECT_EQ(came->focus->plan.plane, plan.plane);
  ASSERT_TRUE(came->focus->plan.view.focus.map);
  EXPECT_EQ(*came->focus->plan.view.focus.map, *plan.view.focus.map);
  EXPECT_TRUE(came->focus->gains.use);
  EXPECT_EQ(came->out_of_service, sent.out_of_service);
  EXPECT_EQ(came->extra_requests, sent.extra_requests);
}

// An empty set means that all cameras are back; no set means no change.
TEST(ViewFeedback, RoundTripsMissingParts) {
  const std::shared_ptr<const ViewFeedback> back = round_trip({.view_id = 1, .out_of_service = CameraSet{}});
  ASSERT_TRUE(back);
  EXPECT_EQ(back->out_of_service, CameraSet{});
  EXPECT_FALSE(back->focus);
  const std::shared_ptr<const ViewFeedback> nothing = round_trip({.view_id = 2});
  ASSERT_TRUE(nothing);
  EXPECT_FALSE(nothing->out_of_service);
  EXPECT_TRUE(nothing->extra_requests.empty());
}

TEST(ViewFeedback, OtherEventsAreIgnored) {
  EXPECT_FALSE(parse_view_feedback(custom_event(gst_structure_new_empty("another")).get()));
  EXPECT_FALSE(parse_view_feedback(custom_event(gst_structure_new_empty(LF_VIEW_FEEDBACK_EVENT)).get()))
      << "no feedback";
  EXPECT_FALSE(parse_view_feedback(EventPtr(gst_event_new_eos()).get()));
}

TEST(ViewFeedback, OtherFieldsAreIgnored) {
  GstStructure* structure = gst_structure_new(LF_VIEW_FEEDBACK_EVENT, "feedback", G_TYPE_UINT, 3, nullptr);
  EXPECT_FALSE(parse_view_feedback(custom_event(structure).get()));
}

}  // namespace
}  // namespace lf::test
