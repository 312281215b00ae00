// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cmath>
#include <sstream>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "rig/exchange.h"

namespace lf {
namespace {

// Returns the elements of a matrix, with its rows, columns and channels in this order. OpenCV writes arrays of matrices
// as a matrix with several channels, or as a matrix with several dimensions.
std::vector<double> parse_elements(const JsonValue& matrix) { return parse_numbers(matrix.at("data")); }

std::vector<double> parse_elements(const JsonValue& file, const char* key, size_t count) {
  std::vector<double> elements = parse_elements(file.at(key));
  if (elements.size() != count)
    file.at(key).fail("must have " + std::to_string(count) + " elements, but has " + std::to_string(elements.size()));
  return elements;
}

constexpr char kUndistortedRemedy[] =
    "; undistort the pictures with the same camera matrices, and import the file with --undistorted";

struct DistortionTerms {
  bool is_fisheye = false;
  std::vector<double> terms;
};

// Returns the distortion terms of all cameras. The rows of fisheye cameras may have zeros after their four terms.
std::vector<DistortionTerms> parse_distortions(const JsonValue& file, size_t cameras) {
  constexpr size_t kLeast = 4;  // k1 k2 p1 p2, or k1 k2 k3 k4
  std::vector<DistortionTerms> distortions(cameras);
  for (const char* key : {"models", "is_fisheye"})
    if (file.find(key)) {
      const std::vector<double> models = parse_elements(file, key, cameras);
      for (size_t i = 0; i < cameras; i++) {
        if (models[i] != 0 && models[i] != 1) file.at(key).fail("must have 0 (pinhole) or 1 (fisheye) for each camera");
        distortions[i].is_fisheye |= models[i] == 1;
      }
    }
  const JsonValue place = file.at("distortions");
  const std::vector<double> all = parse_elements(place);
  const size_t terms = all.size() / cameras;
  if (terms * cameras != all.size() || terms < kLeast)
    place.fail("must have the same number of terms for each of the " + std::to_string(cameras) + " cameras" +
               kUndistortedRemedy);
  for (size_t i = 0; i < cameras; i++) {
    std::vector<double>& own = distortions[i].terms;
    own.assign(all.begin() + static_cast<std::ptrdiff_t>(i * terms),
               all.begin() + static_cast<std::ptrdiff_t>((i + 1) * terms));
    while (distortions[i].is_fisheye && own.size() > kLeast && own.back() == 0) own.pop_back();
  }
  return distortions;
}

// Returns cam_ids, which are a list, or one text with commas.
std::vector<std::string> parse_names(const nlohmann::json& root) {
  std::vector<std::string> names;
  const nlohmann::json ids = root.value("cam_ids", nlohmann::json());
  if (ids.is_string()) {
    std::istringstream text(ids.get<std::string>());
    for (std::string name; std::getline(text, name, ',');) names.push_back(name);
  } else if (ids.is_array()) {
    for (const nlohmann::json& id : ids) names.push_back(id.is_string() ? id.get<std::string>() : id.dump());
  }
  return names;
}

}  // namespace

std::vector<Camera> parse_opencv_multiview(const nlohmann::json& root, const std::string& path, bool undistorted) {
  const JsonValue file(root, path);
  const std::vector<double> sizes = parse_elements(file.at("image_sizes"));
  const size_t count = sizes.size() / 2;
  if (sizes.size() % 2 != 0 || count == 0 || count > kMaxCameras)
    file.at("image_sizes").fail("must have the width and height of 1 to " + std::to_string(kMaxCameras) + " cameras");
  const std::vector<double> matrices = parse_elements(file, "Ks", 9 * count);
  const char* const rotation_key = file.find("Rs") ? "Rs" : "rvecs";
  const JsonValue rotation = file.at(rotation_key);
  const std::vector<double> rotations = parse_elements(rotation);
  const bool has_matrices = rotations.size() == 9 * count;
  if (!has_matrices && rotations.size() != 3 * count)
    rotation.fail("must have a rotation matrix or vector for each of the " + std::to_string(count) + " cameras");
  const std::vector<double> translations = parse_elements(file, "Ts", 3 * count);
  std::vector<DistortionTerms> distortions(count);
  if (!undistorted) distortions = parse_distortions(file, count);
  const std::vector<std::string> names = parse_names(root);

  std::vector<Camera> cameras(count);
  for (size_t i = 0; i < count; i++) {
    Camera& camera = cameras[i];
    const std::string place = "camera " + std::to_string(i);
    if (names.size() == count) camera.name = names[i];
    for (const size_t side : {2 * i, 2 * i + 1})
      if (!(sizes[side] >= 1 && sizes[side] <= kMaxImageSize && std::trunc(sizes[side]) == sizes[side]))
        file.at("image_sizes")
            .fail(place + " must have an integer width and height up to " + std::to_string(kMaxImageSize));
    camera.width = static_cast<int>(sizes[2 * i]);
    camera.height = static_cast<int>(sizes[2 * i + 1]);
    const auto pinhole = pinhole_of_matrix({&matrices[9 * i], 9});
    if (!pinhole)
      file.at("Ks").fail(place + " must have [fx, 0, cx, 0, fy, cy, 0, 0, 1], because a rig cannot hold skew");
    try {
      const auto& [is_fisheye, terms] = distortions[i];
      camera.lens = is_fisheye ? lens_from_opencv_fisheye(*pinhole, terms) : lens_from_opencv(*pinhole, terms);
    } catch (const Error& e) {
      file.at("Ks").fail(place + ": " + e.what() + (undistorted ? "" : kUndistortedRemedy));
    }
    const double *const r = &rotations[(has_matrices ? 9 : 3) * i], *const t = &translations[3 * i];
    camera.pose = pose_of_camera_from_world(
        {has_matrices ? nearest_rotation(matrix_of_rows({r, 9}), rotation) : rotation_from_vector({r[0], r[1], r[2]}),
         {t[0], t[1], t[2]}});
  }
  return cameras;
}

}  // namespace lf
