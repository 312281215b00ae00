// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_controls.h"

#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <vector>

#include <gst/video/colorbalance.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>

#include "common/gst_pointers.h"

namespace lf {
namespace {

// Names of the element properties that set one control, such as exposure, and its automatic mode.
struct Properties {
  const char* name;
  const char* value;
  double unit;  // property value per user unit
  const char* automatic;
  const char *on, *off;
};

constexpr Properties kProperties[] = {
    {"exposure", "exposure", 1e6, "exposure-auto", "continuous", "off"},
    {"gain", "gain", 1, "gain-auto", "continuous", "off"},
    {"exposure", "exposure-time", 1e6, "exposure-time-mode", "auto", "manual"},
    {"exposure", "exposure-time", 1e6, "ae-enable", "true", "false"},
    {"gain", "analogue-gain", 1, "analogue-gain-mode", "auto", "manual"},
    {"gain", "analogue-gain", 1, "ae-enable", "true", "false"},
    {"white_balance", "colour-temperature", 1, "awb-enable", "true", "false"},
    {"focus", "lens-position", 1, "af-mode", "continuous", "manual"},
};

constexpr const char* kKnownNames[] = {"exposure", "gain", "white_balance", "focus", "mains_frequency"};

GParamSpec* find_property(GstElement* element, const char* name) {
  GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(element), name);
  return spec && (spec->flags & G_PARAM_READWRITE) == G_PARAM_READWRITE ? spec : nullptr;
}

std::optional<double> get_number(GstElement* element, const char* name) {
  GValue value = G_VALUE_INIT, number = G_VALUE_INIT;
  g_object_get_property(G_OBJECT(element), name, &value);
  g_value_init(&number, G_TYPE_DOUBLE);
  std::optional<double> result;
  if (g_value_transform(&value, &number)) result = g_value_get_double(&number);
  g_value_unset(&value);
  g_value_unset(&number);
  return result;
}

void set_number(GstElement* element, GParamSpec* spec, double number) {
  GValue from = G_VALUE_INIT, to = G_VALUE_INIT;
  const bool whole = !G_IS_PARAM_SPEC_DOUBLE(spec) && !G_IS_PARAM_SPEC_FLOAT(spec);
  g_value_init(&from, whole ? G_TYPE_INT64 : G_TYPE_DOUBLE);
  if (whole)
    g_value_set_int64(&from, std::llround(number));
  else
    g_value_set_double(&from, number);
  g_value_init(&to, spec->value_type);
  if (g_value_transform(&from, &to)) {
    g_param_value_validate(spec, &to);
    g_object_set_property(G_OBJECT(element), spec->name, &to);
  }
  g_value_unset(&from);
  g_value_unset(&to);
}

std::string get_text(GstElement* element, const char* name) {
  GValue value = G_VALUE_INIT;
  g_object_get_property(G_OBJECT(element), name, &value);
  g_autofree gchar* text = gst_value_serialize(&value);
  g_value_unset(&value);
  return text ? text : "";
}

const Properties* find_properties(GstElement* element, const std::string& name) {
  for (const Properties& p : kProperties)
    if (name == p.name && find_property(element, p.value) && find_property(element, p.automatic)) return &p;
  return nullptr;
}

// Calls `use` with the GstColorBalance channel that has this label, ignoring case. Returns false if there is no such
// channel.
bool with_channel(GstElement* element, const std::string& name,
                  const std::function<void(GstColorBalance*, GstColorBalanceChannel*)>& use) {
  if (!GST_IS_COLOR_BALANCE(element)) return false;
  GstColorBalance* balance = GST_COLOR_BALANCE(element);
  for (const GList* item = gst_color_balance_list_channels(balance); item; item = item->next) {
    auto* channel = static_cast<GstColorBalanceChannel*>(item->data);
    if (g_ascii_strcasecmp(channel->label, name.c_str()) != 0) continue;
    use(balance, channel);
    return true;
  }
  return false;
}

// Sets a control by an element property. Returns false if the element lacks a property for this control.
bool apply_by_property(GstElement* element, const std::string& name, std::optional<double> value) {
  if (const Properties* p = find_properties(element, name)) {
    gst_util_set_object_arg(G_OBJECT(element), p->automatic, value ? p->off : p->on);
    if (value) set_number(element, find_property(element, p->value), *value * p->unit);
    return true;
  }
  GParamSpec* spec = find_property(element, name.c_str());
  if (!spec || !value || !g_value_type_transformable(G_TYPE_DOUBLE, spec->value_type)) return false;
  set_number(element, spec, *value);
  return true;
}

void apply(GstElement* element, const Controls& controls) {
  if (GParamSpec* extra = find_property(element, "extra-controls"); extra && extra->value_type == GST_TYPE_STRUCTURE) {
    g_autoptr(GstStructure) all = v4l2_extra_controls(controls);
    g_autoptr(GstStructure) described = nullptr;
    g_object_get(element, "extra-controls", &described, nullptr);
    if (described)
      gst_structure_foreach(
          described,
          [](GQuark field, const GValue* value, gpointer to) -> gboolean {
            if (!gst_structure_has_field(static_cast<GstStructure*>(to), g_quark_to_string(field)))
              gst_structure_id_set_value(static_cast<GstStructure*>(to), field, value);
            return TRUE;
          },
          all);
    g_object_set(element, "extra-controls", all, nullptr);
    return;
  }
  for (const auto& [name, value] : controls) {
    if (apply_by_property(element, name, value) || !value) continue;
    with_channel(element, name, [&, number = *value](GstColorBalance* balance, GstColorBalanceChannel* channel) {
      gst_color_balance_set_value(balance, channel, static_cast<gint>(std::lround(number)));
    });
  }
}

std::optional<ControlState> read(GstElement* element, const std::string& name) {
  if (find_property(element, "extra-controls")) {
    GParamSpec* handle = g_object_class_find_property(G_OBJECT_GET_CLASS(element), "device-fd");
    const auto number = handle ? get_number(element, "device-fd") : std::nullopt;
    if (!number || *number < 0) return {};
    if (const auto control = read_v4l2_control(name, v4l2_reader(static_cast<int>(*number)))) return control;
  } else if (const Properties* p = find_properties(element, name)) {
    const auto value = get_number(element, p->value);
    return ControlState{value ? std::optional(*value / p->unit) : std::nullopt,
                        get_text(element, p->automatic) != p->off};
  } else if (GParamSpec* spec = find_property(element, name.c_str());
             spec && g_value_type_transformable(spec->value_type, G_TYPE_DOUBLE)) {
    return ControlState{get_number(element, name.c_str())};
  }
  std::optional<ControlState> state;
  with_channel(element, name, [&](GstColorBalance* balance, GstColorBalanceChannel* channel) {
    state = ControlState{gst_color_balance_get_value(balance, channel)};
  });
  return state;
}

// Returns the element itself, or, for a bin, all elements inside.
std::vector<ElementPtr> elements_of(GstElement* source) {
  if (GST_IS_BIN(source)) return take_elements(gst_bin_iterate_recurse(GST_BIN(source)));
  std::vector<ElementPtr> single;
  single.emplace_back(GST_ELEMENT(gst_object_ref(source)));
  return single;
}

std::optional<ControlState> read_any(const std::vector<ElementPtr>& elements, const std::string& name) {
  for (const ElementPtr& element : elements)
    if (const auto state = read(element.get(), name)) return state;
  return std::nullopt;
}

template <typename Put>
GstStructure* read_all(GstElement* source, const Controls& wanted, Put put) {
  GstStructure* result = gst_structure_new_empty("lightfield-controls");
  const std::vector<ElementPtr> elements = elements_of(source);
  for (const char* name : kKnownNames)
    if (const auto state = read_any(elements, name)) put(result, name, *state);
  for (const auto& [name, value] : wanted)
    if (!gst_structure_has_field(result, name.c_str()))
      put(result, name.c_str(), read_any(elements, name).value_or(ControlState{}));
  return result;
}

}  // namespace

void apply_controls(GstElement* source, const Controls& controls) {
  if (controls.empty()) return;
  for (const ElementPtr& element : elements_of(source)) apply(element.get(), controls);
}

GstStructure* read_controls(GstElement* source, const Controls& wanted) {
  return read_all(source, wanted, [](GstStructure* to, const char* name, const ControlState& state) {
    if (state.automatic)
      gst_structure_set(to, name, G_TYPE_STRING, "auto", nullptr);
    else if (state.value)
      gst_structure_set(to, name, G_TYPE_DOUBLE, *state.value, nullptr);
    else
      gst_structure_set(to, name, G_TYPE_BOOLEAN, FALSE, nullptr);
  });
}

GstStructure* read_control_values(GstElement* source, const Controls& wanted) {
  return read_all(source, wanted, [](GstStructure* to, const char* name, const ControlState& state) {
    if (state.value) gst_structure_set(to, name, G_TYPE_DOUBLE, *state.value, nullptr);
  });
}

namespace {

// The V4L2 names (of new and old kernels) and ids of a control and of its automatic mode.
struct KnownControl {
  const char* name;
  uint32_t id;
  double unit;  // V4L2 steps per user unit
  std::array<const char*, 2> fields;
  uint32_t switch_id;
  std::array<const char*, 2> switch_fields;
  int manual, automatic;
};

constexpr KnownControl kKnown[] = {
    {"exposure",
     V4L2_CID_EXPOSURE_ABSOLUTE,
     1e4,  // steps of 100 us
     {"exposure_time_absolute", "exposure_absolute"},
     V4L2_CID_EXPOSURE_AUTO,
     {"auto_exposure", "exposure_auto"},
     V4L2_EXPOSURE_MANUAL,
     V4L2_EXPOSURE_APERTURE_PRIORITY},  // automatic mode of webcams, which have no aperture
    {"gain", V4L2_CID_GAIN, 1, {"gain", nullptr}, V4L2_CID_AUTOGAIN, {"gain_automatic", "autogain"}, 0, 1},
    {"white_balance",
     V4L2_CID_WHITE_BALANCE_TEMPERATURE,
     1,
     {"white_balance_temperature", nullptr},
     V4L2_CID_AUTO_WHITE_BALANCE,
     {"white_balance_automatic", "white_balance_temperature_auto"},
     0,
     1},
    {"focus",
     V4L2_CID_FOCUS_ABSOLUTE,
     1,
     {"focus_absolute", nullptr},
     V4L2_CID_FOCUS_AUTO,
     {"focus_automatic_continuous", "focus_auto"},
     0,
     1},
};

constexpr char kMains[] = "mains_frequency", kMainsField[] = "power_line_frequency";

int mains_menu(std::optional<double> hertz) {
  if (!hertz) return V4L2_CID_POWER_LINE_FREQUENCY_AUTO;
  if (*hertz == 50) return V4L2_CID_POWER_LINE_FREQUENCY_50HZ;
  return *hertz == 60 ? V4L2_CID_POWER_LINE_FREQUENCY_60HZ : V4L2_CID_POWER_LINE_FREQUENCY_DISABLED;
}

const KnownControl* find_known_control(const std::string& name) {
  for (const KnownControl& known : kKnown)
    if (name == known.name) return &known;
  return nullptr;
}

void set(GstStructure* fields, const std::array<const char*, 2>& names, int value) {
  for (const char* name : names)
    if (name) gst_structure_set(fields, name, G_TYPE_INT, value, nullptr);
}

}  // namespace

GstStructure* v4l2_extra_controls(const Controls& controls) {
  GstStructure* fields = gst_structure_new_empty("lightfield-controls");
  for (const auto& [name, value] : controls)
    if (const KnownControl* known = find_known_control(name); known && known->switch_id)
      set(fields, known->switch_fields, value ? known->manual : known->automatic);
  for (const auto& [name, value] : controls) {
    if (name == kMains) {
      gst_structure_set(fields, kMainsField, G_TYPE_INT, mains_menu(value), nullptr);
    } else if (const KnownControl* known = find_known_control(name); known && value) {
      set(fields, known->fields, static_cast<int>(std::lround(*value * known->unit)));
    } else if (!known && value) {
      gst_structure_set(fields, name.c_str(), G_TYPE_INT, static_cast<int>(std::lround(*value)), nullptr);
    }
  }
  return fields;
}

std::optional<ControlState> read_v4l2_control(const std::string& name, const ReadV4l2& read) {
  if (name == kMains) {
    const auto menu = read(V4L2_CID_POWER_LINE_FREQUENCY);
    if (!menu) return std::nullopt;
    if (*menu == V4L2_CID_POWER_LINE_FREQUENCY_AUTO) return ControlState{std::nullopt, true};
    return ControlState{*menu == V4L2_CID_POWER_LINE_FREQUENCY_50HZ   ? 50.0
                        : *menu == V4L2_CID_POWER_LINE_FREQUENCY_60HZ ? 60.0
                                                                      : 0.0};
  }
  const KnownControl* known = find_known_control(name);
  if (!known) return std::nullopt;
  const auto value = read(known->id), automatic = read(known->switch_id);
  if (!value && !automatic) return std::nullopt;
  ControlState control;
  if (value) control.value = *value / known->unit;
  control.automatic = automatic && *automatic != known->manual;
  return control;
}

ReadV4l2 v4l2_reader(int handle) {
  return [handle](uint32_t id) -> std::optional<int32_t> {
    v4l2_control control = {};
    control.id = id;
    if (ioctl(handle, VIDIOC_G_CTRL, &control) != 0) return std::nullopt;
    return control.value;
  };
}

}  // namespace lf
