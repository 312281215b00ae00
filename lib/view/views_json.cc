// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/views_json.h"

#include <cmath>
#include <map>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "geometry/lens.h"
#include "rig/rig.h"

namespace lf {

namespace {

using nlohmann::ordered_json;

constexpr char kViewsFormat[] = "lightfield-views";
constexpr int kViewsVersion = 1;
constexpr double kMaxTime = 1e9;  // seconds; in nanoseconds it fits 64 bits with room to add

std::string default_name(size_t index) {
  std::string number = std::to_string(index);
  if (number.size() < 2) number.insert(0, 1, '0');
  return "view_" + number;
}

Lens parse_view_lens(const JsonValue& value, int width, int height) {
  const std::optional<JsonValue> fov_y = value.find("fov_y");
  const bool has_lens = value.find("model") || value.find("params");
  if (fov_y && has_lens) value.fail("has both \"fov_y\" and \"model\": one lens is enough");
  if (!fov_y && !has_lens) value.fail("key \"fov_y\" (or \"model\" and \"params\") is missing");
  if (!fov_y) return parse_lens(value);
  const double degrees = fov_y->number();
  try {
    return Lens::from_fov_y(degrees, width, height);
  } catch (const Error&) {
    fov_y->fail("must be between 0 and 180 degrees");
  }
}

Plane parse_focal_plane(const JsonValue& value, const Pose& pose) {
  const std::optional<JsonValue> plane = value.find("focal_plane"), distance = value.find("focus_distance");
  if (plane && distance) value.fail("has both \"focal_plane\" and \"focus_distance\": one is enough");
  if (distance) {
    if (distance->number() <= 0) distance->fail("must be positive");
    return focal_plane_at(pose, distance->number());
  }
  if (!plane) value.fail("key \"focal_plane\" (or \"focus_distance\") is missing");
  const std::vector<JsonValue> v = plane->elements(4);
  const Plane result{{v[0].number(), v[1].number(), v[2].number()}, v[3].number()};
  const double norm = glm::length(result.normal);
  if (!(std::abs(norm - 1) <= kUnitTolerance))
    plane->fail("(a, b, c) must have unit length, its length is " + ordered_json(norm).dump());
  return result;
}

NamedView parse_view(const JsonValue& value, size_t index) {
  NamedView view;
  view.name = default_name(index);
  if (const auto name = value.find("name")) {
    view.name = name->name();
    // Pictures are written under this name.
    if (view.name.empty() || view.name.find('/') != std::string::npos)
      name->fail("must be usable as a file name");
  }
  if (const auto time = value.find("time")) {
    view.time = time->number();
    if (!(view.time >= 0 && view.time <= kMaxTime)) time->fail("must be 0 to 1e9 seconds");
  }
  view.view.width = static_cast<int>(value.at("width").integer(1, kMaxImageSize));
  view.view.height = static_cast<int>(value.at("height").integer(1, kMaxImageSize));
  view.view.pose.position = value.at("position").vec3();
  view.view.pose.orientation = value.at("orientation").unit_quaternion();
  view.view.lens = parse_view_lens(value, view.view.width, view.view.height);
  view.view.focus.plane = parse_focal_plane(value, view.view.pose);
  return view;
}

}  // namespace

std::vector<NamedView> load_views(const std::string& path) { return parse_views(read_text_file(path), path); }

std::vector<NamedView> parse_views(const std::string& text, const std::string& name) {
  const nlohmann::json root = parse_json(text, name);
  const JsonValue file(root, name);
  file.require_format(kViewsFormat, kViewsVersion);
  std::vector<NamedView> views;
  std::map<std::string, size_t> index_of_name;
  for (const JsonValue& value : file.at("views").elements()) {
    NamedView view = parse_view(value, views.size());
    if (!views.empty() && view.time < views.back().time)
      value.fail_inside("time: is before that of the view in front of it");
    const auto [same, is_new] = index_of_name.emplace(view.name, views.size());
    if (!is_new) value.fail("name \"" + view.name + "\" is also that of views[" + std::to_string(same->second) + "]");
    views.push_back(std::move(view));
  }
  if (views.empty()) file.at("views").fail("no views");
  return views;
}

void save_views(const std::vector<NamedView>& views, const std::string& path) {
  write_text_file(views_to_json(views), path);
}

std::string views_to_json(const std::vector<NamedView>& views) {
  std::string text = "{\n \"format\": \"" + std::string(kViewsFormat) +
                     "\",\n \"version\": " + std::to_string(kViewsVersion) +
                     ",\n \"views\": [\n";
  for (size_t i = 0; i < views.size(); i++) {
    const View& view = views[i].view;
    const Vec3& p = view.pose.position;
    const Quat& q = view.pose.orientation;
    const Plane& plane = view.focus.plane;
    ordered_json value = {{"name", views[i].name}, {"time", views[i].time}};
    value["position"] = {p.x, p.y, p.z};
    value["orientation"] = {q.w, q.x, q.y, q.z};
    value["width"] = view.width;
    value["height"] = view.height;
    put_lens(view.lens, value);
    value["focal_plane"] = {plane.normal.x, plane.normal.y, plane.normal.z, plane.d};
    text += "  " + value.dump() + (i + 1 < views.size() ? ",\n" : "\n");
  }
  return text + " ]\n}\n";
}

namespace {

uint64_t nanoseconds(double seconds) { return static_cast<uint64_t>(std::llround(seconds * 1e9)); }

}  // namespace

ViewPlayback::ViewPlayback(std::vector<NamedView> views, const Schedule& schedule, bool loop)
    : views_(std::move(views)),
      schedule_(schedule),
      loop_(loop),
      has_times_(views_.front().time != views_.back().time) {}

std::optional<ViewPlayback::Item> ViewPlayback::item(uint64_t n) const {
  const uint64_t pass = n / views_.size();
  const size_t i = n % views_.size();
  if (pass > 0 && !loop_) return std::nullopt;
  const View* view = &views_[i].view;
  const uint64_t own_time = nanoseconds(views_[i].time);
  if (!has_times_) return Item{view, schedule_.instant(n), schedule_.instant(n + 1) - schedule_.instant(n), own_time};

  const uint64_t begin = nanoseconds(views_.front().time), end = begin + duration();
  const uint64_t next = i + 1 < views_.size() ? nanoseconds(views_[i + 1].time) : end;
  const uint64_t time = own_time + pass * (end - begin);
  return Item{view, time, next - own_time, time};
}

uint64_t ViewPlayback::duration() const {
  const size_t n = views_.size();
  if (!has_times_) return schedule_.instant(n);
  const uint64_t last = nanoseconds(views_[n - 1].time), last_interval = last - nanoseconds(views_[n - 2].time);
  return last - nanoseconds(views_[0].time) + (last_interval > 0 ? last_interval : schedule_.period());
}

uint64_t ViewPlayback::first_at(uint64_t running_time) const {
  uint64_t n = 0;
  while (n < views_.size() && item(n)->time < running_time) n++;
  return n;
}

}  // namespace lf
