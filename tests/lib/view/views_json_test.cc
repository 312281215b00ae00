// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/views_json.h"

#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "support/expect_error.h"
#include "view/navigator.h"

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
  EXPECT_NEAR(views[1].view.focus.plane.signed_distance({7, 8, 1}), 0, 1e-14) << "it looks along -z";
  for (const NamedView& view : views) EXPECT_NO_THROW(validate(view.view));
}

TEST(ViewsJson, RoundTripsToTheLastBit) {
  std::vector<NamedView> views = parse_views(good_views().dump(), "v.json");
  views[0].view.pose.position = {1 / 3.0, -1e-300, 1e6 / 7};
  views[0].view.pose.orientation = glm::normalize(Quat(0.1, 0.2, 0.3, 0.4));
  views[1].time = 1 / 3.0;
  const std::string path = testing::TempDir() + "lf_views_json_test.json";
  save_views(views, path);
  const std::vector<NamedView> back = load_views(path);
  std::filesystem::remove(path);
  ASSERT_EQ(back.size(), views.size());
  for (size_t i = 0; i < views.size(); i++) {
    EXPECT_EQ(back[i].name, views[i].name);
    EXPECT_EQ(back[i].time, views[i].time);
    EXPECT_EQ(back[i].view, views[i].view);
  }
}

TEST(ViewsJson, ErrorsNameThePlace) {
  struct {
    const char* patch;  // merged into the good file; null takes a key away
    const char* message;
  } const files[] = {
      {R"({"format": null})", "v.json: key \"format\" is missing"},
      {R"({"format": "lightfield-rig"})", "v.json: format: must be \"lightfield-views\", is \"lightfield-rig\""},
      {R"({"version": 2})", "v.json: version: must be 1 to 1, is 2"},
      {R"({"views": null})", "v.json: key \"views\" is missing"},
      {R"({"views": []})", "v.json: views: no views"},
      {R"({"views": {}})", "v.json: views: must be an array"},
      {R"({"views": [3]})", "v.json: views[0]: must be an object"},
  };
  for (const auto& c : files) {
    json file = good_views();
    file.merge_patch(json::parse(c.patch));
    EXPECT_ERROR(parse_views(file.dump(), "v.json"), c.message);
  }
  struct {
    int view;
    const char* patch;
    const char* message;
  } const cases[] = {
      {0, R"({"name": 3})", "views[0].name: must be a string"},
      {0, R"({"name": ""})", "views[0].name: must be usable as a file name"},
      {0, R"({"name": "../x"})", "views[0].name: must be usable as a file name"},
      {0, R"({"name": "x\u0000"})", "views[0].name: has a character NUL"},
      {0, R"({"name": "x\n"})", "views[0].name: has control characters"},
      {1, R"({"name": "first"})", "views[1]: name \"first\" is also that of views[0]"},
      {0, R"({"name": "view_01"})", "views[1]: name \"view_01\" is also that of views[0]"},
      {0, R"({"time": -1})", "views[0].time: must be 0 to 1e9 seconds"},
      {0, R"({"time": 1e300})", "views[0].time: must be 0 to 1e9 seconds"},
      {0, R"({"time": 0.75})", "views[1].time: is before that of the view in front of it"},
      {1, R"({"position": null})", "views[1]: key \"position\" is missing"},
      {1, R"({"position": [0, 0]})", "views[1].position: must have 3 elements, has 2"},
      {1, R"({"position": [0, "NaN", 0]})", "views[1].position[1]: must be a finite number"},
      {1, R"({"orientation": [1, 0, 0, 0.1]})", "views[1].orientation: must be a quaternion"},
      {1, R"({"width": 0})", "views[1].width: must be 1 to 16384, is 0"},
      {1, R"({"width": 1.5})", "views[1].width: must be an integer, is 1.5"},
      {1, R"({"height": 16385})", "views[1].height: must be 1 to 16384, is 16385"},
      {0, R"({"fov_y": null})", "views[0]: key \"fov_y\" (or \"model\" and \"params\") is missing"},
      {0, R"({"fov_y": 0})", "views[0].fov_y: must be between 0 and 180 degrees"},
      {0, R"({"fov_y": 180})", "views[0].fov_y: must be between 0 and 180 degrees"},
      {0, R"({"fov_y": "wide"})", "views[0].fov_y: must be a finite number, is string"},
      {1, R"({"fov_y": 40})", "views[1]: has both \"fov_y\" and \"model\""},
      {1, R"({"model": "FISHEYE"})", "views[1].model: unknown lens model \"FISHEYE\""},
      {1, R"({"params": [0, 0, 0, 0, 0]})", "views[1].params[0]: the focal length must be positive"},
      {0, R"({"focal_plane": null})", "views[0]: key \"focal_plane\" (or \"focus_distance\") is missing"},
      {0, R"({"focal_plane": [0, 0, 2, 3]})", "views[0].focal_plane: (a, b, c) must have unit length"},
      {0, R"({"focal_plane": [0, 0, 1]})", "views[0].focal_plane: must have 4 elements, has 3"},
      {0, R"({"focus_distance": 1})", "views[0]: has both \"focal_plane\" and \"focus_distance\""},
      {1, R"({"focus_distance": 0})", "views[1].focus_distance: must be positive"},
  };
  for (const auto& c : cases) {
    json file = good_views();
    file["views"][c.view].merge_patch(json::parse(c.patch));
    EXPECT_ERROR(parse_views(file.dump(), "v.json"), std::string("v.json: ") + c.message);
  }
  EXPECT_ERROR(parse_views(good_views().dump().substr(0, 200), "v.json"),
               "v.json: views[1]: not valid JSON: parse error at line 1, column 201");
}

constexpr uint64_t kSecondNs = 1'000'000'000;

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

TEST(ViewPlayback, AListIsShownOneViewPerPeriod) {
  const ViewPlayback playback(views_at({2, 2, 2}), Schedule(4, 1), false);
  EXPECT_FALSE(playback.has_times());
  EXPECT_EQ(play(playback, 99), (std::vector<Shown>{{0, 0, 250000000, 2 * kSecondNs},
                                                    {1, 250000000, 250000000, 2 * kSecondNs},
                                                    {2, 500000000, 250000000, 2 * kSecondNs}}));
  EXPECT_EQ(playback.duration(), 750000000u);
}

TEST(ViewPlayback, APathIsShownAtItsTimes) {
  const ViewPlayback playback(views_at({1, 1.5, 3}), Schedule(4, 1), false);
  EXPECT_TRUE(playback.has_times());
  EXPECT_EQ(play(playback, 99), (std::vector<Shown>{{0, kSecondNs, kSecondNs / 2, kSecondNs},
                                                    {1, 3 * kSecondNs / 2, 3 * kSecondNs / 2, 3 * kSecondNs / 2},
                                                    {2, 3 * kSecondNs, 3 * kSecondNs / 2, 3 * kSecondNs}}));
  EXPECT_EQ(playback.duration(), 7 * kSecondNs / 2);
}

TEST(ViewPlayback, LoopedTimesGoOnGrowing) {
  const ViewPlayback path(views_at({1, 2}), Schedule(4, 1), true);
  EXPECT_EQ(play(path, 5), (std::vector<Shown>{{0, 1 * kSecondNs, kSecondNs, 1 * kSecondNs},
                                               {1, 2 * kSecondNs, kSecondNs, 2 * kSecondNs},
                                               {0, 3 * kSecondNs, kSecondNs, 3 * kSecondNs},
                                               {1, 4 * kSecondNs, kSecondNs, 4 * kSecondNs},
                                               {0, 5 * kSecondNs, kSecondNs, 5 * kSecondNs}}));
  const ViewPlayback list(views_at({0, 0}), Schedule(1, 1), true);
  EXPECT_EQ(play(list, 3),
            (std::vector<Shown>{{0, 0, kSecondNs, 0}, {1, kSecondNs, kSecondNs, 0}, {0, 2 * kSecondNs, kSecondNs, 0}}));
}

TEST(ViewPlayback, EqualTimesAtTheEndStillTakeAPeriod) {
  const ViewPlayback playback(views_at({0, 1, 1}), Schedule(2, 1), true);
  EXPECT_EQ(playback.item(3)->time, 3 * kSecondNs / 2);
}

TEST(ViewPlayback, FindsTheFirstViewFromATimeOn) {
  const ViewPlayback playback(views_at({1, 2, 2, 3}), Schedule(4, 1), false);
  EXPECT_EQ(playback.first_at(0), 0u);
  EXPECT_EQ(playback.first_at(kSecondNs), 0u);
  EXPECT_EQ(playback.first_at(kSecondNs + 1), 1u);
  EXPECT_EQ(playback.first_at(3 * kSecondNs), 3u);
  EXPECT_EQ(playback.first_at(3 * kSecondNs + 1), 4u);
  EXPECT_FALSE(playback.item(4));
}

}  // namespace

}  // namespace lf
