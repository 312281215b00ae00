// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/depth_tracker.h"

#include "base/schedule.h"
#include "lib/focus/array_of_walls.h"
#include "support/test.h"

namespace lf {
namespace {

using std::chrono_literals::operator""ms;

class StillPicture : public CameraPicture {
 public:
  explicit StillPicture(const Image& image) : image_(image) {}
  int width() const override { return image_.width(); }
  int height() const override { return image_.height(); }
  bool takes_work(PixelFamily) const override { return false; }
  std::shared_ptr<const ImageView> view(PixelFamily, const Rect&) override {
    return std::make_shared<const ImageView>(image_.view());
  }

 private:
  const Image& image_;
};

class DamagedPicture : public StillPicture {
 public:
  using StillPicture::StillPicture;
  std::shared_ptr<const ImageView> view(PixelFamily, const Rect&) override { return nullptr; }
};

class DepthTrackerTest : public testing::Test {
 protected:
  explicit DepthTrackerTest(int side = 3) : walls_(false, 1, side) {
    inputs_.set_rig(std::make_shared<const Rig>(walls_.rig));
    for (CameraIndex i = 0; i < walls_.rig.cameras.size(); i++) {
      const auto frames = std::make_shared<CameraFrames>();
      frames->set_mode(CameraFrames::Mode::kRunning);
      frames->start_stream(true);
      inputs_.add(frames);
      inputs_.set_camera(frames, walls_.rig.cameras[i].id);
      inputs_.set_family(frames, PixelFamily::kRgb);
      frames_.push_back(frames);
    }
    inputs_.choose_family();
    inputs_.set_running(true);
  }
  void push(const std::vector<Image>& images, uint64_t time) {
    for (size_t i = 0; i < frames_.size(); i++)
      frames_[i]->push({.picture = std::make_shared<StillPicture>(images[i]), .time = time});
  }
  // Asks until `is_right` accepts the surface. Returns nothing if this does not happen.
  template <class Fn>
  std::optional<View> wait_for(const View& view, const Fn& is_right) {
    return wait_for(tracker_, tracked_, view, is_right);
  }
  template <class Fn>
  static std::optional<View> wait_for(DepthTracker& tracker, std::shared_ptr<DepthTracker::TrackedView>& tracked,
                                      const View& view, const Fn& is_right) {
    for (int i = 0; i < 2000; i++, std::this_thread::sleep_for(10ms))
      if (std::optional<View> found = tracker.surface(tracked, view, {}); found && is_right(*found)) return found;
    return {};
  }
  std::optional<View> measure(const View& view, const DepthTracker::FindFrame& find,
                              const std::atomic<bool>& cancelled) {
    std::optional<DepthTracker::Measured> measured =
        tracker_.measure(*inputs_.array(), view, {}, find, cancelled, serial_for);
    if (!measured) return {};
    return std::move(measured->view);
  }
  // Returns true if the walls are at their depths, in the left and in the right half of the view.
  static bool shows_walls(const View& view, double nearer = 1) {
    const FocalMap& map = *view.focus.map;
    const auto is_at = [&](double part, double inverse) {
      const size_t at = static_cast<size_t>(map.rows / 2) * map.columns + static_cast<size_t>(part * map.columns);
      return std::abs(map.inverse_of(map.levels[at]) / inverse - 1) < 0.1;
    };
    return is_at(0.2, nearer / 3) && is_at(0.8, nearer / 1.5);
  }

  const test::ArrayOfWalls walls_;
  CameraInputs inputs_;
  std::vector<CameraInputs::Frames> frames_;
  std::shared_ptr<DepthTracker::TrackedView> tracked_;
  DepthTracker tracker_{inputs_};
};

TEST_F(DepthTrackerTest, MeasuresTheSurfaceOfAView) {
  push(walls_.images, 1'000'000'000);
  const View view = walls_.view(0);
  const std::optional<View> found = wait_for(view, [](const View& view) { return shows_walls(view); });
  ASSERT_TRUE(found);
  EXPECT_EQ(found->pose, view.pose);
  EXPECT_EQ(found->focus.map->from, view.focus.map->from);
  EXPECT_EQ(found->focus.map->levels.size(), view.focus.map->levels.size());
}

TEST_F(DepthTrackerTest, FollowsTheViewer) {
  push(walls_.images, 1'000'000'000);
  View view = walls_.view(0);
  ASSERT_TRUE(wait_for(view, [](const View& view) { return shows_walls(view); }));
  view.pose.position.x += 0.01;
  EXPECT_TRUE(wait_for(view, [&](const View& found) { return found.pose == view.pose && shows_walls(found); }));
}

TEST_F(DepthTrackerTest, FollowsTheScene) {
  push(walls_.images, 1'000'000'000);
  ASSERT_TRUE(wait_for(walls_.view(0), [](const View& view) { return shows_walls(view); }));
  const test::ArrayOfWalls nearer(false, 1.3);
  push(nearer.images, 2'000'000'000);
  EXPECT_TRUE(wait_for(walls_.view(0), [](const View& view) { return shows_walls(view, 1.3); }));
}

TEST_F(DepthTrackerTest, ACameraWithDamagedFramesIsLeftOut) {
  push(walls_.images, 1'000'000'000);
  frames_[4]->push({.picture = std::make_shared<DamagedPicture>(walls_.images[4]), .time = 2'000'000'000});
  EXPECT_TRUE(wait_for(walls_.view(0), [](const View& view) { return shows_walls(view); }));
}

TEST_F(DepthTrackerTest, ACameraWithFramesOfAnotherSizeIsLeftOut) {
  push(walls_.images, 1'000'000'000);
  const Image small(PixelFamily::kRgb, 80, 60);
  frames_[4]->push({.picture = std::make_shared<StillPicture>(small), .time = 2'000'000'000});
  EXPECT_TRUE(wait_for(walls_.view(0), [](const View& view) { return shows_walls(view); }));
}

TEST_F(DepthTrackerTest, FilmsAreMeasuredAtOnce) {
  const std::atomic<bool> cancelled = false;
  const auto of = [](const test::ArrayOfWalls& walls) {
    return [&walls](CameraIndex camera) {
      return CameraFrame{.picture = std::make_shared<StillPicture>(walls.images[camera])};
    };
  };
  const View view = walls_.view(0);
  const std::optional<View> found = measure(view, of(walls_), cancelled);
  ASSERT_TRUE(found);
  EXPECT_TRUE(shows_walls(*found));
  const test::ArrayOfWalls nearer(false, 1.3);
  std::optional<View> later;
  for (int i = 0; i < 4; i++) later = measure(view, of(nearer), cancelled);
  ASSERT_TRUE(later);
  EXPECT_TRUE(shows_walls(*later, 1.3));
}

TEST_F(DepthTrackerTest, TheSameFramesAreNotDecodedAgain) {
  class Counted : public StillPicture {
   public:
    Counted(const Image& image, int& views) : StillPicture(image), views_(views) {}
    std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) override {
      views_++;
      return StillPicture::view(family, region);
    }

   private:
    int& views_;
  };
  int views = 0;
  std::vector<CameraFrame> frames;
  for (const Image& image : walls_.images) frames.push_back({.picture = std::make_shared<Counted>(image, views)});
  const std::atomic<bool> cancelled = false;
  const auto find = [&](CameraIndex camera) { return frames[camera]; };
  View view = walls_.view(0);
  ASSERT_TRUE(measure(view, find, cancelled));
  const int first = views;
  view.pose.position.x += 0.01;
  const std::optional<View> moved = measure(view, find, cancelled);
  ASSERT_TRUE(moved);
  EXPECT_TRUE(shows_walls(*moved));
  EXPECT_EQ(views, first);

  frames[4].picture = std::make_shared<DamagedPicture>(walls_.images[4]);
  const std::optional<View> damaged = measure(view, find, cancelled);
  ASSERT_TRUE(damaged);
  EXPECT_TRUE(shows_walls(*damaged));
  EXPECT_EQ(views, first) << "a damaged frame concerns its camera only";

  tracker_.clear();
  ASSERT_TRUE(measure(view, find, cancelled));
  EXPECT_GT(views, first) << "all depths are forgotten";
}

class LargeDepthTrackerTest : public DepthTrackerTest {
 protected:
  LargeDepthTrackerTest() : DepthTrackerTest(5) {}
  // Returns true if camera 24, far from the viewpoint, has depths.
  static bool has_last(const std::optional<ArrayDepth>& depths) {
    return depths && std::ranges::binary_search(depths->cameras(), 24u);
  }
};

TEST_F(LargeDepthTrackerTest, CamerasThatContributeHaveDepths) {
  View view = walls_.view(0);
  view.pose.position = walls_.rig.cameras[0].pose.position;
  const auto find = [this](CameraIndex camera) {
    return CameraFrame{.picture = std::make_shared<StillPicture>(walls_.images[camera])};
  };
  const std::atomic<bool> cancelled = false;
  for (const bool contributes : {false, true}) {
    tracker_.clear();
    const std::vector<CameraIndex> contributing(contributes, 24u);
    const auto measured = tracker_.measure(*inputs_.array(), view, contributing, find, cancelled, serial_for);
    ASSERT_TRUE(measured);
    EXPECT_EQ(measured->depths.cameras().size(), DepthTracker::kCamerasOfView);
    EXPECT_EQ(has_last(measured->depths), contributes) << "a film";
  }
  tracker_.clear();
  push(walls_.images, 1'000'000'000);
  for (int i = 0; i < 2000 && !tracker_.depths(); i++, std::this_thread::sleep_for(10ms))
    tracker_.surface(tracked_, view, {24});
  EXPECT_TRUE(has_last(tracker_.depths())) << "live, from the start";
  const auto has_all = [&](const View&) { return tracker_.depths()->cameras().size() >= DepthTracker::kCamerasOfView; };
  EXPECT_TRUE(wait_for(view, has_all)) << "more cameras with each update";
}

// A viewer who comes later gets the depths of the viewer before.
TEST_F(DepthTrackerTest, DepthsStayWithoutViewsWhileTheImagesAreTheSame) {
  constexpr uint64_t kShort = 50'000'000;
  DepthTracker tracker(inputs_, kShort);
  const auto depths_for = [&](std::shared_ptr<DepthTracker::TrackedView>& view) {
    while (true) {
      tracker.surface(view, walls_.view(0), {});
      if (std::optional<ArrayDepth> depths = tracker.depths()) return *depths;
      std::this_thread::sleep_for(10ms);
    }
  };
  const auto becomes_idle = [&] {
    for (int i = 0; i < 1000 && tracker.depths(); i++) std::this_thread::sleep_for(10ms);
    return !tracker.depths();
  };
  const auto view_again = [&](double nearer) {
    EXPECT_TRUE(becomes_idle());
    std::shared_ptr<DepthTracker::TrackedView> next;
    EXPECT_TRUE(wait_for(tracker, next, walls_.view(0), [=](const View& view) { return shows_walls(view, nearer); }));
    return depths_for(next);
  };
  push(walls_.images, 1'000'000'000);
  ArrayDepth first = view_again(1);
  for (int same = 0; same < 100; std::this_thread::sleep_for(10ms)) {  // the depths settle while there are views
    const ArrayDepth now = depths_for(tracked_);
    same = now.shares_all(first) ? same + 1 : 0;
    first = now;
  }
  EXPECT_TRUE(view_again(1).shares_all(first));
  const test::ArrayOfWalls nearer(false, 1.3);
  EXPECT_TRUE(becomes_idle()) << "the images change while there are no views";
  push(nearer.images, 2'000'000'000);
  const ArrayDepth other = view_again(1.3);
  EXPECT_FALSE(other.shares_all(first));
  EXPECT_NE(other.range().nearest, first.range().nearest) << "another scene has another range";
}

TEST_F(DepthTrackerTest, MeasuringCanBeCancelled) {
  const std::atomic<bool> cancelled = true;
  const auto find = [this](CameraIndex camera) {
    return CameraFrame{.picture = std::make_shared<StillPicture>(walls_.images[camera])};
  };
  EXPECT_FALSE(measure(walls_.view(0), find, cancelled));
}

TEST_F(DepthTrackerTest, WithoutFramesThereIsNoSurface) {
  for (int i = 0; i < 10; i++, std::this_thread::sleep_for(10ms))
    EXPECT_FALSE(tracker_.surface(tracked_, walls_.view(0), {}));
}

// The end of a tracker that waits for its views takes longer than the timeout.
TEST_F(DepthTrackerTest, EndsWhileAViewIsTracked) {
  std::shared_ptr<DepthTracker::TrackedView> tracked;
  DepthTracker(inputs_).surface(tracked, walls_.view(0), {});
  EXPECT_LT(now_ns() - tracked->used, DepthTracker::kTimeout);
}

TEST_F(DepthTrackerTest, ClearForgetsTheSurface) {
  push(walls_.images, 1'000'000'000);
  ASSERT_TRUE(wait_for(walls_.view(0), [](const View&) { return true; }));
  tracker_.clear();
  EXPECT_FALSE(tracker_.surface(tracked_, walls_.view(0), {}));
  EXPECT_TRUE(wait_for(walls_.view(0), [](const View& view) { return shows_walls(view); })) << "it is measured again";
}

TEST_F(DepthTrackerTest, TooManyViewsAndTooManyNodesGetNoSurface) {
  push(walls_.images, 1'000'000'000);
  ASSERT_TRUE(wait_for(walls_.view(0), [](const View&) { return true; }));
  std::vector<std::shared_ptr<DepthTracker::TrackedView>> others(DepthTracker::kMaxViews);
  for (auto& other : others) tracker_.surface(other, walls_.view(0), {});
  EXPECT_EQ(others.back()->wanted.width, walls_.view(0).width);
  EXPECT_FALSE(tracker_.surface(others.back(), walls_.view(0), {}));
  View large = walls_.view(0);
  FocalMap map = FocalMap::for_view(4096, 4096);
  map.levels.resize(static_cast<size_t>(map.columns) * map.rows);
  large.focus.map = std::make_shared<const FocalMap>(map);
  EXPECT_FALSE(tracker_.surface(tracked_, large, {}));
}

}  // namespace
}  // namespace lf
