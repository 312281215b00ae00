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

enum class Pixels { kRgb, kRgbx, kBgr, kI420 };  // kBgr: as OpenCV keeps them
std::string pixels_name(Pixels pixels);
PixelFamily family_of(Pixels pixels);

// What a measurement is made on.
struct SceneOptions {
  std::string content = "natural";  // the built-in scene, or "checkerboard": 1-pixel, in every plane
  ArrayOptions array;
  int views = 1;
  // Filming all cameras of a large array takes minutes. Beyond this many pixels fewer of them are filmed, and
  // neighbours share their images: as natural to look at for a renderer or a codec, but without a ground truth.
  double most_filmed_pixels = 64e6;
};

// An array, views of it, and what its cameras see. Immutable but for what is made when first asked for: one thread.
class Scene {
 public:
  explicit Scene(const SceneOptions& options);

  const SceneOptions& options() const { return options_; }
  const Rig& rig() const { return rig_; }
  const Mesh& mesh() const { return mesh_; }
  const std::vector<View>& views() const { return views_; }
  const std::vector<CameraIndex>& cameras() const { return cameras_; }  // all of them
  ImageView image(CameraIndex camera, Pixels pixels) const;
  const Image& source(CameraIndex camera, PixelFamily family) const;  // the same, packed

  // The first view without any rounding, from the images of that family.
  const FloatStill& exact(PixelFamily family) const;
  // What a camera in place of the first view would see; null if that is not known.
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
  std::vector<size_t> source_of_;  // per camera: its place in the following
  std::vector<Image> rgb_, i420_;
  mutable std::vector<std::vector<uint8_t>> rgbx_, bgr_;
  Image truth_;
  mutable FloatStill exact_rgb_, exact_i420_;
};

}  // namespace lf::bench
