// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/colmap_model.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <set>
#include <sstream>
#include <string_view>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "rig/rig.h"

namespace lf {

namespace fs = std::filesystem;

namespace {

struct LensFormat {
  const char* name;
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

constexpr char kUnknownLensRemedy[] = "; run colmap image_undistorter, and import the model in its folder sparse";

class LineReader {
 public:
  explicit LineReader(const std::string& path) : path_(path), text_(read_text_file(path)) {}

  bool next() {
    if (!std::getline(text_, line_)) return false;
    number_++;
    constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
    if (number_ == 1 && line_.starts_with(kByteOrderMark)) line_.erase(0, kByteOrderMark.size());
    if (!line_.empty() && line_.back() == '\r') line_.pop_back();
    position_ = 0;
    return true;
  }
  bool next_data() {
    while (next()) {
      const size_t first = line_.find_first_not_of(" \t");
      if (first != std::string::npos && line_[first] != '#') return true;
    }
    return false;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(path_ + ": line " + std::to_string(number_) + ": " + what);
  }
  bool at_end() const { return line_.find_first_not_of(" \t", position_) == std::string::npos; }
  std::string word(const char* what) {
    const size_t begin = line_.find_first_not_of(" \t", position_);
    if (begin == std::string::npos) fail(std::string(what) + " is missing");
    position_ = std::min(line_.find_first_of(" \t", begin), line_.size());
    return line_.substr(begin, position_ - begin);
  }
  // Returns the rest of the line: names may contain spaces.
  std::string rest(const char* what) {
    const size_t begin = line_.find_first_not_of(" \t", position_);
    if (begin == std::string::npos) fail(std::string(what) + " is missing");
    position_ = line_.size();
    std::string text = line_.substr(begin, line_.find_last_not_of(" \t") + 1 - begin);
    if (!is_utf8(text)) fail(std::string(what) + " is not UTF-8");
    return text;
  }
  double number(const char* what) {
    const std::string text = word(what);
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !is_finite(value))
      fail(std::string(what) + " must be a finite number, but is \"" + text + "\"");
    return value;
  }
  uint32_t integer(const char* what, uint32_t least, uint32_t most) {
    const std::string text = word(what);
    double value = 0;  // a double holds every uint32_t; some programs write integers as floats (1080.0)
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !(value >= least && value <= most) ||
        std::trunc(value) != value)
      fail(std::string(what) + " must be an integer from " + std::to_string(least) + " to " + std::to_string(most) +
           ", but is \"" + text + "\"");
    return static_cast<uint32_t>(value);
  }

 private:
  std::string path_;
  std::istringstream text_;
  std::string line_;
  size_t position_ = 0;
  int number_ = 0;
};

// Reads the little-endian values of a binary file in sequence.
class ByteReader {
 public:
  explicit ByteReader(const std::string& path) : path_(path), bytes_(read_file(path)) {}

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(path_ + ": byte " + std::to_string(position_) + ": " + what);
  }
  bool at_end() const { return position_ == bytes_.size(); }
  template <typename T>
  T value(const char* what) {
    static_assert(std::endian::native == std::endian::little);
    require(sizeof(T), what);
    T value;
    std::memcpy(&value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return value;
  }
  double number(const char* what) {
    const double number = value<double>(what);
    if (!is_finite(number)) fail(std::string(what) + " must be finite");
    return number;
  }
  int size(const char* what) {
    const uint64_t size = value<uint64_t>(what);
    if (size < 1 || size > kMaxImageSize)
      fail(std::string(what) + " must be an integer from 1 to " + std::to_string(kMaxImageSize) + ", but is " +
           std::to_string(size));
    return static_cast<int>(size);
  }
  std::string text(const char* what) {
    const size_t end = bytes_.find('\0', position_);
    if (end == std::string::npos) fail("the file is truncated within " + std::string(what));
    std::string text = bytes_.substr(position_, end - position_);
    if (!is_utf8(text)) fail(std::string(what) + " is not UTF-8");
    position_ = end + 1;
    return text;
  }
  void skip(uint64_t count, size_t size, const char* what) {
    if (count > (bytes_.size() - position_) / size) fail("the file is truncated within " + std::string(what));
    position_ += count * size;
  }

 private:
  void require(size_t size, const char* what) const {
    if (size > bytes_.size() - position_) fail("the file is truncated within " + std::string(what));
  }

  std::string path_, bytes_;
  size_t position_ = 0;
};

// Checks of both kinds of files. `Reader` is LineReader or ByteReader, and fail() names the place.

template <typename Reader>
void add_camera(const Reader& reader, uint32_t id, ColmapCamera camera, std::map<uint32_t, ColmapCamera>& cameras) {
  if (!cameras.emplace(id, std::move(camera)).second)
    reader.fail("CAMERA_ID " + std::to_string(id) + " occurs twice, but every camera needs its own");
}

template <typename Reader>
void check_image(const Reader& reader, const std::map<uint32_t, ColmapCamera>& cameras, const char* cameras_file,
                 ColmapImage& image) {
  const double norm = glm::length(image.q);
  if (!(norm > 0 && is_finite(norm))) reader.fail("QW, QX, QY, QZ are all 0 or not finite, so they are not a rotation");
  // Files with 6 digits are common, and COLMAP also normalises when reading. A unit quaternion stays bit-identical.
  if (std::abs(norm - 1) > 1e-15) image.q /= norm;
  if (!cameras.contains(image.camera_id))
    reader.fail("CAMERA_ID " + std::to_string(image.camera_id) + " is not in " + cameras_file +
                ", so the lens of this image is unknown");
}

template <typename Reader>
void add_image(const Reader& reader, ColmapImage image, std::set<uint32_t>& ids, std::vector<ColmapImage>& images) {
  if (!ids.insert(image.id).second)
    reader.fail("IMAGE_ID " + std::to_string(image.id) + " occurs twice, but every image needs its own");
  images.push_back(std::move(image));
}

template <typename Reader>
void read_pose(Reader& reader, ColmapImage& image) {
  // Separate statements, because the evaluation order of arguments is unspecified.
  image.q.w = reader.number("QW");
  image.q.x = reader.number("QX");
  image.q.y = reader.number("QY");
  image.q.z = reader.number("QZ");
  image.t.x = reader.number("TX");
  image.t.y = reader.number("TY");
  image.t.z = reader.number("TZ");
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

namespace {

using Frames = std::map<uint32_t, std::set<uint32_t>>;

template <typename Reader>
std::set<uint32_t>& add_frame(const Reader& reader, uint32_t id, Frames& frames) {
  const auto [frame, is_new] = frames.emplace(id, std::set<uint32_t>());
  if (!is_new) reader.fail("FRAME_ID " + std::to_string(id) + " occurs twice, but every frame needs its own");
  return frame->second;
}

constexpr const char* kPose[] = {"QW", "QX", "QY", "QZ", "TX", "TY", "TZ"};  // of the rig

Frames read_frames_text(const std::string& path) {
  Frames frames;
  LineReader reader(path);
  while (reader.next_data()) {
    std::set<uint32_t>& images = add_frame(reader, reader.integer("FRAME_ID", 0, UINT32_MAX), frames);
    reader.integer("RIG_ID", 0, UINT32_MAX);
    for (const char* what : kPose) reader.number(what);
    const uint32_t count = reader.integer("NUM_DATA_IDS", 0, UINT32_MAX);
    for (uint32_t i = 0; i < count; i++) {
      const bool is_camera = reader.word("SENSOR_TYPE") == "CAMERA";
      reader.integer("SENSOR_ID", 0, UINT32_MAX);
      const uint32_t id = reader.integer("DATA_ID", 0, UINT32_MAX);
      if (is_camera) images.insert(id);
    }
    if (!reader.at_end()) reader.fail("more data follows the last DATA_ID");
  }
  return frames;
}

Frames read_frames_binary(const std::string& path) {
  constexpr int32_t kCamera = 0;  // COLMAP's SensorType
  Frames frames;
  ByteReader reader(path);
  const uint64_t num_frames = reader.value<uint64_t>("the number of frames");
  for (uint64_t n = 0; n < num_frames; n++) {
    std::set<uint32_t>& images = add_frame(reader, reader.value<uint32_t>("FRAME_ID"), frames);
    reader.value<uint32_t>("RIG_ID");
    for (const char* what : kPose) reader.number(what);
    const uint32_t count = reader.value<uint32_t>("NUM_DATA_IDS");
    for (uint32_t i = 0; i < count; i++) {
      const bool is_camera = reader.value<int32_t>("SENSOR_TYPE") == kCamera;
      reader.value<uint32_t>("SENSOR_ID");
      const uint64_t id = reader.value<uint64_t>("DATA_ID");
      if (is_camera && id > UINT32_MAX) reader.fail("DATA_ID " + std::to_string(id) + " is not the id of an image");
      if (is_camera) images.insert(static_cast<uint32_t>(id));
    }
  }
  if (!reader.at_end()) reader.fail("more data follows the last frame");
  return frames;
}

}  // namespace

Frames read_colmap_frames(const std::string& directory, const ColmapModel& model) {
  const std::string path = path_in(directory, model.is_binary ? "frames.bin" : "frames.txt");
  if (std::error_code ignored; !fs::exists(path, ignored))
    throw Error(path + ": does not exist. COLMAP writes frames since version 3.12");
  return model.is_binary ? read_frames_binary(path) : read_frames_text(path);
}

std::map<uint32_t, ColmapCamera> read_colmap_cameras_text(const std::string& path) {
  std::map<uint32_t, ColmapCamera> cameras;
  LineReader reader(path);
  while (reader.next_data()) {
    const uint32_t id = reader.integer("CAMERA_ID", 0, UINT32_MAX);
    ColmapCamera camera;
    camera.model = reader.word("MODEL");
    camera.width = static_cast<int>(reader.integer("WIDTH", 1, kMaxImageSize));
    camera.height = static_cast<int>(reader.integer("HEIGHT", 1, kMaxImageSize));
    while (!reader.at_end()) camera.params.push_back(reader.number("PARAMS[]"));
    const auto format = std::ranges::find_if(kLensFormats, [&](const LensFormat& f) { return camera.model == f.name; });
    if (format == std::end(kLensFormats))
      reader.fail("unknown lens model \"" + camera.model + "\"" + kUnknownLensRemedy);
    if (camera.params.size() != format->num_params)
      reader.fail(camera.model + " takes " + std::to_string(format->num_params) + " numbers, but the line has " +
                  std::to_string(camera.params.size()));
    camera.num_focal = format->num_focal;
    add_camera(reader, id, std::move(camera), cameras);
  }
  return cameras;
}

std::vector<ColmapImage> read_colmap_images_text(const std::string& path,
                                                 const std::map<uint32_t, ColmapCamera>& cameras) {
  std::vector<ColmapImage> images;
  std::set<uint32_t> ids;
  LineReader reader(path);
  while (reader.next_data()) {
    ColmapImage image;
    image.id = reader.integer("IMAGE_ID", 0, UINT32_MAX);
    read_pose(reader, image);
    image.camera_id = reader.integer("CAMERA_ID", 0, UINT32_MAX);
    check_image(reader, cameras, "cameras.txt", image);
    image.name = reader.rest("NAME");
    add_image(reader, std::move(image), ids, images);
    // The POINTS2D[] line may be empty but must exist. Parsing the line detects files that lack these lines.
    if (reader.next())
      while (!reader.at_end())
        for (const char* what : {"POINTS2D[] X", "POINTS2D[] Y", "POINTS2D[] POINT3D_ID"}) reader.number(what);
  }
  return images;
}

std::map<uint32_t, ColmapCamera> read_colmap_cameras_binary(const std::string& path) {
  std::map<uint32_t, ColmapCamera> cameras;
  ByteReader reader(path);
  const uint64_t count = reader.value<uint64_t>("the number of cameras");
  for (uint64_t i = 0; i < count; i++) {
    const uint32_t id = reader.value<uint32_t>("CAMERA_ID");
    const int32_t number = reader.value<int32_t>("MODEL_ID");
    if (number < 0 || static_cast<size_t>(number) >= std::size(kLensFormats))
      reader.fail("unknown lens model " + std::to_string(number) + kUnknownLensRemedy);
    const LensFormat& format = kLensFormats[number];
    ColmapCamera camera{.model = format.name, .params = {}, .num_focal = format.num_focal};
    camera.width = reader.size("WIDTH");
    camera.height = reader.size("HEIGHT");
    while (camera.params.size() < format.num_params) camera.params.push_back(reader.number("PARAMS[]"));
    add_camera(reader, id, std::move(camera), cameras);
  }
  if (!reader.at_end()) reader.fail("more data follows the last camera");
  return cameras;
}

std::vector<ColmapImage> read_colmap_images_binary(const std::string& path,
                                                   const std::map<uint32_t, ColmapCamera>& cameras) {
  constexpr size_t kPointSize = 2 * sizeof(double) + sizeof(uint64_t);  // x, y, POINT3D_ID
  std::vector<ColmapImage> images;
  std::set<uint32_t> ids;
  ByteReader reader(path);
  const uint64_t count = reader.value<uint64_t>("the number of images");
  for (uint64_t i = 0; i < count; i++) {
    ColmapImage image;
    image.id = reader.value<uint32_t>("IMAGE_ID");
    read_pose(reader, image);
    image.camera_id = reader.value<uint32_t>("CAMERA_ID");
    check_image(reader, cameras, "cameras.bin", image);
    image.name = reader.text("NAME");
    if (image.name.empty()) reader.fail("NAME is empty");
    reader.skip(reader.value<uint64_t>("the number of POINTS2D[]"), kPointSize, "POINTS2D[]");
    add_image(reader, std::move(image), ids, images);
  }
  if (!reader.at_end()) reader.fail("more data follows the last image");
  std::ranges::sort(images, {}, &ColmapImage::id);  // COLMAP writes its hash table
  return images;
}

std::string colmap_cameras_text(const std::map<uint32_t, ColmapCamera>& cameras) {
  std::string text = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
  for (const auto& [id, camera] : cameras) {
    text += std::to_string(id) + " " + camera.model + " " + std::to_string(camera.width) + " " +
            std::to_string(camera.height);
    for (const double value : camera.params) text += " " + number_text(value);
    text += "\n";
  }
  return text;
}

std::string colmap_images_text(const std::vector<ColmapImage>& images) {
  std::string text = "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n";
  for (const ColmapImage& image : images) {
    const Quat& q = image.q;
    text += std::to_string(image.id);
    for (const double value : {q.w, q.x, q.y, q.z, image.t.x, image.t.y, image.t.z}) text += " " + number_text(value);
    text += " " + std::to_string(image.camera_id) + " " + image.name + "\n\n";
  }
  return text;
}

}  // namespace lf
