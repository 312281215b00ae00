// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/colmap_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <sstream>
#include <string_view>

#include "base/error.h"
#include "base/json_value.h"
#include "base/number_text.h"
#include "geometry/lens.h"
#include "rig/rig.h"

namespace lf {
namespace {

struct ColmapModel {
  const char* name;
  size_t num_params;
  size_t num_focal;
};

// Those of COLMAP's models.h that are not ours as well.
constexpr ColmapModel kOtherModels[] = {
    {"OPENCV_FISHEYE", 8, 2},        {"FULL_OPENCV", 12, 2},   {"FOV", 5, 2},
    {"SIMPLE_RADIAL_FISHEYE", 4, 1}, {"RADIAL_FISHEYE", 5, 1}, {"THIN_PRISM_FISHEYE", 12, 2}};

// One file of a model, line by line.
class LineReader {
 public:
  explicit LineReader(const std::string& path) : path_(path), text_(read_text_file(path)) {}

  // The next line as it is.
  bool next() {
    if (!std::getline(text_, line_)) return false;
    number_++;
    constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
    if (number_ == 1 && line_.starts_with(kByteOrderMark)) line_.erase(0, kByteOrderMark.size());
    if (!line_.empty() && line_.back() == '\r') line_.pop_back();
    position_ = 0;
    return true;
  }
  // The next line that is neither empty nor a comment.
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
  // The rest of the line: names may have spaces in them.
  std::string rest(const char* what) {
    const size_t begin = line_.find_first_not_of(" \t", position_);
    if (begin == std::string::npos) fail(std::string(what) + " is missing");
    position_ = line_.size();
    std::string text = line_.substr(begin, line_.find_last_not_of(" \t") + 1 - begin);
    if (!is_utf8(text)) fail(std::string(what) + " is no text in UTF-8");
    return text;
  }
  double number(const char* what) {
    const std::string text = word(what);
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !is_finite(value))
      fail(std::string(what) + " must be a finite number, is \"" + text + "\"");
    return value;
  }
  uint32_t integer(const char* what, uint32_t least, uint32_t most) {
    const std::string text = word(what);
    double value = 0;  // holds every uint32_t; some programs write whole numbers as floats (1080.0)
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !(value >= least && value <= most) ||
        std::trunc(value) != value)
      fail(std::string(what) + " must be an integer of " + std::to_string(least) + " to " + std::to_string(most) +
           ", is \"" + text + "\"");
    return static_cast<uint32_t>(value);
  }

 private:
  std::string path_;
  std::istringstream text_;
  std::string line_;
  size_t position_ = 0;
  int number_ = 0;
};

}  // namespace

std::map<uint32_t, ColmapCamera> read_colmap_cameras(const std::string& path) {
  std::map<uint32_t, ColmapCamera> cameras;
  LineReader reader(path);
  while (reader.next_data()) {
    const uint32_t id = reader.integer("CAMERA_ID", 0, UINT32_MAX);
    ColmapCamera camera;
    camera.model = reader.word("MODEL");
    camera.width = static_cast<int>(reader.integer("WIDTH", 1, kMaxImageSize));
    camera.height = static_cast<int>(reader.integer("HEIGHT", 1, kMaxImageSize));
    while (!reader.at_end()) camera.params.push_back(reader.number("PARAMS[]"));
    size_t num_params = 0;
    if (const auto ours = lens_model_from_name(camera.model)) {
      num_params = lens_model_num_params(*ours);
      camera.num_focal = lens_model_num_focal(*ours);
    } else {
      const auto other = std::find_if(std::begin(kOtherModels), std::end(kOtherModels),
                                      [&](const ColmapModel& m) { return camera.model == m.name; });
      if (other == std::end(kOtherModels)) reader.fail("unknown lens model \"" + camera.model + "\"");
      num_params = other->num_params;
      camera.num_focal = other->num_focal;
    }
    if (camera.params.size() != num_params)
      reader.fail(camera.model + " takes " + std::to_string(num_params) + " numbers, has " +
                  std::to_string(camera.params.size()));
    if (!cameras.emplace(id, camera).second) reader.fail("CAMERA_ID " + std::to_string(id) + " is there twice");
  }
  return cameras;
}

std::vector<ColmapImage> read_colmap_images(const std::string& path, const std::map<uint32_t, ColmapCamera>& cameras) {
  std::vector<ColmapImage> images;
  std::set<uint32_t> ids;
  LineReader reader(path);
  while (reader.next_data()) {
    ColmapImage image;
    image.id = reader.integer("IMAGE_ID", 0, UINT32_MAX);
    // One statement each: the order in which arguments are evaluated is open.
    image.q.w = reader.number("QW");
    image.q.x = reader.number("QX");
    image.q.y = reader.number("QY");
    image.q.z = reader.number("QZ");
    image.t.x = reader.number("TX");
    image.t.y = reader.number("TY");
    image.t.z = reader.number("TZ");
    const double norm = glm::length(image.q);
    if (!(norm > 0 && is_finite(norm))) reader.fail("QW, QX, QY, QZ must be a rotation");
    // COLMAP normalises what it reads as well: files of 6 digits are usual. What is unit already stays to the last bit.
    if (std::abs(norm - 1) > 1e-15) image.q /= norm;
    image.camera_id = reader.integer("CAMERA_ID", 0, UINT32_MAX);
    if (!cameras.count(image.camera_id))
      reader.fail("CAMERA_ID " + std::to_string(image.camera_id) + " is not in cameras.txt");
    image.name = reader.rest("NAME");
    if (!ids.insert(image.id).second) reader.fail("IMAGE_ID " + std::to_string(image.id) + " is there twice");
    images.push_back(image);
    // The line of POINTS2D[] may be empty, but it is there; read so that a file without these lines is not misread.
    if (reader.next())
      while (!reader.at_end())
        for (const char* what : {"POINTS2D[] X", "POINTS2D[] Y", "POINTS2D[] POINT3D_ID"}) reader.number(what);
  }
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
