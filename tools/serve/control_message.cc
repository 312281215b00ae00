// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/control_message.h"

#include <gst/video/video.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/text.h"

namespace lf::serve {
namespace {

using nlohmann::json;

const json& member(const json& object, const char* key) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  if (!object.is_object() || found == object.end()) throw Error(std::string(key) + " is missing");
  return *found;
}

std::string text(const json& object, const char* key) {
  const json& value = member(object, key);
  if (!value.is_string()) throw Error(std::string(key) + " must be a text");
  return value.get<std::string>();
}

double number(const json& value, const std::string& name, double most) {
  if (!value.is_number()) throw Error(name + " must be a number");
  const double result = value.get<double>();
  if (!std::isfinite(result) || std::abs(result) > most) throw Error(name + " is out of range");
  return result;
}

double picture(const json& event, const char* key) {
  return number(member(event, key), key, ControlMessage::kMaxPicture);
}

GstNavigationModifierType modifiers(const json& event) {
  if (!event.contains("modifier_state")) return GST_NAVIGATION_MODIFIER_NONE;
  const std::string names = text(event, "modifier_state");
  GFlagsClass* flags = static_cast<GFlagsClass*>(g_type_class_ref(GST_TYPE_NAVIGATION_MODIFIER_TYPE));
  unsigned state = 0;
  for (size_t begin = 0; begin < names.size();) {
    const size_t end = std::min(names.find_first_of("+|", begin), names.size());
    if (const GFlagsValue* value = g_flags_get_value_by_nick(flags, names.substr(begin, end - begin).c_str()))
      state |= value->value;
    begin = end + 1;
  }
  g_type_class_unref(flags);
  return static_cast<GstNavigationModifierType>(state);
}

GstEvent* navigation(const json& event) {
  const std::string kind = text(event, "event");
  const GstNavigationModifierType state = modifiers(event);
  if (kind == "MouseMove") return gst_navigation_event_new_mouse_move(picture(event, "x"), picture(event, "y"), state);
  if (kind == "MouseButtonPress" || kind == "MouseButtonRelease") {
    const int button = static_cast<int>(number(member(event, "button"), "button", 16));
    const auto make = kind == "MouseButtonPress" ? gst_navigation_event_new_mouse_button_press
                                                 : gst_navigation_event_new_mouse_button_release;
    return make(button, picture(event, "x"), picture(event, "y"), state);
  }
  if (kind == "MouseScroll")
    return gst_navigation_event_new_mouse_scroll(picture(event, "x"), picture(event, "y"), picture(event, "delta_x"),
                                                 picture(event, "delta_y"), state);
  if (kind == "KeyPress" || kind == "KeyRelease") {
    const std::string key = text(event, "key");
    if (key.empty() || key.size() > 32) throw Error("key is not the name of a key");
    return kind == "KeyPress" ? gst_navigation_event_new_key_press(key.c_str(), state)
                              : gst_navigation_event_new_key_release(key.c_str(), state);
  }
  throw Error("event is of an unknown kind");
}

// True if a GQuark of this name exists. GQuarks are never freed, so names from the network must not create new ones.
bool is_field_name(const std::string& name) {
  return !name.empty() && name.size() <= 32 && g_ascii_isalpha(name[0]) &&
         std::all_of(name.begin(), name.end(), [](char c) { return g_ascii_isalnum(c) || c == '-'; }) &&
         g_quark_try_string(name.c_str()) != 0;
}

// Pages of older versions use the prefix lf-.
std::string structure_name(const json& request) {
  const std::string name = text(request, "structureName");
  return name.starts_with("lf-") ? "lightfield-" + name.substr(3) : name;
}

// All fields must be numbers, which lfviewrequest interprets. The server itself sets the view id.
GstEvent* view_change(const json& request, double max_aperture) {
  constexpr char kName[] = "lightfield-view-request";
  if (structure_name(request) != kName) throw Error("structureName is unknown");
  const json& fields = member(request, "structure");
  if (!fields.is_object() || fields.empty() || fields.size() > ControlMessage::kMaxFields)
    throw Error("structure must be an object of a few numbers");
  GstStructure* structure = gst_structure_new_empty(kName);
  try {
    for (const auto& [name, value] : fields.items()) {
      if (!is_field_name(name) || name.starts_with("lightfield-"))
        throw Error("structure has a field of an unknown name");
      const double given = number(value, name, 1e9);
      if (name == "aperture" && given > max_aperture) throw Error("aperture is larger than the server takes");
      gst_structure_set(structure, name.c_str(), G_TYPE_DOUBLE, given, nullptr);
    }
  } catch (const Error&) {
    gst_structure_free(structure);
    throw;
  }
  return gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM, structure);
}

ControlMessage::Pixel pixel_of(const json& structure) {
  const auto side = [&](const char* key) { return static_cast<int>(std::lround(picture(structure, key))); };
  return {side("x"), side("y")};
}

void read_request(const json& request, double max_aperture, ControlMessage& message) {
  const std::string type = text(request, "type");
  if (type == "navigationEvent")
    message.event.reset(navigation(member(request, "event")));
  else if (type != "customUpstreamEvent")
    throw Error("request is of an unknown type");
  else if (structure_name(request) == "lightfield-pixel")
    message.pixel = pixel_of(member(request, "structure"));
  else
    message.event.reset(view_change(request, max_aperture));
}

}  // namespace

ControlMessage parse_control_message(std::string_view text, double max_aperture) {
  ControlMessage message;
  if (text.size() > ControlMessage::kMaxBytes) {
    message.error = "the message is too long";
    return message;
  }
  const json parsed = json::parse(text, nullptr, false);
  if (!parsed.is_object()) {
    message.error = "the message is not a JSON object";
    return message;
  }
  if (const auto id = parsed.find("id"); id != parsed.end() && id->is_number_unsigned())
    message.id = id->get<uint64_t>();
  try {
    if (!message.id) throw Error("id must be a number from 0 on");
    read_request(member(parsed, "request"), max_aperture, message);
  } catch (const Error& error) {
    message.error = error.what();
  }
  return message;
}

std::string control_response(uint64_t id, const std::string& error) {
  return json{{"type", "ControlResponseMessage"}, {"id", id}, {"error", error.empty() ? json() : json(error)}}.dump();
}

std::string info_message(const json& info) {
  return json{{"type", "InfoMessage"}, {"mid", "video0"}, {"info", info}}.dump();
}

}  // namespace lf::serve
