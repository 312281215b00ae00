// SPDX-License-Identifier: LGPL-2.1-or-later
#include "solution_output.h"

#include <algorithm>
#include <filesystem>
#include <numeric>

#include "base/json_value.h"
#include "base/text.h"
#include "calibration/diagnosis.h"
#include "calibration/report.h"
#include "rig/rig_json.h"
#include "terminal.h"

namespace {

using nlohmann::json;

void print_summary(const json& report) {
  for (const json& trial : report["models"])
    terminal::print("tried       %-18s BIC %9.1f  transfer %s%s\n", trial["model"].get<std::string>().c_str(),
                    trial["bic"].get<double>(),
                    trial["transfer_px"].is_null() ? "-" : (trial["transfer_px"].dump().substr(0, 6) + " px").c_str(),
                    trial["chosen"].get<bool>() ? "  chosen" : "");
  terminal::print("distortion  %s\n", report["model"].get<std::string>().c_str());
  terminal::print(
      "residuals   mean %.3f px, median %.3f px, rms %.3f px over all; rms %.3f px without outliers (expected "
      "%.3f)\n",
      report["mean_px"].get<double>(), report["median_px"].get<double>(), report["rms_px"].get<double>(),
      report["inliers"]["rms_px"].get<double>(), report["expected_rms_px"].get<double>());
  terminal::print("outliers    %zu of %zu observations\n", report["outliers"].get<size_t>(),
                  report["observations"].get<size_t>());
  for (const json& finding : report["findings"])
    terminal::print("%s: %s\n", finding["severity"].get<std::string>().c_str(),
                    finding["text"].get<std::string>().c_str());
}

void print_clocks(const std::vector<lf::CameraClock>& clocks) {
  double least = 0, most = 0, sigma = 0;
  size_t known = 0;
  for (const lf::CameraClock& clock : clocks) {
    if (!clock.known) continue;
    known++;
    least = std::min(least, clock.offset), most = std::max(most, clock.offset), sigma = std::max(sigma, clock.sigma);
  }
  if (known == 0) return;
  terminal::print("clocks      offsets %+.2f to %+.2f ms, each +-%.2f ms at most\n", 1e3 * least, 1e3 * most,
                  1e3 * sigma);
}

void require_all(const SolvedCameras& solved, const std::string& out) {
  const auto& cameras = solved.solution.scene.cameras;
  std::string missing;
  size_t found = 0;
  for (size_t i = 0; i < cameras.size(); i++) {
    found += cameras[i].used;
    if (!cameras[i].used) missing += (missing.empty() ? "" : ", ") + std::to_string(solved.tracks.cameras[i].id);
  }
  terminal::print("%s: %zu of %zu cameras\n", out.c_str(), found, cameras.size());
  if (!missing.empty())
    throw lf::Error(std::to_string(cameras.size() - found) + " of " + std::to_string(cameras.size()) +
                    " cameras are missing in " + out + " (" + missing + "): see the findings above");
}

}  // namespace

nlohmann::json load_prior(const std::string& path, lf::SolveOptions& options) {
  json original = lf::parse_json(lf::read_text_file(path), path);
  options.prior = lf::load_rig(path);
  for (const lf::JsonValue& camera : lf::JsonValue(original, path).at("cameras").elements())
    options.prior_covariances.push_back(lf::parse_camera_covariance(camera));
  return original;
}

void save_solution(const SolvedCameras& solved, json original, const std::string& program, const std::string& out,
                   const std::string& report_file, SolveProgress& progress) {
  const auto& [solution, tracks, options, placement_options, lights, boards, names] = solved;
  const std::vector<lf::CameraClock> clocks = lights   ? lights->clocks
                                              : boards ? boards->clocks
                                                       : std::vector<lf::CameraClock>(tracks.cameras.size());
  const lf::Placement placement = lf::place_solution(solution, tracks, options, placement_options);
  std::vector<lf::Finding> findings = diagnose(solution, tracks, options, placement);
  for (lf::Finding& finding : lights   ? lf::diagnose_clocks(*lights)
                              : boards ? lf::diagnose_times(*boards)
                                       : std::vector<lf::Finding>())
    findings.push_back(std::move(finding));
  auto report = calibration_report(solution, tracks, placement, findings);
  if (lights) lf::add_clocks(*lights, report);
  if (boards) lf::add_times(*boards, report);
  original = lf::rig_record(solution, tracks, placement, std::move(original), program);
  lf::Rig rig = lf::make_rig(solution, tracks, options, placement);
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    const auto index = rig.index_of_id(tracks.cameras[i].id);
    if (!index) continue;
    if (clocks[i].known) rig.cameras[*index].time_offset = clocks[i].offset;
    if (i < names.size()) rig.cameras[*index].name = names[i];
  }
  lf::add_details(solution, tracks, placement, rig, report);
  progress.finish();
  lf::rebase_paths(rig, std::filesystem::path(out).parent_path().string());
  lf::save_rig(rig, out, &original);
  if (!report_file.empty()) lf::write_text_file(report.dump(1) + "\n", report_file);
  print_summary(json::parse(report.dump()));
  print_clocks(clocks);
  if (const size_t reflections =
          lights ? std::accumulate(lights->reflections.begin(), lights->reflections.end(), size_t{0}) : 0)
    terminal::print("reflections %zu detections left out\n", reflections);
  require_all(solved, out);
}
