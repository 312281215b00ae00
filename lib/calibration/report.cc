// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/report.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "base/median.h"
#include "calibration/robust_scale.h"

namespace lf {
namespace {

using nlohmann::ordered_json;

struct Figures {
  std::vector<double> lengths;

  double mean() const {
    double sum = 0;
    for (const double l : lengths) sum += l;
    return lengths.empty() ? 0 : sum / static_cast<double>(lengths.size());
  }
  double rms() const {
    double sum = 0;
    for (const double l : lengths) sum += l * l;
    return lengths.empty() ? 0 : std::sqrt(sum / static_cast<double>(lengths.size()));
  }
  void put(ordered_json& value) const {
    value["mean_px"] = mean();
    value["median_px"] = lengths.empty() ? 0 : median(lengths);
    value["rms_px"] = rms();
  }
};

const char* name_of(Finding::Severity severity) {
  switch (severity) {
    case Finding::Severity::kNote: return "note";
    case Finding::Severity::kWarning: return "warning";
    case Finding::Severity::kError: break;
  }
  return "error";
}

}  // namespace

ordered_json calibration_report(const Solution& solution, const Tracks& tracks, const Placement& placement,
                                const std::vector<Finding>& findings) {
  const auto lengths = residual_lengths(solution.scene, tracks.observations);
  Figures all, inliers;
  std::vector<Figures> cameras(tracks.cameras.size());
  std::vector<size_t> given(tracks.cameras.size()), outliers(tracks.cameras.size());
  size_t unplaced = 0;
  for (size_t i = 0; i < lengths.size(); i++) {
    const uint32_t camera = tracks.observations[i].camera;
    given[camera]++;
    if (lengths[i] < 0) {
      unplaced++;
      continue;
    }
    all.lengths.push_back(lengths[i]);
    if (solution.inliers[i]) {
      inliers.lengths.push_back(lengths[i]);
      cameras[camera].lengths.push_back(lengths[i]);
    } else {
      outliers[camera]++;
    }
  }
  ordered_json report = {{"format", "lightfield-calibration"}, {"version", 1}};
  all.put(report);
  report["expected_rms_px"] = solution.expected_rms;
  report["observations"] = tracks.observations.size();
  report["unplaced"] = unplaced;
  report["outliers"] = all.lengths.size() - inliers.lengths.size();
  report["inliers"] = {{"observations", inliers.lengths.size()}};
  inliers.put(report["inliers"]);
  report["sigma_px"] = solution.sigma;
  if (solution.disagreement > 0) report["disagreement_of_halves"] = solution.disagreement;
  report["model"] = solution.distortion.name();
  report["models"] = ordered_json::array();
  for (const ModelTrial& trial : solution.trials)
    report["models"].push_back({{"model", trial.model},
                                {"bic", trial.bic},
                                {"transfer_px", trial.transfer_px ? ordered_json(*trial.transfer_px) : nullptr},
                                {"chosen", trial.chosen}});
  report["scale_from"] = placement.scale_from;
  report["findings"] = ordered_json::array();
  for (const Finding& f : findings)
    report["findings"].push_back({{"severity", name_of(f.severity)}, {"code", f.code}, {"text", f.text}});
  report["cameras"] = ordered_json::array();
  for (size_t i = 0; i < tracks.cameras.size(); i++)
    report["cameras"].push_back({{"id", tracks.cameras[i].id},
                                 {"found", solution.scene.cameras[i].used},
                                 {"observations", given[i]},
                                 {"outliers", outliers[i]},
                                 {"rms_px", cameras[i].rms()}});
  return report;
}

nlohmann::json rig_record(const Solution& solution, const Tracks& tracks, const Placement& placement,
                          nlohmann::json original, const std::string& program) {
  using nlohmann::json;
  json kept = json::array();
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    if (!solution.scene.cameras[i].used) continue;
    json camera = {{"id", tracks.cameras[i].id}};
    if (original.contains("cameras"))
      for (const json& known : original["cameras"])
        if (known["id"] == tracks.cameras[i].id) camera = known;
    camera["covariance"] =
        json::parse(to_json(covariance_in_rig(solution.uncertainty, i, placement.world_from_scene)).dump());
    kept.push_back(std::move(camera));
  }
  original["cameras"] = kept;
  original["provenance"]["calibration"] = {
      {"program", program}, {"sigma_px", solution.sigma}, {"scale_from", placement.scale_from}};
  return original;
}

}  // namespace lf
