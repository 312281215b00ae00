// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/report.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/percentiles.h"
#include "calibration/layout_alignment.h"
#include "calibration/noise.h"

namespace lf {
namespace {

// Amid the cameras, along their mean axes.
Similarity own_frame(const std::vector<Pose>& poses) {
  Vec3 mean(0, 0, 0), forward(0, 0, 0), right(0, 0, 0), down(0, 0, 0);
  for (const Pose& p : poses) mean += p.position, forward += p.forward(), right += p.right(), down += p.down();
  mean /= static_cast<double>(poses.size());
  if (!(glm::length(forward) > 1e-3)) forward = poses[0].forward(), right = poses[0].right();  // all around
  const Vec3 z = glm::normalize(forward);
  Vec3 x = right - glm::dot(right, z) * z;
  if (!(glm::length(x) > 1e-3)) x = glm::cross(down, z);
  if (!(glm::length(x) > 1e-3)) x = poses[0].right() - glm::dot(poses[0].right(), z) * z;
  x = glm::normalize(x);
  Similarity s;
  s.rotation = glm::conjugate(glm::normalize(glm::quat_cast(Mat3(x, glm::cross(z, x), z))));
  s.translation = -(s.rotation * mean);
  return s;
}

Similarity scaled(Similarity s, double factor) {
  s.scale *= factor;
  s.translation *= factor;
  return s;
}

// How well it is known which way all cameras look together, for centres that are known: radians, about one axis.
double common_turn(const Solution& solution) {
  const Uncertainty& u = solution.uncertainty;
  const auto used = static_cast<double>(
      std::count_if(u.camera_row.begin(), u.camera_row.end(), [](const int row) { return row >= 0; }));
  double variance = 0;
  for (int axis = 0; axis < 3 && used > 0; axis++) {
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(u.covariance.rows());
    for (const int row : u.camera_row)
      if (row >= 0) mean[row + axis] = 1 / used;
    variance += mean.dot(u.covariance * mean) / 3;
  }
  return std::sqrt(std::max(0.0, variance));
}

}  // namespace

double neighbour_distance(const std::vector<Pose>& poses) {
  std::vector<double> nearest(poses.size(), std::numeric_limits<double>::infinity());
  for (size_t i = 0; i < poses.size(); i++)
    for (size_t j = 0; j < poses.size(); j++)
      if (i != j) nearest[i] = std::min(nearest[i], glm::length(poses[i].position - poses[j].position));
  std::nth_element(nearest.begin(), nearest.begin() + nearest.size() / 2, nearest.end());
  return nearest[nearest.size() / 2];
}

Placement place_solution(const Solution& solution, const Tracks& tracks, const SolveOptions& options,
                         const PlacementOptions& placement) {
  std::vector<Pose> poses;
  std::vector<size_t> used, own;
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    if (!solution.scene.cameras[i].used) continue;
    used.push_back(i);
    poses.push_back(solution.scene.cameras[i].pose());
    if (options.prior) own.push_back(*options.prior->index_of_id(tracks.cameras[i].id));
  }
  Placement result;
  double scale = 0;
  if (placement.bar_length > 0) {
    if (!tracks.bar) throw Error("the bar's length is given, but the tracks are of one light");
    scale = placement.bar_length;
    result.scale_from = "the bar's length";
  } else if (placement.distance) {
    const auto position = [&](uint32_t id) {
      for (size_t i = 0; i < tracks.cameras.size(); i++)
        if (tracks.cameras[i].id == id && solution.scene.cameras[i].used)
          return solution.scene.cameras[i].pose().position;
      throw Error("the distance is to camera " + std::to_string(id) + ", which was not found");
    };
    const double distance = glm::length(position(placement.distance->a) - position(placement.distance->b));
    if (!(placement.distance->metres > 0) || !(distance > 0))
      throw Error("the distance of two cameras must be positive");
    scale = placement.distance->metres / distance;
    result.scale_from = "the distance of two cameras";
  } else if (placement.pitch > 0) {
    scale = placement.pitch / neighbour_distance(poses);
    result.scale_from = "the pitch";
  }
  // A prior rig has a layout where its cameras are not all at one place.
  std::vector<Pose> layout;
  double extent = 0;
  if (options.prior)
    for (const Camera& camera : options.prior->cameras) layout.push_back(camera.pose);
  for (const size_t i : own) extent = std::max(extent, glm::length(layout[i].position - layout[own[0]].position));
  if (extent > 0) {
    const LayoutAlignment aligned =
        align_to_layout(poses, layout, own, scale > 0 ? std::optional(scale) : std::nullopt, common_turn(solution));
    result.world_from_scene = aligned.layout_from_scene;
    if (!(scale > 0)) result.scale_from = "the prior rig's layout";
    for (const Tracks::Camera& camera : tracks.cameras) result.stands_at.push_back(camera.id);
    for (size_t k = 0; k < used.size(); k++) result.stands_at[used[k]] = options.prior->cameras[aligned.place[k]].id;
    return result;
  }
  result.world_from_scene = scaled(own_frame(poses), scale > 0 ? scale : 1 / neighbour_distance(poses));
  return result;
}

Rig make_rig(const Solution& solution, const Tracks& tracks, const SolveOptions& options, const Placement& placement) {
  Rig rig;
  size_t used = 0;
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    const CameraState& state = solution.scene.cameras[i];
    if (!state.used) continue;
    used++;
    Camera camera;
    if (options.prior) {
      camera = options.prior->cameras[*options.prior->index_of_id(tracks.cameras[i].id)];
    } else {
      camera.id = tracks.cameras[i].id;
      camera.name = "cam_" + std::to_string(camera.id);
      camera.width = state.width, camera.height = state.height;
    }
    camera.lens = state.lens();
    camera.pose = placement.world_from_scene(state.pose());
    rig.cameras.push_back(camera);
  }
  if (options.prior) {
    const auto place = [&](size_t i) {
      return *options.prior->index_of_id(placement.stands_at.empty() ? tracks.cameras[i].id : placement.stands_at[i]);
    };
    std::vector<std::pair<size_t, Camera>> ordered;
    for (size_t i = 0; i < tracks.cameras.size(); i++)
      if (const auto index = rig.index_of_id(tracks.cameras[i].id)) ordered.emplace_back(place(i), rig.cameras[*index]);
    std::sort(ordered.begin(), ordered.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (size_t i = 0; i < ordered.size(); i++) rig.cameras[i] = std::move(ordered[i].second);
    if (used == options.prior->cameras.size()) rig.topology = options.prior->topology;
  }
  if (options.prior) rig.directory = options.prior->directory;
  return rig;
}

CameraCovariance covariance_in_rig(const Uncertainty& uncertainty, size_t index, const Similarity& world_from_scene) {
  const int row = uncertainty.camera_row[index], n = uncertainty.camera_size, lens = n - 6;
  // Steps in the scene to parameters in the rig, lens first.
  Eigen::MatrixXd to = Eigen::MatrixXd::Zero(n, n);
  const Mat3 turn = glm::mat3_cast(world_from_scene.rotation);
  for (int k = 0; k < lens; k++) to(k, 6 + k) = 1;
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++) {
      to(lens + r, 3 + c) = world_from_scene.scale * turn[c][r];
      to(lens + 3 + r, c) = turn[c][r];
    }
  const Eigen::MatrixXd m = to * uncertainty.covariance.block(row, row, n, n) * to.transpose();
  CameraCovariance covariance;
  for (const int term : uncertainty.lens_terms) covariance.parameters.push_back(kLensTermNames[term]);
  for (const char* name : {"x", "y", "z", "rx", "ry", "rz"}) covariance.parameters.push_back(name);
  for (int r = 0; r < n; r++)
    for (int c = 0; c < n; c++) covariance.matrix.push_back(m(r, c));
  return covariance;
}

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

}  // namespace

const char* name_of(Finding::Severity severity) {
  switch (severity) {
    case Finding::Severity::kNote: return "note";
    case Finding::Severity::kWarning: return "warning";
    case Finding::Severity::kError: break;
  }
  return "error";
}

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
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    report["cameras"].push_back({{"id", tracks.cameras[i].id},
                                 {"found", solution.scene.cameras[i].used},
                                 {"observations", given[i]},
                                 {"outliers", outliers[i]},
                                 {"rms_px", cameras[i].rms()}});
    if (!placement.stands_at.empty() && placement.stands_at[i] != tracks.cameras[i].id)
      report["cameras"].back()["stands_at"] = placement.stands_at[i];
  }
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
