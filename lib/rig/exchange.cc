// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <sstream>
#include <vector>

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "rig/mesh.h"

namespace lf {

namespace fs = std::filesystem;

namespace {

using nlohmann::json;

constexpr size_t kMaxYamlDepth = 64;

json scalar(const std::string& text) {
  const std::string_view digits = std::string_view(text).substr(text.size() > 1 && text[0] == '+' ? 1 : 0);
  if (const auto integer = number_of_text<int64_t>(digits)) return *integer;
  const bool has_digit = text.find_first_of("0123456789") != std::string::npos;  // not "inf" and "nan"
  if (const auto number = number_of_text<double>(digits); has_digit && number) return *number;
  if (text == "true" || text == "false") return text == "true";
  if (text.empty() || text == "~" || text == "null") return nullptr;
  return text;
}

class Builder : public YAML::EventHandler {
 public:
  json root;

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { put(mark, nullptr); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    fail(mark, "YAML aliases (*name) are not supported; repeat the value instead of the alias");
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t, const std::string& value) override {
    if (!is_utf8(value)) fail(mark, "the text is not UTF-8");
    if (is_key()) {
      levels_.back().key = value;
      levels_.back().has_key = true;
      if (levels_.back().value->contains(value))
        fail(mark, "\"" + value + "\" occurs twice; remove one of the two entries");
    } else {
      put(mark, tag == "!" ? json(value) : scalar(value));  // "!": in quotes
    }
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    open(mark, json::array());
  }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    open(mark, json::object());
  }
  void OnSequenceEnd() override { levels_.pop_back(); }
  void OnMapEnd() override { levels_.pop_back(); }

 private:
  struct Level {
    json* value;
    std::string key = {};
    bool has_key = false;
  };

  [[noreturn]] static void fail(const YAML::Mark& mark, const std::string& what) {
    throw YAML::ParserException(mark, what);
  }
  bool is_key() const { return !levels_.empty() && levels_.back().value->is_object() && !levels_.back().has_key; }
  json* put(const YAML::Mark& mark, json value) {
    if (levels_.empty()) return &(root = std::move(value));
    if (is_key()) fail(mark, "a key must be a plain word, not a list or a map");
    Level& level = levels_.back();
    level.has_key = false;
    if (level.value->is_array()) return &level.value->emplace_back(std::move(value));
    return &((*level.value)[level.key] = std::move(value));
  }
  void open(const YAML::Mark& mark, json value) {
    if (levels_.size() >= kMaxYamlDepth) fail(mark, "the lists and maps are nested too deeply");
    levels_.push_back({put(mark, std::move(value))});
  }

  std::vector<Level> levels_;
};

}  // namespace

json parse_yaml(const std::string& text, const std::string& name, const char* language) {
  Builder builder;
  try {
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    parser.HandleNextDocument(builder);
  } catch (const YAML::Exception& e) {
    const std::string line = e.mark.is_null() ? "" : "line " + std::to_string(e.mark.line + 1) + ": ";
    throw Error(name + ": " + line + "not valid " + language + ": " + e.msg);
  }
  return std::move(builder.root);
}

std::string yaml_number(double value) {
  std::string text = number_text(value);
  if (text.find('.') == std::string::npos) text.insert(std::min(text.find('e'), text.size()), ".0");
  return text;
}

std::string number_list_text(std::span<const double> numbers) {
  std::string text = "[";
  for (const double number : numbers) text += (text.size() > 1 ? ", " : "") + yaml_number(number);
  return text + "]";
}

RigImport with_topology(RigImport import) {
  for (const std::string& note : fit_topology(import.rig)) import.notes.push_back(note);
  return import;
}

void scale_lengths(RigImport& import, double scale) {
  for (Camera& camera : import.rig.cameras) {
    camera.pose.position *= scale;
    if (!is_finite(camera.pose.position)) throw_camera_error(camera, "its position is too large after the scaling");
  }
  import.near *= scale;
  import.far *= scale;
  import.has_unit = true;
}

std::string depth_note(const RigImport& import) {
  const char* const unit = import.has_unit ? "m" : "units";
  if (!(import.near > 0)) return "";
  return is_finite(import.far) ? format_text("the scene is from %.4g to %.4g %s away (focus-near, focus-far)",
                                             import.near, import.far, unit)
                               : format_text("the scene begins %.4g %s away (focus-near)", import.near, unit);
}

void add_camera(Camera camera, RigImport& import) {
  camera.id = static_cast<uint32_t>(import.rig.cameras.size());
  import.rig.cameras.push_back(std::move(camera));
}

std::vector<double> parse_numbers(const JsonValue& list) {
  std::vector<double> numbers;
  for (const JsonValue& element : list.elements()) numbers.push_back(element.number());
  return numbers;
}

std::vector<double> parse_numbers(const JsonValue& list, size_t count) {
  list.elements(count);
  return parse_numbers(list);
}

void parse_image_size(const JsonValue& list, Camera& camera) {
  const std::vector<JsonValue> sides = list.elements(2);
  parse_image_size(sides[0], sides[1], camera);
}

void parse_image_size(const JsonValue& width, const JsonValue& height, Camera& camera) {
  camera.width = static_cast<int>(width.integer(1, kMaxImageSize));
  camera.height = static_cast<int>(height.integer(1, kMaxImageSize));
}

std::vector<fs::path> paths_in(const std::string& folder) {
  std::vector<fs::path> paths;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    paths.push_back(it->path());
  if (error) throw Error(folder + ": can't be read: " + error.message());
  std::ranges::sort(paths, natural_less, [](const fs::path& path) { return path.string(); });
  return paths;
}

RigExport describe_export(const Rig& rig, const Rig& written, const FormatSupport& capacity) {
  double extent = 0;
  bool images = false, names = false, ids = false, sources = false, time_offsets = false;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const Camera& camera = rig.cameras[i];
    extent = std::max(extent, glm::length(camera.pose.position - rig.cameras[0].pose.position));
    images |= !camera.image.empty();
    names |= !camera.name.empty();
    ids |= camera.id != i;
    sources |= !camera.source.empty();
    time_offsets |= camera.time_offset != 0;
  }
  RigExport result;
  result.max_error = max_reprojection_error(rig, written, extent > 0 ? extent : 1);
  const auto note = [&](bool lost, const char* what) {
    if (lost) result.notes.push_back(std::string(what) + " not kept");
  };
  note(rig.topology.type != Topology::Type::kDelaunay && !capacity.topology, "the topology of the rig is");
  note(names && !capacity.names, "the names of the cameras are");
  note(ids && !capacity.ids, "the ids of the cameras are");
  note(images && !capacity.images, "the images of the cameras are");
  note(sources, "the sources of the cameras are");
  note(time_offsets && !capacity.time_offsets, "the time offsets of the cameras are");
  return result;
}

std::string lost_keys_note(const json& rig_file) {
  static const std::set<std::string_view> kHeld = {"format", "version", "cameras", "topology", "id", "name", "width",
                                                   "height", "model", "params", "position", "orientation",
                                                   // describe_export() describes the loss of these keys
                                                   "image", "source", "time_offset"};
  std::set<std::string> lost;
  const auto add_keys = [&](const json& object) {
    for (const auto& [key, value] : object.items())
      if (!kHeld.contains(key)) lost.insert(key);
  };
  add_keys(rig_file);
  for (const json& camera : rig_file.at("cameras")) add_keys(camera);
  std::string keys;
  for (const std::string& key : lost) keys += (keys.empty() ? "" : ", ") + key;
  return keys.empty() ? "" : "keys that only a rig file can hold are not kept: " + keys;
}

RigExport describe_grid_export(const Rig& rig, const Rig& written, double most, const std::string& grids) {
  RigExport result = describe_export(rig, written, {.names = false, .ids = false, .topology = true});
  if (!(result.max_error <= most))
    throw Error("the format can't hold this rig: it describes " + grids + ", which differs from this rig by " +
                number_text(result.max_error) + " px. Use another format, such as lf-rig export colmap");
  return result;
}

std::vector<std::string> file_names_of(const Rig& rig, std::string (*ending_of)(const Camera&),
                                       bool (*less)(std::string_view, std::string_view)) {
  std::vector<std::string> names;
  bool usable = true;
  for (const Camera& camera : rig.cameras) {
    const std::string name = camera.name + ending_of(camera);
    usable &= !camera.name.empty() && camera.name[0] != '.' && camera.name.find('/') == std::string::npos &&
              (names.empty() || less(names.back(), name));
    names.push_back(name);
  }
  for (size_t i = 0; i < names.size() && !usable; i++)
    names[i] = format_text("camera_%05zu", i) + ending_of(rig.cameras[i]);
  return names;
}

void copy_picture(const Rig& rig, const Camera& camera, const std::string& to) {
  if (camera.image.empty())
    throw_camera_error(camera, "has no image to be copied; lf-rig snapshot takes one still of each camera");
  const std::string from = rig.resolve(camera.image);
  try {
    copy_file(from, to);
  } catch (const Error& error) {
    throw Error(from + ": can't be copied: " + error.what());
  }
}

void throw_camera_error(const Camera& camera, const std::string& what) {
  throw Error("camera " + std::to_string(camera.id) + ": " + what);
}

namespace {

constexpr int kSteps = 8;
constexpr double kNever = std::numeric_limits<double>::infinity();

// Returns the distance in pixels between `pixel` and the projection into `b` of the point that `a` sees there, at
// direction (u, v, 1) and `distance` metres along the axis (infinity: only the direction counts).
double error_at(const Camera& a, const Camera& b, const Vec2& pixel, const Vec2& uv, double distance) {
  const Mat3 b_from_a = glm::transpose(b.pose.rotation()) * a.pose.rotation();
  Vec3 x = b_from_a * Vec3(uv, 1);
  if (distance < kNever)  // subtract positions first, to keep precision far from the origin
    x = x * distance + glm::transpose(b.pose.rotation()) * (a.pose.position - b.pose.position);
  const std::optional<Vec2> seen = b.lens.project(x);
  return seen ? glm::length(*seen - pixel) : kNever;
}

}  // namespace

double max_reprojection_error(const Rig& a, const Rig& b, double distance) {
  if (a.cameras.size() != b.cameras.size()) return kNever;
  double worst = 0;
  for (size_t i = 0; i < a.cameras.size(); i++) {
    const Camera& camera = a.cameras[i];
    for (int n = 0; n < (kSteps + 1) * (kSteps + 1); n++) {
      const Vec2 pixel(camera.width * (n % (kSteps + 1)) / double{kSteps} - 0.5,
                       camera.height * (n / (kSteps + 1)) / double{kSteps} - 0.5);
      const std::optional<Vec2> uv = camera.lens.unproject(pixel);
      if (!uv) continue;
      for (const double d : {distance, kNever}) worst = std::max(worst, error_at(camera, b.cameras[i], pixel, *uv, d));
    }
  }
  return worst;
}

RigExport export_text(const Rig& rig, const std::string& path, std::string (*text_of)(const Rig&),
                      RigImport (*parse)(const std::string& text, const std::string& path)) {
  Rig moved = rig;
  rebase_paths(moved, fs::path(path).parent_path().string());
  const std::string text = text_of(moved);
  const RigExport result = describe_export(rig, parse(text, path).rig, {.ids = false});
  write_text_file(text, path);
  return result;
}

namespace {

constexpr double kRotationTolerance = 1e-3;  // limit for an element of R^T R; angle errors are at most half

}  // namespace

Lens lens_from_opencv(const PinholeParams& pinhole, const std::vector<double>& distortion) {
  constexpr size_t kTerms = 8;
  const auto [fx, fy, cx, cy] = pinhole;
  const auto term = [&](size_t i) { return i < distortion.size() ? distortion[i] : 0.0; };
  for (size_t i = kTerms; i < distortion.size(); i++)
    if (distortion[i] != 0)
      throw Error("distortion term " + std::to_string(i) +
                  " (thin prism or tilt) is not 0, and a rig cannot hold this term; " + kUndistortRemedy);
  const double k1 = term(0), k2 = term(1), p1 = term(2), p2 = term(3);
  if (term(4) != 0 || term(5) != 0 || term(6) != 0 || term(7) != 0)
    return Lens(LensModel::kFullOpenCv, {fx, fy, cx, cy, k1, k2, p1, p2, term(4), term(5), term(6), term(7)});
  const bool radial = k1 != 0 || k2 != 0;
  if (p1 != 0 || p2 != 0 || (radial && fx != fy)) return Lens(LensModel::kOpenCv, {fx, fy, cx, cy, k1, k2, p1, p2});
  if (fx != fy) return Lens(LensModel::kPinhole, {fx, fy, cx, cy});
  if (!radial) return Lens::pinhole(fx, cx, cy);
  if (k2 == 0) return Lens(LensModel::kSimpleRadial, {fx, cx, cy, k1});
  return Lens(LensModel::kRadial, {fx, cx, cy, k1, k2});
}

Lens lens_from_opencv_fisheye(const PinholeParams& pinhole, const std::vector<double>& distortion) {
  const auto [fx, fy, cx, cy] = pinhole;
  if (distortion.size() != 4) throw Error("a fisheye lens must have the distortion terms k1, k2, k3 and k4");
  return Lens(LensModel::kOpenCvFisheye, {fx, fy, cx, cy, distortion[0], distortion[1], distortion[2], distortion[3]});
}

Lens lens_from_opencv(const JsonValue& place, const PinholeParams& pinhole, const std::vector<double>& distortion,
                      bool fisheye, const std::string& remedy) {
  try {
    return (fisheye ? lens_from_opencv_fisheye(pinhole, distortion) : lens_from_opencv(pinhole, distortion));
  } catch (const Error& e) {
    place.fail(e.what() + remedy);
  }
}

std::optional<PinholeParams> pinhole_of_matrix(std::span<const double> rows) {
  if (rows[1] != 0 || rows[3] != 0 || rows[6] != 0 || rows[7] != 0 || rows[8] != 1) return std::nullopt;
  return PinholeParams{rows[0], rows[4], rows[2], rows[5]};
}

std::vector<double> opencv_terms(const Camera& camera) {
  try {
    return opencv_terms(camera.lens);
  } catch (const Error& e) {
    throw_camera_error(camera, e.what());
  }
}

std::vector<double> opencv_terms(const Lens& lens) {
  const Distortion<double>& of = lens.distortion();
  if (of.fisheye) {
    if (of.is_tangential || of.is_prism)
      throw Error("OpenCV's fisheye lenses have no tangential and thin-prism terms, unlike the lens model " +
                  std::string(lens_model_name(lens.model())));
    return {of.k.begin(), of.k.end()};
  }
  if (!of.is_general) return {of.k[0], of.k[1], of.p1, of.p2};
  return {of.k[0], of.k[1], of.p1, of.p2, of.k[2], of.d[0], of.d[1], of.d[2]};
}

RigidTransform RigidTransform::operator*(const RigidTransform& first) const {
  return {rotation * first.rotation, (*this)(first.translation)};
}

RigidTransform RigidTransform::inverse() const {
  const Mat3 back = glm::transpose(rotation);
  return {back, -(back * translation)};
}

RigidTransform camera_from_world(const Pose& pose) { return RigidTransform{pose.rotation(), pose.position}.inverse(); }

Pose pose_of_camera_from_world(const RigidTransform& motion) { return pose_of_world_from_camera(motion.inverse()); }

Pose pose_of_world_from_camera(const RigidTransform& motion) {
  return {motion.translation, glm::normalize(glm::quat_cast(motion.rotation))};
}

Mat3 rotation_from_euler(const Vec3& angles) {
  return glm::mat3_cast(glm::angleAxis(angles.z, Vec3(0, 0, 1)) * glm::angleAxis(angles.y, Vec3(0, 1, 0)) *
                        glm::angleAxis(angles.x, Vec3(1, 0, 0)));
}

Mat3 rotation_from_vector(const Vec3& vector) {
  const double angle = glm::length(vector);
  return angle > 0 ? glm::mat3_cast(glm::angleAxis(angle, vector / angle)) : Mat3(1);
}

Vec3 euler_from_rotation(const Mat3& r) {
  const double z = std::atan2(r[0][1], r[0][0]), y = std::atan2(-r[0][2], std::hypot(r[0][0], r[0][1]));
  const double s = std::sin(z), c = std::cos(z);
  // The first two angles are removed before the third is computed, so that the result is exact if y is 90 degrees.
  return {std::atan2(s * r[2][0] - c * r[2][1], c * r[1][1] - s * r[1][0]), y, z};
}

Vec3 vector_from_rotation(const Mat3& rotation) {
  const Quat q = glm::normalize(glm::quat_cast(rotation));
  const Vec3 axis = Vec3(q.x, q.y, q.z) * (q.w < 0 ? -1.0 : 1.0);
  const double sine = glm::length(axis);
  return sine > 0 ? axis * (2 * std::atan2(sine, std::abs(q.w)) / sine) : Vec3(0, 0, 0);
}

Mat3 matrix_of_rows(std::span<const double> r) { return {r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8]}; }

Mat3 nearest_rotation(const Mat3& matrix, const JsonValue& value) {
  const Mat3 square = glm::transpose(matrix) * matrix;
  double error = 0;
  for (int c = 0; c < 3; c++)
    for (int r = 0; r < 3; r++) error = std::max(error, std::abs(square[c][r] - (c == r)));
  if (!(error <= kRotationTolerance) || glm::determinant(matrix) < 0)
    value.fail("must be a rotation (orthonormal, right-handed)");
  // One Newton step of the polar decomposition squares the error. Exact input needs none.
  Mat3 rotation = matrix;
  for (int i = 0; i < 4 && error > 1e-15; i++, error *= error)
    rotation = (rotation + glm::transpose(glm::inverse(rotation))) * 0.5;
  return rotation;
}

RigidTransform parse_rigid_transform(const JsonValue& rows) {
  const std::vector<JsonValue> lines = rows.elements();
  if (lines.size() != 3 && lines.size() != 4) rows.fail("must have 3 or 4 rows");
  Mat3 matrix;
  RigidTransform motion;
  for (int r = 0; r < static_cast<int>(lines.size()); r++) {
    const std::vector<JsonValue> row = lines[r].elements(4);
    for (int c = 0; c < 4; c++) {
      const double x = row[c].number();
      if (r == 3 && x != (c == 3)) lines[r].fail("must be [0, 0, 0, 1]");
      if (r < 3 && c < 3) matrix[c][r] = x;
      if (r < 3 && c == 3) motion.translation[r] = x;
    }
  }
  motion.rotation = nearest_rotation(matrix, rows);
  return motion;
}

std::string rigid_transform_text(const RigidTransform& motion) {
  std::string text = "[";
  for (int r = 0; r < 3; r++) {
    text += "[";
    for (int c = 0; c < 3; c++) text += yaml_number(motion.rotation[c][r]) + ", ";
    text += yaml_number(motion.translation[r]) + "], ";
  }
  return text + "[0.0, 0.0, 0.0, 1.0]]";
}

const char kUndistortRemedy[] =
    "undistort the pictures to a pinhole first (colmap image_undistorter, cv2.undistort, cv2.fisheye.undistortImage, "
    "image_proc) and import that camera";

namespace {

using nlohmann::json;

struct UnsupportedKey {
  const char* text;
  bool anywhere;  // matches any key with `text` in it, else the whole key
  const char* meaning;
  const char* remedy;
};

constexpr char kReshoot[] = "use a global shutter, or remove the key if the cameras stood still";
constexpr char kRewrite[] = "convert the poses to OpenGL's axes (x right, y up, z back) and remove the key";

constexpr UnsupportedKey kDangers[] = {
    {"fisheye", true, "a fisheye lens", kUndistortRemedy},
    {"ftheta", true, "an f-theta lens", kUndistortRemedy},
    {"equirect", true, "a panoramic picture", kUndistortRemedy},
    {"latlong", true, "a panoramic picture", kUndistortRemedy},
    {"panoram", true, "a panoramic picture", kUndistortRemedy},
    {"spherical", true, "a panoramic picture", kUndistortRemedy},
    {"omnidir", true, "an omnidirectional lens", kUndistortRemedy},
    {"xi", false, "the mirror parameter of an omnidirectional lens", kUndistortRemedy},
    {"orthographic", true, "a projection without perspective", "use cameras with perspective"},
    {"sk_x", false, "skew", kUndistortRemedy},
    {"sk_y", false, "skew", kUndistortRemedy},
    {"skew", true, "skew", kUndistortRemedy},
    {"alpha_c", false, "skew", kUndistortRemedy},
    {"k3", false, "a distortion term", kUndistortRemedy},
    {"k4", false, "a distortion term", kUndistortRemedy},
    {"k5", false, "a distortion term", kUndistortRemedy},
    {"k6", false, "a distortion term", kUndistortRemedy},
    {"rolling_shutter", true, "a rolling shutter", kReshoot},
    {"line_delay", true, "a rolling shutter", kReshoot},
    {"readout_time", true, "a rolling shutter", kReshoot},
    {"transform_matrix_start", false, "a camera that moves during the exposure", kReshoot},
    {"transform_matrix_end", false, "a camera that moves during the exposure", kReshoot},
    {"from_mitsuba", false, "other axes", kRewrite},
    {"from_na", false, "other axes", kRewrite},
};

constexpr std::string_view kModelKeys[] = {"camera_model", "distortion_model", "lens_model",     "camera_type",
                                           "lens_type",    "model_type",       "model",          "projection",
                                           "Camera.type",  "projection_model", "distortion_type"};
constexpr std::string_view kPinholes[] = {"pinhole", "simple_pinhole", "perspective", "opencv", "radial",
                                          "simple_radial", "radtan", "plumb_bob", "radial-tangential", "brown",
                                          "brown_conrady",
                                          // the importers check the additional terms
                                          "rational_polynomial", "full_opencv"};

std::string lower_case(std::string text) {
  for (char& c : text) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return text;
}

bool is_neutral(const json& value) {
  switch (value.type()) {
    case json::value_t::null: return true;
    case json::value_t::boolean: return !value.get<bool>();
    case json::value_t::string: {
      const std::string text = lower_case(value.get<std::string>());
      return text.empty() || text == "none" || text == "off" || text == "false" || text == "no" || text == "global";
    }
    case json::value_t::array:
    case json::value_t::object: return std::all_of(value.begin(), value.end(), is_neutral);
    default: return value.get<double>() == 0;
  }
}

std::string short_dump(const json& value) {
  constexpr size_t kMost = 60;
  if (value.is_structured()) return value.is_array() ? "a list" : "a map";
  const std::string text = value.dump(-1, ' ', true, json::error_handler_t::replace);
  return text.size() > kMost ? text.substr(0, kMost) + "..." : text;
}

class KeyChecker {
 public:
  KeyChecker(const std::set<std::string_view>& known, const std::set<std::string_view>& supported)
      : known_(known), supported_(supported) {}

  // `place` is the place of `value` in the file. `is_known` is false inside an unknown value, so that its keys are not
  // listed again.
  void check(const json& value, const JsonValue& place, bool is_known = true) {
    if (value.is_array() && std::ranges::any_of(value, [](const json& v) { return v.is_structured(); })) {
      const std::vector<JsonValue> places = place.elements();
      for (size_t i = 0; i < value.size(); i++) check(value[i], places[i], is_known);
    } else if (value.is_object()) {
      for (const auto& [key, member] : value.items()) {
        const JsonValue there = place.at(key.c_str());
        check_member(key, member, there);
        const bool member_is_known = known_.contains(key);
        if (is_known && !member_is_known) unknown_[key]++;
        check(member, there, is_known && member_is_known);
      }
    }
  }

  std::vector<std::string> notes() const {
    constexpr size_t kMaxNames = 12;
    if (unknown_.empty()) return {};
    std::string text = "keys that were not read: ";
    size_t listed = 0;
    for (const auto& [key, count] : unknown_) {
      if (listed == kMaxNames) {
        text += ", and " + std::to_string(unknown_.size() - listed) + " more";
        break;
      }
      text += (listed++ > 0 ? ", " : "") + key + (count > 1 ? " (" + std::to_string(count) + " times)" : "");
    }
    return {text};
  }

 private:
  void check_member(const std::string& key, const json& value, const JsonValue& place) const {
    if (std::find(std::begin(kModelKeys), std::end(kModelKeys), key) != std::end(kModelKeys)) {
      if (value.is_string() && !is_neutral(value) &&
          std::find(std::begin(kPinholes), std::end(kPinholes), lower_case(value.get<std::string>())) ==
              std::end(kPinholes) &&
          !supported_.contains(lower_case(value.get<std::string>())))
        place.fail("the lens model " + short_dump(value) + " cannot be imported; " + kUndistortRemedy);
      return;
    }
    const std::string name = lower_case(key);
    if (supported_.contains(name)) return;
    for (const UnsupportedKey& danger : kDangers)
      if ((danger.anywhere ? name.find(danger.text) != std::string::npos : name == danger.text) && !is_neutral(value))
        place.fail("is " + short_dump(value) + ", which means " + danger.meaning +
                   ". Such cameras cannot be imported; " + danger.remedy);
  }

  const std::set<std::string_view>&known_, &supported_;
  std::map<std::string, size_t> unknown_;
};

}  // namespace

std::vector<std::string> check_foreign_keys(const json& root, const std::string& path,
                                            const std::set<std::string_view>& known,
                                            const std::set<std::string_view>& supported) {
  KeyChecker checker(known, supported);
  checker.check(root, JsonValue(root, path));
  return checker.notes();
}

}  // namespace lf
