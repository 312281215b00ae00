// SPDX-License-Identifier: LGPL-2.1-or-later
// The Python module `lightfield_calibration`: the API of lightfield/calibration.h. It is a separate module, because
// it loads Ceres and OpenCV.
#include <lightfield/calibration.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

namespace lightfield {
namespace {

namespace py = pybind11;
using namespace py::literals;

Tracks make_tracks(const std::vector<std::tuple<uint32_t, int, int>>& cameras, const py::array_t<double>& observations,
                   bool bar, bool ordered) {
  if (observations.ndim() != 2 || observations.shape(1) < 5 || observations.shape(1) > 6)
    throw Error("observations: must have the shape (N, 5) or (N, 6)");
  Tracks tracks;
  tracks.bar = bar;
  tracks.ordered = ordered;
  for (const auto& [id, width, height] : cameras) tracks.cameras.push_back({id, width, height});
  const auto rows = observations.unchecked<2>();
  for (py::ssize_t i = 0; i < rows.shape(0); i++) {
    const auto index = [&](int column) {
      const double value = rows(i, column);
      if (!(value >= 0 && value < 4294967296. && value == static_cast<uint32_t>(value)))
        throw Error("observations[" + std::to_string(i) + "]: camera, position and light must be integers from 0");
      return static_cast<uint32_t>(value);
    };
    const uint32_t position = index(1);
    tracks.num_positions = std::max<size_t>(tracks.num_positions, size_t{position} + 1);
    tracks.observations.push_back(
        {index(0), position, index(2), rows(i, 3), rows(i, 4), rows.shape(1) == 6 ? rows(i, 5) : 1});
  }
  return tracks;
}

Calibration calibrate(const Tracks& tracks, std::optional<Rig> prior, std::optional<int> distortion_terms,
                      double bar_length, const std::optional<std::tuple<uint32_t, uint32_t, double>>& distance,
                      double pitch, std::function<void(const std::string&)> progress) {
  CalibrationOptions options;
  options.prior = std::move(prior);
  options.distortion_terms = distortion_terms;
  options.bar_length = bar_length;
  if (distance) options.distance = {std::get<0>(*distance), std::get<1>(*distance), std::get<2>(*distance)};
  options.pitch = pitch;
  options.progress = std::move(progress);
  const py::gil_scoped_release others_run;  // pybind11 locks again during `progress`
  return calibrate_rig(tracks, options);
}

py::array_t<double> matrix_of(const Covariance& covariance) {
  const auto size = static_cast<py::ssize_t>(covariance.parameters.size());
  return py::array_t<double>({size, size}, covariance.matrix.data());
}

}  // namespace

PYBIND11_MODULE(lightfield_calibration, m) {
  m.doc() = "Computes the lenses and poses of a camera array from tracked points.";
  py::module_::import("lightfield");  // defines Rig and Error
  py::class_<Tracks>(m, "Tracks", "The pixels of a moving light, the two lights of a moving bar, or features.")
      .def(
          py::init(&make_tracks), "cameras"_a, "observations"_a, "bar"_a = false, "ordered"_a = true,
          "cameras: tuples (id, width, height), pixels.\n"
          "observations: array (N, 5) or (N, 6) with the columns camera (index), position (number), light (0 or 1), x\n"
          "  and y (pixels; (0, 0) is the centre of the top-left pixel), and sigma (relative standard deviation, 1).\n"
          "bar: whether each position has two lights at a constant distance.\n"
          "ordered: whether positions are successive frames.")
      .def_property_readonly(
          "cameras", [](const Tracks& tracks) { return tracks.cameras.size(); }, "Number of cameras.")
      .def_readonly("num_positions", &Tracks::num_positions);
  m.def("load_tracks", &load_tracks, "path"_a, "Reads a tracks file.");

  py::class_<Covariance>(m, "Covariance", "The precision of the parameters of a camera.")
      .def_readonly("camera_id", &Covariance::camera_id)
      .def_readonly("parameters", &Covariance::parameters, "Names; see lightfield/calibration.h for the units.")
      .def_property_readonly("matrix", &matrix_of, "Array of the shape (parameters, parameters).");
  py::class_<Finding> finding(m, "Finding", "A remark that users should know before they trust a calibration.");
  py::enum_<Finding::Severity>(finding, "Severity")
      .value("NOTE", Finding::Severity::kNote)
      .value("WARNING", Finding::Severity::kWarning)
      .value("ERROR", Finding::Severity::kError);
  finding.def_readonly("severity", &Finding::severity)
      .def_readonly("code", &Finding::code)
      .def_readonly("text", &Finding::text);
  py::class_<Calibration>(m, "Calibration", "The result of calibrate_rig().")
      .def_readonly("rig", &Calibration::rig)
      .def_readonly("covariances", &Calibration::covariances)
      .def_readonly("findings", &Calibration::findings)
      .def_readonly("sigma", &Calibration::sigma, "Estimated noise of the observations, pixels.")
      .def_readonly("outliers", &Calibration::outliers)
      .def_readonly("scale_from", &Calibration::scale_from);
  m.def(
      "calibrate_rig", &calibrate, "tracks"_a, py::kw_only(), "prior"_a = py::none(), "distortion_terms"_a = py::none(),
      "bar_length"_a = 0, "distance"_a = py::none(), "pitch"_a = 0, "progress"_a = py::none(),
      "Calibrates an array.\n\n"
      "prior: an approximate Rig. distortion_terms: 0 to 2, or None to choose the number.\n"
      "bar_length, distance, pitch: the known length, metres: of the bar, of two cameras (id, id, metres), or between\n"
      "  neighbours. progress: a function that is called with the name of each step; it may raise an exception.");
}

}  // namespace lightfield
