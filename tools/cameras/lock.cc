// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/lock.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <nlohmann/json.hpp>

#include "base/text.h"
#include "cameras/doctor.h"
#include "cameras/rig_cameras.h"
#include "rig/rig_json.h"

namespace lf::cameras {
namespace {

constexpr std::array kAutomatic = {"exposure", "gain", "white_balance", "focus"};
// Factor that the check applies to a control. The brightness or colour should follow.
const std::map<std::string, double> kHypothesisFactors = {{"exposure", 0.5}, {"gain", 0.5}, {"white_balance", 0.6}};
// Minimum relative change of brightness or colour that proves an effect; larger than noise and lamp flicker.
constexpr double kResponse = 0.03;
constexpr double kDark = 2;  // brightness (0 to 255) below which controls cannot be checked

nlohmann::json with_controls(const Rig& rig, const Controls& controls) {
  nlohmann::json json = nlohmann::json::parse(rig_to_json(rig));
  std::map<uint32_t, Controls> all;
  for (const Camera& camera : rig.cameras) all[camera.id] = controls;
  put_controls(all, json);
  return json;
}

struct Colour {
  std::array<double, 3> mean = {NAN, NAN, NAN};
  std::string problem;
  double brightness() const { return 0.299 * mean[0] + 0.587 * mean[1] + 0.114 * mean[2]; }
};

Colour colour_of(GstSample* sample) {
  const Image rgb = rgb_of(sample);
  std::array<uint64_t, 3> sum = {};
  for (size_t i = 0; i < rgb.data().size(); i++) sum[i % 3] += rgb.data()[i];
  Colour colour;
  for (size_t i = 0; i < 3; i++)
    colour.mean[i] = 3.0 * static_cast<double>(sum[i]) / static_cast<double>(rgb.data().size());
  return colour;
}

std::vector<Colour> look(const Rig& rig, const Controls& controls, const LockOptions& options) {
  const TemporaryRig file(rig, with_controls(rig, controls), options.path, options.trusted);
  std::vector<GstSample*> latest(rig.cameras.size());
  std::mutex mutex;
  std::vector<Colour> colours(rig.cameras.size());
  {
    RigCameras cameras(file.rig(), file.path(), {.decode = false, .trusted = options.trusted},
                       [&](const CameraFrame& frame) {
                         const std::lock_guard lock(mutex);
                         if (latest[frame.camera]) gst_sample_unref(latest[frame.camera]);
                         latest[frame.camera] = gst_sample_ref(frame.sample);
                       });
    cameras.start();
    cameras.wait_for_frames(options.timeout);
    cameras.wait(options.settle);
    cameras.stop();
    for (const CameraIndex i : cameras.cameras()) colours[i].problem = cameras.problem(i);
  }
  for (size_t i = 0; i < latest.size(); i++) {
    if (!latest[i]) continue;
    try {
      const std::string problem = colours[i].problem;
      colours[i] = colour_of(latest[i]);
      colours[i].problem = problem;
    } catch (const Error& error) {
      colours[i].problem = error.what();
    }
    gst_sample_unref(latest[i]);
  }
  return colours;
}

bool responds(const std::string& control, const Colour& usual, const Colour& changed) {
  if (control == "white_balance")
    return std::abs(std::log((changed.mean[0] / changed.mean[2]) / (usual.mean[0] / usual.mean[2]))) > kResponse;
  return std::abs(changed.brightness() / usual.brightness() - 1) > kResponse;
}

}  // namespace

double flicker_free_exposure(double exposure, double mains) {
  const double half_wave = 0.5 / mains;
  return exposure < half_wave ? exposure : std::floor(exposure / half_wave + 1e-6) * half_wave;
}

ControlValues choose_controls(const Rig& rig, const LockOptions& options) {
  Rig one = rig_subset(rig, {options.reference});
  const std::string name = one.cameras[0].label();
  Controls automatic;
  for (const char* control : kAutomatic) automatic[control] = std::nullopt;
  const TemporaryRig file(one, with_controls(one, automatic), options.path, options.trusted);
  RigCameras cameras(file.rig(), file.path(), {.decode = false, .trusted = options.trusted}, {});
  cameras.start();
  cameras.wait_for_frames(options.timeout);
  cameras.wait(options.settle);
  if (cameras.frames(0) == 0)
    throw CameraFailure(cameras.problem(0).empty() ? name + " gives no frames" : cameras.problem(0));
  ControlValues values;
  g_autoptr(GstStructure) stats = cameras.stats(0);
  if (const GValue* all = gst_structure_get_value(stats, "control-values"))
    for (const char* control : kAutomatic) {
      double value = 0;
      if (gst_structure_get_double(gst_value_get_structure(all), control, &value)) values[control] = value;
    }
  cameras.stop();
  if (values.empty())
    throw Error(name +
                ": its source reports no exposure, gain, white balance or focus; set these controls in the web page of "
                "each camera, to the same values for all cameras");
  if (options.mains && values.contains("exposure"))
    values["exposure"] = flicker_free_exposure(values["exposure"], *options.mains);
  return values;
}

std::vector<StuckControl> find_stuck_controls(const Rig& rig, const ControlValues& controls, const LockOptions& options,
                                              const std::function<void(const std::string&)>& on_step) {
  std::vector<StuckControl> stuck;
  if (on_step) on_step("pictures with the controls as they are in the rig");
  const Controls all(controls.begin(), controls.end());
  const std::vector<Colour> usual = look(rig, all, options);
  std::vector<bool> works(rig.cameras.size(), true);
  for (CameraIndex i = 0; i < usual.size(); i++) {
    works[i] = !std::isnan(usual[i].mean[0]) && usual[i].brightness() > kDark;
    if (works[i]) continue;
    const bool dark = usual[i].problem.empty() && !std::isnan(usual[i].mean[0]);
    stuck.push_back({i, "",
                     dark ? "its picture is black, so its controls can't be checked"
                          : usual[i].problem + ": " + remedy_for(rig.cameras[i], usual[i].problem)});
  }
  for (const auto& [control, value] : controls) {
    const auto factor = kHypothesisFactors.find(control);
    if (factor == kHypothesisFactors.end() || value == 0) continue;
    Controls other = all;
    other[control] = value * factor->second;
    if (on_step) on_step("pictures with another " + control);
    const std::vector<Colour> changed = look(rig, other, options);
    for (CameraIndex i = 0; i < changed.size(); i++)
      if (works[i] && !std::isnan(changed[i].mean[0]) && !responds(control, usual[i], changed[i]))
        stuck.push_back({i, control, "the picture stays the same"});
  }
  return stuck;
}

}  // namespace lf::cameras
