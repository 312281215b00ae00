// SPDX-License-Identifier: LGPL-2.1-or-later
// What a check of a rig says, in words and for programs.
#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "base/number_text.h"
#include "calibration/rig_check.h"

namespace lf {
namespace {

using nlohmann::ordered_json;
using Severity = Finding::Severity;
using State = RigCheck::State;

constexpr double kDegrees = 180 / M_PI;
constexpr double kScaleOff = 0.01;   // of 1
constexpr double kWorthSaying = 3;   // sigmas
constexpr double kLeastTurn = 3e-4;  // radians
constexpr double kLeastMove = 3e-4;  // metres

// "turned by 0.42 degrees (up 0.40, left 0.12)": the parts that are more than chance, the largest first.
// What is below `least` a rig may be off by all the time.
std::string parts(const Vec3& value, const Vec3& sigma, double least, double unit, const char* const names[3][2]) {
  std::array<int, 3> order = {0, 1, 2};
  std::ranges::sort(order, [&](int a, int b) { return std::abs(value[a]) > std::abs(value[b]); });
  std::string all;
  for (const int k : order)
    if (std::abs(value[k]) > std::max(least, kWorthSaying * sigma[k]) && std::abs(value[k]) > 0.1 * glm::length(value))
      all += (all.empty() ? "" : ", ") + format_text("%.2f %s", std::abs(value[k]) * unit, names[k][value[k] > 0]);
  return all;
}

std::string motion_of(const RigCheck::Camera& camera) {
  // About the axes to the right and down, and forward: what a positive angle does.
  static constexpr const char* kTurns[3][2] = {
      {"down", "up"}, {"to the left", "to the right"}, {"anticlockwise", "clockwise"}};
  static constexpr const char* kMoves[3][2] = {{"to the left", "to the right"}, {"up", "down"}, {"back", "forward"}};
  std::string all;
  if (const std::string turn = parts(camera.turn, camera.turn_sigma, kLeastTurn, kDegrees, kTurns); !turn.empty())
    all = "turned by " + turn + " (degrees)";
  if (const std::string move = parts(camera.move, camera.move_sigma, kLeastMove, 1e3, kMoves); !move.empty())
    all += (all.empty() ? "" : ", ") + ("moved by " + move + " (mm)");
  return all.empty() ? "" : ": " + all;
}

const char* name_of(State state) {
  switch (state) {
    case State::kHolds: return "holds";
    case State::kMoved: return "moved";
    case State::kLens: return "lens";
    case State::kUnknown: break;
  }
  return "unknown";
}

std::string name_of(const Rig& rig, uint32_t id) {
  const auto index = rig.index_of_id(id);
  const std::string name = index ? rig.cameras[*index].name : "";
  return "camera " + std::to_string(id) + (name.empty() ? "" : " (" + name + ")");
}

}  // namespace

std::vector<Finding> diagnose_check(const Rig& rig, const RigCheck& check, double bar_length) {
  std::vector<Finding> findings;
  if (check.is_lost) {
    findings.push_back({Severity::kError, "rig-lost",
                        "so many cameras are off that nothing tells which of them moved: calibrate the rig anew"});
  } else {
    for (const RigCheck::Camera& camera : check.cameras) {
      const std::string who = name_of(rig, camera.id);
      if (camera.state == State::kMoved)
        findings.push_back({Severity::kError, "moved-camera",
                            format_text("%s has moved, its picture by %.1f pixels%s. Put it back, or calibrate anew",
                                        who.c_str(), camera.shift_px, motion_of(camera).c_str())});
      if (camera.state == State::kLens)
        findings.push_back(
            {Severity::kError, "changed-lens",
             format_text(
                 "%s: its focal length has changed by %+.1f %%, its picture by %.1f pixels: has somebody turned focus "
                 "or zoom, or is its focus automatic? Calibrate anew once it stays",
                 who.c_str(), 100 * camera.focal_change, camera.shift_px)});
    }
    if (check.shift_px > kLeastShift)
      findings.push_back(
          {Severity::kError, "rig-off",
           format_text(
               "all cameras are off by %.1f pixels or so, each otherwise: the rig was bent, or is not as good as it "
               "says: calibrate anew",
               check.shift_px)});
  }
  for (const RigCheck::Camera& camera : check.cameras)
    if (camera.state == State::kUnknown)
      findings.push_back(
          {Severity::kWarning, "unseen-camera",
           format_text("%s saw the light at %zu places alone: nothing can be said of it. Move the light before "
                       "it, too",
                       name_of(rig, camera.id).c_str(), camera.sights)});
  if (check.bar && bar_length > 0 && std::abs(*check.bar / bar_length - 1) > kScaleOff)
    findings.push_back({Severity::kWarning, "wrong-scale",
                        format_text("the bar measures %.1f mm by this rig, not %.1f: %s", 1e3 * *check.bar,
                                    1e3 * bar_length, "the rig's scale is off, or the bar is another one")});
  return findings;
}

ordered_json check_report(const Rig& rig, const RigCheck& check, const std::vector<Finding>& findings) {
  const auto triple = [](const Vec3& v, double unit) {
    return ordered_json::array({v.x * unit, v.y * unit, v.z * unit});
  };
  ordered_json report = {{"format", "lightfield-check"}, {"version", 1},           {"from", "tracks"},
                         {"holds", check.holds()},       {"lights", check.lights}, {"residual_px", check.residual_px},
                         {"shift_px", check.shift_px}};
  if (check.bar) report["bar_metres"] = *check.bar;
  report["findings"] = ordered_json::array();
  for (const Finding& f : findings)
    report["findings"].push_back({{"severity", name_of(f.severity)}, {"code", f.code}, {"text", f.text}});
  report["cameras"] = ordered_json::array();
  for (const RigCheck::Camera& camera : check.cameras) {
    const auto index = rig.index_of_id(camera.id);
    report["cameras"].push_back({{"id", camera.id},
                                 {"name", index ? rig.cameras[*index].name : ""},
                                 {"state", name_of(camera.state)},
                                 {"sights", camera.sights},
                                 {"residual_px", camera.residual_px},
                                 {"shift_px", camera.shift_px},
                                 {"move_mm", triple(camera.move, 1e3)},
                                 {"move_sigma_mm", triple(camera.move_sigma, 1e3)},
                                 {"turn_deg", triple(camera.turn, kDegrees)},
                                 {"turn_sigma_deg", triple(camera.turn_sigma, kDegrees)},
                                 {"focal_change", camera.focal_change}});
  }
  return report;
}

}  // namespace lf
