// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Rigs are passed as the text of rig files, because this library uses only the public API of lightfield.
#include <lightfield/calibration.h>

#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "calibration/diagnosis.h"
#include "calibration/report.h"
#include "calibration/tracks.h"
#include "rig/rig_json.h"

namespace lightfield {
namespace {

using nlohmann::json;

lf::Tracks to_tracks(const Tracks& tracks) {
  lf::Tracks out;
  out.cameras = tracks.cameras;
  out.bar = tracks.bar;
  out.ordered = tracks.ordered;
  out.num_positions = tracks.num_positions;
  for (const Tracks::Observation& o : tracks.observations)
    out.observations.push_back({o.camera, o.position, o.light, {o.x, o.y}, o.sigma});
  lf::check_tracks(out, "tracks");
  return out;
}

Tracks from_tracks(const lf::Tracks& tracks) {
  Tracks out;
  out.cameras = tracks.cameras;
  out.bar = tracks.bar;
  out.ordered = tracks.ordered;
  out.num_positions = tracks.num_positions;
  for (const lf::Observation& o : tracks.observations)
    out.observations.push_back({o.camera, o.position, o.light, o.pixel.x, o.pixel.y, o.sigma});
  return out;
}

json take_prior(const Rig& prior, lf::SolveOptions& options) {
  const std::string text = prior.json(), name = "prior";
  json original = lf::parse_json(text, name);
  options.prior = lf::parse_rig(text, name);
  for (const lf::JsonValue& camera : lf::JsonValue(original, name).at("cameras").elements())
    options.prior_covariances.push_back(lf::parse_camera_covariance(camera));
  return original;
}

lf::PlacementOptions to_placement(const CalibrationOptions& options) {
  if (!(options.pitch >= 0) || !(options.bar_length >= 0)) throw Error("pitch, bar_length: must not be below 0 metres");
  return {.pitch = options.pitch, .bar_length = options.bar_length, .distance = options.distance};
}

}  // namespace

Tracks load_tracks(const std::string& path) { return from_tracks(lf::load_tracks(path)); }

Calibration calibrate_rig(const Tracks& tracks, const CalibrationOptions& options) {
  const lf::Tracks seen = to_tracks(tracks);
  lf::SolveOptions solve;
  solve.progress = options.progress;
  if (options.distortion_terms) {
    if (*options.distortion_terms < 0 || *options.distortion_terms > 2) throw Error("distortion_terms: must be 0 to 2");
    solve.distortion = lf::DistortionModel{*options.distortion_terms, false};
  }
  json original = json::object();
  if (options.prior) original = take_prior(*options.prior, solve);
  const lf::PlacementOptions placing = to_placement(options);

  const lf::Solution solution = lf::solve_tracks(seen, solve);
  const lf::Placement placement = lf::place_solution(solution, seen, solve, placing);
  original = lf::rig_record(solution, seen, placement, std::move(original), "liblightfield-calibration");
  const std::string rig = lf::rig_to_json(lf::make_rig(solution, seen, solve, placement), &original);

  Calibration out{parse_rig(rig, "calibration"), {}, {}, solution.sigma, 0, placement.scale_from};
  for (size_t i = 0; i < seen.cameras.size(); i++) {
    if (!solution.scene.cameras[i].used) continue;
    lf::CameraCovariance known =
        lf::covariance_in_rig(solution.uncertainty, solution.scene, i, placement.world_from_scene);
    out.covariances.push_back({seen.cameras[i].id, std::move(known.parameters), std::move(known.matrix)});
  }
  out.findings = lf::diagnose(solution, seen, solve, placement);
  out.outliers = static_cast<size_t>(std::ranges::count(solution.inliers, 0));
  return out;
}

}  // namespace lightfield
