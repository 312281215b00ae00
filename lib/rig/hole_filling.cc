// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/hole_filling.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "rig/ear_clipping.h"
#include "rig/link.h"

namespace lf {
namespace {

// The plane of the triangles between `camera` and the edges of its link.
PlaneAxes local_plane(const LinkPart& part, const Vec3& centre, const CameraCentres& centres, const PlaneAxes& plane) {
  Vec3 area(0);
  double longest2 = 0;
  const size_t n = part.camera.size();
  for (size_t i = 0; i + (part.closed ? 0 : 1) < n; ++i) {
    const Vec3 a = centres.at[part.camera[i]] - centre, b = centres.at[part.camera[(i + 1) % n]] - centre;
    area += glm::cross(a, b);
    longest2 = std::max({longest2, glm::dot(a, a), glm::dot(b, b)});
  }
  // Thinner than a quantum: no direction but noise.
  if (glm::dot(area, area) <= centres.quantum * centres.quantum * longest2) return plane;
  return plane_with_normal(area, plane);
}

// A box in local coordinates, in quanta.
struct Box {
  Vec3 low{HUGE_VAL}, high{-HUGE_VAL};
  void add(const Vec3& p) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  bool meets(const Box& o) const {
    return glm::all(glm::lessThanEqual(low, o.high)) && glm::all(glm::lessThanEqual(o.low, high));
  }
};

class HoleFiller {
 public:
  HoleFiller(const CameraCentres& centres, const PlaneAxes& local) : centres_(centres), local_(local) {}

  IntPoint at(CameraIndex camera) const { return quantise(centres_.at[camera], local_, centres_.quantum); }

  Outline outline(const LinkPart& part) const {
    Outline outline{part.camera, {}, part.closed};
    for (const CameraIndex camera : part.camera) outline.at.push_back(at(camera));
    return outline;
  }

  // The edges that a filled bay could run into: near the chain in depth as well, so that the far side of a cylinder
  // does not count.
  std::vector<MeshEdge> edges_near(const LinkPart& part, const std::vector<Triangle>& faces,
                                   const std::vector<LinkPart>& link) const {
    Box bay;
    for (const CameraIndex camera : part.camera) bay.add(place(camera));
    const double depth = std::max(bay.high.x - bay.low.x, bay.high.y - bay.low.y);
    bay.low.z -= depth;
    bay.high.z += depth;
    std::vector<MeshEdge> edges;
    const auto add = [&](CameraIndex from, CameraIndex to) { edges.push_back({from, to, at(from), at(to)}); };
    for (const Triangle& t : faces) {
      Box box;
      for (const CameraIndex camera : t) box.add(place(camera));
      if (!box.meets(bay)) continue;
      for (int k = 0; k < 3; ++k) add(t[k], t[(k + 1) % 3]);
    }
    for (const LinkPart& other : link) {
      if (&other == &part) continue;
      for (size_t i = 0; i + 1 < other.camera.size(); ++i) add(other.camera[i], other.camera[i + 1]);
    }
    return edges;
  }

 private:
  Vec3 place(CameraIndex camera) const {
    const IntPoint p = at(camera);
    return {p.x, p.y, glm::dot(centres_.at[camera], local_.normal) / centres_.quantum};
  }

  const CameraCentres& centres_;
  PlaneAxes local_;
};

}  // namespace

void remove_camera(std::vector<Triangle>& faces, CameraIndex camera, const CameraCentres& centres,
                   const PlaneAxes& plane) {
  const auto star_begin = std::stable_partition(
      faces.begin(), faces.end(), [&](const Triangle& t) { return std::find(t.begin(), t.end(), camera) == t.end(); });
  const std::vector<Triangle> star(star_begin, faces.end());
  faces.erase(star_begin, faces.end());
  const std::vector<LinkPart> link = camera_link(star, camera);
  for (const LinkPart& part : link) {
    const HoleFiller filler(centres, local_plane(part, centres.at[camera], centres, plane));
    // Inside a ring there is nothing else.
    const std::vector<MeshEdge> around = part.closed ? std::vector<MeshEdge>{} : filler.edges_near(part, faces, link);
    const std::vector<Triangle> filled = clip_ears(filler.outline(part), around);
    faces.insert(faces.end(), filled.begin(), filled.end());
  }
}

}  // namespace lf
