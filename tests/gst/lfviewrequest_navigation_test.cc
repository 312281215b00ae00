// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gst/video/navigation.h>

#include "gst/view_request_source.h"

namespace lf::test {
namespace {

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

TEST(LfViewRequestNavigation, EachKindMovesTheVeryNextRequest) {
  Source source;
  set_somewhere(source);
  source.play_live();
  Navigator expected(somewhere());
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
  const Vec2 place((1.5 - 160) / 200, (1.5 - 100) / 200);  // pixel (1, 1) from the middle, in heights
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

// Pixels are those of the whole picture, and what is under the pointer is in one of its views.
TEST(LfViewRequestNavigation, ThePointerIsInOneOfASetsViews) {
  Source source;
  set_somewhere(source);
  gst_util_set_object_arg(G_OBJECT(source.element()), "views", "top-bottom");
  source.set("eye-distance", 0.0);
  source.play_live();
  Navigator expected(somewhere());
  source.next_live();
  const auto check = [&](const std::string& what) {
    source.pull();  // the other view of the set
    expect_near(source.next_live().request.view, make_view(expected.viewpoint(), 320, 200), what);
  };
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_scroll(1, 201, 0, 1, kPlain)));
  expected.zoom(1, {(1.5 - 160) / 200, (1.5 - 100) / 200});
  check("wheel");
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_press(1, 100, 190, kPlain)));
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_move(100, 210, kPlain)));
  expected.orbit(0, 20 / 200.0);
  check("a drag from view to view");
  gboolean done = FALSE;
  for (const auto& [y, inside] : {std::pair<double, gboolean>(399, TRUE), std::pair<double, gboolean>(401, FALSE)}) {
    g_signal_emit_by_name(source.element(), "focus-at", 10.0, y, &done);
    EXPECT_EQ(done, inside) << y;
  }
}

// How far a drag over twice the height takes the eye, metres.
double drag_far(Source& source, GstNavigationModifierType state) {
  const Vec3 before = source.next_live().request.view.pose.position;
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_press(1, 0, 20, state)));
  for (int x = 2; x <= 96; x += 2) EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_move(x, 20, state)));
  EXPECT_TRUE(source.send(gst_navigation_event_new_mouse_button_release(1, 96, 20, state)));
  const double far = glm::length(source.next_live().request.view.pose.position - before);
  EXPECT_TRUE(source.send(gst_navigation_event_new_key_press("r", kPlain)));
  return far;
}

TEST(LfViewRequestNavigation, StaysWhereTheArrayIsSeen) {
  const TemporaryFiles files;
  save_rig(test_rig(), files.path("rig.json"));
  Source source;
  source.set("rig", files.path("rig.json").c_str());
  source.play_live();
  EXPECT_LT(drag_far(source, kPlain), 0.16) << "half of the array's width is 0.1 m";
  EXPECT_LT(drag_far(source, kShift), 0.16);
  source.set("keep-visible", FALSE);
  EXPECT_GT(drag_far(source, kPlain), 0.3);
  source.set("keep-visible", TRUE);
  for (int i = 0; i < 50; i++) source.send(gst_navigation_event_new_key_press("d", kPlain));
  EXPECT_LT(source.get("x"), 1.22);
  source.set("rig", nullptr);
  EXPECT_GT(drag_far(source, kPlain), 0.3) << "without a rig nobody knows what is seen";
}

TEST(LfViewRequestNavigation, EventsOfOtherViewsAndNonsenseChangeNothing) {
  Source source;
  set_somewhere(source);
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
  Navigator expected(somewhere());
  expected.key("w");
  expect_near(source.next_live().request.view, make_view(expected.viewpoint(), 320, 200));
}

TEST(LfViewRequestNavigation, AFileIsNotSteered) {
  const TemporaryFiles files;
  const std::vector<NamedView> views = test_views({0, 0});
  save_views(views, files.path("views.json"));
  Source source;
  source.set("location", files.path("views.json").c_str());
  source.play_live();
  source.next_live();
  EXPECT_FALSE(source.send(gst_navigation_event_new_key_press("w", kPlain)));
  EXPECT_FALSE(source.send(view_event(", x=(double)7")));
  EXPECT_EQ(source.next_live().request.view, views[1].view);
}

TEST(LfViewRequestNavigation, CustomEventsSetTheView) {
  Source source;
  set_somewhere(source);
  source.play_live();
  source.next_live();
  EXPECT_TRUE(source.send(tagged(view_event(", x=(double)7, yaw=(int)90, focus-distance=(double)0.5"), 0)));
  Viewpoint expected = somewhere();
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

TEST(LfViewRequestNavigation, TheSignalSetsTheViewAndPropertiesNotify) {
  Source source;
  set_somewhere(source);
  source.play_live();
  source.next_live();
  std::string notified;
  g_signal_connect(source.element(), "notify", G_CALLBACK(+[](GObject*, GParamSpec* pspec, gpointer data) {
                     *static_cast<std::string*>(data) += std::string(pspec->name) + " ";
                   }),
                   &notified);
  const auto set_view = [&](GstStructure* structure) {
    gboolean done = FALSE;
    g_signal_emit_by_name(source.element(), "set-view", structure, &done);
    gst_structure_free(structure);
    return done;
  };
  EXPECT_TRUE(set_view(gst_structure_new("view", "z", G_TYPE_DOUBLE, 4.0, "roll", G_TYPE_DOUBLE, 0.0, "x",
                                         G_TYPE_DOUBLE, 1.0, nullptr)));
  EXPECT_EQ(notified, "z roll ");  // x is what it was
  EXPECT_FALSE(set_view(gst_structure_new("view", "size", G_TYPE_INT, 4, nullptr)));
  EXPECT_FALSE(set_view(gst_structure_new("view", "z", G_TYPE_DOUBLE, 9.0, "yawn", G_TYPE_DOUBLE, 1.0, nullptr)))
      << "one that is unknown is no field of a view";
  EXPECT_FALSE(set_view(gst_structure_new("view", "z", G_TYPE_BOOLEAN, TRUE, nullptr)));
  Viewpoint expected = somewhere();
  expected.pose = {{1, -2, 4}, quat_from_euler({35, -20, 0})};
  expect_near(source.next_live().request.view, make_view(expected, 320, 200));
  notified.clear();
  source.send(gst_navigation_event_new_key_press("plus", kPlain));
  EXPECT_NE(notified.find("fov"), std::string::npos) << notified;
}

// Pictures of another host: what their window says never comes to the source by itself.
TEST(LfViewRequestNavigation, AWindowInAnotherBranchSteers) {
  const ElementPtr pipeline = launch(
      "lfviewrequest name=v is-live=true navigation-from=pictures ! fakesink  videotestsrc is-live=true ! "
      "identity name=pictures ! fakesink name=window");
  ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  gst_element_get_state(pipeline.get(), nullptr, nullptr, 10 * GST_SECOND);
  GstElement* view = gst_bin_get_by_name(GST_BIN(pipeline.get()), "v");
  GstElement* window = gst_bin_get_by_name(GST_BIN(pipeline.get()), "window");
  GstPad* pad = gst_element_get_static_pad(window, "sink");
  double before = 0, after = 0;
  g_object_get(view, "z", &before, nullptr);
  gst_pad_push_event(pad,
                     gst_event_new_navigation(gst_structure_new("application/x-gst-navigation", "event", G_TYPE_STRING,
                                                                "key-press", "key", G_TYPE_STRING, "w", nullptr)));
  g_object_get(view, "z", &after, nullptr);
  EXPECT_GT(after, before);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  gst_object_unref(pad);
  gst_object_unref(window);
  gst_object_unref(view);
  EXPECT_THAT(run(launch("lfviewrequest navigation-from=nobody ! fakesink").get(), 5),
              testing::HasSubstr("no element \"nobody\""));
}

}  // namespace
}  // namespace lf::test
