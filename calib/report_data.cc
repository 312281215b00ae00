// SPDX-License-Identifier: LGPL-2.1-or-later
#include "report_data.h"

#include <algorithm>
#include <cmath>
#include <regex>

#include <Eigen/Eigenvalues>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace {

using nlohmann::json;

constexpr double kNinetyFive = 2.7955;  // sigmas: 95 % of normal vectors of three dimensions are within

std::optional<double> number(const json& object, const char* key) {
  return object.contains(key) && object[key].is_number() ? std::optional(object[key].get<double>()) : std::nullopt;
}

}  // namespace

std::optional<double> ReportData::Camera::covered() const {
  if (!solved || solved->coverage.empty()) return std::nullopt;
  const auto some = std::ranges::count_if(solved->coverage, [](double count) { return count > 0; });
  return static_cast<double>(some) / static_cast<double>(solved->coverage.size());
}

std::optional<double> ReportData::Camera::ellipsoid() const {
  if (!solved || !solved->position) return std::nullopt;
  Eigen::Matrix3d matrix;
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++) matrix(r, c) = solved->covariance[static_cast<size_t>(r)][static_cast<size_t>(c)];
  const double most = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(matrix).eigenvalues().maxCoeff();
  return kNinetyFive * std::sqrt(std::max(0.0, most));
}

void ReportData::add(const json& report, const std::string& name) {
  try {
    const std::string format = report.is_object() && report.contains("format") ? report["format"] : json("");
    if (format == "lightfield-track-report")
      add_track(report);
    else if (format == "lightfield-calibration")
      add_solve(report);
    else if (format == "lightfield-colour-report")
      add_colour(report);
    else if (format == "lightfield-check")
      add_check(report);
    else
      throw lf::Error(name +
                      ": is no report of lf-calibrate: give what --json of track, solve, colour and check wrote");
    for (const json& finding : report.at("findings"))
      findings.push_back({finding.at("severity"), finding.at("code"), finding.at("text")});
  } catch (const json::exception& e) {
    throw lf::Error(name + ": is damaged, or of another version: run its step again (" + e.what() + ")");
  }
  std::ranges::sort(cameras, {}, &Camera::id);
}

std::vector<ReportData::Finding> ReportData::findings_of(uint32_t camera) const {
  // "camera 3: ...", "cameras 3 and 7 are ..."
  const std::regex named("\\bcameras? ((\\d+)( \\([^)]*\\))?(, | and )?)*\\b" + std::to_string(camera) + "\\b");
  std::vector<Finding> own;
  for (const Finding& finding : findings)
    if (std::regex_search(finding.text, named)) own.push_back(finding);
  return own;
}

ReportData::Camera& ReportData::camera(const json& value) {
  const uint32_t id = value.at("id");
  auto found = std::ranges::find(cameras, id, &Camera::id);
  if (found == cameras.end()) {
    cameras.push_back({});
    found = cameras.end() - 1;
    found->id = id;
  }
  if (value.contains("name")) found->name = value["name"].get<std::string>();
  return *found;
}

void ReportData::add_track(const json& report) {
  for (const json& value : report.at("cameras")) {
    Camera& one = camera(value);
    one.trouble = value.at("trouble").get<std::string>();
    one.remarks = value.at("remarks").get<std::vector<std::string>>();
  }
}

void ReportData::add_solve(const json& report) {
  Solve& s = solve.emplace();
  s.rms_px = report.at("inliers").at("rms_px");
  s.expected_px = report.at("expected_rms_px");
  s.observations = report.at("observations");
  s.outliers = report.at("outliers");
  s.model = report.at("model").get<std::string>();
  s.scale_from = report.at("scale_from").get<std::string>();
  for (const json& trial : report.at("models"))
    s.trials.push_back({trial.at("model"), trial.at("bic"), number(trial, "transfer_px"), trial.at("chosen")});
  s.near_m = report.at("lights").at("near_m"), s.far_m = report.at("lights").at("far_m");
  s.columns = report.at("coverage").at("columns"), s.rows = report.at("coverage").at("rows");
  for (const json& depth : report.at("projection"))
    s.projection.push_back({depth.at("depth_m"), depth.at("median_px"), depth.at("worst_px")});
  for (const json& mode : report.at("soft_modes"))
    s.modes.push_back(
        {mode.at("text"), mode.at("sigma").get<double>() / mode.at("limit").get<double>(), mode.at("soft")});
  for (const json& value : report.at("cameras")) {
    Camera& one = camera(value);
    one.width = value.at("width"), one.height = value.at("height");
    Camera::Solved& solved = one.solved.emplace();
    solved.found = value.at("found");
    solved.observations = value.at("observations");
    solved.outliers = value.at("outliers");
    solved.rms_px = value.at("rms_px");
    solved.coverage = value.at("coverage").get<std::vector<double>>();
    solved.residuals = value.at("residuals").get<std::vector<std::array<double, 4>>>();
    if (value.contains("position")) {
      solved.position = value["position"].get<std::array<double, 3>>();
      solved.covariance = value.at("position_covariance").get<std::array<std::array<double, 3>, 3>>();
    }
    solved.offset_ms = number(value, "time_offset_ms");
    solved.offset_sigma_ms = number(value, "time_offset_sigma_ms");
    solved.reflections = number(value, "reflections").value_or(0);
  }
}

void ReportData::add_colour(const json& report) {
  Colour& c = colour.emplace();
  const auto row = [](const std::string& what, const json& differences, bool chosen) {
    return Colour::Row{what, differences.at("median"), differences.at("p95"), chosen};
  };
  c.from = report.at("from").get<std::string>();
  c.before = row("as they are", report.at("before"), false);
  c.after = row("corrected", report.at("after"), true);
  c.rows.push_back(c.before);
  for (const json& trial : report.at("trials"))
    c.rows.push_back(row(trial.at("terms"), trial.at("held_out"), trial.at("terms") == report.at("terms")));
  for (const json& value : report.at("cameras"))
    camera(value).coloured = Camera::Coloured{value.at("corrected"), value.at("stuck"), value.at("gain"),
                                              value.at("rms"), value.at("clipped")};
}

void ReportData::add_check(const json& report) {
  check = Check{report.at("holds"), report.at("from"), number(report, "residual_px")};
  for (const json& value : report.at("cameras"))
    camera(value).checked = Camera::Checked{value.at("state"), number(value, "shift_px").value_or(0)};
}
