// SPDX-License-Identifier: LGPL-2.1-or-later
#include "report_data.h"

#include <algorithm>
#include <cmath>
#include <regex>
#include <set>

#include <Eigen/Eigenvalues>
#include <nlohmann/json.hpp>

#include "base/maths.h"
#include "base/text.h"

namespace {

using nlohmann::json;

// radius, in standard deviations, of a sphere with 95 % of a 3D normal distribution
constexpr double kNinetyFive = 2.7955;

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
                      ": is not a report of lf-calibrate; give the --json files of track, solve, colour and check");
    for (const json& finding : report.at("findings"))
      findings.push_back({finding.at("severity"), finding.at("code"), finding.at("text")});
  } catch (const json::exception& e) {
    throw lf::Error(name + ": the report is damaged or comes from another version; run its calibration step again (" +
                    e.what() + ")");
  }
  std::ranges::sort(cameras, {}, &Camera::id);
}

std::vector<ReportData::Finding> ReportData::findings_of(uint32_t camera) const {
  // Finds the camera ids in texts such as "camera 3: ..." and "cameras 3 and 7 are ...".
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
    Camera::SolveResult& solved = one.solved.emplace();
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
    solved.readout_ms = number(value, "readout_ms");
    if (solved.readout_ms == 0.0) solved.readout_ms.reset();
    solved.readout_sigma_ms = number(value, "readout_sigma_ms");
    solved.reflections = number(value, "reflections").value_or(0);
  }
}

void ReportData::add_colour(const json& report) {
  Colour& c = colour.emplace();
  const auto row = [](const std::string& what, const json& differences, bool chosen) {
    return Colour::Row{what, differences.at("median"), differences.at("p95"), chosen};
  };
  c.from = report.at("from").get<std::string>();
  c.before = row("uncorrected", report.at("before"), false);
  c.after = row("corrected", report.at("after"), true);
  c.rows.push_back(c.before);
  for (const json& trial : report.at("trials"))
    c.rows.push_back(row(trial.at("terms"), trial.at("held_out"), trial.at("terms") == report.at("terms")));
  for (const json& value : report.at("cameras"))
    camera(value).coloured = Camera::ColourResult{value.at("corrected"), value.at("stuck"), value.at("gain"),
                                                  value.at("rms"), value.at("clipped")};
}

void ReportData::add_check(const json& report) {
  check = Check{report.at("holds"), report.at("from"), number(report, "residual_px")};
  for (const json& value : report.at("cameras"))
    camera(value).checked = Camera::CheckResult{value.at("state"), number(value, "shift_px").value_or(0)};
}

namespace {

using lf::format_text;
using Grade = ReportVerdict::Grade;

constexpr double kMinCoverageShare = 0.5;           // share of the image
constexpr double kLargeResidual = 2.5;              // relative to the median camera,
constexpr double kSmall = 0.1;                      // pixels
constexpr double kManyOutliers = 0.2;               // share of a camera's observations
constexpr double kLargeEllipsoid = 3;               // relative to the median camera
constexpr double kColourOff = 2, kColourLarge = 2;  // levels, 0..255; relative to the median camera
constexpr size_t kMaxAdvice = 8;

struct TypicalErrors {
  double rms = 0, ellipsoid = 0, colour = 0;
};

TypicalErrors typical_errors(const ReportData& data) {
  std::vector<double> rms, ellipsoids, colours;
  for (const ReportData::Camera& camera : data.cameras) {
    if (camera.solved && camera.solved->found) rms.push_back(camera.solved->rms_px);
    if (const auto size = camera.ellipsoid()) ellipsoids.push_back(*size);
    if (camera.coloured && !camera.coloured->stuck) colours.push_back(camera.coloured->rms);
  }
  const auto middle = [](std::vector<double>& v) { return v.empty() ? 0 : lf::median(std::move(v)); };
  return {middle(rms), middle(ellipsoids), middle(colours)};
}

class CameraGrader {
 public:
  CameraGrader(const ReportData& data, const ReportData::Camera& camera, const TypicalErrors& typical)
      : data_(data), camera_(camera), typical_(typical) {}

  ReportVerdict::Camera run() {
    if (!camera_.trouble.empty()) add_reason(Grade::kBad, camera_.trouble);
    for (const ReportData::Finding& finding : data_.findings_of(camera_.id))
      if (finding.severity != "note") {
        // A calibration with colour problems is valid, but cameras with such problems spoil rendered views.
        const bool spoils = finding.code == "stuck-exposure" || finding.code == "black-camera";
        add_reason(finding.severity == "error" || spoils ? Grade::kBad : Grade::kFair, finding.text);
      }
    if (camera_.solved) geometry(*camera_.solved);
    if (camera_.coloured) colour(*camera_.coloured);
    if (camera_.checked) check(*camera_.checked);
    if (verdict_.grade != Grade::kBad)
      for (const std::string& remark : camera_.remarks) add_reason(Grade::kFair, remark);
    std::ranges::stable_sort(reasons_, [](const auto& a, const auto& b) { return a.first > b.first; });
    for (auto& [grade, what] : reasons_) verdict_.reasons.push_back(std::move(what));
    return std::move(verdict_);
  }

 private:
  // The page shows a reason beside the camera's name, so the name is removed from the reason.
  void add_reason(Grade grade, std::string what) {
    verdict_.grade = std::max(verdict_.grade, grade);
    const std::string name = "camera " + std::to_string(camera_.id);
    if (what.starts_with(name)) {
      what = what.substr(name.size());
      if (what.starts_with(" (") && what.find(')') != std::string::npos) what = what.substr(what.find(')') + 1);
      what = what.substr(std::min(what.find_first_not_of(": "), what.size()));
    }
    for (const auto& [other, before] : reasons_)
      if (before == what) return;
    reasons_.emplace_back(grade, what);
  }

  void geometry(const ReportData::Camera::SolveResult& solved) {
    if (!solved.found) {
      if (verdict_.grade != Grade::kBad)
        add_reason(Grade::kBad, "could not be placed, so it is not in the calibrated rig");
      return;
    }
    if (solved.rms_px > kSmall && solved.rms_px > kLargeResidual * typical_.rms)
      add_reason(Grade::kFair,
                 format_text("residuals of %.2f px, %.1f times the median: did it move, or is autofocus on?",
                             solved.rms_px, solved.rms_px / typical_.rms));
    if (solved.outliers > kManyOutliers * solved.observations)
      add_reason(Grade::kFair, format_text("%.0f %% of its observations are outliers",
                                           100 * solved.outliers / std::max(1.0, solved.observations)));
    if (const auto covered = camera_.covered(); covered && *covered < kMinCoverageShare)
      add_reason(Grade::kFair, format_text("the light covered %.0f %% of the image: its lens is extrapolated elsewhere",
                                           100 * *covered));
    if (const auto size = camera_.ellipsoid();
        size && *size > kLargeEllipsoid * typical_.ellipsoid && typical_.ellipsoid > 0)
      add_reason(Grade::kFair, format_text("its position is uncertain by %.1f mm (median camera: %.1f mm)", 1e3 * *size,
                                           1e3 * typical_.ellipsoid));
  }

  void colour(const ReportData::Camera::ColourResult& coloured) {
    if (coloured.stuck && verdict_.grade != Grade::kBad)
      add_reason(Grade::kBad,
                 format_text("its exposure is stuck: %.0f %% of the median brightness", 100 * coloured.gain));
    else if (!coloured.stuck && !coloured.corrected)
      add_reason(Grade::kFair, "its colours are not corrected: it saw too little of the chart, or overlaps too little");
    else if (!coloured.stuck && coloured.rms > kColourOff && coloured.rms > kColourLarge * typical_.colour)
      add_reason(Grade::kFair, format_text("its colours differ from other cameras by %.1f of 255", coloured.rms));
  }

  void check(const ReportData::Camera::CheckResult& checked) {
    if (verdict_.grade == Grade::kBad || checked.state == "holds") return;
    if (checked.state == "moved" || checked.state == "lens")
      add_reason(Grade::kBad, format_text("its image has moved by %.1f pixels since calibration", checked.shift_px));
    else if (checked.state == "unknown" && reasons_.empty())
      add_reason(Grade::kFair, "the check had too little data of this camera");
  }

  const ReportData& data_;
  const ReportData::Camera& camera_;
  const TypicalErrors& typical_;
  ReportVerdict::Camera verdict_;
  std::vector<std::pair<Grade, std::string>> reasons_;
};

std::string headline_of(const ReportData& data, const ReportVerdict& verdict) {
  size_t bad = 0, fair = 0;
  for (const ReportVerdict::Camera& camera : verdict.cameras)
    bad += camera.grade == Grade::kBad, fair += camera.grade == Grade::kFair;
  const size_t all = verdict.cameras.size();
  const auto count = [](size_t n) { return std::to_string(n) + (n == 1 ? " camera" : " cameras"); };
  if (data.check && !data.check->holds) return data.solve ? "The rig no longer holds" : "The rig does not hold";
  if (bad > 0) return count(bad) + " of " + std::to_string(all) + (bad == 1 ? " needs" : " need") + " attention";
  if (verdict.grade == Grade::kBad) return "The calibration cannot be trusted yet";
  if (fair > 0) return "Fit for use; " + count(fair) + " of " + std::to_string(all) + " could be better";
  if (verdict.grade == Grade::kFair) return "Fit for use; a better recording would reduce the uncertainty";
  if (data.check && !data.solve) return "The rig holds";
  return "All " + count(all) + (all == 1 ? " is good" : " are good");
}

}  // namespace

const char* name_of(Grade grade) { return grade == Grade::kGood ? "good" : grade == Grade::kFair ? "fair" : "bad"; }

ReportVerdict grade_calibration(const ReportData& data) {
  ReportVerdict verdict;
  const TypicalErrors typical = typical_errors(data);
  std::set<std::string> said, of_cameras;
  for (const ReportData::Camera& camera : data.cameras) {
    verdict.cameras.push_back(CameraGrader(data, camera, typical).run());
    for (const ReportData::Finding& finding : data.findings_of(camera.id)) of_cameras.insert(finding.text);
  }
  const auto add = [&](const std::string& what) {
    if (verdict.next.size() < kMaxAdvice && said.insert(what).second) verdict.next.push_back(what);
  };
  const auto add_cameras = [&](Grade grade) {
    for (size_t i = 0; i < data.cameras.size(); i++) {
      if (verdict.cameras[i].grade != grade) continue;
      verdict.grade = std::max(verdict.grade, grade);
      const std::string& reason = verdict.cameras[i].reasons.front();
      add("camera " + data.cameras[i].title() + ": " + reason);
    }
  };
  add_cameras(Grade::kBad);
  for (const char* severity : {"error", "warning"})
    for (const ReportData::Finding& finding : data.findings) {
      // "no-gain" means that the cameras already agree.
      if (finding.severity != severity || finding.code == "no-gain" || of_cameras.contains(finding.text)) continue;
      verdict.grade = std::max(verdict.grade, finding.severity == "error" ? Grade::kBad : Grade::kFair);
      add(finding.text);
    }
  add_cameras(Grade::kFair);
  verdict.headline = headline_of(data, verdict);
  return verdict;
}
