// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "image/image.h"
#include "view/depth_image.h"
#include "view/view.h"

namespace lf {

// Files with the surface that a view shows: depth images, points and triangles.

// Writes a Portable Float Map (http://www.pauldebevec.com/Research/HDR/PFM/): 32-bit floats in metres, little-endian,
// bottom row first. Throws Error with the file's name.
void save_depth_pfm(const DepthImage& image, const std::string& path);
// Writes a PNG with 16 bits per pixel, in millimetres. Depths of 65.5 m and more are stored as 65535. Throws Error with
// the file's name.
void save_depth_png(const DepthImage& image, const std::string& path);
// Writes a PNG with 8 bits per pixel: the confidences of the depths of a picture of width x height pixels, from 0 to
// 255. `confidence` is a map as of DepthConfidence, or null, which means that all confidences are 0. Throws Error with
// the file's name.
void save_confidence_png(const FocalMap* confidence, int width, int height, const std::string& path);

// A point of the surface that a view shows, in world coordinates (metres), with its colour.
struct ColouredPoint {
  float x, y, z;
  uint8_t red, green, blue;
};

// Returns the points of all pixels with a known and finite depth, row by row. Pixels beside a depth edge, where the
// depth changes by more than a twentieth from one pixel to the next, are left out, because they are between two
// surfaces. `rgb` must have the size and the family (kRgb) of the view's picture.
std::vector<ColouredPoint> point_cloud(const View& view, const DepthImage& depths, const ImageView& rgb);

// Writes a PLY file (Stanford Triangle Format 1.0, binary, little-endian) with x, y, z, red, green and blue of each
// vertex. Throws Error with the file's name.
void save_ply(const std::vector<ColouredPoint>& points, const std::string& path);

// The surface that a view shows, as triangles between the nodes of its focal map.
struct SurfaceMesh {
  std::vector<std::array<float, 3>> positions;  // in coordinates of the rig, metres
  std::vector<std::array<float, 2>> places;     // positions in the picture, 0 to 1 from the top left corner
  std::vector<uint32_t> triangles;              // three vertices each, counter-clockwise as seen from the view
};

// Returns the mesh of a view. Nodes without coverage, and nodes with an unknown or infinite depth, have no triangles.
// Triangles whose depths differ by more than a tenth are left out, because an object ends there. If the view shows a
// plane, its nodes are FocalMap::kMinStep pixels apart. `coverage` has one value per pixel, or is empty.
SurfaceMesh surface_mesh(const View& view, std::span<const float> coverage = {});

// Writes a mesh with its picture as the texture: a binary file of glTF 2.0 (.glb), which also contains a camera at the
// view. The axes have the directions of glTF: y up, z backward. `rgb` is the picture of the view. Throws Error with the
// file's name.
void save_gltf(const View& view, const SurfaceMesh& mesh, const Image& rgb, const std::string& path);

}  // namespace lf
