// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/light_coverage.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "base/error.h"
#include "base/number_text.h"

namespace lf {
namespace {

constexpr double kLongest = 1;        // seconds between two looks that a light's way is known in
constexpr double kLeastAngle = 0.02;  // radians between lines of sight that meet anywhere
constexpr double kMeet = 0.1;         // of the depth, by which lines of sight pass each other at most
constexpr size_t kLeastDepths = 8;
constexpr double kTail = 0.05;    // share of the depths at either end that is not believed
constexpr double kThrough = 1.6;  // the far depth over the near one, of a light that was moved through a volume
constexpr double kNear = 1.5;     // array sizes: what is nearer is near
constexpr size_t kNamed = 2;      // cameras that are named; more than a glance takes in is no help

// A point's depth before `a`, where its line of sight comes nearest to that of `b`; each is (u, v, 1).
std::optional<double> depth_before(const Pose& a, const Vec2& of_a, const Pose& b, const Vec2& of_b) {
  const Vec3 p = a.rotation() * Vec3(of_a, 1), q = b.rotation() * Vec3(of_b, 1), way = b.position - a.position;
  const Vec3 across = glm::cross(p, q);
  const double square = glm::dot(across, across);
  if (std::sqrt(square) < kLeastAngle * glm::length(p) * glm::length(q)) return std::nullopt;
  const double depth = glm::dot(glm::cross(way, q), across) / square;
  const double other = glm::dot(glm::cross(way, p), across) / square;
  if (!(depth > 0) || !(other > 0)) return std::nullopt;
  if (glm::length(p * depth - (way + q * other)) > kMeet * depth) return std::nullopt;
  return depth;
}

}  // namespace

LightCoverage::LightCoverage(const Rig& rig, int lights) : rig_(rig), lights_(static_cast<size_t>(lights)) {
  if (lights < 1) throw Error("lights: must be one at least");
  for (const lf::Camera& camera : rig.cameras) {
    cameras_.emplace_back(camera);
    for (const lf::Camera& other : rig.cameras)
      size_ = std::max(size_, glm::length(camera.pose.position - other.pose.position));
  }
}

void LightCoverage::look(CameraIndex index, double time, const std::vector<Sight>& sights) {
  Camera& camera = cameras_[index];
  camera.looks++;
  camera.lit |= !sights.empty();
  Vec2 sum(0);
  const size_t seen = std::min(sights.size(), lights_);
  for (size_t i = 0; i < seen; i++) {
    camera.places.come(sights[i].pixel);
    sum += sights[i].pixel;
  }
  const std::optional<Look> before = camera.last;
  camera.last.reset();
  if (seen < lights_) return;
  camera.last = Look{time, sum / static_cast<double>(seen)};
  if (before && time > before->time && time - before->time < kLongest) measure_depth(index, *before, *camera.last);
}

void LightCoverage::measure_depth(CameraIndex index, const Look& before, const Look& now) {
  const lf::Camera& planned = rig_.cameras[index];
  std::optional<CameraIndex> farthest;
  double distance = 0;
  for (CameraIndex i = 0; i < cameras_.size(); i++) {
    const std::optional<Look>& look = cameras_[i].last;
    if (i == index || !look || look->time < before.time || look->time > now.time) continue;
    const double d = glm::length(rig_.cameras[i].pose.position - planned.pose.position);
    if (d > distance) farthest = i, distance = d;
  }
  if (!farthest) return;
  const Look& other = *cameras_[*farthest].last;
  const double t = (other.time - before.time) / (now.time - before.time);
  const auto of_this = planned.lens.unproject(before.pixel + t * (now.pixel - before.pixel));
  const auto of_other = rig_.cameras[*farthest].lens.unproject(other.pixel);
  if (!of_this || !of_other) return;
  if (const auto depth = depth_before(planned.pose, *of_this, rig_.cameras[*farthest].pose, *of_other))
    cameras_[index].depths.push_back(*depth);
}

std::string LightCoverage::depth_wanted(CameraIndex index) const {
  std::vector<double> depths = cameras_[index].depths;
  if (depths.size() < kLeastDepths) return "";
  std::ranges::sort(depths);
  const auto tail = static_cast<size_t>(kTail * static_cast<double>(depths.size()));
  const double near = depths[tail], far = depths[depths.size() - 1 - tail];
  if (far >= kThrough * near) return "";
  return near < kNear * size_ ? "farther" : "nearer";
}

std::string LightCoverage::wanted(CameraIndex index) const {
  const std::string places = listed(cameras_[index].places.gaps()), depth = depth_wanted(index);
  return places + (places.empty() || depth.empty() ? "" : ", ") + depth;
}

// The largest gaps alone: what a glance takes in.
std::string LightCoverage::most_wanted(CameraIndex index) const {
  std::vector<PicturePlaces::Gap> gaps = cameras_[index].places.gaps();
  std::ranges::stable_sort(gaps, std::greater(), &PicturePlaces::Gap::places);
  if (gaps.size() > kNamed) gaps.resize(kNamed);
  const std::string places = listed(gaps), depth = depth_wanted(index);
  return places + (places.empty() || depth.empty() ? "" : ", ") + depth;
}

std::string LightCoverage::told() const {
  struct Lack {
    int places = 0, cameras = 0;
  };
  std::map<std::string, Lack> places, depths;
  const auto most = [](const std::map<std::string, Lack>& lacks) {
    const auto& [name, lack] =
        *std::ranges::max_element(lacks, {}, [](const auto& entry) { return entry.second.places; });
    return name + " (" + std::to_string(lack.cameras) + (lack.cameras == 1 ? " camera)" : " cameras)");
  };
  std::vector<CameraIndex> dark, lacking;
  size_t looked = 0;
  double share = 0;
  for (CameraIndex i = 0; i < cameras_.size(); i++) {
    const Camera& camera = cameras_[i];
    if (camera.looks == 0) continue;
    looked++;
    share += camera.places.share();
    if (!camera.lit) {
      dark.push_back(i);
      continue;
    }
    for (const PicturePlaces::Gap& gap : camera.places.gaps())
      places[gap.name].places += gap.places, places[gap.name].cameras++;
    if (const std::string depth = depth_wanted(i); !depth.empty()) depths[depth].places++, depths[depth].cameras++;
    if (!wanted(i).empty()) lacking.push_back(i);
  }
  if (looked == 0) return "No camera has given a picture yet.";
  if (dark.size() == looked) return "No camera has seen a light that moves yet: is it on, and in the pictures?";
  std::string text =
      format_text("The light came to %.0f %% of the pictures.", std::floor(100 * share / static_cast<double>(looked)));
  if (lacking.empty() && dark.empty()) return text + " It was everywhere, near and far.";
  std::string next = places.empty() ? "" : most(places);
  if (!depths.empty()) next += (next.empty() ? "" : ", ") + most(depths);
  if (!next.empty()) text += " Next: " + next + ".";
  const auto name = [&](CameraIndex i) {
    const lf::Camera& camera = rig_.cameras[i];
    return " Camera " + std::to_string(camera.id) + (camera.name.empty() ? "" : " (" + camera.name + ")");
  };
  for (size_t i = 0; i < std::min(kNamed, dark.size()); i++) text += name(dark[i]) + " has seen no light.";
  std::ranges::stable_sort(lacking, {}, [&](CameraIndex i) { return cameras_[i].places.share(); });
  for (size_t i = 0; i < std::min(kNamed, lacking.size()); i++)
    text += name(lacking[i]) + format_text(" %.0f %%: ", std::floor(100 * cameras_[lacking[i]].places.share())) +
            most_wanted(lacking[i]) + ".";
  return text;
}

}  // namespace lf
