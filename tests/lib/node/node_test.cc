// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/node.h"
#include "lib/focus/array_of_walls.h"
#include "render/gl/gles_renderer.h"
#include "support/test.h"
#include "view/view.h"

namespace lf {
namespace {

class Picture : public CameraPicture {
 public:
  explicit Picture(const ImageView& image) : image_(image) {}
  int width() const override { return image_.width; }
  int height() const override { return image_.height; }
  bool takes_work(PixelFamily) const override { return false; }
  std::shared_ptr<const ImageView> view(PixelFamily, const Rect&) override {
    return std::make_shared<const ImageView>(image_);
  }

 private:
  const ImageView image_;
};

class NodeOfViews : public testing::Test {
 protected:
  static constexpr uint64_t kTime = 1'000'000'000;

  // Cameras in `missing` have ended without a frame.
  void start(bool live, const CameraSet& missing = {}) {
    node_.inputs().set_rig(std::make_shared<const Rig>(walls_.rig));
    for (CameraIndex i = 0; i < walls_.rig.cameras.size(); i++) {
      const auto frames = std::make_shared<CameraFrames>();
      frames->set_mode(CameraFrames::Mode::kRunning);
      frames->start_stream(live);
      node_.inputs().add(frames);
      node_.inputs().set_camera(frames, walls_.rig.cameras[i].id);
      node_.inputs().set_family(frames, PixelFamily::kRgb);
      if (!std::ranges::binary_search(missing, i))
        frames->push({.picture = std::make_shared<Picture>(walls_.images[i].view()), .time = kTime});
      frames->end_stream();
      frames_.push_back(frames);
    }
    node_.inputs().set_running(true);
    options_.live = live;
    options_.render.codec = CodecChoice::kRaw16;
    options_.render.resampling = Resampling::kSharpened;
  }

  // A row of views; one is too small to show sharpening, and one looks away.
  std::vector<wire::AnyRequest> set() const {
    std::vector<wire::AnyRequest> requests;
    const ViewSet set{.layout = ViewSetLayout::kRow, .columns = 6, .eye_distance = 0.01};
    const View middle = walls_.view(100);
    for (const ViewSetPosition& place : set.places()) {
      ViewRequest request;
      request.view_id = 7;
      request.sequence = static_cast<uint32_t>(requests.size());
      request.target_time = kTime;
      request.absolute_time = options_.live;
      request.rig_hash = walls_.rig.hash();
      request.place = place;
      request.view = set.view(middle, place);
      request.view.focus.map = walls_.view(static_cast<uint8_t>(60 + 20 * place.index)).focus.map;
      request.gains.use = true;
      if (place.index == 1) {
        request.view.width = 40;
        request.view.height = 30;
        request.view.lens = Lens::from_fov_y(25, 40, 30);
        request.view.focus.map = nullptr;
      }
      if (place.index == 4) request.view.pose.position.x += 0.1;
      requests.push_back(request);
    }
    return requests;
  }

  // Expects the same answers together and alone. Returns the number of GPU passes.
  size_t expect_same(const std::vector<wire::AnyRequest>& requests) {
    std::vector<const wire::AnyRequest*> all;
    for (const wire::AnyRequest& request : requests) all.push_back(&request);
    const auto answers = [&](std::span<const wire::AnyRequest* const> some) {
      return node_.answer(some, requester_, options_, [] { return ByteBuffer(); });
    };
    std::vector<ByteBuffer> alone;
    for (const wire::AnyRequest* const& request : all) alone.push_back(answers({&request, 1}).front().answer.bytes);
    const auto together = answers(all);
    EXPECT_EQ(together.size(), requests.size());
    for (size_t i = 0; i < together.size(); i++) {
      EXPECT_EQ(together[i].answer.bytes, alone[i]) << i;
      EXPECT_EQ(together[i].warning, "");
    }
    return options_.render.gpu ? options_.render.gpu->passes() : 0;
  }

  test::ArrayOfWalls walls_;
  Node node_;
  std::vector<CameraInputs::Frames> frames_;
  Node::ClientState requester_;
  Node::Options options_;
};

TEST_F(NodeOfViews, BatchedAnswersEqualSingleAnswers) {
  start(true);
  expect_same(set());
  EXPECT_EQ(node_.stats().requests, 12u);
  EXPECT_EQ(node_.stats().missing_frames, 0u);
}

TEST_F(NodeOfViews, AnswersSeveralOfAnAperture) {
  std::string why;
  options_.render.gpu = gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  ASSERT_TRUE(options_.render.gpu) << why;
  start(true);
  std::vector<wire::AnyRequest> requests = set();
  for (wire::AnyRequest& request : requests)
    std::get<ViewRequest>(request).view.blending = {.kind = Blending::Kind::kAperture, .aperture = 0.1};
  EXPECT_TRUE(Node::can_batch_requests(requests[1], requests[2]));
  EXPECT_EQ(expect_same(requests), 3u) << "one request uses a plane, with another shader";
  EXPECT_GT(node_.stats().drawn, 6u);
}

TEST_F(NodeOfViews, AnswersSeveralOfFiles) {
  start(false);
  expect_same(set());
}

TEST_F(NodeOfViews, AnswersSeveralWithoutSomeCameras) {
  start(true, {2, 4});
  expect_same(set());
  const uint64_t missing = node_.stats().missing_frames;
  EXPECT_GT(missing, 0u);
  EXPECT_EQ(missing % 2, 0u) << "same count as separate requests";
}

TEST_F(NodeOfViews, AnswersSeveralOfFilesWithoutSomeCameras) {
  start(false, {2, 4});
  expect_same(set());
  EXPECT_EQ(node_.stats().missing_frames % 2, 0u);
}

TEST_F(NodeOfViews, AnswersSeveralWithoutAnyCamera) {
  start(true, {0, 1, 2, 3, 4, 5, 6, 7, 8});
  expect_same(set());
}

TEST_F(NodeOfViews, AnswersSeveralInAPassOfItsGpu) {
  start(true);
  std::string why;
  options_.render.gpu = gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  ASSERT_TRUE(options_.render.gpu) << why;
  // One view has no map, and some views are partly beside the mesh, which takes another program.
  const auto passes = expect_same(set());
  EXPECT_GE(passes, 3u);
  EXPECT_LE(passes, 5u);
  EXPECT_GE(node_.stats().drawn, 10u);
}

TEST_F(NodeOfViews, RefusesBatchesOfUnfitRequests) {
  start(true);
  const auto expect_refused = [&](const auto& change) {
    std::vector<wire::AnyRequest> requests = set();
    std::vector<const wire::AnyRequest*> all;
    for (wire::AnyRequest& request : requests) {
      change(std::get<ViewRequest>(request));
      all.push_back(&request);
    }
    const auto replies = node_.answer(all, requester_, options_, [] { return ByteBuffer(); });
    ASSERT_EQ(replies.size(), 6u);
    EXPECT_NE(replies[0].warning, "");
    for (size_t i = 1; i < replies.size(); i++) EXPECT_EQ(replies[i].warning, "") << "warns once";
    for (const auto& reply : replies) EXPECT_FALSE(reply.answer.bytes.empty());
  };
  expect_refused([](ViewRequest& request) { request.rig_hash = 1; });
  EXPECT_EQ(node_.stats().rig_mismatches, 6u);
  expect_refused([](ViewRequest& request) { request.out_of_service = {99}; });
  EXPECT_EQ(node_.stats().bad_requests, 6u);
}

TEST_F(NodeOfViews, OnlyViewsOfOneCaptureTimeAreBatched) {
  const std::vector<wire::AnyRequest> requests = set();
  EXPECT_TRUE(Node::can_batch_requests(requests[1], requests[2]));
  const auto differs = [&](const auto& change) {
    wire::AnyRequest other = requests[2];
    change(std::get<ViewRequest>(other));
    return !Node::can_batch_requests(requests[1], other) && !Node::can_batch_requests(other, requests[1]);
  };
  EXPECT_TRUE(differs([](ViewRequest& request) { request.view_id++; }));
  EXPECT_TRUE(differs([](ViewRequest& request) { request.target_time++; }));
  EXPECT_TRUE(differs([](ViewRequest& request) { request.out_of_service = {1}; }));
  EXPECT_TRUE(differs([](ViewRequest& request) { request.rig_hash++; }));
  EXPECT_TRUE(differs([](ViewRequest& request) { request.gains.ask = true; }));
  EXPECT_TRUE(differs([](ViewRequest& request) { request.gains.use = false; }));
  EXPECT_TRUE(differs([](ViewRequest& request) { request.place = {}; }));
  EXPECT_FALSE(Node::can_batch_requests(requests[1], wire::PixelCommand{}));
  wire::AnyRequest any_time = requests[1];
  std::get<ViewRequest>(any_time).target_time = kNoTime;
  EXPECT_FALSE(Node::can_batch_requests(any_time, any_time)) << "requests for the newest frames";
}

using RequesterPtr = std::shared_ptr<Node::ClientState>;

TEST(ClientStates, EachViewHasItsOwnState) {
  const Node::ClientState common;
  ClientStates views(common);
  const RequesterPtr three = views.of(3);
  three->warned_of = 33;
  EXPECT_EQ(views.of(4)->warned_of, 0u);
  EXPECT_EQ(views.of(3), three);
  EXPECT_EQ(three->cancelled, common.cancelled) << "shared flag";
  EXPECT_EQ(three->images, common.images);
  views.clear();
  EXPECT_EQ(views.of(3)->warned_of, 0u);
}

TEST(ClientStates, LeastRecentlyUsedStateIsForgotten) {
  ClientStates views{Node::ClientState()};
  for (uint32_t id = 0; id < 2 * ClientStates::kMaxViews; id++) views.of(id)->warned_of = 1;
  views.of(0);
  views.of(1000);
  EXPECT_EQ(views.of(0)->warned_of, 1u);
  EXPECT_EQ(views.of(1)->warned_of, 0u);
}

TEST(ClientStates, EstimatesOfViewsAreIndependent) {
  ClientStates views{Node::ClientState()};
  views.of(1)->estimate.done(1000, 5000);
  EXPECT_EQ(views.nanoseconds(1, 100), 500u);
  EXPECT_EQ(views.nanoseconds(2, 100), 0u) << "unknown";
  views.of(2);
  EXPECT_EQ(views.nanoseconds(2, 100), 0u);
}

// An answer may be suspended for any number of other views and resumed.
TEST(ClientStates, StateInUseOutlivesItsEntry) {
  ClientStates views{Node::ClientState()};
  RequesterPtr held = views.of(1);
  const std::weak_ptr<Node::ClientState> watched = held;
  held->warned_of = 11;
  for (uint32_t id = 2; id < 2 + 3 * ClientStates::kMaxViews; id++) views.of(id)->warned_of = id;
  ASSERT_FALSE(watched.expired());
  EXPECT_EQ(held->warned_of, 11u);
  EXPECT_NE(views.of(1), held) << "still forgotten";
  held.reset();
  EXPECT_TRUE(watched.expired());
}

}  // namespace
}  // namespace lf
