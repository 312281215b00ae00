// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "bench/array.h"
#include "image/image.h"
#include "reference/float_renderer.h"
#include "rig/mesh.h"

namespace lf::bench {

enum class Pixels { kRgb, kRgbx, kBgr, kI420 };  // kBgr: OpenCV's channel order
std::string pixels_name(Pixels pixels);
PixelFamily family_of(Pixels pixels);

struct SceneOptions {
  std::string content = "natural";  // the built-in scene, or "checkerboard": 1-pixel, in every plane
  ArrayOptions array;
  int views = 1;
  // Maximum number of rendered pixels, because rendering all cameras of a large array takes minutes. Larger arrays
  // share images between neighbours: equally natural for a renderer or codec, but without ground truth.
  double most_filmed_pixels = 64e6;
};

// An array, its views, and its camera images. Some members are computed on first use, without a lock.
class Scene {
 public:
  explicit Scene(const SceneOptions& options);

  const SceneOptions& options() const { return options_; }
  const Rig& rig() const { return rig_; }
  const Mesh& mesh() const { return mesh_; }
  const std::vector<View>& views() const { return views_; }
  const std::vector<CameraIndex>& cameras() const { return cameras_; }  // all cameras
  ImageView image(CameraIndex camera, Pixels pixels) const;
  const Image& source(CameraIndex camera, PixelFamily family) const;  // the same, packed

  // Returns the first view without any rounding, from the images of that family.
  const FloatStill& exact(PixelFamily family) const;
  // Returns the image of a camera at the first viewpoint; null if unknown.
  const Image* truth() const { return truth_.data().empty() ? nullptr : &truth_; }

 private:
  void film();
  void draw_checkerboard();
  const uint8_t* in_layout(size_t source, const RgbLayout& layout, std::vector<std::vector<uint8_t>>& made) const;

  SceneOptions options_;
  Rig rig_;
  Mesh mesh_;
  std::vector<View> views_;
  std::vector<CameraIndex> cameras_;
  std::vector<size_t> source_of_;  // per camera: index into the vectors below
  std::vector<Image> rgb_, i420_;
  mutable std::vector<std::vector<uint8_t>> rgbx_, bgr_;
  Image truth_;
  mutable FloatStill exact_rgb_, exact_i420_;
};

}  // namespace lf::bench
