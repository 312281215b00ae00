// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <algorithm>
#include <filesystem>
#include <limits>

#include "base/error.h"
#include "base/json_value.h"
#include "rig/mesh_fit.h"

namespace lf {
RigImport with_topology(RigImport import) {
  for (const std::string& note : fit_topology(import.rig)) import.notes.push_back(note);
  return import;
}

RigExport describe_export(const Rig& rig, const Rig& written, const FormatCapacity& capacity) {
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
  note(rig.topology.type != Topology::Type::kDelaunay, "the topology of the rig is");
  note(names && !capacity.names, "the names of the cameras are");
  note(ids && !capacity.ids, "the ids of the cameras are");
  note(images && !capacity.images, "the images of the cameras are");
  note(sources, "the sources of the cameras are");
  note(time_offsets && !capacity.time_offsets, "the time offsets of the cameras are");
  return result;
}

void refuse_camera(const Camera& camera, const std::string& what) {
  throw Error("camera " + std::to_string(camera.id) + ": " + what);
}

namespace {

constexpr int kSteps = 8;
constexpr double kNever = std::numeric_limits<double>::infinity();

// At the pixel where `a` sees direction (u, v, 1), `distance` metres along the axis; infinity: the direction alone.
double error_at(const Camera& a, const Camera& b, const Vec2& pixel, const Vec2& uv, double distance) {
  const Mat3 b_from_a = glm::transpose(b.pose.rotation()) * a.pose.rotation();
  Vec3 x = b_from_a * Vec3(uv, 1);
  if (distance < kNever)  // differences of positions first: nothing is lost far from the origin
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
      if (!uv) continue;  // no ray of `a` ends there
      for (const double d : {distance, kNever}) worst = std::max(worst, error_at(camera, b.cameras[i], pixel, *uv, d));
    }
  }
  return worst;
}

RigExport export_text(const Rig& rig, const std::string& path, std::string (*text_of)(const Rig&),
                      RigImport (*parse)(const std::string& text, const std::string& path)) {
  Rig moved = rig;
  relocate(moved, std::filesystem::path(path).parent_path().string());
  const std::string text = text_of(moved);
  const RigExport result = describe_export(rig, parse(text, path).rig, {.ids = false});
  write_text_file(text, path);
  return result;
}

}  // namespace lf
