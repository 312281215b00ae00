// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

// The data behind a report page. It contains the results of all calibration steps, read from their --json files and
// merged by camera.
struct ReportData {
  struct Finding {
    std::string severity, code, text;  // "error", "warning" or "note"
  };
  struct Camera {
    uint32_t id = 0;
    std::string name;
    int width = 0, height = 0;
    std::string trouble;
    std::vector<std::string> remarks;
    // The result of `lf-calibrate solve` for this camera: the light positions that were used, and the estimated
    // position with its uncertainty.
    struct SolveResult {
      bool found = false;
      double observations = 0, outliers = 0, rms_px = 0;
      std::vector<double> coverage;                       // number of observations per image cell, row-major
      std::vector<std::array<double, 4>> residuals;       // x, y, dx, dy of each residual
      std::optional<std::array<double, 3>> position;      // metres
      std::array<std::array<double, 3>, 3> covariance{};  // square metres
      std::optional<double> offset_ms, offset_sigma_ms;
      std::optional<double> readout_ms, readout_sigma_ms;  // of a rolling shutter; nullopt if not significant
      double reflections = 0;
    };
    std::optional<SolveResult> solved;
    struct ColourResult {
      bool corrected = false, stuck = false;
      double gain = 1, rms = 0, clipped = 0;
    };
    std::optional<ColourResult> coloured;
    struct CheckResult {
      std::string state;  // "holds", "moved", "lens", "colour", "picture" or "unknown"
      double shift_px = 0;
    };
    std::optional<CheckResult> checked;

    std::string title() const { return name.empty() ? std::to_string(id) : std::to_string(id) + " " + name; }
    std::optional<double> covered() const;
    // Returns the longest semi-axis of the 95 % confidence ellipsoid of the position, in metres. The true position is
    // within this distance with a probability of at least 95 %.
    std::optional<double> ellipsoid() const;
  };
  struct Solve {
    double rms_px = 0, expected_px = 0, observations = 0, outliers = 0;
    std::string model, scale_from;
    // A lens model that was tried: its BIC (Bayesian information criterion; lower is better), and its RMS error in
    // pixels for observations that were left out of the fit.
    struct Trial {
      std::string model;
      double bic = 0;
      std::optional<double> transfer_px;
      bool chosen = false;
    };
    std::vector<Trial> trials;
    double near_m = 0, far_m = 0;
    int columns = 0, rows = 0;
    // The predicted error of projecting a new point at this distance into a camera, for the median camera and the worst
    // camera.
    struct Depth {
      double depth_m = 0, median_px = 0, worst_px = 0;
    };
    std::vector<Depth> projection;
    // A deformation of the array that the recording may not determine well, in words.
    struct Mode {
      std::string text;
      double share = 0;  // uncertainty relative to the limit; above 1, the report recommends a better recording
      bool soft = false;
    };
    std::vector<Mode> modes;
  };
  struct Colour {
    struct Row {
      std::string what;
      double median = 0, p95 = 0;
      bool chosen = false;
    };
    std::string from;
    // colour differences between cameras: first without correction, then with each tested set of corrections
    std::vector<Row> rows;
    Row before, after;
  };
  struct Check {
    bool holds = true;
    std::string from;
    std::optional<double> residual_px;
  };

  std::vector<Camera> cameras;  // sorted by id
  std::vector<Finding> findings;
  std::optional<Solve> solve;
  std::optional<Colour> colour;
  std::optional<Check> check;

  // Adds the contents of the report file `name`. Throws lf::Error that names the file if it is damaged or not a report
  // of lf-calibrate.
  void add(const nlohmann::json& report, const std::string& name);
  std::vector<Finding> findings_of(uint32_t camera) const;

 private:
  Camera& camera(const nlohmann::json& value);
  void add_track(const nlohmann::json& report);
  void add_solve(const nlohmann::json& report);
  void add_colour(const nlohmann::json& report);
  void add_check(const nlohmann::json& report);
};

// The verdict on a calibration: a grade for each camera and for the whole calibration, with reasons and recommended
// next steps.
struct ReportVerdict {
  enum class Grade { kGood, kFair, kBad };
  struct Camera {
    Grade grade = Grade::kGood;
    std::vector<std::string> reasons;  // worst first
  };
  Grade grade = Grade::kGood;
  std::string headline;
  std::vector<Camera> cameras;
  std::vector<std::string> next;  // most important first
};

ReportVerdict grade_calibration(const ReportData& data);

const char* name_of(ReportVerdict::Grade grade);
