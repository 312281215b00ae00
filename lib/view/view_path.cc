// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view_path.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "geometry/lens.h"
#include "rig/rig.h"
#include "view/navigator.h"

namespace lf {

namespace {

using nlohmann::ordered_json;

constexpr char kViewsFormat[] = "lightfield-views";
constexpr int kViewsVersion = 1;
constexpr double kMaxTime = 1e9;  // seconds; sums in nanoseconds fit 64 bits

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
    if (view.name.empty() || view.name.find('/') != std::string::npos)
      name->fail("must be usable as a file name: not empty, and without \"/\"");
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
      value.fail_inside("time: must not be before the previous view");
    const auto [same, is_new] = index_of_name.emplace(view.name, views.size());
    if (!is_new) value.fail("name \"" + view.name + "\" is also in views[" + std::to_string(same->second) + "]");
    views.push_back(std::move(view));
  }
  if (views.empty()) file.at("views").fail("no views, but a file needs at least one view");
  return views;
}

void save_views(const std::vector<NamedView>& views, const std::string& path) {
  write_text_file(views_to_json(views), path);
}

std::string views_to_json(const std::vector<NamedView>& views) {
  std::string text = "{\n \"format\": \"" + std::string(kViewsFormat) +
                     "\",\n \"version\": " + std::to_string(kViewsVersion) + ",\n \"views\": [\n";
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

std::optional<uint64_t> RequestSchedule::end() const {
  if (!playback_ || loop_) return std::nullopt;
  return playback_->item(0)->time + playback_->duration();
}

void RequestSchedule::seek(uint64_t running_time) {
  index_ = playback_ ? playback_->first_at(running_time) : schedule_.first_from(running_time);
}

std::optional<RequestSlot> RequestSchedule::next() const {
  if (!playback_) {
    const uint64_t begin = schedule_.instant(index_);
    return RequestSlot{begin, schedule_.instant(index_ + 1) - begin, begin};
  }
  const auto item = playback_->item(index_);
  if (!item) return std::nullopt;
  return RequestSlot{item->time, item->duration, item->target_time, item->view};
}

std::optional<RequestSlot> RequestSchedule::next_live(uint64_t now, uint64_t base_time, uint64_t capture_delay) const {
  std::optional<RequestSlot> slot = next();
  if (!slot) return std::nullopt;
  if (playback_ && playback_->has_times()) {
    slot->target_time = schedule_.instant(schedule_.index_at(base_time + slot->pts));
    return slot;
  }
  // Requests the newest capture that is old enough, but no capture twice and none before the stream begins. A timestamp
  // in the future belongs to another base time.
  const uint64_t farthest = now - std::min(now, base_time) + schedule_.instant(2);
  const uint64_t earliest = base_time + (last_pts_ && *last_pts_ <= farthest ? *last_pts_ + 1 : 0);
  const uint64_t k = std::max(schedule_.index_at(now - std::min(now, capture_delay)), schedule_.first_from(earliest));
  slot->target_time = schedule_.instant(k);
  slot->pts = slot->target_time - base_time;
  slot->duration = schedule_.instant(k + 1) - slot->target_time;
  return slot;
}

RequestSlot RequestSchedule::early_request(const RequestSlot& slot, uint64_t now, uint64_t base_time,
                                           uint64_t capture_delay) const {
  const uint64_t old_enough = now - std::min(now, capture_delay);
  RequestSlot early = slot;
  early.pts = old_enough - std::min(old_enough, base_time);
  early.target_time = schedule_.instant(schedule_.index_at(old_enough));
  return early;
}

bool RequestSchedule::set_rate(const Schedule& schedule) {
  if (playback_ && !playback_->has_times() && index_ > 0) return false;
  if (playback_)
    playback_->set_schedule(schedule);
  else
    index_ = schedule.first_from(schedule_.instant(index_));
  schedule_ = schedule;
  return true;
}

void RequestSchedule::advance(const RequestSlot& slot) {
  last_pts_ = slot.pts;
  index_++;
}

namespace {

using Vec4 = glm::dvec4;

// The Hermite segment between keys i and i + 1, and the position in the segment.
struct Segment {
  const std::vector<NamedView>& keys;
  size_t i;
  double s, length;  // 0..1, seconds

  template <typename Value>
  auto mix(Value value) const {
    using T = decltype(value(i));
    const size_t n = keys.size();
    const auto velocity = [&](size_t k) -> T {  // per second; one-sided at the ends
      const size_t before = k > 0 ? k - 1 : k, after = k + 1 < n ? k + 1 : k;
      return (value(after) - value(before)) / (keys[after].time - keys[before].time);
    };
    const double s2 = s * s, s3 = s2 * s;
    return value(i) * (2 * s3 - 3 * s2 + 1) + value(i + 1) * (3 * s2 - 2 * s3) +
           velocity(i) * ((s3 - 2 * s2 + s) * length) + velocity(i + 1) * ((s3 - s2) * length);
  }
};

Vec4 as_vec(const Quat& q) { return {q.w, q.x, q.y, q.z}; }
Vec4 as_vec(const Plane& p) { return {p.normal, p.d}; }

// Returns the distance of the focal plane along the optical axis if it faces the view, else 0.
double facing_distance(const View& view) {
  const Vec3 axis = view.pose.forward();
  const double distance =
      -view.focus.plane.signed_distance(view.pose.position) / glm::dot(view.focus.plane.normal, axis);
  const bool faces = glm::length(glm::cross(view.focus.plane.normal, axis)) < 1e-6;
  return faces && distance > 0 ? distance : 0;
}

std::string numbered(size_t i) {
  char name[32];
  std::snprintf(name, sizeof name, "view_%06zu", i);
  return name;
}

void require_range(const FocusRange& focus) {
  if (!(focus.near > 0 && focus.near <= focus.far && std::isfinite(focus.far)))
    throw Error("focus: must be 0 < near <= far, is " + number_text(focus.near) + " and " + number_text(focus.far));
}

}  // namespace

ViewPath::ViewPath(std::vector<NamedView> keys) : keys_(std::move(keys)) {
  if (keys_.empty()) throw Error("views: a path needs at least one view");
  for (size_t i = 0; i < keys_.size(); i++) {
    View& view = keys_[i].view;
    planes_face_ = planes_face_ && facing_distance(view) > 0;
    if (i == 0) continue;
    View& before = keys_[i - 1].view;
    const std::string place = "views[" + std::to_string(i) + "].";
    if (!(keys_[i].time > keys_[i - 1].time)) throw Error(place + "time: must be later than the previous view");
    if (view.width != before.width || view.height != before.height)
      throw Error(place + "width, height: must match the first view");
    if (view.lens.model() != before.lens.model()) throw Error(place + "model: must match the first view");
    // q and -q are the same orientation, and a plane and its negative are the same plane, so take the nearer sign.
    if (glm::dot(view.pose.orientation, before.pose.orientation) < 0) view.pose.orientation = -view.pose.orientation;
  }
  for (size_t i = 1; i < keys_.size() && !planes_face_; i++) {
    Plane& plane = keys_[i].view.focus.plane;
    if (glm::dot(plane.normal, keys_[i - 1].view.focus.plane.normal) < 0) plane = {-plane.normal, -plane.d};
  }
}

View ViewPath::at(double time) const {
  const auto later = [](double t, const NamedView& key) { return t < key.time; };
  const size_t next = std::upper_bound(keys_.begin(), keys_.end(), time, later) - keys_.begin();
  if (next == 0) return keys_.front().view;
  const NamedView& key = keys_[next - 1];
  if (next == keys_.size() || time == key.time) return key.view;

  const double length = keys_[next].time - key.time;
  const Segment segment{keys_, next - 1, (time - key.time) / length, length};
  View view = key.view;
  view.pose.position = segment.mix([&](size_t k) { return keys_[k].view.pose.position; });
  const Vec4 q = glm::normalize(segment.mix([&](size_t k) { return as_vec(keys_[k].view.pose.orientation); }));
  view.pose.orientation = Quat(q.x, q.y, q.z, q.w);
  std::array<double, Lens::kMaxParams> params{};
  for (int p = 0; p < view.lens.num_params(); p++)
    params[p] = segment.mix([&](size_t k) { return keys_[k].view.lens.params()[p]; });
  view.lens = Lens(view.lens.model(), params);
  if (planes_face_) {
    const double log_distance = segment.mix([&](size_t k) { return std::log(facing_distance(keys_[k].view)); });
    view.focus.plane = focal_plane_at(view.pose, std::exp(log_distance));
  } else {
    const Vec4 plane = segment.mix([&](size_t k) { return as_vec(keys_[k].view.focus.plane); });
    const double norm = glm::length(Vec3(plane));
    view.focus.plane = {Vec3(plane) / norm, plane.w / norm};
  }
  return view;
}

std::vector<NamedView> ViewPath::sample(double rate_hz) const {
  if (!(rate_hz > 0)) throw Error("rate: must be positive");
  const size_t count = static_cast<size_t>(std::floor((end() - begin()) * rate_hz + 1e-3)) + 1;
  std::vector<NamedView> views(count);
  for (size_t i = 0; i < count; i++) {
    views[i].name = numbered(i);
    views[i].time = begin() + static_cast<double>(i) / rate_hz;
    views[i].view = at(views[i].time);
  }
  return views;
}

std::vector<NamedView> make_focus_sweep(const View& view, const FocusRange& range, int planes) {
  require_range(range);
  if (planes < 1) throw Error("planes: must be at least 1");
  std::vector<NamedView> views;
  for (int i = 0; i < planes; i++) {
    const double share = planes > 1 ? static_cast<double>(i) / (planes - 1) : 0;
    NamedView named{numbered(static_cast<size_t>(i)), 0, view};
    const double inverse = (1 - share) / range.near + share / range.far;
    named.view.focus = {focal_plane_at(view.pose, 1 / inverse), nullptr};
    views.push_back(named);
  }
  return views;
}

namespace {

// Share of a camera's field of view that tour views use. The rest hides the image borders if the eye is between
// cameras.
constexpr double kFieldOfView = 0.85;

// A key of the tour. x and y are in halves of the array's extent. z is in units of the distance where a view from the
// middle just spans the array. focus is from near (0) to far (1), logarithmic. |x| + |z| <= 1 keeps all lines of sight
// inside the array.
struct Key {
  double x, y, z, focus;
};
constexpr Key kKeys[] = {{0, 0, 0, 0},         {-0.6, -0.4, 0, 0}, {-0.35, 0.35, 0.35, 0.4}, {0.35, 0.35, 0.5, 1},
                         {0.55, -0.3, 0.2, 1}, {0, 0, -0.5, 1},    {-0.3, -0.2, -0.3, 0.4},  {0, 0, 0, 0}};
constexpr int kNumKeys = std::size(kKeys);
constexpr double kFarthest = 0.85;  // largest |x| + |z|

}  // namespace

std::vector<NamedView> make_tour(const Rig& rig, const FocusRange& focus, const TourOptions& options) {
  require_range(focus);
  if (options.frames < 1) throw Error("frames: must be at least 1");
  if (!(options.rate_hz > 0)) throw Error("rate: must be positive");

  const Viewpoint home = default_viewpoint(rig);
  const Camera& middle = rig.cameras[middle_camera(rig)];
  const int width = options.width > 0 ? options.width : middle.width;
  const int height = options.height > 0 ? options.height : middle.height;
  // Makes the view no wider than the camera in either direction; in tangents of half the angle.
  const double half_y = kFieldOfView * std::min(middle.height / 2.0 / middle.lens.fy(),
                                                middle.width / 2.0 / middle.lens.fx() * height / width);
  const double half_x = half_y * width / height;

  double extent_x = 0, extent_y = 0;
  for (const Camera& camera : rig.cameras) {
    const Vec3 from_middle = camera.pose.position - home.pose.position;
    extent_x = std::max(extent_x, std::abs(glm::dot(from_middle, home.pose.right())));
    extent_y = std::max(extent_y, std::abs(glm::dot(from_middle, home.pose.down())));
  }
  // Cameras on a line cover the whole perpendicular direction.
  const double tiny = 1e-3 * std::max(extent_x, extent_y);
  double reach = std::numeric_limits<double>::infinity();
  if (extent_x > tiny) reach = std::min(reach, extent_x / half_x);
  if (extent_y > tiny) reach = std::min(reach, extent_y / half_y);
  if (!std::isfinite(reach)) reach = 0;

  if (!(options.room >= 0)) throw Error("room: must not be negative");
  const double aside = extent_x > tiny ? std::min(options.room / 2 / extent_x, 1.0) : 0;
  const double part = std::max(1 - aside / kFarthest, 0.0);

  const double seconds = (options.frames - 1) / options.rate_hz;
  std::vector<NamedView> keys;
  for (int i = 0; i < (options.frames > 1 ? kNumKeys : 1); i++) {
    const Key& key = kKeys[i];
    Viewpoint v = home;
    // Moves at most half-way to the focal plane, however large the array is.
    const double forward = std::min(part * key.z * reach, focus.near / 2);
    v.pose.position += part * key.x * extent_x * home.pose.right() + part * key.y * extent_y * home.pose.down() +
                       forward * home.pose.forward();
    v.fov_y_deg = 2 * std::atan(half_y) * (180 / M_PI);
    v.focus_distance = focus.near * std::pow(focus.far / focus.near, key.focus) - forward;
    keys.push_back({"", seconds * i / (kNumKeys - 1), make_view(clamped(v), width, height)});
  }
  std::vector<NamedView> views = ViewPath(std::move(keys)).sample(options.rate_hz);
  if (options.still)
    for (NamedView& view : views) view.time = 0;
  return views;
}

}  // namespace lf
