// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/v4l2_controls.h"

#include <linux/videodev2.h>
#include <sys/ioctl.h>

#include <array>
#include <cmath>

namespace lf {
namespace {

// A control and the switch that leaves it to the camera, by the names of V4L2 (new and old kernels') and their ids.
struct Known {
  const char* name;
  uint32_t id;
  double unit;  // steps in one of ours
  std::array<const char*, 2> fields;
  uint32_t switch_id;  // 0: none
  std::array<const char*, 2> switch_fields;
  int manual, automatic;  // values of the switch
};

constexpr Known kKnown[] = {
    {"exposure",
     V4L2_CID_EXPOSURE_ABSOLUTE,
     1e4,  // of 100 us
     {"exposure_time_absolute", "exposure_absolute"},
     V4L2_CID_EXPOSURE_AUTO,
     {"auto_exposure", "exposure_auto"},
     V4L2_EXPOSURE_MANUAL,
     V4L2_EXPOSURE_APERTURE_PRIORITY},  // a webcam's automatic: it has no aperture
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

const Known* find_known(const std::string& name) {
  for (const Known& known : kKnown)
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
    if (const Known* known = find_known(name); known && known->switch_id)
      set(fields, known->switch_fields, value ? known->manual : known->automatic);
  for (const auto& [name, value] : controls) {
    if (name == kMains) {
      gst_structure_set(fields, kMainsField, G_TYPE_INT, mains_menu(value), nullptr);
    } else if (const Known* known = find_known(name); known && value) {
      set(fields, known->fields, static_cast<int>(std::lround(*value * known->unit)));
    } else if (!known && value) {
      gst_structure_set(fields, name.c_str(), G_TYPE_INT, static_cast<int>(std::lround(*value)), nullptr);
    }
  }
  return fields;
}

std::optional<V4l2Control> read_v4l2_control(const std::string& name, const ReadV4l2& read) {
  if (name == kMains) {
    const auto menu = read(V4L2_CID_POWER_LINE_FREQUENCY);
    if (!menu) return std::nullopt;
    if (*menu == V4L2_CID_POWER_LINE_FREQUENCY_AUTO) return V4l2Control{std::nullopt, true};
    return V4l2Control{*menu == V4L2_CID_POWER_LINE_FREQUENCY_50HZ   ? 50.0
                       : *menu == V4L2_CID_POWER_LINE_FREQUENCY_60HZ ? 60.0
                                                                     : 0.0,
                       false};
  }
  const Known* known = find_known(name);
  if (!known) return std::nullopt;
  const auto value = read(known->id), automatic = read(known->switch_id);
  if (!value && !automatic) return std::nullopt;
  V4l2Control control;
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
