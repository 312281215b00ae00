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

// The input of a calibration: where the cameras saw a moving light, the two lights of a moving bar, or the features of
// a static scene. All sightings with the same position number show the same point in space (or the same bar). For
// features, each feature has its own position number.
struct Tracks {
  struct Camera {
    uint32_t id = 0;            // unique
    int width = 0, height = 0;  // image size, pixels
  };
  struct Observation {
    uint32_t camera = 0;    // index into Tracks::cameras
    uint32_t position = 0;  // number of the position, from 0
    uint32_t light = 0;     // index of the light on the bar: 0 or 1; always 0 without a bar
    double x = 0, y = 0;    // pixels; (0, 0) is the centre of the top-left pixel
    double sigma = 1;       // standard deviation of x and y; only the ratio to other observations matters
  };
  std::vector<Camera> cameras;
  bool bar = false;     // true: each position has two lights at a constant distance
  bool ordered = true;  // true: positions are successive frames; false: features, in no particular order
  size_t num_positions = 0;
  std::vector<Observation> observations;
};

// Reads a tracks file ({"format": "lightfield-tracks", ...}), which docs/reference/files.md describes. Throws Error
// with the file name and the place in the file.
Tracks load_tracks(const std::string& path);

struct CalibrationOptions {
  // An approximate rig to start from, for example the nominal layout of the array. Lenses that carry a covariance in
  // the rig file count as measurements. Cameras are matched by id.
  std::optional<Rig> prior = {};
  // Number of radial distortion terms, 0 to 2. Without a value, the calibration chooses the number that the tracks
  // support.
  std::optional<int> distortion_terms = {};
  // Images alone do not determine the size of an array, so the scale must come from a known length, in metres. The
  // first of these that is set is used: bar_length (the distance of the bar's two lights), distance (the distance of
  // two cameras), pitch (the median distance of neighbouring cameras). If none is set, the layout of the prior gives
  // the scale.
  double bar_length = 0;
  struct Distance {
    uint32_t a = 0, b = 0;  // ids of the two cameras
    double metres = 0;
  };
  std::optional<Distance> distance = {};
  double pitch = 0;
  // Called with the name of each step before the step starts, for example to show progress. The function may throw an
  // exception to abort the calibration; the exception propagates to the caller.
  std::function<void(const std::string& step)> progress = {};
  uint64_t reserved[4] = {};  // space for the options of later versions; must be 0
};

// The precision of one camera's parameters, as a covariance matrix. The matrix is the inverse of the information in the
// observations and the prior (the Cramer-Rao bound). Possible parameters are: "f" or "fx" and "fy", "cx", "cy" in
// pixels; "k1", "k2" as in Lens; the position "x", "y", "z" in metres; rotations about the world axes "rx", "ry", "rz"
// in radians.
struct Covariance {
  uint32_t camera_id = 0;
  std::vector<std::string> parameters;
  std::vector<double> matrix;  // row by row, parameters.size() squared values
};

// A problem or remark that users should know before they trust a calibration.
struct Finding {
  enum class Severity { kNote, kWarning, kError };
  Severity severity = Severity::kNote;
  std::string code;  // a stable name that programs can test, such as "swapped-cameras"
  std::string text;  // an explanation for users
};

struct Calibration {
  Rig rig;                              // the calibrated cameras; json() and save_rig() also write the covariances
  std::vector<Covariance> covariances;  // one per camera of the rig, in the same order
  std::vector<Finding> findings;
  double sigma = 0;     // estimated standard deviation of x and y of the inlier observations, pixels
  size_t outliers = 0;  // number of observations that contradict the result
  // the length that determined the scale ("the bar's length", ...); empty if none: neighbours are then 1 apart
  std::string scale_from;
};

// Computes the positions, orientations and lenses of the cameras by robust bundle adjustment (Triggs, McLauchlan,
// Hartley, Fitzgibbon 2000). This takes seconds to minutes. The same input gives the same result except for
// rounding errors (about 1e-6 pixels), because threads add in a varying order. Throws Error if the tracks are
// inconsistent or insufficient. May be called from any thread.
Calibration calibrate_rig(const Tracks& tracks, const CalibrationOptions& options = {});

}  // namespace lightfield
