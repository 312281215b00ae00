// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/foreign_keys.h"

#include <algorithm>
#include <map>

#include <nlohmann/json.hpp>

#include "base/error.h"

namespace lf {

const char kUndistortRemedy[] =
    "undistort the pictures to a pinhole first (colmap image_undistorter, cv2.undistort, cv2.fisheye.undistortImage, "
    "image_proc) and import that camera";

namespace {

using nlohmann::json;

struct Danger {
  const char* text;
  bool anywhere;  // matches any key with `text` in it, else the whole key
  const char* meaning;
  const char* remedy;
};

constexpr char kReshoot[] = "use a global shutter, or remove the key if the cameras stood still";
constexpr char kRewrite[] = "convert the poses to OpenGL's axes (x right, y up, z back) and remove the key";

constexpr Danger kDangers[] = {
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
                                          // Their further terms are checked where they are read.
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
  KeyChecker(const std::string& path, const std::set<std::string_view>& known) : path_(path), known_(known) {}

  // `is_known`: keys inside of an unknown value are not listed again.
  void check(const json& value, bool is_known = true) {
    if (value.is_array()) {
      for (size_t i = 0; i < value.size(); i++) {
        if (!value[i].is_structured()) continue;
        place_.push_back({{}, i});
        check(value[i], is_known);
        place_.pop_back();
      }
    } else if (value.is_object()) {
      for (const auto& [key, member] : value.items()) {
        place_.push_back({key, 0});
        check_member(key, member);
        const bool member_is_known = known_.contains(key);
        if (is_known && !member_is_known) unknown_[key]++;
        check(member, is_known && member_is_known);
        place_.pop_back();
      }
    }
  }

  std::vector<std::string> notes() const {
    constexpr size_t kMostNames = 12;
    if (unknown_.empty()) return {};
    std::string text = "keys that were not read: ";
    size_t listed = 0;
    for (const auto& [key, count] : unknown_) {
      if (listed == kMostNames) {
        text += ", and " + std::to_string(unknown_.size() - listed) + " more";
        break;
      }
      text += (listed++ > 0 ? ", " : "") + key + (count > 1 ? " (" + std::to_string(count) + " times)" : "");
    }
    return {text};
  }

 private:
  struct Step {
    std::string key;  // "": an element of an array
    size_t index;
  };

  [[noreturn]] void fail(const std::string& what) const {
    std::string place;
    for (const Step& step : place_) {
      if (step.key.empty())
        place += "[" + std::to_string(step.index) + "]";
      else
        place += (place.empty() ? "" : ".") + step.key;
    }
    throw Error(path_ + ": " + place + ": " + what);
  }

  void check_member(const std::string& key, const json& value) const {
    if (std::find(std::begin(kModelKeys), std::end(kModelKeys), key) != std::end(kModelKeys)) {
      if (value.is_string() && !is_neutral(value) &&
          std::find(std::begin(kPinholes), std::end(kPinholes), lower_case(value.get<std::string>())) ==
              std::end(kPinholes))
        fail("a rig cannot hold the lens model " + short_dump(value) + ", only pinholes with k1, k2, p1, p2; " +
             kUndistortRemedy);
      return;
    }
    const std::string name = lower_case(key);
    for (const Danger& danger : kDangers)
      if ((danger.anywhere ? name.find(danger.text) != std::string::npos : name == danger.text) && !is_neutral(value))
        fail("is " + short_dump(value) + ", which means " + danger.meaning + " that a rig cannot hold; " +
             danger.remedy);
  }

  const std::string& path_;
  const std::set<std::string_view>& known_;
  std::vector<Step> place_;
  std::map<std::string, size_t> unknown_;
};

}  // namespace

std::vector<std::string> check_foreign_keys(const json& root, const std::string& path,
                                            const std::set<std::string_view>& known) {
  KeyChecker checker(path, known);
  checker.check(root);
  return checker.notes();
}

}  // namespace lf
