// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/colmap_model.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <set>
#include <sstream>
#include <string_view>
#include <tuple>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "rig/exchange.h"

namespace lf {

namespace fs = std::filesystem;

namespace {

struct LensFormat {
  std::string_view name;
  size_t num_params, num_focal;
};

// COLMAP's lens models (sensor/models.h) in the order of their numbers in binary files.
constexpr LensFormat kLensFormats[] = {{"SIMPLE_PINHOLE", 3, 1},
                                       {"PINHOLE", 4, 2},
                                       {"SIMPLE_RADIAL", 4, 1},
                                       {"RADIAL", 5, 1},
                                       {"OPENCV", 8, 2},
                                       {"OPENCV_FISHEYE", 8, 2},
                                       {"FULL_OPENCV", 12, 2},
                                       {"FOV", 5, 2},
                                       {"SIMPLE_RADIAL_FISHEYE", 4, 1},
                                       {"RADIAL_FISHEYE", 5, 1},
                                       {"THIN_PRISM_FISHEYE", 12, 2}};

constexpr int32_t kCameraSensor = 0;  // COLMAP's SensorType

constexpr char kUnknownLensRemedy[] = "; run colmap image_undistorter, and import the model in its folder sparse";

// Reads the records of a text file. Each record is a line of words in the order of the functions below.
class LineReader {
 public:
  static constexpr const char* kCameras = "cameras.txt";

  LineReader(const std::string& path, const std::string&) : path_(path), text_(read_text_file(path)) {}

  bool next_record() {
    while (next_line()) {
      const size_t first = line_.find_first_not_of(" \t");
      if (first != std::string::npos && line_[first] != '#') return true;
    }
    return false;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(path_ + ": line " + std::to_string(number_) + ": " + what);
  }
  double number(const char* what) {
    const std::string text = word(what);
    const auto value = number_of_text<double>(text);
    if (!value || !is_finite(*value)) fail(std::string(what) + " must be a finite number, but is \"" + text + "\"");
    return *value;
  }
  uint32_t id(const char* what) { return integer(what, 0, UINT32_MAX); }
  int size(const char* what) { return static_cast<int>(integer(what, 1, kMaxImageSize)); }
  const LensFormat& lens() {
    const std::string model = word("MODEL");
    const auto* const lens = std::ranges::find(kLensFormats, std::string_view(model), &LensFormat::name);
    if (lens == std::end(kLensFormats)) fail("unknown lens model \"" + model + "\"" + kUnknownLensRemedy);
    return *lens;
  }
  std::vector<double> params(const LensFormat& lens) {
    std::vector<double> params;
    while (!at_end()) params.push_back(number("PARAMS[]"));
    if (params.size() != lens.num_params)
      fail(std::string(lens.name) + " takes " + std::to_string(lens.num_params) + " numbers, but the line has " +
           std::to_string(params.size()));
    return params;
  }
  // Returns the rest of the line: names may contain spaces.
  std::string name() {
    const size_t begin = begin_of_word("NAME");
    position_ = line_.size();
    std::string text = line_.substr(begin, line_.find_last_not_of(" \t") + 1 - begin);
    if (!is_utf8(text)) fail("NAME is not UTF-8");
    return text;
  }
  // The POINTS2D[] line may be empty but must exist. Parsing the line detects files that lack these lines.
  void skip_points() {
    if (!next_line()) return;
    while (!at_end())
      for (const char* what : {"POINTS2D[] X", "POINTS2D[] Y", "POINTS2D[] POINT3D_ID"}) number(what);
  }
  bool is_camera() { return word("SENSOR_TYPE") == "CAMERA"; }
  uint32_t data_id(bool) { return id("DATA_ID"); }
  bool has_pose() { return integer("HAS_POSE", 0, 1) == 1; }
  void end_record(const char* last) const {
    if (!at_end()) fail(std::string("more data follows the last ") + last);
  }

 private:
  bool next_line() {
    if (!std::getline(text_, line_)) return false;
    number_++;
    constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
    if (number_ == 1 && line_.starts_with(kByteOrderMark)) line_.erase(0, kByteOrderMark.size());
    if (!line_.empty() && line_.back() == '\r') line_.pop_back();
    position_ = 0;
    return true;
  }
  bool at_end() const { return line_.find_first_not_of(" \t", position_) == std::string::npos; }
  size_t begin_of_word(const char* what) const {
    if (at_end()) fail(std::string(what) + " is missing");
    return line_.find_first_not_of(" \t", position_);
  }
  std::string word(const char* what) {
    const size_t begin = begin_of_word(what);
    position_ = std::min(line_.find_first_of(" \t", begin), line_.size());
    return line_.substr(begin, position_ - begin);
  }
  uint32_t integer(const char* what, uint32_t least, uint32_t most) {
    const std::string text = word(what);
    const auto value = number_of_text<double>(text);  // some programs write integers as floats (1080.0)
    if (!value || !(*value >= least && *value <= most) || std::trunc(*value) != *value)
      fail(std::string(what) + " must be an integer from " + std::to_string(least) + " to " + std::to_string(most) +
           ", but is \"" + text + "\"");
    return static_cast<uint32_t>(*value);
  }

  std::string path_;
  std::istringstream text_;
  std::string line_;
  size_t position_ = 0;
  int number_ = 0;
};

// Reads the records of a binary file: their number, and then their little-endian values in sequence. `kind` names a
// record in errors.
class ByteReader {
 public:
  static constexpr const char* kCameras = "cameras.bin";

  ByteReader(const std::string& path, const std::string& kind) : path_(path), kind_(kind), bytes_(read_file(path)) {
    records_ = value<uint64_t>("the number of " + kind + "s");
  }

  bool next_record() {
    if (records_ == 0 && position_ < bytes_.size()) fail("more data follows the last " + kind_);
    return records_ > 0 && records_--;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(path_ + ": byte " + std::to_string(position_) + ": " + what);
  }
  double number(const char* what) {
    const double number = value<double>(what);
    if (!is_finite(number)) fail(std::string(what) + " must be finite");
    return number;
  }
  uint32_t id(const char* what) { return value<uint32_t>(what); }
  int size(const char* what) {
    const uint64_t size = value<uint64_t>(what);
    if (size < 1 || size > kMaxImageSize)
      fail(std::string(what) + " must be an integer from 1 to " + std::to_string(kMaxImageSize) + ", but is " +
           std::to_string(size));
    return static_cast<int>(size);
  }
  const LensFormat& lens() {
    const int32_t number = value<int32_t>("MODEL_ID");
    if (number < 0 || static_cast<size_t>(number) >= std::size(kLensFormats))
      fail("unknown lens model " + std::to_string(number) + kUnknownLensRemedy);
    return kLensFormats[number];
  }
  std::vector<double> params(const LensFormat& lens) {
    std::vector<double> params;
    while (params.size() < lens.num_params) params.push_back(number("PARAMS[]"));
    return params;
  }
  std::string name() {
    const size_t end = bytes_.find('\0', position_);
    if (end == std::string::npos) fail("the file is truncated within NAME");
    std::string text = bytes_.substr(position_, end - position_);
    if (!is_utf8(text)) fail("NAME is not UTF-8");
    position_ = end + 1;
    if (text.empty()) fail("NAME is empty");
    return text;
  }
  void skip_points() {
    constexpr size_t kPointSize = 2 * sizeof(double) + sizeof(uint64_t);  // x, y, POINT3D_ID
    const uint64_t count = value<uint64_t>("the number of POINTS2D[]");
    if (count > (bytes_.size() - position_) / kPointSize) fail("the file is truncated within POINTS2D[]");
    position_ += count * kPointSize;
  }
  bool is_camera() { return value<int32_t>("SENSOR_TYPE") == kCameraSensor; }
  uint32_t data_id(bool is_camera) {
    const uint64_t id = value<uint64_t>("DATA_ID");
    if (is_camera && id > UINT32_MAX) fail("DATA_ID " + std::to_string(id) + " is not the id of an image");
    return static_cast<uint32_t>(id);
  }
  bool has_pose() {
    const auto flag = value<uint8_t>("HAS_POSE");
    if (flag > 1) fail("HAS_POSE must be 0 or 1, but is " + std::to_string(flag));
    return flag == 1;
  }
  void end_record(const char*) const {}

 private:
  template <typename T>
  T value(const std::string& what) {
    static_assert(std::endian::native == std::endian::little);
    if (sizeof(T) > bytes_.size() - position_) fail("the file is truncated within " + what);
    T value;
    std::memcpy(&value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return value;
  }

  std::string path_, kind_, bytes_;
  size_t position_ = 0;
  uint64_t records_ = 0;  // number of records that have not been read
};

// The functions below read both kinds of files. `Reader` is LineReader or ByteReader.

template <typename Reader>
std::pair<Quat, Vec3> read_pose(Reader& reader) {
  Quat q{};
  Vec3 t{};
  // Separate statements, because the evaluation order of arguments is unspecified.
  q.w = reader.number("QW");
  q.x = reader.number("QX");
  q.y = reader.number("QY");
  q.z = reader.number("QZ");
  t.x = reader.number("TX");
  t.y = reader.number("TY");
  t.z = reader.number("TZ");
  const double norm = glm::length(q);
  if (!(norm > 0 && is_finite(norm))) reader.fail("QW, QX, QY, QZ are all 0 or not finite, so they are not a rotation");
  // Files with 6 digits are common, and COLMAP also normalises when reading. A unit quaternion stays bit-identical.
  if (std::abs(norm - 1) > 1e-15) q /= norm;
  return {q, t};
}

template <typename Reader>
std::map<uint32_t, ColmapCamera> read_cameras(const std::string& path) {
  std::map<uint32_t, ColmapCamera> cameras;
  Reader reader(path, "camera");
  while (reader.next_record()) {
    const uint32_t id = reader.id("CAMERA_ID");
    const LensFormat& lens = reader.lens();
    ColmapCamera camera{.model = std::string(lens.name), .params = {}, .num_focal = lens.num_focal};
    camera.width = reader.size("WIDTH");
    camera.height = reader.size("HEIGHT");
    camera.params = reader.params(lens);
    if (!cameras.emplace(id, std::move(camera)).second)
      reader.fail("CAMERA_ID " + std::to_string(id) + " occurs twice, but every camera needs its own");
  }
  return cameras;
}

template <typename Reader>
std::vector<ColmapImage> read_images(const std::string& path, const std::map<uint32_t, ColmapCamera>& cameras) {
  std::vector<ColmapImage> images;
  std::set<uint32_t> ids;
  Reader reader(path, "image");
  while (reader.next_record()) {
    ColmapImage image;
    image.id = reader.id("IMAGE_ID");
    std::tie(image.q, image.t) = read_pose(reader);
    image.camera_id = reader.id("CAMERA_ID");
    if (!cameras.contains(image.camera_id))
      reader.fail("CAMERA_ID " + std::to_string(image.camera_id) + " is not in " + Reader::kCameras +
                  ", so the lens of this image is unknown");
    image.name = reader.name();
    if (!ids.insert(image.id).second)
      reader.fail("IMAGE_ID " + std::to_string(image.id) + " occurs twice, but every image needs its own");
    reader.skip_points();
    images.push_back(std::move(image));
  }
  return images;
}

using Frames = std::map<uint32_t, std::set<uint32_t>>;

template <typename Reader>
Frames read_frames(const std::string& path) {
  Frames frames;
  Reader reader(path, "frame");
  while (reader.next_record()) {
    const uint32_t id = reader.id("FRAME_ID");
    const auto [frame, is_new] = frames.emplace(id, std::set<uint32_t>());
    if (!is_new) reader.fail("FRAME_ID " + std::to_string(id) + " occurs twice, but every frame needs its own");
    reader.id("RIG_ID");
    read_pose(reader);
    const uint32_t count = reader.id("NUM_DATA_IDS");
    for (uint32_t i = 0; i < count; i++) {
      const bool is_camera = reader.is_camera();
      reader.id("SENSOR_ID");
      const uint32_t image = reader.data_id(is_camera);
      if (is_camera) frame->second.insert(image);
    }
    reader.end_record("DATA_ID");
  }
  return frames;
}

// NUM_SENSORS includes the reference sensor, which comes first and has no pose.
template <typename Reader>
std::map<uint32_t, ColmapRig> read_rigs(const std::string& path) {
  std::map<uint32_t, ColmapRig> rigs;
  Reader reader(path, "rig");
  while (reader.next_record()) {
    const uint32_t id = reader.id("RIG_ID");
    const auto [rig, is_new] = rigs.emplace(id, ColmapRig());
    if (!is_new) reader.fail("RIG_ID " + std::to_string(id) + " occurs twice, but every rig needs its own");
    const uint32_t count = reader.id("NUM_SENSORS");
    for (uint32_t i = 0; i < count; i++) {
      const bool is_camera = reader.is_camera();
      const uint32_t sensor = reader.id("SENSOR_ID");
      std::optional<std::pair<Quat, Vec3>> pose;
      if (i == 0)
        pose.emplace(Quat(1, 0, 0, 0), Vec3(0));
      else if (reader.has_pose())
        pose = read_pose(reader);
      if (is_camera && !rig->second.cameras.emplace(sensor, pose).second)
        reader.fail("camera " + std::to_string(sensor) + " occurs twice in rig " + std::to_string(id));
    }
    reader.end_record("sensor");
  }
  return rigs;
}

// Writes the records of a text file. `header` names the values of a record.
class LineWriter {
 public:
  LineWriter(const std::string& header, size_t) : text_("# " + header + "\n") {}
  void id(uint32_t id) { word(std::to_string(id)); }
  void size(int size) { word(std::to_string(size)); }
  void number(double number) { word(number_text(number)); }
  void lens(const std::string& model) { word(model); }
  void name(const std::string& name) { word(name); }
  void no_points() { text_ += "\n"; }  // the second line of an image
  void camera(uint32_t id) { word("CAMERA " + std::to_string(id)); }
  void data_id(uint32_t id) { word(std::to_string(id)); }
  void has_pose() { word("1"); }
  void end_record() { text_ += "\n"; }
  const std::string& text() const { return text_; }

 private:
  void word(const std::string& word) { text_ += (text_.back() == '\n' ? "" : " ") + word; }

  std::string text_;
};

// Writes the records of a binary file.
class ByteWriter {
 public:
  ByteWriter(const std::string&, size_t records) { value<uint64_t>(records); }
  void id(uint32_t id) { value(id); }
  void size(int size) { value(static_cast<uint64_t>(size)); }
  void number(double number) { value(number); }
  void lens(const std::string& model) {
    const auto* const lens = std::ranges::find(kLensFormats, std::string_view(model), &LensFormat::name);
    value(static_cast<int32_t>(lens - std::begin(kLensFormats)));
  }
  void name(const std::string& name) { bytes_ += name + '\0'; }
  void no_points() { value<uint64_t>(0); }
  void camera(uint32_t id) {
    value(kCameraSensor);
    value(id);
  }
  void data_id(uint32_t id) { value<uint64_t>(id); }
  void has_pose() { value<uint8_t>(1); }
  void end_record() const {}
  const std::string& text() const { return bytes_; }

 private:
  template <typename T>
  void value(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(value));
  }

  std::string bytes_;
};

// The functions below write both kinds of files. `Writer` is LineWriter or ByteWriter.

template <typename Writer>
void write_pose(Writer& writer, const Quat& q, const Vec3& t) {
  for (const double number : {q.w, q.x, q.y, q.z, t.x, t.y, t.z}) writer.number(number);
}

template <typename Writer>
std::string write_cameras(const std::map<uint32_t, ColmapCamera>& cameras) {
  Writer writer("CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]", cameras.size());
  for (const auto& [id, camera] : cameras) {
    writer.id(id);
    writer.lens(camera.model);
    writer.size(camera.width);
    writer.size(camera.height);
    for (const double number : camera.params) writer.number(number);
    writer.end_record();
  }
  return writer.text();
}

template <typename Writer>
std::string write_images(const std::vector<ColmapImage>& images) {
  Writer writer("IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)",
                images.size());
  for (const ColmapImage& image : images) {
    writer.id(image.id);
    write_pose(writer, image.q, image.t);
    writer.id(image.camera_id);
    writer.name(image.name);
    writer.no_points();
    writer.end_record();
  }
  return writer.text();
}

template <typename Writer>
std::string write_rigs(uint32_t rig_id, const std::vector<ColmapImage>& images) {
  Writer writer(
      "RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[] as (SENSOR_TYPE, SENSOR_ID, HAS_POSE, QW, QX, "
      "QY, QZ, TX, TY, TZ)",
      1);
  writer.id(rig_id);
  writer.id(static_cast<uint32_t>(images.size()));
  const ColmapImage& reference = images.front();
  writer.camera(reference.camera_id);
  for (size_t i = 1; i < images.size(); i++) {
    const Quat q = images[i].q * glm::conjugate(reference.q);
    writer.camera(images[i].camera_id);
    writer.has_pose();
    write_pose(writer, q, images[i].t - q * reference.t);
  }
  writer.end_record();
  return writer.text();
}

template <typename Writer>
std::string write_frames(uint32_t rig_id, const std::vector<ColmapImage>& images) {
  Writer writer(
      "FRAME_ID, RIG_ID, QW, QX, QY, QZ, TX, TY, TZ, NUM_DATA_IDS, DATA_IDS[] as (SENSOR_TYPE, SENSOR_ID, DATA_ID)", 1);
  writer.id(1);
  writer.id(rig_id);
  write_pose(writer, images.front().q, images.front().t);
  writer.id(static_cast<uint32_t>(images.size()));
  for (const ColmapImage& image : images) {
    writer.camera(image.camera_id);
    writer.data_id(image.id);
  }
  writer.end_record();
  return writer.text();
}

std::string path_in(const std::string& directory, const char* file) { return (fs::path(directory) / file).string(); }

[[noreturn]] void fail_without_model(const std::string& directory) {
  std::error_code ignored;
  if (fs::is_regular_file(directory, ignored))
    throw Error(directory + ": is a file, but the importer needs the folder of the model; give " +
                (fs::path(directory).has_parent_path() ? fs::path(directory).parent_path().string() : "."));
  for (const char* model : {"sparse/0", "sparse", "0"})
    for (const char* file : {"/cameras.txt", "/cameras.bin"})
      if (fs::exists(path_in(directory, model) + file, ignored))
        throw Error(directory + ": has no cameras.txt or cameras.bin. Import the folder inside it: the model is in " +
                    path_in(directory, model));
  if (fs::exists(path_in(directory, "poses_bounds.npy"), ignored))
    throw Error(directory + ": is an LLFF capture; use lf-rig import llff");
  throw Error(directory +
              ": cameras.txt and cameras.bin can't be read. A folder of pictures alone has no positions. Estimate them "
              "with COLMAP, and import the folder of its model, such as sparse/0");
}

}  // namespace

ColmapModel read_colmap_model(const std::string& directory) {
  std::error_code ignored;
  const auto has = [&](const char* file) { return fs::exists(path_in(directory, file), ignored); };
  ColmapModel model;
  model.is_binary = !has("cameras.txt");
  if (model.is_binary && !has("cameras.bin")) fail_without_model(directory);
  model.cameras_path = path_in(directory, model.is_binary ? "cameras.bin" : "cameras.txt");
  model.images_path = path_in(directory, model.is_binary ? "images.bin" : "images.txt");
  if (model.is_binary) {
    model.cameras = read_colmap_cameras_binary(model.cameras_path);
    model.images = read_colmap_images_binary(model.images_path, model.cameras);
  } else {
    model.cameras = read_colmap_cameras_text(model.cameras_path);
    model.images = read_colmap_images_text(model.images_path, model.cameras);
  }
  return model;
}

Frames read_colmap_frames(const std::string& directory, const ColmapModel& model) {
  const std::string path = path_in(directory, model.is_binary ? "frames.bin" : "frames.txt");
  if (std::error_code ignored; !fs::exists(path, ignored))
    throw Error(path + ": does not exist. COLMAP writes frames since version 3.12");
  return model.is_binary ? read_frames<ByteReader>(path) : read_frames<LineReader>(path);
}

std::map<uint32_t, ColmapRig> read_colmap_rigs(const std::string& directory, const ColmapModel& model) {
  const std::string path = path_in(directory, model.is_binary ? "rigs.bin" : "rigs.txt");
  if (std::error_code ignored; !fs::exists(path, ignored))
    throw Error(path + ": does not exist. COLMAP writes rigs since version 3.12");
  return model.is_binary ? read_rigs<ByteReader>(path) : read_rigs<LineReader>(path);
}

std::map<uint32_t, ColmapCamera> read_colmap_cameras_text(const std::string& path) {
  return read_cameras<LineReader>(path);
}

std::vector<ColmapImage> read_colmap_images_text(const std::string& path,
                                                 const std::map<uint32_t, ColmapCamera>& cameras) {
  return read_images<LineReader>(path, cameras);
}

std::map<uint32_t, ColmapCamera> read_colmap_cameras_binary(const std::string& path) {
  return read_cameras<ByteReader>(path);
}

std::vector<ColmapImage> read_colmap_images_binary(const std::string& path,
                                                   const std::map<uint32_t, ColmapCamera>& cameras) {
  std::vector<ColmapImage> images = read_images<ByteReader>(path, cameras);
  std::ranges::sort(images, {}, &ColmapImage::id);  // COLMAP writes its hash table
  return images;
}

std::string colmap_cameras_file(const std::map<uint32_t, ColmapCamera>& cameras, bool binary) {
  return binary ? write_cameras<ByteWriter>(cameras) : write_cameras<LineWriter>(cameras);
}

std::string colmap_images_file(const std::vector<ColmapImage>& images, bool binary) {
  return binary ? write_images<ByteWriter>(images) : write_images<LineWriter>(images);
}

std::string colmap_points_file(bool binary) {
  return binary ? ByteWriter("", 0).text() : LineWriter("3D point list: empty", 0).text();
}

std::string colmap_rigs_file(uint32_t rig_id, const std::vector<ColmapImage>& images, bool binary) {
  return binary ? write_rigs<ByteWriter>(rig_id, images) : write_rigs<LineWriter>(rig_id, images);
}

std::string colmap_frames_file(uint32_t rig_id, const std::vector<ColmapImage>& images, bool binary) {
  return binary ? write_frames<ByteWriter>(rig_id, images) : write_frames<LineWriter>(rig_id, images);
}

}  // namespace lf
