// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/rig_report.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <string_view>
#include <vector>

#include "base/text.h"
#include "image/image_file.h"
#include "rig/camera_source.h"
#include "rig/mesh.h"
#include "rig/source_security.h"
#include "rig/triangulation.h"

namespace lf {
namespace {

using Severity = RigFinding::Severity;

constexpr double kSliver = 0.02;     // height of a triangle over its longest side: an angle of about one degree
constexpr double kSamePlace = 1e-9;  // of the baseline
constexpr double kMinShare = 0.5;    // minimum share of triangles whose cameras look through the triangle

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

double flatness(const Rig& rig, const MeshFace& face) {
  const auto position = [&](int i) { return rig.cameras[face.camera[i]].pose.position; };
  const Vec3 a = position(1) - position(0), b = position(2) - position(0);
  const double longest = std::max({glm::length(a), glm::length(b), glm::length(a - b)});
  return longest > 0 ? glm::length(glm::cross(a / longest, b / longest)) : 0;
}

// Reports coincident cameras. Each is reported once, together with the first camera at that position.
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
      findings.push_back({Severity::kWarning, "cameras[" + std::to_string(b) + "].position: also used by cameras[" +
                                                  std::to_string(a) + "]"});
    }
  }
}

// A finding that cameras share. It is reported once, with the first camera and the number of further cameras.
class SharedFinding {
 public:
  explicit SharedFinding(Severity severity) : severity_(severity) {}
  void add(size_t camera, const std::string& text) {
    if (cameras_++ == 0) first_ = "cameras[" + std::to_string(camera) + "]" + text;
  }
  void report(std::vector<RigFinding>& findings) const {
    if (cameras_ == 0) return;
    findings.push_back(
        {severity_,
         first_ + (cameras_ > 1 ? "; " + std::to_string(cameras_ - 1) + " more cameras have the same problem" : "")});
  }

 private:
  Severity severity_;
  std::string first_;
  size_t cameras_ = 0;
};

std::string cause_of_principal_point(const Camera& camera) {
  // Calibrations put the principal point near the middle, with equal proportions in both directions.
  constexpr double kSameShare = 1.15;
  const double x = camera.lens.cx() + 0.5, y = camera.lens.cy() + 0.5;  // relative to the corner
  constexpr double kNormalised = 2;                                     // cx and cy of 0 to 1, and half a pixel
  if (std::abs(x) < kNormalised && std::abs(y) < kNormalised)
    return "Are the values normalised, or in millimetres? A rig has pixels";
  const double share_x = x / (camera.width / 2.0), share_y = y / (camera.height / 2.0);
  if (std::min(share_x, share_y) > 0 && std::max(share_x, share_y) < kSameShare * std::min(share_x, share_y))
    return format_text(
        "Was the camera calibrated at another resolution, about %.0fx%.0f? Scale f, cx and cy to the "
        "size of the pictures",
        2 * x, 2 * y);
  return "This is right only if the picture is an off-centre part of the picture of the lens";
}

// Returns the distance between the principal point and the fold of the distortion, in pixels.
double fold_radius(const Lens& lens) {
  if (!lens.folds()) return INFINITY;
  return std::min(lens.fx(), lens.fy()) * lens.bend({lens.max_length(), 0}).x;
}

// Returns the share of pixels with a line of sight, measured at 17 x 17 positions from corner to corner.
double share_with_rays(const Camera& camera) {
  constexpr int kSteps = 16;
  int seen = 0;
  for (int j = 0; j <= kSteps; j++)
    for (int i = 0; i <= kSteps; i++)
      seen += camera.lens.direction(Vec2(camera.width * i / double{kSteps}, camera.height * j / double{kSteps}) - 0.5)
                  .has_value();
  return seen / double{(kSteps + 1) * (kSteps + 1)};
}

bool has_ray_at_corners(const Camera& camera) {
  for (const double x : {-0.5, camera.width - 0.5})
    for (const double y : {-0.5, camera.height - 0.5})
      if (!camera.lens.direction({x, y})) return false;
  return true;
}

// A large spread suggests a wrong unit or unsynchronised clocks.
void check_time_offsets(const Rig& rig, std::vector<RigFinding>& findings) {
  constexpr double kMost = 1;  // seconds
  const auto [least, most] = std::ranges::minmax_element(rig.cameras, {}, &Camera::time_offset);
  if (most->time_offset - least->time_offset <= kMost) return;
  const auto text = [&](const auto& camera) {
    return "cameras[" + std::to_string(camera - rig.cameras.begin()) +
           "].time_offset: " + number_text(camera->time_offset) + " s";
  };
  findings.push_back({Severity::kWarning, text(most) + ", " + text(least) +
                                              ": the recordings must overlap in time; is the value in seconds?"});
}

void check_mesh(const Rig& rig, std::vector<RigFinding>& findings) {
  size_t triangles = 0, slivers = 0;
  double worst = kSliver;
  std::string worst_text;
  const Mesh mesh = build_mesh(rig);
  for (const MeshFace& face : mesh.faces) {
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
                                                " has no triangle, so views only blend along a line"});
  if (slivers > 0)
    findings.push_back({Severity::kWarning,
                        "topology: " + std::to_string(slivers) + " of " + std::to_string(triangles) +
                            " triangles are very thin, which makes weights unsteady; the thinnest is between cameras " +
                            worst_text});
  if (const double share = share_facing_cameras(rig, mesh); slivers < triangles && share < kMinShare)
    findings.push_back(
        {Severity::kWarning,
         "topology: cameras look along " +
             std::to_string(std::lround((1 - share) * static_cast<double>(triangles - slivers))) + " of " +
             std::to_string(triangles) +
             " triangles, not through the triangles, as in an inward-looking ring: views between cameras stay black. "
             "List the triangles around the scene (as lf-rig new --inward and lf-rig import do)"});
  if (const std::optional<GridFault> fault = find_grid_fault(rig))
    findings.push_back({Severity::kWarning, "topology: " + fault->text});
}

std::vector<uint8_t> bytes_of_file(const std::string& path, std::streamoff from, std::ios::seekdir direction,
                                   size_t count) {
  std::ifstream file(path, std::ios::binary);
  std::vector<uint8_t> bytes(count);
  file.seekg(from, direction);
  if (!file) file.clear(), file.seekg(0);  // shorter than the requested range
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<size_t>(file.gcount()));
  return bytes;
}

// True if a PNG or JPEG file has no end marker. Truncation is the most common damage, for example by a full disk, and
// is detected without decoding.
bool is_cut_off(const std::string& path) {
  constexpr std::streamoff kTail = 4096;  // some cameras pad JPEG
  const std::vector<uint8_t> tail = bytes_of_file(path, -kTail, std::ios::end, kTail);
  const std::string_view text(reinterpret_cast<const char*>(tail.data()), tail.size());
  const ImageCoding coding = detect_image_coding(bytes_of_file(path, 0, std::ios::beg, 4));
  return text.find(coding == ImageCoding::kPng ? "IEND" : "\xff\xd9") == text.npos;
}

// Cameras that show the same file. Two cameras at different positions cannot take the same picture.
struct SharedFiles {
  std::map<std::string, size_t> camera_of_file;
  SharedFinding finding{Severity::kWarning};
};

class FileChecker {
 public:
  FileChecker(const Rig& rig, size_t index, std::vector<RigFinding>& findings, std::vector<std::string>& turned,
              SharedFiles& shared)
      : rig_(rig), index_(index), camera_(rig.cameras[index]), findings_(findings), turned_(turned), shared_(shared) {
    place_ = "cameras[" + std::to_string(index) + "]";
  }

  void check() {
    check_source(".image", camera_.image, true);
    check_source(".source", camera_.source, false);
  }

 private:
  void find(Severity severity, const char* key, const std::string& text) {
    findings_.push_back({severity, place_ + key + ": " + text});
  }

  void check_source(const char* key, const std::string& text, bool is_image) {
    if (text.empty()) return;
    try {
      const CameraSource source = find_source(rig_, text, is_image);
      const bool is_shown = !is_image || camera_.source.empty();
      if (is_shown && source.is_file()) check_shared(key, source.location);
      if (source.kind == CameraSource::Kind::kStill) check_picture(key, source.location);
      if (source.kind == CameraSource::Kind::kSequence) check_sequence(key, source);
      if (const auto part = source.is_file() ? std::nullopt : untrusted_component(text))
        find(Severity::kWarning, key, "has " + *part + ": the rig opens only with --trust-rig");
    } catch (const Error& e) {
      find(Severity::kError, key, redacted_location(e.what()));
    }
  }

  void check_shared(const char* key, const std::string& path) {
    std::error_code ignored;
    const std::string file = std::filesystem::weakly_canonical(path, ignored).string();
    const auto [same, is_new] = shared_.camera_of_file.emplace(file.empty() ? path : file, index_);
    if (!is_new)
      shared_.finding.add(index_, key + (": " + path) + " is also the file of cameras[" + std::to_string(same->second) +
                                      "]: give each camera its own file");
  }

  void check_picture(const char* key, const std::string& path) {
    const ImageSize size = load_image_size(path);
    if (size != ImageSize{camera_.width, camera_.height})
      find(Severity::kError, key,
           path + " is " + size_text(size.width, size.height) + ", the camera is " +
               size_text(camera_.width, camera_.height));
    else
      load_image(path);  // finds damage that the header does not show
    constexpr size_t kHeaders = 1 << 20;
    const std::string notice = orientation_notice(exif_orientation(bytes_of_file(path, 0, std::ios::beg, kHeaders)));
    if (!notice.empty()) turned_.push_back(place_ + key + ": " + path + ": " + notice);
  }

  void check_sequence(const char* key, const CameraSource& sequence) {
    check_picture(key, sequence_file(sequence, 0));
    int cut_off = 0;
    std::string first;
    for (int i = 0; i < sequence.count; i++)
      if (const std::string path = sequence_file(sequence, i); is_cut_off(path) && cut_off++ == 0) first = path;
    if (cut_off > 0)
      find(Severity::kWarning, key,
           first + (cut_off > 1 ? " and " + std::to_string(cut_off - 1) + " more are" : " is") +
               " truncated, so there are no frames");
  }

  const Rig& rig_;
  const size_t index_;
  const Camera& camera_;
  std::vector<RigFinding>& findings_;
  std::vector<std::string>& turned_;  // notices about images with an EXIF rotation
  SharedFiles& shared_;
  std::string place_;
};

// Returns true if the cameras are on a circle without large gaps.
bool is_ring(const Rig& rig) {
  constexpr size_t kLeastCameras = 5;  // four cameras at the corners of a square are also on a circle
  constexpr double kTolerance = 0.05;  // relative to the radius
  constexpr double kLargestGap = 2;    // relative to the mean
  if (rig.cameras.size() < kLeastCameras) return false;
  const double count = static_cast<double>(rig.cameras.size());
  std::vector<Vec3> positions;
  Vec3 centre(0);
  for (const Camera& camera : rig.cameras) {
    positions.push_back(camera.pose.position);
    centre += camera.pose.position / count;
  }
  double radius = 0;
  for (const Vec3& position : positions) radius += glm::distance(position, centre) / count;
  const PlaneAxes axes = principal_axes(positions);
  std::vector<double> angles;
  for (const Vec3& position : positions) {
    const Vec3 from_centre = position - centre;
    const double x = glm::dot(from_centre, axes.x), y = glm::dot(from_centre, axes.y);
    const double height = glm::dot(from_centre, glm::cross(axes.x, axes.y));
    if (!(std::abs(std::hypot(x, y) - radius) <= kTolerance * radius && std::abs(height) <= kTolerance * radius))
      return false;
    angles.push_back(std::atan2(y, x));
  }
  std::ranges::sort(angles);
  angles.push_back(angles.front() + 2 * M_PI);
  for (size_t i = 1; i < angles.size(); i++)
    if (angles[i] - angles[i - 1] > kLargestGap * 2 * M_PI / count) return false;
  return true;
}

}  // namespace

RigSummary summarize(const Rig& rig) {
  RigSummary summary;
  for (const Camera& camera : rig.cameras) {
    summary.images += !camera.image.empty();
    summary.sources += !camera.source.empty();
  }
  const auto [least, most] = bounding_box(rig);
  summary.extent = most - least;
  summary.baseline = largest_distance(rig);
  summary.mean_neighbour = mean_nearest_distance(rig);
  for (const MeshFace& face : build_mesh(rig).faces) (face.corners() == 3 ? summary.triangles : summary.other_faces)++;
  summary.lenses = lens_lines(rig);
  return summary;
}

std::string arrangement_text(const Rig& rig) {
  if (rig.cameras.size() < 2) return "";
  const Topology& topology = rig.topology;
  std::string shape = "irregular arrangement";
  if (topology.type == Topology::Type::kGrid && topology.rows > 1 && topology.columns > 1)
    shape = "grid of " + size_text(topology.rows, topology.columns);
  else if (is_ring(rig))
    shape = "ring";
  else if (std::ranges::none_of(build_mesh(rig).faces, [](const MeshFace& face) { return face.corners() == 3; }))
    shape = "row";
  return shape + ", " + short_text(mean_nearest_distance(rig)) + " m between neighbouring cameras";
}

std::vector<RigFinding> check_lenses(const Rig& rig) {
  constexpr double kShortestFocal = 0.1;  // relative to the side; 157 degrees
  constexpr double kMiddle = 0.25;        // half of the middle half
  constexpr double kMinShare = 0.1;       // a smaller part of a picture is of no use
  SharedFinding focal(Severity::kWarning), centre(Severity::kWarning), fold(Severity::kWarning),
      blank(Severity::kError);
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const Camera& camera = rig.cameras[i];
    const Lens& lens = camera.lens;
    const std::string place = ".params" + (camera.name.empty() ? "" : " (" + camera.name + ")") + ": ";
    const std::string size = size_text(camera.width, camera.height);
    if (lens.fx() < kShortestFocal * camera.width || lens.fy() < kShortestFocal * camera.height) {
      const bool wide = lens.fx() / camera.width < lens.fy() / camera.height;
      const double f = wide ? lens.fx() : lens.fy(), side = wide ? camera.width : camera.height;
      focal.add(i,
                place + format_text("the focal length of %.6g px gives a picture of %s a field of view of %.0f "
                                    "degrees. Is the focal length in millimetres or normalised? A rig has pixels",
                                    f, size.c_str(),
                                    (lens.distortion().fisheye ? side / f : 2 * std::atan(side / 2 / f)) * 180 / M_PI));
    }
    if (std::abs(lens.cx() + 0.5 - camera.width / 2.0) > kMiddle * camera.width ||
        std::abs(lens.cy() + 0.5 - camera.height / 2.0) > kMiddle * camera.height)
      centre.add(i, place + format_text("the principal point (%.6g, %.6g) is far from the middle of the picture of %s. "
                                        "%s",
                                        lens.cx(), lens.cy(), size.c_str(), cause_of_principal_point(camera).c_str()));
    if (has_ray_at_corners(camera)) continue;
    const double share = share_with_rays(camera), radius = fold_radius(lens);
    // The corners of a fisheye picture may be beyond the field of view.
    if (lens.distortion().fisheye && !lens.folds() && share >= kMinShare) continue;
    // Without a radial fold, the tangential terms are the cause.
    std::string terms = format_text("k1 %.6g, k2 %.6g", lens.k1(), lens.k2());
    if (lens.distortion().is_general)
      terms = lens_model_name(lens.model());
    else if (!lens.folds())
      terms += format_text(", p1 %.6g, p2 %.6g", lens.p1(), lens.p2());
    const std::string cause =
        lens.folds() ? format_text("(%s) folds the picture at %.0f px from the principal point", terms.c_str(), radius)
                     : format_text("(%s) is not invertible in the whole picture", terms.c_str());
    (share < kMinShare ? blank : fold)
        .add(i, place + format_text("the distortion %s, so only %.0f %% of the picture of %s can be used. Are the "
                                    "coefficients of another lens model or lens?",
                                    cause.c_str(), 100 * share, size.c_str()));
  }
  std::vector<RigFinding> findings;
  for (const SharedFinding* finding : {&blank, &fold, &focal, &centre}) finding->report(findings);
  return findings;
}

std::vector<RigFinding> check_rig(const Rig& rig) {
  std::vector<RigFinding> findings = check_lenses(rig);
  std::map<std::string, size_t> index_of_name;
  std::vector<size_t> blind;
  std::vector<std::string> turned;
  SharedFiles shared;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const auto [same, is_new] = index_of_name.emplace(rig.cameras[i].name, i);
    if (!is_new)
      findings.push_back({Severity::kWarning, "cameras[" + std::to_string(i) + "].name: \"" + rig.cameras[i].name +
                                                  "\" is also used by cameras[" + std::to_string(same->second) + "]"});
    if (rig.cameras[i].image.empty() && rig.cameras[i].source.empty()) blind.push_back(i);
    FileChecker(rig, i, findings, turned, shared).check();
  }
  shared.finding.report(findings);
  if (!turned.empty())
    findings.push_back({Severity::kWarning,
                        turned[0] + (turned.size() > 1 ? "; " + std::to_string(turned.size() - 1) + " more" : "")});
  if (!blind.empty())
    findings.push_back({Severity::kWarning,
                        "cameras[" + std::to_string(blind[0]) + "]" +
                            (blind.size() > 1 ? " and " + std::to_string(blind.size() - 1) + " more have" : " has") +
                            " neither an image nor a source: " +
                            (blind.size() == rig.cameras.size() ? "the built-in scene is used until each camera has one"
                                                                : "add one, or remove the camera")});
  check_time_offsets(rig, findings);
  find_duplicates(rig, findings);
  check_mesh(rig, findings);
  return findings;
}

}  // namespace lf
