// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <lightfield/rig.h>

// Calibration is a separate library, lightfield-calibration (pkg-config lightfield-calibration), because it depends on
// Ceres and OpenCV.
namespace lightfield {

// Image positions of a moving light, of two lights on a rigid bar, or of the features of a static scene. For features,
// each position is a feature.
struct Tracks {
  struct Camera {
    uint32_t id = 0;            // unique
    int width = 0, height = 0;  // image size, pixels
  };
  struct Observation {
    uint32_t camera = 0;    // index into Tracks::cameras
    uint32_t position = 0;  // number of the position of the light or bar, from 0
    uint32_t light = 0;     // 0, or 1 for the second light of a bar
    double x = 0, y = 0;    // pixels; (0, 0) is the centre of the top-left pixel
    double sigma = 1;       // standard deviation of x and y, relative to other observations
  };
  std::vector<Camera> cameras;
  bool bar = false;     // positions have two lights at a constant distance
  bool ordered = true;  // positions are successive frames; false for features
  size_t num_positions = 0;
  std::vector<Observation> observations;
};

// Reads {"format": "lightfield-tracks", ...} (docs/reference/files.md). Throws Error with the file and the place.
Tracks load_tracks(const std::string& path);

struct CalibrationOptions {
  // Known lenses, with covariances if the rig file has them, and approximate poses. Cameras are matched by id.
  std::optional<Rig> prior = {};
  // Number of radial distortion terms, 0 to 2; without a value: chosen from the tracks.
  std::optional<int> distortion_terms = {};
  // Sources of the scale, which images alone do not give, in metres. The first one set is used: the distance of the
  // bar's lights, the distance of two cameras, the median distance of neighbouring cameras; otherwise the layout of the
  // prior.
  double bar_length = 0;
  struct Distance {
    uint32_t a = 0, b = 0;  // ids of the two cameras
    double metres = 0;
  };
  std::optional<Distance> distance = {};
  double pitch = 0;
  // Called with the name of each step before it starts. An exception aborts the calibration and propagates to the
  // caller.
  std::function<void(const std::string& step)> progress = {};
};

// Covariance of the parameters of a camera, as the inverse of the information in the observations and the prior
// (Cramer-Rao bound). Parameter names: "f" or "fx" and "fy", "cx", "cy" in pixels; "k1", "k2" as in Lens; position "x",
// "y", "z" in metres; rotation about the world axes "rx", "ry", "rz" in radians.
struct Covariance {
  uint32_t camera_id = 0;
  std::vector<std::string> parameters;
  std::vector<double> matrix;  // row by row, parameters.size() squared
};

// A problem or remark that users must know before they trust a calibration.
struct Finding {
  enum class Severity { kNote, kWarning, kError };
  Severity severity = Severity::kNote;
  std::string code;  // for programs: "swapped-cameras"
  std::string text;  // a sentence for users
};

struct Calibration {
  Rig rig;                              // the calibrated cameras; json() and save_rig() include the covariances
  std::vector<Covariance> covariances;  // one for each camera of the rig, in its order
  std::vector<Finding> findings;
  double sigma = 0;        // estimated standard deviation of x and y of the inliers, pixels
  size_t outliers = 0;     // number of observations that do not fit
  std::string scale_from;  // "the bar's length", ...; empty if unknown: neighbours are then 1 apart
};

// Computes positions, orientations and lenses of cameras from tracks and optional prior knowledge, by robust bundle
// adjustment (Triggs, McLauchlan, Hartley, Fitzgibbon 2000). Takes seconds to minutes. The result is deterministic.
// Throws Error if the tracks are inconsistent or insufficient. May be called from any thread.
Calibration calibrate_rig(const Tracks& tracks, const CalibrationOptions& options = {});

}  // namespace lightfield
