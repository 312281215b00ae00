// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include "common/view_feedback.h"
#include "gst/view_request_source.h"
#include "node/camera_access.h"
#include "wire/command_codec.h"

namespace lf::test {
namespace {

// lfviewrequest with requests of other viewers coming in.
class LfViewRequestRelay : public testing::Test {
 protected:
  void start(bool live = false) {
    element_.reset(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make("lfviewrequest", nullptr))));
    g_object_set(element_.get(), "is-live", live, nullptr);
    harness_.reset(gst_harness_new_with_element(element_.get(), "sink", "src"));
    gst_harness_set_src_caps_str(harness_.get(), "application/x-lightfield-request,framerate=30/1");
  }

  ViewRequest request(uint32_t view_id, uint32_t sequence, const CameraSet& out = {}) {
    ViewRequest request;
    request.view_id = view_id;
    request.sequence = sequence;
    request.view = test_views({0})[0].view;
    request.out_of_service = out;
    return request;
  }

  void push(const ViewRequest& request, GstClockTime pts = 0) {
    GstBuffer* buffer = to_buffer(wire::encode_request(request));
    GST_BUFFER_PTS(buffer) = pts;
    ASSERT_EQ(gst_harness_push(harness_.get(), buffer), GST_FLOW_OK);
  }

  ViewRequest pull() {
    const BufferPtr buffer(gst_harness_pull(harness_.get()));
    EXPECT_TRUE(buffer);
    if (!buffer) return {};
    pts_ = GST_BUFFER_PTS(buffer.get());
    return wire::decode_request(to_bytes(buffer.get())).value_or(ViewRequest{});
  }

  void announce(guint view_id, const CameraSet& cameras) {
    EXPECT_TRUE(gst_harness_push_upstream_event(harness_.get(),
                                                view_feedback_event({.view_id = view_id, .out_of_service = cameras})));
  }

  ElementPtr element_;
  HarnessPtr harness_;
  GstClockTime pts_ = 0;
};

TEST_F(LfViewRequestRelay, PassesRequestsOnAsTheyAre) {
  start();
  for (uint32_t i = 0; i < 5; i++) {
    const ViewRequest asked = request(i % 2, i, {3});
    push(asked, i * kMs);
    EXPECT_EQ(pull(), asked);
    EXPECT_EQ(pts_, i * kMs);
  }
  const CapsPtr caps(gst_pad_get_current_caps(harness_->sinkpad));
  EXPECT_TRUE(gst_structure_has_field(gst_caps_get_structure(caps.get(), 0), "framerate"));
  gst_harness_push_event(harness_.get(), gst_event_new_eos());
  bool eos = false;
  for (int i = 0; i < 20 && !eos; i++) {
    GstEvent* event = gst_harness_pull_event(harness_.get());
    if (!event) break;
    eos = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
    gst_event_unref(event);
  }
  EXPECT_TRUE(eos);
}

TEST_F(LfViewRequestRelay, AddsTheCamerasThatAreOutOfServiceInThisView) {
  start();
  announce(1, {5, 9});
  push(request(1, 0, {3, 9}));
  EXPECT_EQ(pull().out_of_service, (CameraSet{3, 5, 9}));
  push(request(2, 0, {3, 9}));
  EXPECT_EQ(pull().out_of_service, (CameraSet{3, 9}));
  announce(1, {});
  push(request(1, 1));
  EXPECT_TRUE(pull().out_of_service.empty());
}

TEST_F(LfViewRequestRelay, TellsTheLatencyOfWhatItRelays) {
  for (const bool upstream_is_live : {true, false}) {
    start(true);
    gst_harness_set_live(harness_.get(), upstream_is_live);
    gst_harness_set_upstream_latency(harness_.get(), 200 * kMs);
    GstQuery* query = gst_query_new_latency();
    ASSERT_TRUE(gst_pad_peer_query(harness_->sinkpad, query));
    gboolean live = FALSE;
    GstClockTime min = 0;
    gst_query_parse_latency(query, &live, &min, nullptr);
    gst_query_unref(query);
    EXPECT_TRUE(live);
    EXPECT_EQ(min, upstream_is_live ? 200 * kMs : 0);
  }
}

// The viewer does not know what is out of service here: its commands end, new ones are made.
TEST_F(LfViewRequestRelay, MakesTheCommandsItself) {
  TemporaryFiles files;
  const Rig rig = test_rig();
  save_rig(rig, files.path("rig.json"));
  start();
  gst_element_set_state(element_.get(), GST_STATE_READY);
  g_object_set(element_.get(), "rig", files.path("rig.json").c_str(), nullptr);
  gst_util_set_object_arg(G_OBJECT(element_.get()), "access", "pixels");
  gst_element_set_state(element_.get(), GST_STATE_PLAYING);
  announce(1, {5});
  ViewRequest asked = request(1, 0);
  asked.view = make_view(default_viewpoint(rig), 32, 24);
  push(asked);
  const auto of_viewer =
      wire::encode_any_request(CameraAccess::of(Access::kWarp)->command(rig, build_mesh(rig), asked));
  ASSERT_EQ(gst_harness_push(harness_.get(), to_buffer(of_viewer)), GST_FLOW_OK);
  asked.out_of_service = {5};
  EXPECT_EQ(pull(), asked);
  const BufferPtr command(gst_harness_pull(harness_.get()));
  ASSERT_TRUE(command);
  EXPECT_EQ(wire::decode_any_request(to_bytes(command.get())),
            CameraAccess::of(Access::kPixels)->command(rig, build_mesh(rig, {5}), asked));
  asked.sequence++;
  push(asked);
  EXPECT_EQ(pull(), asked) << "the viewer's command has ended";
}

// A viewer behind a network hears nothing of compositors: the relay gives its requests the surface that was found.
// Where somebody before the relay takes it, or where requests come from a file, they stay as they are.
TEST_F(LfViewRequestRelay, GivesRequestsTheSurfaceThatNobodyElseTakes) {
  const struct {
    bool live, taken, changes;
  } cases[] = {{true, false, true}, {true, true, false}, {false, false, false}};
  for (const auto& [live, taken, changes] : cases) {
    start(live);
    if (!taken)
      gst_pad_set_event_function(
          harness_->srcpad, +[](GstPad*, GstObject*, GstEvent* event) -> gboolean {
            gst_event_unref(event);
            return FALSE;
          });
    ViewRequest asked = request(1, 0);
    push(asked);
    EXPECT_EQ(pull(), asked);
    FocalMap map = FocalMap::for_view(asked.view.width, asked.view.height);
    map.from = {{0, 0, 1}, 0};
    map.farthest = 0.05;
    map.nearest = 0.3;
    map.levels.assign(static_cast<size_t>(map.columns) * map.rows, 51);
    FocusControl::Plan plan{asked.view, {{Trial::Kind::kPlane, 200}}};
    plan.view.focus.map = std::make_shared<FocalMap>(std::move(map));
    const ViewFeedback feedback{.view_id = asked.view_id, .focus = FoundFocus{asked.sequence, plan, asked.gains}};
    EXPECT_EQ(gst_harness_push_upstream_event(harness_.get(), view_feedback_event(feedback)), live);

    ViewRequest other = asked;
    other.view_id = 2;
    push(other);
    EXPECT_EQ(pull(), other) << "of another view";
    for (uint32_t i = 1; i < 3; i++) {
      asked.sequence = i;
      push(asked);
      const ViewRequest sent = pull();
      EXPECT_EQ(sent.view.focus.map != nullptr, changes);
      EXPECT_EQ(sent.trials.size(), changes && i == 1 ? 1u : 0u) << "trials are for one request";
    }
  }
}

TEST_F(LfViewRequestRelay, DropsGarbage) {
  start();
  ASSERT_EQ(gst_harness_push(harness_.get(), to_buffer({1, 2, 3})), GST_FLOW_OK);
  push(request(0, 7));
  EXPECT_EQ(pull().sequence, 7u);
}

TEST_F(LfViewRequestRelay, FlushesAndStopsWhateverWaits) {
  for (const bool live : {false, true}) {
    for (int i = 0; i < 20; i++) {
      start(live);
      if (i % 2) push(request(0, 0));
      if (i % 3 == 0) {
        gst_harness_push_event(harness_.get(), gst_event_new_flush_start());
        gst_harness_push_event(harness_.get(), gst_event_new_flush_stop(TRUE));
      }
      harness_.reset();
    }
  }
}

TEST(LfViewRequestOutOfService, AnnouncedCamerasAreInTheNextRequests) {
  TemporaryFiles files;
  save_rig(test_rig(), files.path("rig.json"));
  Source source;
  source.set("rig", files.path("rig.json").c_str(), "out-of-service", "11", "view-id", 4u);
  source.play_live();
  EXPECT_EQ(source.next_live().request.out_of_service, CameraSet{1});
  const auto announce = [&](guint view_id, const CameraSet& cameras) {
    EXPECT_TRUE(source.send(view_feedback_event({.view_id = view_id, .out_of_service = cameras})));
  };
  announce(4, {0, 3});
  announce(5, {2});
  EXPECT_EQ(source.next_live().request.out_of_service, (CameraSet{0, 1, 3}));
  announce(4, {});
  EXPECT_EQ(source.next_live().request.out_of_service, CameraSet{1});
}

}  // namespace
}  // namespace lf::test
