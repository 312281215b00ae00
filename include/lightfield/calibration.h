// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <lightfield/rig.h>

// Calibration is a library of its own, lightfield-calibration (pkg-config lightfield-calibration), which brings Ceres
// and OpenCV along.
namespace lightfield {

// What all cameras saw of a light, or of two lights on a rigid bar, at a sequence of places; or of the features of a
// still scene, where each position is a feature.
struct Tracks {
  struct Camera {
    uint32_t id = 0;            // unique
    int width = 0, height = 0;  // size of the camera's images, pixels
  };
  // One light as one camera saw it.
  struct Observation {
    uint32_t camera = 0;    // index into Tracks::cameras
    uint32_t position = 0;  // number of the light's or the bar's place, counted from 0
    uint32_t light = 0;     // 0, or 1 for the second light of a bar
    double x = 0, y = 0;    // pixels; (0, 0) is the centre of the top-left one
    double sigma = 1;       // standard deviation of x and of y, in proportion to those of other observations
  };
  std::vector<Camera> cameras;
  bool bar = false;     // positions have two lights, always equally far apart
  bool ordered = true;  // positions follow each other in time at one frame each, which features do not
  size_t num_positions = 0;
  std::vector<Observation> observations;
};

// Reads {"format": "lightfield-tracks", ...} (calib/README.md). Throws Error naming the file and the place in it.
Tracks load_tracks(const std::string& path);

struct CalibrationOptions {
  // Lenses as they were measured, with their covariances where its file has them, and where cameras are about. Cameras
  // are found by their ids.
  std::optional<Rig> prior = {};
  // How many radial terms lenses have, 0 to 2; nothing: as many as the tracks call for.
  std::optional<int> distortion_terms = {};
  // What gives the scale, which no image tells. The first that is there counts: metres between the two lights of the
  // bar, between two cameras, between neighbouring cameras (the median); else the prior's layout.
  double bar_length = 0;
  struct Distance {
    uint32_t a = 0, b = 0;  // ids of the two cameras
    double metres = 0;
  };
  std::optional<Distance> distance = {};
  double pitch = 0;
  // Called before each step with its name. May throw, which ends the calibration and comes out of it.
  std::function<void(const std::string& step)> progress = {};
};

// How well the parameters of a camera are known, by name: "f" or "fx" and "fy", "cx", "cy" in pixels, "k1", "k2" as in
// Lens, "x", "y", "z" of its place in metres, "rx", "ry", "rz" in radians: the rotation, about the world's axes, by
// which the true orientation may differ. The inverse of the information in the observations and the prior (the bound of
// Cramer and Rao).
struct Covariance {
  uint32_t camera_id = 0;
  std::vector<std::string> parameters;
  std::vector<double> matrix;  // row by row, parameters.size() squared
};

// What a person must know before trusting a calibration.
struct Finding {
  enum class Severity { kNote, kWarning, kError };
  Severity severity = Severity::kNote;
  std::string code;  // a name for programs: "swapped-cameras"
  std::string text;  // a sentence for people
};

struct Calibration {
  Rig rig;                              // the cameras that were found; json() and save_rig() have the covariances, too
  std::vector<Covariance> covariances;  // one for each camera of the rig, in the rig's order
  std::vector<Finding> findings;
  double sigma = 0;        // estimated standard deviation of an observation's x and y, pixels, by those that fit
  size_t outliers = 0;     // observations that do not fit
  std::string scale_from;  // "the bar's length", ...; empty where nothing gives it: neighbours are 1 apart
};

// Positions, orientations and lenses of cameras, from tracks alone or with what is known already, by bundle adjustment
// (Triggs, McLauchlan, Hartley, Fitzgibbon 2000) with robust weights. Takes seconds to minutes, and gives the same for
// the same input. Throws Error for tracks that contradict themselves and where nothing can be found. Call from any
// thread.
Calibration calibrate_rig(const Tracks& tracks, const CalibrationOptions& options = {});

}  // namespace lightfield
