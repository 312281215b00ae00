// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "base/number_text.h"
#include "cameras/doctor.h"
#include "cameras/rig_cameras.h"

namespace lf::cameras {
namespace {

using nlohmann::ordered_json;

constexpr size_t kMostLines = 24;

std::string size_of(const Camera& camera) { return std::to_string(camera.width) + "x" + std::to_string(camera.height); }

std::string line_of(const Rig& rig, const CameraExam& exam) {
  const Camera& camera = rig.cameras[exam.camera];
  std::string line = format_text("%-16s", name_of(camera).c_str());
  if (exam.times.frames < 3) return line + (exam.problem.empty() ? " no frames\n" : " does not work\n");
  line += format_text(" %8.2f  %-12s %-9s %5zu %6.0f ms", exam.times.rate(),
                      exam.format.empty() ? "-" : exam.format.c_str(), size_of(camera).c_str(), exam.times.missing,
                      1e3 * exam.delay);
  line += std::isnan(exam.phase) ? "         -" : format_text(" %+6.1f ms", 1e3 * exam.phase);
  line += format_text(" %5.1f ms %6.0f", 1e3 * exam.times.jitter, exam.brightness);
  return line + "\n";
}

constexpr char kHeader[] =
    "camera           frames/s  format       size      lost     delay      skew   jitter  light\n";

// Healthy cameras of a large array, those that deliver the same in one line.
std::string groups_of(const Rig& rig, const Exam& exam, const std::set<std::string>& troubled) {
  struct Group {
    size_t count = 0;
    double least = INFINITY, most = 0, longest = 0;
  };
  std::map<std::string, Group> groups;
  std::string lines;
  for (const CameraExam& camera : exam.cameras) {
    const Camera& what = rig.cameras[camera.camera];
    if (troubled.contains("camera " + name_of(what))) {
      lines += line_of(rig, camera);
      continue;
    }
    Group& group = groups[(camera.format.empty() ? "" : camera.format + " ") + size_of(what)];
    group.count++;
    group.least = std::min(group.least, camera.times.rate());
    group.most = std::max(group.most, camera.times.rate());
    group.longest = std::max(group.longest, camera.delay);
  }
  for (const auto& [what, group] : groups)
    lines += format_text("%zu others: %s, %.2f to %.2f frames/s, delay up to %.0f ms\n", group.count, what.c_str(),
                         group.least, group.most, 1e3 * group.longest);
  return lines;
}

ordered_json number(double value) { return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr); }

ordered_json json_of(const std::vector<LinkLoad>& loads) {
  ordered_json all = ordered_json::array();
  for (const LinkLoad& load : loads)
    all.push_back({{"link", load.link.name},
                   {"cameras", load.cameras.size()},
                   {"bytes_per_second", load.needed},
                   {"capacity", load.link.capacity > 0 ? ordered_json(load.link.capacity) : ordered_json(nullptr)}});
  return all;
}

}  // namespace

std::string links_of(const std::vector<LinkLoad>& loads, const char* when) {
  std::string lines;
  for (const LinkLoad& load : loads) {
    lines += format_text("%s: %s: %zu camera%s, %.1f", load.link.name.c_str(), when, load.cameras.size(),
                         load.cameras.size() == 1 ? "" : "s", load.needed / 1e6);
    lines += load.link.capacity > 0 ? format_text(" of %.0f MB/s\n", load.link.capacity / 1e6) : " MB/s\n";
  }
  return lines;
}

std::string page_of(const Rig& rig, const Exam& exam) {
  std::set<std::string> troubled;
  for (const Finding& finding : exam.findings) troubled.insert(finding.cameras);
  std::string page = links_of(exam.measured, "measured") + kHeader;
  if (exam.cameras.size() <= kMostLines)
    for (const CameraExam& camera : exam.cameras) page += line_of(rig, camera);
  else
    page += groups_of(rig, exam, troubled);
  if (exam.cameras.size() > 1 && exam.skew.spread > 0)
    page += format_text("frames of one time lie up to %.1f ms apart; at 1 m/s things are %.0f mm off between cameras\n",
                        1e3 * exam.skew.spread, 1e3 * exam.skew.spread);
  for (const Finding& finding : exam.findings)
    page += std::string(finding.error ? "error: " : "warning: ") + finding.cameras + ": " + finding.what + "\n   " +
            finding.remedy + "\n";
  const size_t count = exam.cameras.size(), errors = static_cast<size_t>(exam.errors());
  page +=
      format_text("%zu camera%s, %zu error%s, %zu warning%s\n", count, count == 1 ? "" : "s", errors,
                  errors == 1 ? "" : "s", exam.findings.size() - errors, exam.findings.size() - errors == 1 ? "" : "s");
  return page;
}

std::string json_of(const Rig& rig, const Exam& exam) {
  ordered_json cameras = ordered_json::array(), findings = ordered_json::array();
  for (const CameraExam& one : exam.cameras) {
    const Camera& camera = rig.cameras[one.camera];
    ordered_json controls = ordered_json::object();
    for (const auto& [name, value] : one.controls) controls[name] = value ? ordered_json(*value) : ordered_json("auto");
    cameras.push_back({{"id", camera.id},
                       {"name", camera.name},
                       {"problem", one.problem},
                       {"width", camera.width},
                       {"height", camera.height},
                       {"format", one.format},
                       {"frames", one.times.frames},
                       {"frames_per_second", one.times.rate()},
                       {"missing", one.times.missing},
                       {"left_undecoded", one.left_undecoded},
                       {"delay", one.delay},
                       {"skew", number(one.phase)},
                       {"jitter", one.times.jitter},
                       {"stamps", one.stamps},
                       {"bytes_per_second", one.bytes_per_second},
                       {"brightness", number(one.brightness)},
                       {"controls", controls}});
  }
  for (const Finding& finding : exam.findings)
    findings.push_back({{"severity", finding.error ? "error" : "warning"},
                        {"about", finding.cameras},
                        {"what", finding.what},
                        {"remedy", finding.remedy}});
  return ordered_json{{"cameras", cameras},
                      {"links", {{"planned", json_of(exam.planned)}, {"measured", json_of(exam.measured)}}},
                      {"skew", exam.skew.spread},
                      {"findings", findings}}
      .dump(1);
}

}  // namespace lf::cameras
