// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "rig/colmap_model.h"

// Writes COLMAP's binary files, as specified at https://colmap.github.io/format.html.
namespace lf::test {

// Returns the bytes of values in a little-endian file. Texts end with a zero byte.
template <typename... Values>
std::string bytes_of(const Values&... values) {
  std::string bytes;
  const auto add = [&bytes](const auto& value) {
    if constexpr (std::is_arithmetic_v<std::remove_cvref_t<decltype(value)>>)
      bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
    else
      bytes += std::string(value) + '\0';
  };
  (add(values), ...);
  return bytes;
}

// The number of a lens model is its index.
inline constexpr std::string_view kColmapModels[] = {"SIMPLE_PINHOLE",
                                                     "PINHOLE",
                                                     "SIMPLE_RADIAL",
                                                     "RADIAL",
                                                     "OPENCV",
                                                     "OPENCV_FISHEYE",
                                                     "FULL_OPENCV",
                                                     "FOV",
                                                     "SIMPLE_RADIAL_FISHEYE",
                                                     "RADIAL_FISHEYE",
                                                     "THIN_PRISM_FISHEYE"};

inline std::string colmap_cameras_binary(const std::map<uint32_t, ColmapCamera>& cameras) {
  std::string bytes = bytes_of(uint64_t{cameras.size()});
  for (const auto& [id, camera] : cameras) {
    const auto model = std::ranges::find(kColmapModels, camera.model) - std::begin(kColmapModels);
    bytes += bytes_of(id, static_cast<int32_t>(model), static_cast<uint64_t>(camera.width),
                      static_cast<uint64_t>(camera.height));
    for (const double value : camera.params) bytes += bytes_of(value);
  }
  return bytes;
}

// Each image gets `points` 2D points.
inline std::string colmap_images_binary(const std::vector<ColmapImage>& images, uint64_t points = 0) {
  std::string bytes = bytes_of(uint64_t{images.size()});
  for (const ColmapImage& image : images) {
    bytes += bytes_of(image.id, image.q.w, image.q.x, image.q.y, image.q.z, image.t.x, image.t.y, image.t.z,
                      image.camera_id, image.name, points);
    for (uint64_t i = 0; i < points; i++) bytes += bytes_of(617.03, 443.58, uint64_t{1412});
  }
  return bytes;
}

}  // namespace lf::test
