// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/control_message.h"
#include "support/mentions.h"

#include <gst/gst.h>
#include <gst/video/video.h>

namespace lf::serve {
namespace {

constexpr double kMaxAperture = 0.5;

ControlMessage parse(std::string_view text) { return parse_control_message(text, kMaxAperture); }

std::string navigation(const std::string& event) {
  return R"({"id":7,"mid":null,"request":{"type":"navigationEvent","event":)" + event + "}}";
}
std::string view(const std::string& structure) {
  return R"({"id":8,"request":{"type":"customUpstreamEvent","structureName":"lightfield-view-request","structure":)" +
         structure + "}}";
}

TEST(ControlMessage, UnknownFieldsAreRefused) {
  EXPECT_NE(parse(view(R"({"never-heard-of":1})")).error, "");
  EXPECT_EQ(g_quark_try_string("never-heard-of"), 0u);
}

TEST(ControlMessage, NavigationBecomesGStreamersEvents) {
  const ControlMessage move =
      parse(navigation(R"({"event":"MouseMove","x":1.5,"y":2,"modifier_state":"shift-mask+button1-mask"})"));
  ASSERT_TRUE(move.event) << move.error;
  EXPECT_EQ(move.id, 7u);
  gdouble x = 0, y = 0;
  ASSERT_TRUE(gst_navigation_event_parse_mouse_move_event(move.event.get(), &x, &y));
  EXPECT_EQ(x, 1.5);
  EXPECT_EQ(y, 2);
  GstNavigationModifierType state;
  gst_navigation_event_parse_modifier_state(move.event.get(), &state);
  EXPECT_EQ(state, GST_NAVIGATION_MODIFIER_SHIFT_MASK | GST_NAVIGATION_MODIFIER_BUTTON1_MASK);

  const std::pair<const char*, GstNavigationEventType> table[] = {
      {R"({"event":"MouseButtonPress","button":1,"x":1,"y":2})", GST_NAVIGATION_EVENT_MOUSE_BUTTON_PRESS},
      {R"({"event":"MouseButtonRelease","button":1,"x":1,"y":2})", GST_NAVIGATION_EVENT_MOUSE_BUTTON_RELEASE},
      {R"({"event":"MouseScroll","x":1,"y":2,"delta_x":0,"delta_y":-1})", GST_NAVIGATION_EVENT_MOUSE_SCROLL},
      {R"({"event":"KeyPress","key":"Left"})", GST_NAVIGATION_EVENT_KEY_PRESS},
      {R"({"event":"KeyRelease","key":"Left"})", GST_NAVIGATION_EVENT_KEY_RELEASE}};
  for (const auto& [text, type] : table) {
    const ControlMessage message = parse(navigation(text));
    ASSERT_TRUE(message.event) << text << message.error;
    EXPECT_EQ(gst_navigation_event_get_type(message.event.get()), type) << text;
  }
}

TEST(ControlMessage, ViewsBecomeCustomEvents) {
  for (const char* name : {"x", "focus-distance"}) g_quark_from_string(name);
  const ControlMessage message = parse(view(R"({"x":0.25,"focus-distance":3})"));
  ASSERT_TRUE(message.event) << message.error;
  const GstStructure* structure = gst_event_get_structure(message.event.get());
  EXPECT_STREQ(gst_structure_get_name(structure), "lightfield-view-request");
  gdouble value = 0;
  EXPECT_TRUE(gst_structure_get_double(structure, "focus-distance", &value));
  EXPECT_EQ(value, 3);
  EXPECT_EQ(gst_structure_n_fields(structure), 2);
}

TEST(ControlMessage, AperturesHaveALimit) {
  g_quark_from_string("aperture");
  EXPECT_TRUE(parse(view(R"({"aperture":0.5})")).event);
  const ControlMessage wide = parse(view(R"({"aperture":0.51})"));
  EXPECT_FALSE(wide.event);
  EXPECT_MENTIONS(wide.error, "aperture", "larger");
}

std::string pixel(const std::string& structure) {
  return R"({"id":9,"request":{"type":"customUpstreamEvent","structureName":"lightfield-pixel","structure":)" +
         structure + "}}";
}

TEST(ControlMessage, RequestsPixels) {
  const ControlMessage message = parse(pixel(R"({"x":20.4,"y":-10})"));
  ASSERT_TRUE(message.pixel) << message.error;
  EXPECT_FALSE(message.event);
  EXPECT_EQ(message.pixel->x, 20);
  EXPECT_EQ(message.pixel->y, -10);
}

TEST(ControlMessage, RefusesEverythingElse) {
  const std::string table[] = {
      "",
      "{",
      "[]",
      "7",
      "null",
      R"({"id":7})",
      R"({"request":{"type":"navigationEvent","event":{"event":"KeyPress","key":"Left"}}})",
      R"({"id":-7,"request":{"type":"navigationEvent","event":{"event":"KeyPress","key":"Left"}}})",
      R"({"id":"7","request":{"type":"navigationEvent","event":{"event":"KeyPress","key":"Left"}}})",
      R"({"id":7,"request":{"type":"reboot"}})",
      R"({"id":7,"request":[]})",
      navigation("null"),
      navigation("{}"),
      navigation(R"({"event":"MouseMove","x":1})"),
      navigation(R"({"event":"MouseMove","x":"1","y":2})"),
      navigation(R"({"event":"MouseMove","x":true,"y":2})"),
      navigation(R"({"event":"MouseMove","x":1e300,"y":2})"),
      navigation(R"({"event":"MouseMove","x":1e999,"y":2})"),
      navigation(R"({"event":"MouseMove","x":1,"y":2,"modifier_state":3})"),
      navigation(R"({"event":"MouseButtonPress","button":99,"x":1,"y":2})"),
      navigation(R"({"event":"KeyPress","key":""})"),
      navigation(R"({"event":"KeyPress","key":")" + std::string(100, 'k') + "\"}"),
      navigation(R"({"event":"Teleport"})"),
      view("{}"),
      view("[1]"),
      view("null"),
      view(R"({"x":"1"})"),
      view(R"({"x":null})"),
      view(R"({"x":1e10})"),
      view(R"({"x y":1})"),
      view(R"({"lightfield-view-id":1})"),
      view(R"({"":1})"),
      pixel(R"({"x":1})"),
      pixel(R"({"x":1,"y":"2"})"),
      pixel(R"({"x":1,"y":1e300})"),
      pixel("[]"),
      R"({"id":8,"request":{"type":"customUpstreamEvent","structureName":"GstForceKeyUnit","structure":{"x":1}}})",
      std::string(ControlMessage::kMaxBytes, '['),
      view("{\"x\":1}" + std::string(ControlMessage::kMaxBytes, ' '))};
  for (const std::string& text : table) {
    const ControlMessage message = parse(text);
    EXPECT_FALSE(message.event || message.pixel) << text;
    EXPECT_NE(message.error, "") << text;
  }
  std::string many = "{\"x\":1";
  for (int i = 0; i < 20; i++) many += ",\"a" + std::to_string(i) + "\":1";
  EXPECT_FALSE(parse(view(many + "}")).event);
}

TEST(ControlMessage, AnswersInWebrtcsinksFormat) {
  EXPECT_EQ(control_response(7, ""), R"({"error":null,"id":7,"type":"ControlResponseMessage"})");
  EXPECT_EQ(control_response(8, "no"), R"({"error":"no","id":8,"type":"ControlResponseMessage"})");
  EXPECT_EQ(parse(R"({"id":9,"request":{"type":"x"}})").id, 9u) << "for the error reply";
}

}  // namespace
}  // namespace lf::serve
