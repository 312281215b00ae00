// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "image/image.h"
#include "view/view.h"

namespace lf {

// The surface that a view shows, as triangles between the nodes of its focal map.
struct SurfaceMesh {
  std::vector<std::array<float, 3>> positions;  // in coordinates of the rig, metres
  std::vector<std::array<float, 2>> places;     // of the vertices in the picture, 0 to 1 from the top left corner
  std::vector<uint32_t> triangles;              // three vertices each, counter-clockwise as seen from the view
};

// Returns the mesh of a view. Nodes without coverage, and nodes with an unknown or infinite depth, have no triangles.
// Triangles whose depths differ by more than a tenth are left out, because an object ends there. If the view shows a
// plane, its nodes are FocalMap::kMinStep pixels apart. `coverage` has one value per pixel, or is empty.
SurfaceMesh surface_mesh(const View& view, std::span<const float> coverage = {});

// Writes a mesh with its picture as the texture: a binary file of glTF 2.0 (.glb), which also contains a camera at the
// view. The axes are those of glTF, y up and z backward. `rgb` is the picture of the view. Throws Error with the file's
// name.
void save_gltf(const View& view, const SurfaceMesh& mesh, const Image& rgb, const std::string& path);

}  // namespace lf
