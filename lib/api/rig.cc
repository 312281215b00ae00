// SPDX-License-Identifier: LGPL-2.1-or-later
#include <lightfield/rig.h>

#include <cmath>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "api/convert.h"
#include "base/json_value.h"
#include "rig/mesh.h"
#include "rig/rig_json.h"

namespace lightfield {
namespace {

std::shared_ptr<const Rig::Data> data_of(lf::Rig rig, std::string original = {}) {
  const uint64_t hash = rig.hash();
  return std::make_shared<const Rig::Data>(
      Rig::Data{std::make_shared<const lf::Rig>(std::move(rig)), hash, std::move(original)});
}

lf::Camera to_camera(const Camera& camera) {
  lf::Camera out;
  out.id = camera.id;
  out.name = camera.name;
  out.width = camera.width;
  out.height = camera.height;
  out.lens = lf::api::to_lens(camera.lens);
  out.pose = lf::api::to_pose(camera.world_from_camera);
  out.image = camera.image;
  out.source = camera.source;
  if (camera.colour) {
    const Vec3& black = camera.colour->black;
    out.colour = lf::ColourModel{
        {black.x, black.y, black.z}, camera.colour->gamma, camera.colour->matrix, camera.colour->vignetting};
  }
  return out;
}

lf::Rig to_rig(const std::vector<Camera>& cameras, const Topology& topology) {
  lf::Rig rig;
  for (size_t i = 0; i < cameras.size(); i++) {
    try {
      rig.cameras.push_back(to_camera(cameras[i]));
    } catch (const Error& error) {
      throw Error("cameras[" + std::to_string(i) + "].lens: " + error.what());
    }
  }
  using Type = lf::Topology::Type;
  switch (topology.type) {
    case Topology::Type::kGrid: rig.topology.type = Type::kGrid; break;
    case Topology::Type::kTriangles: rig.topology.type = Type::kTriangles; break;
    default: rig.topology.type = Type::kDelaunay;
  }
  rig.topology.rows = topology.rows;
  rig.topology.columns = topology.columns;
  rig.topology.triangles = topology.triangles;
  return rig;
}

std::shared_ptr<const Rig::Data> parse(const std::string& text, const std::string& name, const std::string& directory) {
  return data_of(lf::parse_rig(text, name, directory), text);
}

std::string json_of(const Rig::Data& data, const lf::Rig& rig) {
  if (data.original.empty()) return lf::rig_to_json(rig);
  const nlohmann::json original = lf::parse_json(data.original, "rig");
  return lf::rig_to_json(rig, &original);
}

// Written and read again, so that a rig from values is checked as one from a file is.
std::shared_ptr<const Rig::Data> checked(const lf::Rig& rig) {
  return data_of(lf::parse_rig(lf::rig_to_json(rig), "rig"));
}

}  // namespace

Pose look_at(const Vec3& eye, const Vec3& target) {
  const lf::Vec3 from(eye.x, eye.y, eye.z), to(target.x, target.y, target.z), down(0, 1, 0);
  const double away = glm::length(to - from);
  if (!(away > 0) || !std::isfinite(away)) throw Error("look_at: eye and target must be two places");
  if (!(glm::length(glm::cross(to - from, down)) > 1e-9 * away)) throw Error("look_at: the line of sight is vertical");
  return lf::api::from_pose(lf::look_at(from, to, down));
}

Rig::Rig(const std::vector<Camera>& cameras, const Topology& topology) : data_(checked(to_rig(cameras, topology))) {}

size_t Rig::size() const { return data_->rig->cameras.size(); }
uint64_t Rig::hash() const { return data_->hash; }

Camera Rig::camera(size_t index) const {
  if (index >= size())
    throw Error("camera " + std::to_string(index) + " is not one of the " + std::to_string(size()) + " cameras");
  const lf::Camera& camera = data_->rig->cameras[index];
  std::optional<CameraColour> colour;
  if (const auto& of = camera.colour)
    colour = CameraColour{{of->black.x, of->black.y, of->black.z}, of->gamma, of->matrix, of->vignetting};
  return {camera.id,
          camera.name,
          camera.width,
          camera.height,
          lf::api::from_lens(camera.lens),
          lf::api::from_pose(camera.pose),
          camera.image,
          camera.source,
          colour};
}

std::string Rig::json() const { return json_of(*data_, *data_->rig); }

Rig load_rig(const std::string& path) {
  return Rig(parse(lf::read_text_file(path), path, std::filesystem::path(path).parent_path().string()));
}

Rig parse_rig(const std::string& json, const std::string& name) { return Rig(parse(json, name, "")); }

void save_rig(const Rig& rig, const std::string& path) {
  lf::Rig moved = *rig.data().rig;
  lf::relocate(moved, std::filesystem::path(path).parent_path().string());
  lf::write_text_file(json_of(rig.data(), moved), path);
}

}  // namespace lightfield
