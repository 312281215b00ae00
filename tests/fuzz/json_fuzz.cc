// SPDX-License-Identifier: LGPL-2.1-or-later
// Rigs, views and tracks in JSON: a letter says which, the text follows. What is taken is written as a text that says
// the same, and errors name the file.
#include "base/error.h"
#include "calibration/tracks.h"
#include "fuzz/fuzz.h"
#include "rig/mesh.h"
#include "rig/rig_json.h"
#include "view/views_json.h"

using lf::fuzz::require;

namespace {

constexpr char kName[] = "input.json";

bool same(const lf::Camera& a, const lf::Camera& b) {
  return a.id == b.id && a.name == b.name && a.width == b.width && a.height == b.height && a.lens == b.lens &&
         a.pose == b.pose && a.image == b.image && a.source == b.source && a.time_offset == b.time_offset;
}

void rig(const std::string& text) {
  const lf::Rig rig = lf::parse_rig(text, kName);
  require(!rig.cameras.empty() && rig.cameras.size() <= lf::kMaxCameras);
  const std::string written = lf::rig_to_json(rig);
  const lf::Rig again = lf::parse_rig(written, kName);
  require(lf::rig_to_json(again) == written && again.cameras.size() == rig.cameras.size());
  for (size_t i = 0; i < rig.cameras.size(); i++) require(same(rig.cameras[i], again.cameras[i]));
  // Either it has a mesh, or an error says why not.
  if (rig.cameras.size() <= 16)
    for (const lf::MeshFace& face : lf::build_mesh(rig).faces)
      for (int i = 0; i < face.corners(); i++) require(face.camera[i] < rig.cameras.size());
}

void views(const std::string& text) {
  const std::vector<lf::NamedView> views = lf::parse_views(text, kName);
  require(!views.empty());
  const std::vector<lf::NamedView> again = lf::parse_views(lf::views_to_json(views), kName);
  require(again.size() == views.size());
  for (size_t i = 0; i < views.size(); i++)
    require(again[i].name == views[i].name && again[i].time == views[i].time && again[i].view == views[i].view);
}

void tracks(const std::string& text) {
  const lf::Tracks tracks = lf::parse_tracks(text, kName);
  for (const lf::Observation& o : tracks.observations)
    require(o.camera < tracks.cameras.size() && o.position < tracks.num_positions);
  const std::string written = lf::tracks_to_json(tracks);
  require(lf::tracks_to_json(lf::parse_tracks(written, kName)) == written);
}

}  // namespace

LF_FUZZ_TARGET(json)(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    if (data[0] == 'r') rig(text);
    if (data[0] == 'v') views(text);
    if (data[0] == 't') tracks(text);
  } catch (const lf::Error& error) {
    require(error.what()[0] != 0);
  }
  return 0;
}
