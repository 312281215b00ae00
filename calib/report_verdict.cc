// SPDX-License-Identifier: LGPL-2.1-or-later
#include "report_verdict.h"
#include "base/number_text.h"

#include <algorithm>
#include <set>

#include "base/percentiles.h"

namespace {

using lf::format_text;
using Grade = ReportVerdict::Grade;

constexpr double kLeastCoverage = 0.5;              // share of a picture
constexpr double kLargeResidual = 2.5;              // times the median camera's,
constexpr double kSmall = 0.1;                      // pixels: below, a residual is no matter
constexpr double kManyOutliers = 0.2;               // share of a camera's observations
constexpr double kLargeEllipsoid = 3;               // times the median camera's
constexpr double kColourOff = 2, kColourLarge = 2;  // levels of 255; times the median camera's
constexpr size_t kMostNext = 8;

struct Usual {
  double rms = 0, ellipsoid = 0, colour = 0;  // medians of all cameras
};

Usual usual_of(const ReportData& data) {
  std::vector<double> rms, ellipsoids, colours;
  for (const ReportData::Camera& camera : data.cameras) {
    if (camera.solved && camera.solved->found) rms.push_back(camera.solved->rms_px);
    if (const auto size = camera.ellipsoid()) ellipsoids.push_back(*size);
    if (camera.coloured && !camera.coloured->stuck) colours.push_back(camera.coloured->rms);
  }
  const auto middle = [](std::vector<double>& v) { return v.empty() ? 0 : lf::median(std::move(v)); };
  return {middle(rms), middle(ellipsoids), middle(colours)};
}

class CameraJudge {
 public:
  CameraJudge(const ReportData& data, const ReportData::Camera& camera, const Usual& usual)
      : data_(data), camera_(camera), usual_(usual) {}

  ReportVerdict::Camera run() {
    if (!camera_.trouble.empty()) say(Grade::kBad, camera_.trouble);
    for (const ReportData::Finding& finding : data_.findings_of(camera_.id))
      if (finding.severity != "note") {
        // Colours alone end no calibration, but these cameras spoil pictures.
        const bool spoils = finding.code == "stuck-exposure" || finding.code == "black-camera";
        say(finding.severity == "error" || spoils ? Grade::kBad : Grade::kFair, finding.text);
      }
    if (camera_.solved) geometry(*camera_.solved);
    if (camera_.coloured) colour(*camera_.coloured);
    if (camera_.checked) check(*camera_.checked);
    if (verdict_.grade != Grade::kBad)
      for (const std::string& remark : camera_.remarks) say(Grade::kFair, remark);
    std::ranges::stable_sort(said_, [](const auto& a, const auto& b) { return a.first > b.first; });
    for (auto& [grade, what] : said_) verdict_.reasons.push_back(std::move(what));
    return std::move(verdict_);
  }

 private:
  // Reasons stand beside the camera's name.
  void say(Grade grade, std::string what) {
    verdict_.grade = std::max(verdict_.grade, grade);
    const std::string name = "camera " + std::to_string(camera_.id);
    if (what.starts_with(name)) {
      what = what.substr(name.size());
      if (what.starts_with(" (") && what.find(')') != std::string::npos) what = what.substr(what.find(')') + 1);
      what = what.substr(std::min(what.find_first_not_of(": "), what.size()));
    }
    for (const auto& [other, before] : said_)
      if (before == what) return;
    said_.emplace_back(grade, what);
  }

  void geometry(const ReportData::Camera::Solved& solved) {
    if (!solved.found) {
      if (verdict_.grade != Grade::kBad) say(Grade::kBad, "is not in the rig: its recording fits nowhere");
      return;
    }
    if (solved.rms_px > kSmall && solved.rms_px > kLargeResidual * usual_.rms)
      say(Grade::kFair,
          format_text("residuals of %.2f px, %.1f times most others': did it move, or is its focus automatic?",
                      solved.rms_px, solved.rms_px / usual_.rms));
    if (solved.outliers > kManyOutliers * solved.observations)
      say(Grade::kFair, format_text("%.0f %% of what it saw does not fit",
                                    100 * solved.outliers / std::max(1.0, solved.observations)));
    if (const auto covered = camera_.covered(); covered && *covered < kLeastCoverage)
      say(Grade::kFair,
          format_text("the light came to %.0f %% of its picture: its lens is guessed in the rest", 100 * *covered));
    if (const auto size = camera_.ellipsoid();
        size && *size > kLargeEllipsoid * usual_.ellipsoid && usual_.ellipsoid > 0)
      say(Grade::kFair, format_text("its place is known to %.1f mm, that of most others to %.1f", 1e3 * *size,
                                    1e3 * usual_.ellipsoid));
  }

  void colour(const ReportData::Camera::Coloured& coloured) {
    if (coloured.stuck && verdict_.grade != Grade::kBad)
      say(Grade::kBad, format_text("its exposure is stuck: %.0f %% as bright as most others", 100 * coloured.gain));
    else if (!coloured.stuck && !coloured.corrected)
      say(Grade::kFair, "its colours are not corrected: too little was seen of the chart, or in common with others");
    else if (!coloured.stuck && coloured.rms > kColourOff && coloured.rms > kColourLarge * usual_.colour)
      say(Grade::kFair, format_text("its colours stay %.1f of 255 off the others'", coloured.rms));
  }

  void check(const ReportData::Camera::Checked& checked) {
    if (verdict_.grade == Grade::kBad || checked.state == "holds") return;
    if (checked.state == "moved" || checked.state == "lens")
      say(Grade::kBad, format_text("its picture has moved by %.1f pixels since", checked.shift_px));
    else if (checked.state == "unknown" && said_.empty())
      say(Grade::kFair, "nothing tells whether it still is where it was");
  }

  const ReportData& data_;
  const ReportData::Camera& camera_;
  const Usual& usual_;
  ReportVerdict::Camera verdict_;
  std::vector<std::pair<Grade, std::string>> said_;
};

std::string headline_of(const ReportData& data, const ReportVerdict& verdict) {
  size_t bad = 0, fair = 0;
  for (const ReportVerdict::Camera& camera : verdict.cameras)
    bad += camera.grade == Grade::kBad, fair += camera.grade == Grade::kFair;
  const size_t all = verdict.cameras.size();
  const auto count = [](size_t n) { return std::to_string(n) + (n == 1 ? " camera" : " cameras"); };
  if (data.check && !data.check->holds) return data.solve ? "The rig no longer holds" : "The rig does not hold";
  if (bad > 0) return count(bad) + " of " + std::to_string(all) + (bad == 1 ? " needs" : " need") + " you";
  if (verdict.grade == Grade::kBad) return "The calibration can't be trusted yet";
  if (fair > 0) return "Fit for use; " + count(fair) + " of " + std::to_string(all) + " could be better";
  if (verdict.grade == Grade::kFair) return "Fit for use; a better recording would make it firmer";
  if (data.check && !data.solve) return "The rig holds";
  return "All " + count(all) + (all == 1 ? " is good" : " are good");
}

}  // namespace

const char* name_of(Grade grade) { return grade == Grade::kGood ? "good" : grade == Grade::kFair ? "fair" : "bad"; }

ReportVerdict judge(const ReportData& data) {
  ReportVerdict verdict;
  const Usual usual = usual_of(data);
  std::set<std::string> said, of_cameras;
  for (const ReportData::Camera& camera : data.cameras) {
    verdict.cameras.push_back(CameraJudge(data, camera, usual).run());
    for (const ReportData::Finding& finding : data.findings_of(camera.id)) of_cameras.insert(finding.text);
  }
  const auto add = [&](const std::string& what) {
    if (verdict.next.size() < kMostNext && said.insert(what).second) verdict.next.push_back(what);
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
  // What is wrong with all of them together.
  for (const char* severity : {"error", "warning"})
    for (const ReportData::Finding& finding : data.findings) {
      // That there was nothing to correct is no fault.
      if (finding.severity != severity || finding.code == "no-gain" || of_cameras.contains(finding.text)) continue;
      verdict.grade = std::max(verdict.grade, finding.severity == "error" ? Grade::kBad : Grade::kFair);
      add(finding.text);
    }
  add_cameras(Grade::kFair);
  verdict.headline = headline_of(data, verdict);
  return verdict;
}
