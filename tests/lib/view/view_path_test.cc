// SPDX-License-Identifier: LGPL-2.1-or-later
#include <nlohmann/json.hpp>

#include "base/text.h"
#include "geometry/pose.h"
#include "render/contribution_map.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/temp_dir.h"
#include "support/test.h"
#include "view/navigator.h"
#include "view/view_path.h"

namespace lf {
namespace {

using nlohmann::json;

json good_views() {
  return json::parse(R"({"format": "lightfield-views", "version": 1, "note": "ignored", "views": [
    {"name": "first", "position": [0, 0, 0], "orientation": [1, 0, 0, 0], "width": 320, "height": 240, "fov_y": 90,
     "focal_plane": [0, 0, -1, 3]},
    {"time": 0.5, "position": [1, 2, 3], "orientation": [0, 0, 1, 0], "width": 1, "height": 8192,
     "model": "RADIAL", "params": [386.73880838315351, 159.5, 119.5, -0.15, 0.03], "focus_distance": 2}]})");
}

TEST(ViewsJson, ReadsBothFormsOfLensAndFocus) {
  const std::vector<NamedView> views = parse_views(good_views().dump(), "v.json");
  ASSERT_EQ(views.size(), 2u);
  EXPECT_EQ(views[0].name, "first");
  EXPECT_EQ(views[0].time, 0);
  EXPECT_EQ(views[0].view.lens, Lens::pinhole(views[0].view.lens.fx(), 159.5, 119.5));
  EXPECT_NEAR(views[0].view.lens.fx(), 120, 1e-12);
  EXPECT_EQ(views[0].view.focus.plane, (Plane{{0, 0, -1}, 3}));
  EXPECT_EQ(views[1].name, "view_01");
  EXPECT_EQ(views[1].time, 0.5);
  EXPECT_EQ(views[1].view.height, 8192);
  EXPECT_EQ(views[1].view.lens.model(), LensModel::kRadial);
  EXPECT_NEAR(views[1].view.focus.plane.signed_distance({7, 8, 1}), 0, 1e-14) << "looks along -z";
  for (const NamedView& view : views) EXPECT_NO_THROW(validate(view.view));
}

TEST(ViewsJson, RoundTripsToTheLastBit) {
  std::vector<NamedView> views = parse_views(good_views().dump(), "v.json");
  views[0].view.pose.position = {1 / 3.0, -1e-300, 1e6 / 7};
  views[0].view.pose.orientation = glm::normalize(Quat(0.1, 0.2, 0.3, 0.4));
  views[1].time = 1 / 3.0;
  const TempDir dir;
  save_views(views, dir / "views.json");
  const std::vector<NamedView> back = load_views(dir / "views.json");
  ASSERT_EQ(back.size(), views.size());
  for (size_t i = 0; i < views.size(); i++) {
    EXPECT_EQ(back[i].name, views[i].name);
    EXPECT_EQ(back[i].time, views[i].time);
    EXPECT_EQ(back[i].view, views[i].view);
  }
}

TEST(ViewsJson, ErrorsNameThePlace) {
  // Patches, merged into the good file; null removes a key.
  const InvalidText files[] = {
      {R"({"format": null})", {"v.json", "\"format\"", "missing"}},
      {R"({"format": "lightfield-rig"})", {"v.json", "format", "lightfield-views", "lightfield-rig"}},
      {R"({"version": 2})", {"v.json", "version", "1 to 1", "2"}},
      {R"({"views": null})", {"v.json", "\"views\"", "missing"}},
      {R"({"views": []})", {"v.json", "views: no"}},
      {R"({"views": {}})", {"v.json", "views", "array"}},
      {R"({"views": [3]})", {"v.json", "views[0]", "object"}},
  };
  for (const auto& c : files) {
    json file = good_views();
    file.merge_patch(json::parse(c.text));
    EXPECT_ERROR(parse_views(file.dump(), "v.json"), c.facts);
  }
  struct {
    int view;
    const char* patch;
    std::vector<std::string> facts;
  } const cases[] = {
      {0, R"({"name": 3})", {"views[0].name", "string"}},
      {0, R"({"name": ""})", {"views[0].name", "file name"}},
      {0, R"({"name": "../x"})", {"views[0].name", "file name"}},
      {0, R"({"name": "x\u0000"})", {"views[0].name", "NUL"}},
      {0, R"({"name": "x\n"})", {"views[0].name", "control characters"}},
      {1, R"({"name": "first"})", {"views[1]", "first", "views[0]"}},
      {0, R"({"name": "view_01"})", {"views[1]", "view_01", "views[0]"}},
      {0, R"({"time": -1})", {"views[0].time", "0 to 1e9"}},
      {0, R"({"time": 1e300})", {"views[0].time", "0 to 1e9"}},
      {0, R"({"time": 0.75})", {"views[1].time", "previous view"}},
      {1, R"({"position": null})", {"views[1]", "\"position\"", "missing"}},
      {1, R"({"position": [0, 0]})", {"views[1].position", "3 elements", "2"}},
      {1, R"({"position": [0, "NaN", 0]})", {"views[1].position[1]", "finite", "number"}},
      {1, R"({"orientation": [1, 0, 0, 0.1]})", {"views[1].orientation", "quaternion"}},
      {1, R"({"width": 0})", {"views[1].width", "1 to 16384", "0"}},
      {1, R"({"width": 1.5})", {"views[1].width", "integer", "1.5"}},
      {1, R"({"height": 16385})", {"views[1].height", "1 to 16384", "16385"}},
      {0, R"({"fov_y": null})", {"views[0]", "fov_y", "model", "params", "missing"}},
      {0, R"({"fov_y": 0})", {"views[0].fov_y", "0 and 180"}},
      {0, R"({"fov_y": 180})", {"views[0].fov_y", "0 and 180"}},
      {0, R"({"fov_y": "wide"})", {"views[0].fov_y", "finite", "number", "string"}},
      {1, R"({"fov_y": 40})", {"views[1]", "both", "fov_y", "model"}},
      {1, R"({"model": "FISHEYE"})", {"views[1].model", "unknown", "FISHEYE"}},
      {1, R"({"params": [0, 0, 0, 0, 0]})", {"views[1].params[0]", "positive"}},
      {0, R"({"focal_plane": null})", {"views[0]", "focal_plane", "focus_distance", "missing"}},
      {0, R"({"focal_plane": [0, 0, 2, 3]})", {"views[0].focal_plane", "unit length"}},
      {0, R"({"focal_plane": [0, 0, 1]})", {"views[0].focal_plane", "4 elements", "3"}},
      {0, R"({"focus_distance": 1})", {"views[0]", "both", "focal_plane", "focus_distance"}},
      {1, R"({"focus_distance": 0})", {"views[1].focus_distance", "positive"}},
  };
  for (const auto& c : cases) {
    json file = good_views();
    file["views"][c.view].merge_patch(json::parse(c.patch));
    EXPECT_ERROR(parse_views(file.dump(), "v.json"), "v.json:");
    EXPECT_ERROR(parse_views(file.dump(), "v.json"), c.facts);
  }
  EXPECT_ERROR(parse_views(good_views().dump().substr(0, 200), "v.json"), "v.json", "views[1]", "JSON", "line 1",
               "column 201");
}

constexpr uint64_t kSecond = 1'000'000'000;

std::vector<NamedView> views_at(const std::vector<double>& times) {
  std::vector<NamedView> views;
  for (double time : times) {
    Viewpoint v;
    v.pose.position.x = static_cast<double>(views.size());
    views.push_back({"v", time, make_view(v, 32, 24)});
  }
  return views;
}

struct Shown {
  double x;
  uint64_t time, duration, target;
  bool operator==(const Shown&) const = default;
};
void PrintTo(const Shown& s, std::ostream* out) {
  *out << "{" << s.x << " at " << s.time << " for " << s.duration << ", target " << s.target << "}";
}

std::vector<Shown> play(const ViewPlayback& playback, uint64_t limit) {
  std::vector<Shown> shown;
  for (uint64_t n = 0; n < limit; n++) {
    const auto item = playback.item(n);
    if (!item) break;
    shown.push_back({item->view->pose.position.x, item->time, item->duration, item->target_time});
  }
  return shown;
}

TEST(ViewPlayback, ListShowsOneViewPerPeriod) {
  const ViewPlayback playback(views_at({2, 2, 2}), Schedule(4, 1), false);
  EXPECT_FALSE(playback.has_times());
  EXPECT_EQ(play(playback, 99), (std::vector<Shown>{{0, 0, 250000000, 2 * kSecond},
                                                    {1, 250000000, 250000000, 2 * kSecond},
                                                    {2, 500000000, 250000000, 2 * kSecond}}));
  EXPECT_EQ(playback.duration(), 750000000u);
}

TEST(ViewPlayback, PathKeepsItsTimes) {
  const ViewPlayback playback(views_at({1, 1.5, 3}), Schedule(4, 1), false);
  EXPECT_TRUE(playback.has_times());
  EXPECT_EQ(play(playback, 99), (std::vector<Shown>{{0, kSecond, kSecond / 2, kSecond},
                                                    {1, 3 * kSecond / 2, 3 * kSecond / 2, 3 * kSecond / 2},
                                                    {2, 3 * kSecond, 3 * kSecond / 2, 3 * kSecond}}));
  EXPECT_EQ(playback.duration(), 7 * kSecond / 2);
}

TEST(ViewPlayback, LoopedTimesIncrease) {
  const ViewPlayback path(views_at({1, 2}), Schedule(4, 1), true);
  EXPECT_EQ(play(path, 5), (std::vector<Shown>{{0, 1 * kSecond, kSecond, 1 * kSecond},
                                               {1, 2 * kSecond, kSecond, 2 * kSecond},
                                               {0, 3 * kSecond, kSecond, 3 * kSecond},
                                               {1, 4 * kSecond, kSecond, 4 * kSecond},
                                               {0, 5 * kSecond, kSecond, 5 * kSecond}}));
  const ViewPlayback list(views_at({0, 0}), Schedule(1, 1), true);
  EXPECT_EQ(play(list, 3),
            (std::vector<Shown>{{0, 0, kSecond, 0}, {1, kSecond, kSecond, 0}, {0, 2 * kSecond, kSecond, 0}}));
}

TEST(ViewPlayback, EqualTimesAtTheEndStillTakeAPeriod) {
  const ViewPlayback playback(views_at({0, 1, 1}), Schedule(2, 1), true);
  EXPECT_EQ(playback.item(3)->time, 3 * kSecond / 2);
}

TEST(ViewPlayback, FindsTheFirstViewFromATime) {
  const ViewPlayback playback(views_at({1, 2, 2, 3}), Schedule(4, 1), false);
  EXPECT_EQ(playback.first_at(0), 0u);
  EXPECT_EQ(playback.first_at(kSecond), 0u);
  EXPECT_EQ(playback.first_at(kSecond + 1), 1u);
  EXPECT_EQ(playback.first_at(3 * kSecond), 3u);
  EXPECT_EQ(playback.first_at(3 * kSecond + 1), 4u);
  EXPECT_FALSE(playback.item(4));
}

constexpr uint64_t kFrame = kSecond / 10;
const Schedule kTenth(10, 1);

TEST(RequestSchedule, OneRequestPerFrame) {
  RequestSchedule schedule(kTenth);
  EXPECT_FALSE(schedule.from_file());
  EXPECT_FALSE(schedule.end());
  for (uint64_t i = 0; i < 3; i++) {
    const RequestSlot slot = schedule.next().value();
    EXPECT_EQ(slot.pts, i * kFrame);
    EXPECT_EQ(slot.duration, kFrame);
    EXPECT_EQ(slot.target_time, slot.pts);
    EXPECT_FALSE(slot.view);
    schedule.advance(slot);
  }
  schedule.seek(kSecond + 1);
  EXPECT_EQ(schedule.next()->pts, kSecond + kFrame);
}

TEST(RequestSchedule, NewRateAppliesFromTheNextFrame) {
  RequestSchedule schedule(kTenth);
  for (int i = 0; i < 3; i++) schedule.advance(*schedule.next());
  EXPECT_TRUE(schedule.set_rate(Schedule(20, 1)));
  EXPECT_EQ(schedule.next()->pts, 3 * kFrame);
  EXPECT_EQ(schedule.next()->duration, kFrame / 2);
  schedule.advance(*schedule.next());
  EXPECT_TRUE(schedule.set_rate(Schedule(5, 1)));
  EXPECT_EQ(schedule.next()->pts, 4 * kFrame) << "next instant at the new rate";
}

TEST(RequestSchedule, ListOfViewsHasOneRate) {
  RequestSchedule schedule(kTenth, views_at({0, 0, 0}), false);
  EXPECT_TRUE(schedule.set_rate(Schedule(20, 1)));
  EXPECT_EQ(schedule.end(), 3 * kFrame / 2);
  schedule.advance(*schedule.next());
  EXPECT_FALSE(schedule.set_rate(kTenth)) << "timestamps follow from view numbers";
  EXPECT_EQ(schedule.next()->pts, kFrame / 2);
  RequestSchedule path(kTenth, views_at({0, 1, 3}), false);
  path.advance(*path.next());
  EXPECT_TRUE(path.set_rate(Schedule(20, 1)));
  EXPECT_EQ(path.next()->pts, kSecond) << "the file's time";
}

TEST(RequestSchedule, FileEnds) {
  RequestSchedule schedule(kTenth, views_at({0, 0.5}), false);
  EXPECT_TRUE(schedule.from_file());
  const auto first = schedule.next();
  ASSERT_TRUE(first && first->view);
  schedule.advance(*first);
  const auto second = schedule.next();
  EXPECT_EQ(second->pts, kSecond / 2);
  EXPECT_EQ(schedule.end(), second->pts + second->duration);
  schedule.advance(*second);
  EXPECT_FALSE(schedule.next());
  EXPECT_FALSE(schedule.next_live(kSecond, 0, 0));
  EXPECT_FALSE(RequestSchedule(kTenth, views_at({0, 0.5}), true).end());
}

// A request created before the pipeline has a base time carries the clock's time.
TEST(RequestSchedule, IgnoresTimestampsOfAnotherBaseTime) {
  constexpr uint64_t kBase = 1000 * kSecond;
  RequestSchedule schedule(kTenth);
  schedule.advance(*schedule.next_live(kBase, 0, 0));
  const RequestSlot slot = schedule.next_live(kBase + kSecond, kBase, 0).value();
  EXPECT_EQ(slot.target_time, kBase + kSecond);
  EXPECT_EQ(slot.pts, kSecond);
}

TEST(RequestSchedule, LiveRequestsTheNewestOldEnoughInstant) {
  constexpr uint64_t kBase = 1000 * kSecond, kDelay = 30'000'000;
  RequestSchedule schedule(kTenth);
  const RequestSlot slot = schedule.next_live(kBase + 5 * kFrame + kDelay + 1, kBase, kDelay).value();
  EXPECT_EQ(slot.target_time, kBase + 5 * kFrame);
  EXPECT_EQ(slot.pts, 5 * kFrame);
  schedule.advance(slot);
  EXPECT_EQ(schedule.next_live(kBase + 5 * kFrame + kDelay + 2, kBase, kDelay)->pts, 6 * kFrame) << "no repetition";
  EXPECT_EQ(schedule.next_live(kBase + 9 * kFrame + kDelay, kBase, kDelay)->pts, 9 * kFrame)
      << "past requests are skipped";
  EXPECT_EQ(RequestSchedule(kTenth).next_live(kBase, kBase, kDelay)->pts, 0u) << "none before the stream begins";
}

TEST(RequestSchedule, EarlyRequestUsesTheAvailableCapture) {
  constexpr uint64_t kBase = 1000 * kSecond, kDelay = 30'000'000;
  const RequestSchedule schedule(kTenth);
  const RequestSlot slot = *schedule.next_live(kBase + 5 * kFrame + kDelay, kBase, kDelay);
  const uint64_t now = kBase + 5 * kFrame + kDelay - 10;
  const RequestSlot early = schedule.early_request(slot, now, kBase, kDelay);
  EXPECT_EQ(early.target_time, kBase + 4 * kFrame);
  EXPECT_EQ(early.pts, 5 * kFrame - 10);
  EXPECT_EQ(early.duration, slot.duration);
}

TEST(RequestSchedule, SlotIsSkippedOnce) {
  RequestSchedule schedule(kTenth);
  const uint64_t turn = schedule.turn();
  schedule.pass(turn);
  schedule.pass(turn);
  EXPECT_EQ(schedule.next()->pts, kFrame);
}

NamedView key(double time, const Vec3& position, const EulerAngles& degrees, double focus, double fov = 40) {
  Viewpoint v;
  v.pose = {position, quat_from_euler(degrees)};
  v.focus_distance = focus;
  v.fov_y_deg = fov;
  return {"key", time, make_view(v, 320, 240)};
}

std::vector<NamedView> keys() {
  return {key(1, {0, 0, 0}, {0, 0, 0}, 2), key(2, {1, 0, 0}, {20, 5, 0}, 4, 50), key(4, {1, 1, 0}, {-30, 0, 10}, 1),
          key(5, {0, 1, -1}, {170, 0, 0}, 3)};
}

TEST(ViewPath, PassesThroughKeysAndStaysAtTheEnds) {
  const ViewPath path(keys());
  EXPECT_EQ(path.begin(), 1);
  EXPECT_EQ(path.end(), 5);
  for (const NamedView& k : keys()) {
    const View view = path.at(k.time);
    EXPECT_EQ(view.pose.position, k.view.pose.position);
    EXPECT_NEAR(std::abs(glm::dot(view.pose.orientation, k.view.pose.orientation)), 1, 1e-15);
    EXPECT_EQ(view.lens, k.view.lens);
  }
  EXPECT_EQ(path.at(-3).pose.position, keys().front().view.pose.position);
  EXPECT_EQ(path.at(99).pose.position, keys().back().view.pose.position);
}

TEST(ViewPath, IsSmooth) {
  const ViewPath path(keys());
  // The velocity, by finite differences, is continuous across keys: its change is bounded by the acceleration.
  const double h = 1e-4;
  const auto velocity = [&](double t) { return (path.at(t + h).pose.position - path.at(t).pose.position) / h; };
  const auto turn = [&](double t) { return (path.at(t + h).pose.orientation - path.at(t).pose.orientation) / h; };
  for (double t = 1 + h; t < 5 - 3 * h; t += 0.01) {
    EXPECT_LT(glm::length(velocity(t + h) - velocity(t)), 20 * h) << t;
    EXPECT_LT(glm::length(turn(t + h) - turn(t)), 20 * h) << t;
  }
  for (double t : {2.0, 4.0}) {
    EXPECT_LT(glm::length(velocity(t) - velocity(t - h)), 20 * h) << t;
    EXPECT_LT(glm::length(turn(t) - turn(t - h)), 20 * h) << t;
  }
}

TEST(ViewPath, EveryViewIsValidAndItsPlaneFacesIt) {
  const ViewPath path(keys());
  for (double t = 0; t < 6; t += 0.037) {
    const View view = path.at(t);
    validate(view);
    EXPECT_NEAR(glm::length(view.pose.orientation), 1, 1e-14);
    EXPECT_NEAR(glm::dot(view.focus.plane.normal, view.pose.forward()), -1, 1e-12) << t;
  }
}

TEST(ViewPath, FocusMovesLogarithmically) {
  const ViewPath path({key(0, {}, {}, 1), key(2, {}, {}, 16)});
  const View view = path.at(1);
  EXPECT_NEAR(view.focus.plane.signed_distance(view.pose.position), 4, 1e-12);
}

TEST(ViewPath, StraightPathStaysStraight) {
  const ViewPath path({key(0, {0, 0, 0}, {}, 2), key(1, {1, 2, 3}, {}, 2), key(2, {2, 4, 6}, {}, 2)});
  for (double t = 0; t <= 2; t += 0.125)
    EXPECT_LT(glm::length(path.at(t).pose.position - t * Vec3(1, 2, 3)), 1e-14) << t;
}

TEST(ViewPath, FixedPlanesStay) {
  const Plane wall{{0, 0, -1}, 5};
  std::vector<NamedView> k = keys();
  for (NamedView& view : k) view.view.focus.plane = wall;
  k[2].view.focus.plane = {-wall.normal, -wall.d};
  const ViewPath path(k);
  for (double t = 1; t < 5; t += 0.1) {
    EXPECT_LT(glm::length(path.at(t).focus.plane.normal - wall.normal), 1e-14);
    EXPECT_NEAR(path.at(t).focus.plane.d, 5, 1e-14);
  }
}

TEST(ViewPath, SignOfAQuaternionDoesNotMatter) {
  std::vector<NamedView> flipped = keys();
  flipped[1].view.pose.orientation = -flipped[1].view.pose.orientation;
  const ViewPath a(keys()), b(flipped);
  for (double t = 1; t < 5; t += 0.1)
    EXPECT_NEAR(std::abs(glm::dot(a.at(t).pose.orientation, b.at(t).pose.orientation)), 1, 1e-15);
}

TEST(ViewPath, SamplesIncludeBothEnds) {
  const std::vector<NamedView> views = ViewPath(keys()).sample(15);
  ASSERT_EQ(views.size(), 61u);
  EXPECT_EQ(views.front().name, "view_000000");
  EXPECT_EQ(views.back().name, "view_000060");
  EXPECT_EQ(views[15].time, 2);
  EXPECT_EQ(views.back().view.pose.position, keys().back().view.pose.position);
  EXPECT_EQ(ViewPath({keys()[0]}).sample(30).size(), 1u);
}

TEST(ViewPath, ErrorsNameTheKey) {
  EXPECT_ERROR(ViewPath({}), "views", "one view");
  std::vector<NamedView> k = keys();
  k[3].view.lens = Lens(LensModel::kPinhole, {100, 100, 0, 0});
  EXPECT_ERROR(ViewPath(k), "views[3].model", "first view");
  k[1].view.width = 321;
  EXPECT_ERROR(ViewPath(k), "views[1].width", "height", "first view");
  k = keys();
  k[2].time = k[1].time;
  EXPECT_ERROR(ViewPath(k), "views[2].time", "previous view");
  EXPECT_THROW(ViewPath(keys()).sample(0), Error);
}

Rig grid(int rows, int columns) { return test::camera_grid(rows, columns, 0.1, 64, 48, 60); }

double focus_depth(const View& view) { return -view.focus.plane.d / view.focus.plane.normal.z; }

TEST(Tour, StartsAndEndsInTheMiddleWithTheNearFocus) {
  const std::vector<NamedView> views = make_tour(grid(5, 5), {2, 6}, {.frames = 60, .rate_hz = 15});
  ASSERT_EQ(views.size(), 60u);
  EXPECT_EQ(views[1].time, 1 / 15.0);
  for (const View* view : {&views.front().view, &views.back().view}) {
    EXPECT_NEAR(glm::length(view->pose.position - Vec3(0.2, 0.2, 0)), 0, 1e-9);
    EXPECT_NEAR(focus_depth(*view), 2, 1e-9);
    EXPECT_EQ(view->width, 64);
    EXPECT_EQ(view->height, 48);
  }
}

TEST(Tour, GoesToTheFarFocusSmoothly) {
  const std::vector<NamedView> views = make_tour(grid(5, 5), {2, 6}, {.frames = 200});
  double farthest = 0, nearest = 1e9, longest_step = 0;
  for (size_t i = 0; i < views.size(); i++) {
    farthest = std::max(farthest, focus_depth(views[i].view));
    nearest = std::min(nearest, focus_depth(views[i].view));
    if (i > 0)
      longest_step = std::max(longest_step, glm::length(views[i].view.pose.position - views[i - 1].view.pose.position));
  }
  EXPECT_NEAR(farthest, 6, 0.6);
  EXPECT_NEAR(nearest, 2, 0.2);
  EXPECT_LT(longest_step, 0.03);
}

void expect_covered(const Rig& rig, const View& view) {
  const ViewPlan plan(rig, build_mesh(rig), view);
  for (const float c : view_coverage(rig, plan, FaceIdMap(plan, {0, 0, 64, 48}))) ASSERT_GT(c, 0.999f);
}

TEST(Tour, ArrayCoversEveryView) {
  // Far focus, so that the array limits the coverage, not the cameras' fields of view.
  for (const auto& [rows, columns] : {std::pair{5, 5}, {3, 9}, {1, 6}, {1, 2}}) {
    const Rig rig = grid(rows, columns);
    for (const NamedView& view : make_tour(rig, {50, 80}, {.frames = 15})) {
      SCOPED_TRACE(testing::Message() << rows << "x" << columns << " at " << view.time);
      expect_covered(rig, view.view);
    }
  }
}

TEST(Tour, ArrayCoversTheViewsOfASet) {
  for (const auto& [rows, columns] : {std::pair{5, 5}, {3, 9}, {1, 6}}) {
    const Rig rig = grid(rows, columns);
    const double width = glm::distance(rig.cameras.front().pose.position, rig.cameras[columns - 1].pose.position);
    for (const double share : {0.2, 0.5}) {
      ViewSet set;
      set.layout = ViewSetLayout::kStereo;
      set.eye_distance = share * width;
      set.converged = false;
      double farthest = 0;
      for (const NamedView& view : make_tour(rig, {50, 80}, {.frames = 15, .room = set.eye_distance})) {
        farthest = std::max(farthest, std::abs(view.view.pose.position.x - rig.cameras[columns / 2].pose.position.x));
        SCOPED_TRACE(testing::Message() << rows << "x" << columns << " at " << view.time);
        for (const int eye : {0, 1}) expect_covered(rig, set.view(view.view, set.place(eye)));
      }
      EXPECT_GT(farthest, 0.1 * width) << "the path still moves";
    }
  }
}

TEST(Tour, SingleCameraOnlyRefocuses) {
  for (const NamedView& view : make_tour(grid(1, 1), {2, 6}, {.frames = 9}))
    EXPECT_EQ(view.view.pose.position, Vec3(0, 0, 0));
}

TEST(Tour, StillAndOneFrame) {
  for (const NamedView& view : make_tour(grid(2, 2), {1, 2}, {.frames = 5, .still = true})) EXPECT_EQ(view.time, 0);
  const std::vector<NamedView> one = make_tour(grid(2, 2), {1, 2}, {.width = 7, .height = 5, .frames = 1});
  ASSERT_EQ(one.size(), 1u);
  EXPECT_EQ(one[0].view.width, 7);
  EXPECT_EQ(one[0].view.height, 5);
}

TEST(Tour, RefusesImpossibleOptions) {
  EXPECT_ERROR(make_tour(grid(2, 2), {0, 2}, {}), "focus", "near <= far");
  EXPECT_ERROR(make_tour(grid(2, 2), {3, 2}, {}), "focus", "near <= far");
  EXPECT_ERROR(make_tour(grid(2, 2), {1, 2}, {.frames = 0}), "frames", "1");
  EXPECT_ERROR(make_tour(grid(2, 2), {1, 2}, {.rate_hz = 0}), "rate", "positive");
  EXPECT_ERROR(make_tour(grid(2, 2), {1, 2}, {.room = -1}), "room", "negative");
}

TEST(FocusSweep, IsUniformInInverseDistance) {
  const View view = key(0, {1, 2, 3}, {20, 5, 0}, 7).view;
  const std::vector<NamedView> views = make_focus_sweep(view, {1.5, 6}, 4);
  ASSERT_EQ(views.size(), 4u);
  for (int i = 0; i < 4; i++) {
    const double distance = 1 / ((3 - i) / 3.0 / 1.5 + i / 3.0 / 6);
    const Vec3 on_axis = view.pose.position + distance * view.pose.forward();
    EXPECT_NEAR(views[i].view.focus.plane.signed_distance(on_axis), 0, 1e-12) << i;
    EXPECT_NEAR(std::abs(glm::dot(views[i].view.focus.plane.normal, view.pose.forward())), 1, 1e-12);
    EXPECT_EQ(views[i].view.pose, view.pose);
  }
  EXPECT_EQ(views[3].name, "view_000003");
  EXPECT_EQ(make_focus_sweep(view, {2, 2}, 1).size(), 1u);
  EXPECT_ERROR(make_focus_sweep(view, {2, 1}, 3), "0 < near <= far");
  EXPECT_ERROR(make_focus_sweep(view, {0, 1}, 3), "0 < near <= far");
  EXPECT_ERROR(make_focus_sweep(view, {1, 2}, 0), "planes", "1");
}

}  // namespace
}  // namespace lf
