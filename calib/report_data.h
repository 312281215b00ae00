// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

// What the steps of a calibration said (the files of their --json), brought together camera by camera.
struct ReportData {
  struct Finding {
    std::string severity, code, text;  // error, warning or note
  };
  struct Camera {
    uint32_t id = 0;
    std::string name;
    int width = 0, height = 0;
    std::string trouble;               // what is wrong with the camera's recording, by `track`; "": nothing
    std::vector<std::string> remarks;  // remarks of `track` on the recording
    struct Solved {
      bool found = false;
      double observations = 0, outliers = 0, rms_px = 0;
      std::vector<double> coverage;                       // counts, row by row
      std::vector<std::array<double, 4>> residuals;       // x, y, dx, dy
      std::optional<std::array<double, 3>> position;      // metres
      std::array<std::array<double, 3>, 3> covariance{};  // square metres
      std::optional<double> offset_ms, offset_sigma_ms;
      double reflections = 0;
    };
    std::optional<Solved> solved;
    struct Coloured {
      bool corrected = false, stuck = false;
      double gain = 1, rms = 0, clipped = 0;
    };
    std::optional<Coloured> coloured;
    struct Checked {
      std::string state;  // holds, moved, lens, colour, picture, unknown
      double shift_px = 0;
    };
    std::optional<Checked> checked;

    std::string title() const { return name.empty() ? std::to_string(id) : std::to_string(id) + " " + name; }
    // Share of the picture's parts that the light came to; nothing where that is not known.
    std::optional<double> covered() const;
    // Metres: the longest half axis of the ellipsoid that the camera is in with 95 %.
    std::optional<double> ellipsoid() const;
  };
  struct Solve {
    double rms_px = 0, expected_px = 0, observations = 0, outliers = 0;
    std::string model, scale_from;
    struct Trial {
      std::string model;
      double bic = 0;
      std::optional<double> transfer_px;
      bool chosen = false;
    };
    std::vector<Trial> trials;
    double near_m = 0, far_m = 0;
    int columns = 0, rows = 0;
    struct Depth {
      double depth_m = 0, median_px = 0, worst_px = 0;
    };
    std::vector<Depth> projection;
    struct Mode {
      std::string text;
      double share = 0;  // part of the uncertainty that is worth a better recording
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
    std::vector<Row> rows;  // differences of cameras as they are, then with each set of terms that was tried
    Row before, after;
  };
  struct Check {
    bool holds = true;
    std::string from;
    std::optional<double> residual_px;
  };

  std::vector<Camera> cameras;  // the cameras, by id
  std::vector<Finding> findings;
  std::optional<Solve> solve;
  std::optional<Colour> colour;
  std::optional<Check> check;

  // Adds what `report` says, the contents of the file `name`. Throws lf::Error naming the file where it is no report of
  // lf-calibrate, or a damaged one.
  void add(const nlohmann::json& report, const std::string& name);
  // The findings that name the camera.
  std::vector<Finding> findings_of(uint32_t camera) const;

 private:
  Camera& camera(const nlohmann::json& value);
  void add_track(const nlohmann::json& report);
  void add_solve(const nlohmann::json& report);
  void add_colour(const nlohmann::json& report);
  void add_check(const nlohmann::json& report);
};

// What a calibration is worth, camera by camera, and what to do next.
struct ReportVerdict {
  enum class Grade { kGood, kFair, kBad };
  struct Camera {
    Grade grade = Grade::kGood;
    std::vector<std::string> reasons;  // worst first; none for a good one
  };
  Grade grade = Grade::kGood;     // grade of the whole calibration
  std::string headline;           // the verdict in one line
  std::vector<Camera> cameras;    // one for each camera of the data
  std::vector<std::string> next;  // what to do, most needed first
};

ReportVerdict judge(const ReportData& data);

const char* name_of(ReportVerdict::Grade grade);  // "good", "fair", "bad"
