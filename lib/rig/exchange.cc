// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <algorithm>

#include "base/error.h"
#include "rig/reprojection.h"

namespace lf {

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
  note(time_offsets, "the time offsets of the cameras are");
  return result;
}

void refuse_camera(const Camera& camera, const std::string& what) {
  throw Error("camera " + std::to_string(camera.id) + ": " + what);
}

}  // namespace lf
