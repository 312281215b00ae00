// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/controller/gstdirectcontrolbinding.h>
#include <gst/controller/gstinterpolationcontrolsource.h>
#include <gst/video/navigation.h>

#include "common/common.h"
#include "gst/view_request_source.h"
#include "node/camera_access.h"
#include "render/contribution_map.h"
#include "wire/command_codec.h"

namespace lf::test {
namespace {

TEST(LfViewRequestFile, ListHasOneTimestampPerFrame) {
  const std::vector<NamedView> views = test_views({2, 2, 2});
  FileSource source(views);
  source.set("framerate", 10, 1, "view-id", 7u);
  source.play();
  for (uint32_t i = 0; i < 3; i++) {
    const Unit unit = source.pull();
    EXPECT_EQ(unit.pts, i * 100 * kMs);
    EXPECT_EQ(unit.duration, 100 * kMs);
    ViewRequest expected;
    expected.view_id = 7;
    expected.sequence = i;
    expected.target_time = 2 * GST_SECOND;
    expected.quality = 90;
    expected.view = views[i].view;
    EXPECT_EQ(unit.request, expected) << i;
    EXPECT_EQ(unit.bytes, wire::encode_request(expected)) << i;
  }
  EXPECT_TRUE(source.wait_eos());
  EXPECT_EQ(gst_harness_buffers_in_queue(source.harness()), 0u);
}

TEST(LfViewRequestFile, PathKeepsItsTimes) {
  FileSource source(test_views({0.5, 1, 3}));
  source.play();
  for (const auto& [time, duration] : {std::pair(500, 500), std::pair(1000, 2000), std::pair(3000, 2000)}) {
    const Unit unit = source.pull();
    EXPECT_EQ(unit.pts, time * kMs);
    EXPECT_EQ(unit.duration, duration * kMs) << time;
    EXPECT_EQ(unit.request.target_time, time * kMs);
    EXPECT_FALSE(unit.request.absolute_time);
  }
  EXPECT_TRUE(source.wait_eos());
}

TEST(LfViewRequestFile, ViewsOfASetHaveTheSameCaptureTime) {
  const std::vector<NamedView> views = test_views({0.5, 1});
  std::vector<NamedView> even = views;
  for (NamedView& named : even) named.view.width = 32;
  FileSource source(even);
  gst_util_set_object_arg(G_OBJECT(source.element()), "views", "quilt");
  source.set("columns", 3, "rows", 2, "eye-distance", 0.01, "num-buffers", 2);
  source.play();
  const ViewSet set{.layout = ViewSetLayout::kQuilt, .columns = 3, .rows = 2, .eye_distance = 0.01};
  uint32_t sequence = 0;
  for (const NamedView& named : even)
    for (const ViewSetPosition& place : set.places()) {
      const Unit unit = source.pull();
      EXPECT_EQ(unit.request.place, place);
      EXPECT_EQ(unit.request.view, set.view(named.view, place)) << place.index;
      EXPECT_EQ(unit.request.sequence, sequence++);
      EXPECT_EQ(unit.request.target_time, static_cast<uint64_t>(named.time * 1e9));
      EXPECT_EQ(unit.pts, unit.request.target_time);
    }
  EXPECT_TRUE(source.wait_eos());
  EXPECT_EQ(gst_harness_buffers_in_queue(source.harness()), 0u) << "num-buffers counts pictures";
}

TEST(LfViewRequestFile, LoopsWithIncreasingTimes) {
  FileSource source(test_views({0, 1}));
  source.set("loop", TRUE, "num-buffers", 5);
  source.play();
  for (uint32_t i = 0; i < 5; i++) {
    const Unit unit = source.pull();
    EXPECT_EQ(unit.pts, i * GST_SECOND);
    EXPECT_EQ(unit.request.target_time, i * GST_SECOND);
    EXPECT_EQ(unit.request.sequence, i);
    EXPECT_EQ(unit.request.view.width, 32 + static_cast<int>(i % 2));
  }
  EXPECT_TRUE(source.wait_eos());
}

TEST(LfViewRequestFile, SeeksAndKnowsItsDuration) {
  FileSource source(test_views({0, 1, 2, 3}));
  source.play();
  for (int i = 0; i < 4; i++) source.pull();
  EXPECT_TRUE(source.wait_eos());
  gint64 duration = 0;
  EXPECT_TRUE(gst_element_query_duration(source.element(), GST_FORMAT_TIME, &duration));
  EXPECT_EQ(duration, static_cast<gint64>(4 * GST_SECOND));
  EXPECT_TRUE(source.send(gst_event_new_seek(1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET, 1500 * kMs,
                                             GST_SEEK_TYPE_NONE, 0)));
  const Unit unit = source.pull();
  EXPECT_EQ(unit.pts, 2 * GST_SECOND);
  EXPECT_EQ(unit.request.sequence, 4u);
  EXPECT_EQ(source.pull().pts, 3 * GST_SECOND);
  EXPECT_TRUE(source.wait_eos());
  EXPECT_FALSE(source.send(gst_event_new_seek(-1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET, 0,
                                              GST_SEEK_TYPE_SET, 2 * GST_SECOND)));
}

TEST(LfViewRequestFile, LiveListFollowsTheSchedule) {
  FileSource source(test_views({5, 5}));
  source.set("framerate", 10, 1);
  source.play_live(GST_SECOND);
  for (int i = 0; i < 2; i++) {
    const Unit unit = source.next_live();
    EXPECT_EQ(unit.request.target_time, GST_SECOND + i * 100 * kMs);
    EXPECT_TRUE(unit.request.absolute_time);
    EXPECT_EQ(unit.request.view.width, 32 + i);
  }
  EXPECT_TRUE(source.wait_eos());
}

TEST(ExceptionGuard, ExceptionsBecomePostedErrors) {
  Source source;
  const auto call = [&source](bool fails) {
    return guarded(source.element(), GST_FLOW_ERROR, [fails] {
      if (fails) throw std::runtime_error("what is wrong");
      return GST_FLOW_EOS;
    });
  };
  EXPECT_EQ(call(false), GST_FLOW_EOS);
  EXPECT_EQ(source.pop_message(GST_MESSAGE_ERROR), "");
  EXPECT_EQ(call(true), GST_FLOW_ERROR);
  EXPECT_EQ(source.pop_message(GST_MESSAGE_ERROR), "what is wrong");
}

TEST(LfViewRequest, CaptureDelayIsAutomaticOrAtMostAMinute) {
  GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(Source().element()), "capture-delay");
  ASSERT_TRUE(G_IS_PARAM_SPEC_INT64(spec));
  EXPECT_EQ(G_PARAM_SPEC_INT64(spec)->minimum, -1);
  EXPECT_EQ(G_PARAM_SPEC_INT64(spec)->maximum, gint64{60} * GST_SECOND);
  EXPECT_EQ(G_PARAM_SPEC_INT64(spec)->default_value, -1);
}

TEST(LfViewRequestFile, LivePathKeepsItsTimes) {
  FileSource source(test_views({0.25, 0.5}));
  source.set("framerate", 10, 1, "capture-delay", 20 * kMs);
  source.play_live();
  const Unit first = source.next_live();
  EXPECT_EQ(first.pts, 250 * kMs);
  EXPECT_EQ(source.clock_time(), 270 * kMs);
  EXPECT_EQ(first.request.target_time, 200 * kMs);  // the newest multiple of 100 ms at that time
  EXPECT_EQ(source.next_live().request.target_time, 500 * kMs);
}

TEST(LfViewRequestFile, ErrorsNameFileAndPlace) {
  const TempDir files;
  const std::string head = R"({"format": "lightfield-views", "version": 1, "views": [)";
  const std::string view = head + R"({"position": [0,0,0], "orientation": [1,0,0,0], "width": 8, "height": 8, )";
  struct Row {
    const char *property, *name;
    std::string text;
    std::vector<std::string> expected;
  };
  const Row rows[] = {
      {"location", "not-json", "view", {}},
      {"location", "truncated", view, {}},
      {"location", "empty", head + "]}", {"views"}},
      {"location", "fov", view + R"("fov_y": "wide", "focus_distance": 1}]})", {"views[0].fov_y"}},
      {"location", "no-focus", view + R"("fov_y": 40}]})", {"views[0]"}},
      {"location", "format", R"({"format": "lightfield-rig", "version": 1, "views": []})", {"format"}},
      {"rig", "rig-truncated", R"({"format": "lightfield-rig", )", {}},
      {"rig", "rig-empty", R"({"format": "lightfield-rig", "version": 1, "cameras": []})", {"cameras"}},
      {"rig", "rig-views", head + "]}", {"format"}},
  };
  const auto error_of = [](Source& source) {
    EXPECT_EQ(gst_element_set_state(source.element(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
    return source.pop_message(GST_MESSAGE_ERROR);
  };
  for (const Row& row : rows) {
    Source source;
    const std::string path = files.write(row.name, row.text);
    source.set(row.property, path.c_str());
    const std::string error = error_of(source);
    EXPECT_THAT(error, HasSubstr(path)) << row.name;
    EXPECT_EQ(contains(error, "location: "), row.property == std::string("location")) << error;
    EXPECT_EQ(source.pop_message(GST_MESSAGE_ERROR), "") << "no other error hides the reason";
    for (const std::string& part : row.expected) EXPECT_THAT(error, HasSubstr(part)) << row.name;
  }
  for (const char* property : {"location", "rig"}) {
    Source source;
    source.set(property, (files / "none.json").c_str());
    const std::string error = error_of(source);
    EXPECT_THAT(error, HasSubstr("none.json")) << property;
    EXPECT_EQ(contains(error, "lf-path can make"), property == std::string("location")) << error;
    gst_element_set_state(source.element(), GST_STATE_NULL);
    source.set(property, nullptr, "num-buffers", 1);
    source.play();
    source.pull();
  }
}

TEST(LfViewRequestProperties, AreDocumentedAndViewIsControllable) {
  Source source;
  guint n = 0;
  GParamSpec** pspecs = g_object_class_list_properties(G_OBJECT_GET_CLASS(source.element()), &n);
  int own = 0, controllable = 0;
  for (guint i = 0; i < n; i++) {
    if (pspecs[i]->owner_type != G_OBJECT_TYPE(source.element())) continue;
    own++;
    controllable += (pspecs[i]->flags & GST_PARAM_CONTROLLABLE) != 0;
    EXPECT_GT(strlen(g_param_spec_get_blurb(pspecs[i])), 10u) << pspecs[i]->name;
    EXPECT_TRUE(pspecs[i]->flags & (GST_PARAM_MUTABLE_READY | GST_PARAM_MUTABLE_PLAYING)) << pspecs[i]->name;
    GValue value = G_VALUE_INIT;
    g_value_init(&value, pspecs[i]->value_type);
    g_object_get_property(G_OBJECT(source.element()), pspecs[i]->name, &value);
    EXPECT_TRUE(g_param_value_defaults(pspecs[i], &value)) << pspecs[i]->name;
    g_value_unset(&value);
  }
  g_free(pspecs);
  EXPECT_EQ(own, 34);
  EXPECT_EQ(controllable, 10);
}

TEST(LfViewRequestProperties, ApertureAndNearestCamerasApplyToTheNextRequest) {
  TestSource source;
  source.set("num-buffers", 5);
  source.set("nearest-cameras", 3);
  source.play();
  EXPECT_EQ(source.pull().request.view.blending, (Blending{Blending::Kind::kAngle, 0, 3}));
}

TEST(LfViewRequestProperties, ApertureIsPartOfTheView) {
  TestSource source;
  const StructurePtr view(gst_structure_new("view", "aperture", G_TYPE_DOUBLE, 0.25, nullptr));
  EXPECT_TRUE(emit(source.element(), "set-view", view.get()));
  EXPECT_EQ(source.get("aperture"), 0.25);
  source.set("num-buffers", 1, "nearest-cameras", 3);
  source.play();
  EXPECT_EQ(source.pull().request.view.blending, (Blending{Blending::Kind::kAperture, 0.25, 0}));
}

// The margin widens the requested picture, not the view that navigation moves.
TEST(LfViewRequestProperties, MarginWidensTheRequest) {
  TestSource source;
  source.play_live();
  const View plain = source.next_live().request.view;
  const StructurePtr view(gst_structure_new("view", "margin", G_TYPE_DOUBLE, 0.25, nullptr));
  EXPECT_TRUE(emit(source.element(), "set-view", view.get()));
  View wide = source.next_live().request.view;
  EXPECT_NEAR(wide.lens.fx(), plain.lens.fx() / 1.25, 1e-9);
  EXPECT_NEAR(wide.lens.fy(), plain.lens.fy() / 1.25, 1e-9);
  wide.lens = plain.lens;
  expect_near(wide, plain);
  const double fov = source.get("fov");
  EXPECT_TRUE(source.send(gst_navigation_event_new_key_press("d", GST_NAVIGATION_MODIFIER_NONE)));
  EXPECT_EQ(source.get("margin"), 0.25) << "navigation keeps the margin";
  EXPECT_EQ(source.get("fov"), fov);
  source.set("fov", 169.0, "margin", 1.0);
  EXPECT_NEAR(source.next_live().request.view.lens.fy(), 100 / std::tan(85 * M_PI / 180), 1e-9) << "at most 170 degrees";
}

// Around the widest view that cameras see completely, a margin would be black.
TEST(LfViewRequestProperties, MarginStopsWhereCamerasSeeNothing) {
  const TempDir files;
  save_rig(test_rig(), files / "rig.json");
  Source source;
  source.set("rig", (files / "rig.json").c_str(), "num-buffers", 1);
  source.play();
  source.pull();
  const double home = source.get("fov");
  for (const double fov : {home, home / 20}) {
    const StructurePtr view(
        gst_structure_new("view", "fov", G_TYPE_DOUBLE, fov, "margin", G_TYPE_DOUBLE, 0.5, nullptr));
    EXPECT_TRUE(emit(source.element(), "set-view", view.get()));
    EXPECT_EQ(source.get("margin") < 0.5, fov == home) << source.get("margin");
  }
}

TEST(LfViewRequestFile, PropertiesSelectTheBlending) {
  FileSource source(test_views({0, 1}));
  source.set("aperture", 0.5);
  source.play();
  EXPECT_EQ(source.pull().request.view.blending, (Blending{Blending::Kind::kAperture, 0.5, 0}));
}

TEST(LfViewRequestProperties, DefineTheView) {
  TestSource source;
  source.set("view-id", 3u, "quality", 80u, "framerate", 30000, 1001, "num-buffers", 3);
  source.play();
  for (uint32_t i = 0; i < 3; i++) {
    const Unit unit = source.pull();
    expect_near(unit.request.view, make_view(test_viewpoint(), 320, 200));
    EXPECT_EQ(unit.request.view_id, 3u);
    EXPECT_EQ(unit.request.quality, 80);
    EXPECT_EQ(unit.request.sequence, i);
    EXPECT_EQ(unit.request.rig_hash, 0u);
    EXPECT_EQ(unit.pts, i * 1001 * GST_SECOND / 30000);
    EXPECT_EQ(unit.request.target_time, unit.pts);
    EXPECT_FALSE(unit.request.absolute_time);
  }
  EXPECT_TRUE(source.wait_eos());
  EXPECT_EQ(caps_of(source.harness()->sinkpad),
            "application/x-lightfield-request, parsed=(boolean)true, framerate=(fraction)30000/1001");
}

TEST(LfViewRequestProperties, AnglesKeepTheirValuesStraightUp) {
  Source source;
  source.set("pitch", 90.0, "yaw", 20.0, "roll", 30.0, "num-buffers", 1);
  source.play();
  Viewpoint expected;
  expected.pose.orientation = quat_from_euler({20, 90, 30});
  expect_near(source.pull().request.view, make_view(expected, 640, 480));
  EXPECT_EQ(source.get("pitch"), 90);
  EXPECT_EQ(source.get("yaw"), 20);
  EXPECT_EQ(source.get("roll"), 30);
}

TEST(LfViewRequestProperties, DefaultsComeFromTheRig) {
  const TempDir files;
  save_rig(test_rig(), files / "rig.json");
  const Rig rig = load_rig(files / "rig.json");
  Source source;
  source.set("rig", (files / "rig.json").c_str(), "x", 1.25, "focus-distance", 9.0, "num-buffers", 1);
  source.play();
  const ViewRequest request = source.pull().request;
  Viewpoint expected = VisibleFraction(rig).home(64.0 / 48);
  const double y = expected.pose.position.y;
  expected.pose.position.x = 1.25;
  expected.focus_distance = 9;
  expect_near(request.view, make_view(expected, 64, 48));
  EXPECT_EQ(request.rig_hash, rig.hash());
  EXPECT_NEAR(source.get("yaw"), 30, 1e-9);
  EXPECT_NEAR(source.get("y"), y, 1e-12);
}

TEST(LfViewRequestProperties, ControllersApplyToEachRequest) {
  Source source;
  GstControlSource* ramp = gst_interpolation_control_source_new();
  g_object_set(ramp, "mode", GST_INTERPOLATION_MODE_LINEAR, nullptr);
  gst_timed_value_control_source_set(GST_TIMED_VALUE_CONTROL_SOURCE(ramp), 0, 10);
  gst_timed_value_control_source_set(GST_TIMED_VALUE_CONTROL_SOURCE(ramp), GST_SECOND, 20);
  for (const char* name : {"x", "fov", "focus-distance"})
    gst_object_add_control_binding(GST_OBJECT(source.element()),
                                   gst_direct_control_binding_new_absolute(GST_OBJECT(source.element()), name, ramp));
  gst_object_unref(ramp);
  source.set("framerate", 10, 1, "num-buffers", 11, "width", 100, "height", 100);
  source.play();
  for (int i = 0; i <= 10; i++) {
    Viewpoint expected;
    expected.pose.position.x = expected.fov_y_deg = expected.focus_distance = 10 + i;
    expect_near(source.pull().request.view, make_view(expected, 100, 100), std::to_string(i));
  }
}

TEST(LfViewRequestProperties, OutOfServiceChangesWhilePlaying) {
  RigSource source;
  source.set("out-of-service", "15,10-11");
  source.play_live();
  EXPECT_EQ(source.next_live().request.out_of_service, (CameraSet{0, 1, 5}));
  source.set("out-of-service", "13");
  EXPECT_EQ(source.next_live().request.out_of_service, (CameraSet{3}));
  source.set("out-of-service", "13,99");
  EXPECT_THAT(source.pop_message(GST_MESSAGE_WARNING), HasSubstr("99"));
  EXPECT_EQ(source.next_live().request.out_of_service, (CameraSet{3}));
  source.set("out-of-service", nullptr);
  EXPECT_EQ(source.next_live().request.out_of_service, CameraSet{});
}

TEST(LfViewRequestProperties, IgnoredSettingsAreReported) {
  const TempDir files;
  save_views(test_views({0, 1}), files / "views.json");
  const std::string views = "location=" + files / "views.json";
  struct Case {
    std::string properties, words;
  };
  for (const Case& c :
       {Case{"", ""}, Case{views + " loop=true", ""}, Case{"is-live=true eager=true capture-delay=1000", ""},
        Case{"eager=true", "live requests"}, Case{views + " is-live=true eager=true", "of a file"},
        Case{"capture-delay=1000", "capture-delay: "}, Case{views + " width=64", "width and height: "},
        Case{"loop=true", "loop: "}, Case{"view-cone=7", "view-cone: "}, Case{"columns=3", "columns and rows"},
        Case{"views=row columns=3 eye-distance=0.01", ""}, Case{"views=quilt columns=3 rows=2 view-cone=7", ""},
        Case{"views=row rows=2", "columns and rows"}}) {
    const PipelinePtr pipeline = launch("lfviewrequest name=v " + c.properties + " ! fakesink async=false");
    ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE) << c.properties;
    const std::string told = warnings_of(pipeline.get());
    EXPECT_THAT(told, HasSubstr(c.words)) << c.properties;
    EXPECT_EQ(told.empty(), c.words.empty()) << c.properties << ": " << told;
    g_object_set(child_of(pipeline.get(), "v").get(), "quality", 80, nullptr);
    EXPECT_EQ(warnings_of(pipeline.get()), "") << "warns once";
  }
}

TEST(LfViewRequestProperties, OutOfServiceNeedsCamerasOfTheRig) {
  const TempDir files;
  save_rig(test_rig(), files / "rig.json");
  Source source;
  source.set("out-of-service", "1");
  EXPECT_EQ(gst_element_set_state(source.element(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(source.pop_message(GST_MESSAGE_ERROR), HasSubstr("out-of-service: requires"));
  gst_element_set_state(source.element(), GST_STATE_NULL);
  source.set("rig", (files / "rig.json").c_str());
  EXPECT_EQ(gst_element_set_state(source.element(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(source.pop_message(GST_MESSAGE_ERROR), HasSubstr("camera list \"1\""));
}

std::pair<ViewRequest, wire::AnyRequest> request_and_command(const char* access, const CameraSet& out = {}) {
  RigSource source;
  source.set("view-id", 7u, "num-buffers", 1);
  gst_util_set_object_arg(G_OBJECT(source.element()), "access", access);
  if (!out.empty()) source.set("out-of-service", "12");
  source.play();
  const Unit unit = source.pull();
  const BufferPtr command(gst_harness_pull(source.harness()));
  EXPECT_TRUE(command);
  if (!command) return {};
  EXPECT_EQ(GST_BUFFER_PTS(command.get()), unit.pts);
  std::string reason;
  const auto any = wire::decode_any_request(to_bytes(command.get()), &reason);
  EXPECT_TRUE(any) << reason;
  EXPECT_TRUE(source.wait_eos());
  return {unit.request, any.value_or(wire::AnyRequest{})};
}

TEST(LfViewRequest, CommandsFollowTheirRequest) {
  const Rig rig = test_rig();
  for (const CameraSet& out : {CameraSet{}, CameraSet{2}}) {
    const Mesh mesh = build_mesh(rig, out);
    const auto [asked, warp] = request_and_command("warp", out);
    EXPECT_EQ(asked.out_of_service, out);
    EXPECT_EQ(warp, CameraAccess::of(Access::kWarp)->command(rig, mesh, asked));
    const auto [again, pixels] = request_and_command("pixels", out);
    EXPECT_EQ(pixels, CameraAccess::of(Access::kPixels)->command(rig, mesh, again));
  }
}

TEST(LfViewRequest, CommandsNeedARig) {
  Source source;
  gst_util_set_object_arg(G_OBJECT(source.element()), "access", "warp");
  EXPECT_EQ(gst_element_set_state(source.element(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(source.pop_message(GST_MESSAGE_ERROR), mentions("access", "rig"));
}

GstEvent* tagged(GstEvent* event, guint view_id) {
  event = gst_event_make_writable(event);
  gst_structure_set(gst_event_writable_structure(event), "lightfield-view-id", G_TYPE_UINT, view_id, nullptr);
  return event;
}

GstEvent* view_event(const char* fields) {
  GstStructure* structure =
      gst_structure_from_string((std::string("lightfield-view-request") + fields).c_str(), nullptr);
  return gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM, structure);
}

constexpr auto kPlain = GST_NAVIGATION_MODIFIER_NONE;
constexpr auto kShift = GST_NAVIGATION_MODIFIER_SHIFT_MASK;
constexpr auto kControl = GST_NAVIGATION_MODIFIER_CONTROL_MASK;

TEST(LfViewRequestNavigation, EachEventMovesTheNextRequest) {
  TestSource source;
  source.play_live();
  Navigator expected(test_viewpoint());
  expect_near(source.next_live().request.view, make_view(expected.viewpoint(), 320, 200));
  const auto check = [&](const std::string& what) {
    expect_near(source.next_live().request.view, make_view(expected.viewpoint(), 320, 200), what);
  };

  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_press(1, 100, 50, kPlain)));
  check("a press alone");
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_move(120, 40, kPlain)));
  expected.orbit(20 / 200.0, -10 / 200.0);
  check("drag");
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_move(130, 40, kShift)));
  expected.pan(10 / 200.0, 0);
  check("shift-drag");
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_release(1, 130, 40, kPlain)));
  EXPECT_FALSE(source.send(gst_navigation_event_new_mouse_move(10, 10, kPlain)));
  check("a move without a button");
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_press(3, 10, 10, kPlain)));
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_move(10, 30, kPlain)));
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_release(3, 10, 30, kPlain)));
  expected.pan(0, 20 / 200.0);
  check("drag with another button");
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_scroll(1, 1, 0, 1, kPlain)));
  const Vec2 place((1.5 - 160) / 200, (1.5 - 100) / 200);  // pixel (1, 1) from the centre, in units of the height
  expected.zoom(1, place);
  check("wheel");
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_scroll(1, 1, 0, -2, kControl)));
  expected.focus(-2);
  check("ctrl-wheel");
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_press(5, 1, 1, kPlain)));
  expected.zoom(-1, place);
  check("wheel as a button");
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_press(4, 1, 1, kControl)));
  expected.focus(1);
  check("ctrl-wheel as a button");
  for (const char* key : {"Left", "Up", "w", "a", "E", "plus", "bracketleft"}) {
    EXPECT_TRUE(source.send(gst_navigation_event_new_key_press(key, kPlain)));
    EXPECT_FALSE(source.send(gst_navigation_event_new_key_release(key, kPlain)));
    expected.key(key);
    check(key);
  }
  EXPECT_FALSE(source.send(gst_navigation_event_new_key_press("F5", kPlain)));
  EXPECT_FALSE(source.send(gst_navigation_event_new_command(GST_NAVIGATION_COMMAND_MENU1)));
  check("what means nothing");
  EXPECT_NEAR(source.get("x"), expected.viewpoint().pose.position.x, 1e-12);
  EXPECT_NEAR(source.get("focus-distance"), expected.viewpoint().focus_distance, 1e-12);
  EXPECT_TRUE(source.send(gst_navigation_event_new_key_press("r", kPlain)));
  expected.reset();
  check("r");
}

// Pointer coordinates are relative to the whole picture; the pointer selects one view of the set.
TEST(LfViewRequestNavigation, PointerSelectsAViewOfTheSet) {
  TestSource source;
  gst_util_set_object_arg(G_OBJECT(source.element()), "views", "top-bottom");
  source.set("eye-distance", 0.0);
  source.play_live();
  Navigator expected(test_viewpoint());
  source.next_live();
  const auto check = [&](const std::string& what) {
    source.pull();
    expect_near(source.next_live().request.view, make_view(expected.viewpoint(), 320, 200), what);
  };
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_scroll(1, 201, 0, 1, kPlain)));
  expected.zoom(1, {(1.5 - 160) / 200, (1.5 - 100) / 200});
  check("wheel");
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_press(1, 100, 190, kPlain)));
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_move(100, 210, kPlain)));
  expected.orbit(0, 20 / 200.0);
  check("a drag from view to view");
  EXPECT_TRUE(emit(source.element(), "focus-at", 10.0, 399.0));
  EXPECT_FALSE(emit(source.element(), "focus-at", 10.0, 401.0));
}

// Returns how far a drag over twice the picture height moves the viewpoint, metres.
double drag_far(Source& source, GstNavigationModifierType state) {
  const Vec3 before = source.next_live().request.view.pose.position;
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_press(1, 0, 20, state)));
  for (int x = 2; x <= 96; x += 2) EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_move(x, 20, state)));
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_release(1, 96, 20, state)));
  const double far = glm::length(source.next_live().request.view.pose.position - before);
  EXPECT_TRUE(source.send(gst_navigation_event_new_key_press("r", kPlain)));
  return far;
}

TEST(LfViewRequestNavigation, StaysWhereTheArrayIsVisible) {
  RigSource source;
  source.play_live();
  EXPECT_LT(drag_far(source, kPlain), 0.16) << "half of the array's width is 0.1 m";
  EXPECT_LT(drag_far(source, kShift), 0.16);
  source.set("constrain-view", FALSE);
  EXPECT_GT(drag_far(source, kPlain), 0.3);
  source.set("constrain-view", TRUE);
  for (int i = 0; i < 50; i++) source.send(gst_navigation_event_new_key_press("d", kPlain));
  EXPECT_LT(source.get("x"), 1.22);
  source.set("rig", nullptr);
  EXPECT_GT(drag_far(source, kPlain), 0.3) << "unlimited without a rig";
}

TEST(LfViewRequestNavigation, InvalidEventsAndOtherViewsAreIgnored) {
  TestSource source;
  source.set("view-id", 2u);
  source.play_live();
  const View view = source.next_live().request.view;
  EXPECT_FALSE(source.send(tagged(gst_navigation_event_new_key_press("w", kPlain), 3)));
  EXPECT_FALSE(source.send(tagged(view_event(", x=(double)7"), 0)));
  EXPECT_FALSE(source.send(view_event(", x=(double)7, lightfield-view-id=(string)2")));
  EXPECT_FALSE(source.send(gst_navigation_event_new_mouse_scroll(0, 0, 0, NAN, kPlain)));
  EXPECT_FALSE(source.send(gst_navigation_event_new_mouse_scroll(0, 0, 1, 0, kPlain)));
  EXPECT_FALSE(source.send(gst_navigation_event_new_mouse_button_press(1, NAN, 0, kPlain)));
  EXPECT_FALSE(source.send(gst_navigation_event_new_mouse_button_press(9, 0, 0, kPlain)));
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_press(1, 0, 0, kPlain)));
  EXPECT_FALSE(source.send(gst_navigation_event_new_mouse_move(INFINITY, 0, kPlain)));
  source.set("navigation", FALSE);
  EXPECT_FALSE(source.send(gst_navigation_event_new_key_press("w", kPlain)));
  EXPECT_EQ(source.next_live().request.view, view);

  source.set("navigation", TRUE);
  EXPECT_TRUE(source.send(tagged(gst_navigation_event_new_key_press("w", kPlain), 2)));
  Navigator expected(test_viewpoint());
  expected.key("w");
  expect_near(source.next_live().request.view, make_view(expected.viewpoint(), 320, 200));
}

TEST(LfViewRequestNavigation, ViewsOfAFileDoNotMove) {
  const std::vector<NamedView> views = test_views({0, 0});
  FileSource source(views);
  source.play_live();
  source.next_live();
  EXPECT_FALSE(source.send(gst_navigation_event_new_key_press("w", kPlain)));
  EXPECT_FALSE(source.send(view_event(", x=(double)7")));
  EXPECT_EQ(source.next_live().request.view, views[1].view);
}

TEST(LfViewRequestNavigation, CustomEventsSetTheView) {
  TestSource source;
  source.play_live();
  source.next_live();
  EXPECT_TRUE(source.send(tagged(view_event(", x=(double)7, yaw=(int)90, focus-distance=(double)0.5"), 0)));
  Viewpoint expected = test_viewpoint();
  expected.pose = {{7, -2, 0.5}, quat_from_euler({90, -20, 10})};
  expected.focus_distance = 0.5;
  expect_near(source.next_live().request.view, make_view(expected, 320, 200));
  EXPECT_FALSE(source.send(view_event("")));
  EXPECT_FALSE(source.send(view_event(", x=(double)8, y=(double)nan")));
  EXPECT_FALSE(source.send(view_event(", x=(double)8, y=(string)here")));
  expect_near(source.next_live().request.view, make_view(expected, 320, 200));
  EXPECT_TRUE(source.send(view_event(", fov=(double)1000, focus-distance=(double)-3")));
  expected.fov_y_deg = kMaxFovDeg;
  expected.focus_distance = kMinFocus;
  expect_near(source.next_live().request.view, make_view(expected, 320, 200));
}

TEST(LfViewRequestNavigation, SignalSetsTheViewAndNotifies) {
  TestSource source;
  source.play_live();
  source.next_live();
  std::string notified;
  g_signal_connect(source.element(), "notify", G_CALLBACK(+[](GObject*, GParamSpec* pspec, gpointer data) {
                     *static_cast<std::string*>(data) += std::string(pspec->name) + " ";
                   }),
                   &notified);
  const auto set_view = [&](GstStructure* view) {
    return emit(source.element(), "set-view", StructurePtr(view).get());
  };
  EXPECT_TRUE(set_view(gst_structure_new("view", "z", G_TYPE_DOUBLE, 4.0, "roll", G_TYPE_DOUBLE, 0.0, "x",
                                         G_TYPE_DOUBLE, 1.0, nullptr)));
  EXPECT_EQ(notified, "z roll ");
  EXPECT_FALSE(set_view(gst_structure_new("view", "size", G_TYPE_INT, 4, nullptr)));
  EXPECT_FALSE(set_view(gst_structure_new("view", "z", G_TYPE_DOUBLE, 9.0, "yawn", G_TYPE_DOUBLE, 1.0, nullptr)))
      << "unknown field";
  EXPECT_FALSE(set_view(gst_structure_new("view", "z", G_TYPE_BOOLEAN, TRUE, nullptr)));
  Viewpoint expected = test_viewpoint();
  expected.pose = {{1, -2, 4}, quat_from_euler({35, -20, 0})};
  expect_near(source.next_live().request.view, make_view(expected, 320, 200));
  notified.clear();
  source.send(gst_navigation_event_new_key_press("plus", kPlain));
  EXPECT_THAT(notified, HasSubstr("fov"));
}

// Navigation events of a window that shows pictures of another host do not reach this source upstream.
TEST(LfViewRequestNavigation, WindowInAnotherBranchMovesTheView) {
  const PipelinePtr pipeline = launch(
      "lfviewrequest name=v is-live=true navigation-element=pictures ! fakesink  videotestsrc is-live=true ! "
      "identity name=pictures ! fakesink name=window");
  ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  gst_element_get_state(pipeline.get(), nullptr, nullptr, 10 * GST_SECOND);
  const ElementPtr view = child_of(pipeline.get(), "v"), window = child_of(pipeline.get(), "window");
  const double before = get<double>(view.get(), "z");
  gst_pad_push_event(pad_of(window.get(), "sink").get(), gst_navigation_event_new_key_press("w", kPlain));
  EXPECT_GT(get<double>(view.get(), "z"), before);
  EXPECT_THAT(run(launch("lfviewrequest navigation-element=nobody ! fakesink").get(), 5),
              HasSubstr("no element \"nobody\""));
}

}  // namespace
}  // namespace lf::test
