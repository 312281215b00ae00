// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/rig_report.h"

#include <algorithm>
#include <climits>
#include <filesystem>
#include <limits>
#include <map>

#include "base/error.h"
#include "base/number_text.h"
#include "image/image_file.h"
#include "rig/bin_description.h"
#include "rig/camera_distances.h"
#include "rig/mesh.h"

namespace lf {
namespace {

namespace fs = std::filesystem;
using Severity = RigFinding::Severity;

constexpr double kSliver = 0.02;     // height of a triangle over its longest side: an angle of about one degree
constexpr double kSamePlace = 1e-9;  // of the baseline

std::string short_text(double value) { return format_text("%.6g", value); }

std::string range_text(double least, double most) {
  const std::string a = short_text(least), b = short_text(most);
  return a == b ? a : a + " to " + b;
}

double distance(const Rig& rig, size_t a, size_t b) {
  return glm::length(rig.cameras[a].pose.position - rig.cameras[b].pose.position);
}

std::vector<std::string> lens_lines(const Rig& rig) {
  struct Kind {
    double least_f = std::numeric_limits<double>::infinity(), most_f = 0;
    std::pair<int, int> least_size{INT_MAX, INT_MAX}, most_size{0, 0};
    size_t cameras = 0;
  };
  std::map<LensModel, Kind> kinds;
  for (const Camera& camera : rig.cameras) {
    Kind& kind = kinds[camera.lens.model()];
    kind.least_f = std::min({kind.least_f, camera.lens.fx(), camera.lens.fy()});
    kind.most_f = std::max({kind.most_f, camera.lens.fx(), camera.lens.fy()});
    kind.least_size = std::min(kind.least_size, {camera.width, camera.height});
    kind.most_size = std::max(kind.most_size, {camera.width, camera.height});
    kind.cameras++;
  }
  std::vector<std::string> lines;
  for (const auto& [model, kind] : kinds) {
    std::string sizes = size_text(kind.least_size.first, kind.least_size.second);
    if (kind.least_size != kind.most_size) sizes += " to " + size_text(kind.most_size.first, kind.most_size.second);
    lines.push_back(std::string(lens_model_name(model)) + ", f " + range_text(kind.least_f, kind.most_f) + " px, " +
                    std::to_string(kind.cameras) + (kind.cameras == 1 ? " camera of " : " cameras of ") + sizes);
  }
  return lines;
}

// Height over the longest side.
double flatness(const Rig& rig, const MeshFace& face) {
  const auto position = [&](int i) { return rig.cameras[face.camera[i]].pose.position; };
  const Vec3 a = position(1) - position(0), b = position(2) - position(0);
  const double longest = std::max({glm::length(a), glm::length(b), glm::length(a - b)});
  return longest > 0 ? glm::length(glm::cross(a / longest, b / longest)) : 0;
}

// Cameras at one place, each named once with the first camera there: neighbours in the order along the widest axis.
void find_duplicates(const Rig& rig, std::vector<RigFinding>& findings) {
  const double tolerance = kSamePlace * largest_distance(rig);
  const int axis = widest_axis(rig);
  std::vector<size_t> order(rig.cameras.size());
  for (size_t i = 0; i < order.size(); i++) order[i] = i;
  const auto along = [&](size_t i) { return rig.cameras[i].pose.position[axis]; };
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return along(a) < along(b); });
  std::vector<bool> named(order.size());
  for (size_t i = 0; i < order.size(); i++) {
    if (named[order[i]]) continue;
    for (size_t j = i + 1; j < order.size() && along(order[j]) - along(order[i]) <= tolerance; j++) {
      const auto [a, b] = std::minmax(order[i], order[j]);
      if (named[b] || distance(rig, a, b) > tolerance) continue;
      named[order[j]] = true;
      findings.push_back({Severity::kWarning, "cameras[" + std::to_string(b) + "].position: is that of cameras[" +
                                                  std::to_string(a) + "] too"});
    }
  }
}

void check_mesh(const Rig& rig, std::vector<RigFinding>& findings) {
  size_t triangles = 0, slivers = 0;
  double worst = kSliver;
  std::string worst_text;
  for (const MeshFace& face : build_mesh(rig).faces) {
    if (face.corners() != 3) continue;
    triangles++;
    const double flat = flatness(rig, face);
    if (flat >= kSliver) continue;
    slivers++;
    if (flat >= worst) continue;
    worst = flat;
    worst_text =
        std::to_string(face.camera[0]) + ", " + std::to_string(face.camera[1]) + ", " + std::to_string(face.camera[2]);
  }
  if (triangles == 0)
    findings.push_back({Severity::kWarning, "topology: the mesh of " + std::to_string(rig.cameras.size()) +
                                                (rig.cameras.size() == 1 ? " camera" : " cameras") +
                                                " has no triangle: views blend along a line alone"});
  if (slivers > 0)
    findings.push_back({Severity::kWarning, "topology: " + std::to_string(slivers) + " of " +
                                                std::to_string(triangles) +
                                                " triangles are slivers, the worst that of cameras " + worst_text});
}

void check_files(const Rig& rig, size_t index, std::vector<RigFinding>& findings) {
  const Camera& camera = rig.cameras[index];
  const std::string place = "cameras[" + std::to_string(index) + "]";
  if (!camera.image.empty()) {
    try {
      const std::string path = rig.resolve(camera.image);
      const ImageSize size = load_image_size(path);
      if (size != ImageSize{camera.width, camera.height})
        findings.push_back({Severity::kError, place + ".image: " + path + " is " + size_text(size.width, size.height) +
                                                  ", the camera is " + size_text(camera.width, camera.height)});
      else
        load_image(path);  // finds damage that the header does not show
    } catch (const Error& e) {
      findings.push_back({Severity::kError, place + ".image: " + e.what()});
    }
  }
  // A sequence (film_%03d.png) is known by its folder alone.
  if (!camera.source.empty() && !is_uri(camera.source) && !is_bin_description(camera.source)) {
    fs::path file = rig.resolve(camera.source);
    if (camera.source.find('%') != std::string::npos) file = file.has_parent_path() ? file.parent_path() : ".";
    std::error_code ignored;
    if (!fs::exists(file, ignored))
      findings.push_back({Severity::kError, place + ".source: " + file.string() + " is missing"});
  }
}

}  // namespace

RigSummary summarize(const Rig& rig) {
  RigSummary summary;
  Vec3 least(std::numeric_limits<double>::infinity()), most(-std::numeric_limits<double>::infinity());
  for (const Camera& camera : rig.cameras) {
    least = glm::min(least, camera.pose.position);
    most = glm::max(most, camera.pose.position);
    summary.images += !camera.image.empty();
    summary.sources += !camera.source.empty();
  }
  summary.extent = most - least;
  summary.baseline = largest_distance(rig);
  summary.mean_neighbour = mean_nearest_distance(rig);
  for (const MeshFace& face : build_mesh(rig).faces) (face.corners() == 3 ? summary.triangles : summary.other_faces)++;
  summary.lenses = lens_lines(rig);
  return summary;
}

std::vector<RigFinding> check_rig(const Rig& rig) {
  std::vector<RigFinding> findings;
  std::map<std::string, size_t> index_of_name;
  std::vector<size_t> blind;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const auto [same, is_new] = index_of_name.emplace(rig.cameras[i].name, i);
    if (!is_new)
      findings.push_back({Severity::kWarning, "cameras[" + std::to_string(i) + "].name: \"" + rig.cameras[i].name +
                                                  "\" is that of cameras[" + std::to_string(same->second) + "] too"});
    if (rig.cameras[i].image.empty() && rig.cameras[i].source.empty()) blind.push_back(i);
    check_files(rig, i, findings);
  }
  if (!blind.empty())
    findings.push_back({Severity::kWarning,
                        "cameras[" + std::to_string(blind[0]) + "]" +
                            (blind.size() > 1 ? " and " + std::to_string(blind.size() - 1) + " more have" : " has") +
                            " neither an image nor a source"});
  find_duplicates(rig, findings);
  check_mesh(rig, findings);
  return findings;
}

}  // namespace lf
