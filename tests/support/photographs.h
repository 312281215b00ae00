// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "image/image_file.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/rigs.h"
#include "support/temp_dir.h"
#include "view/view_path.h"

namespace lf::test {

// Returns a path with these views, `interval` seconds apart.
inline std::vector<NamedView> path_of(const std::vector<View>& views, double interval) {
  std::vector<NamedView> path;
  for (const View& view : views) {
    const std::string number = std::to_string(path.size());
    path.push_back({"view_" + number, interval * static_cast<double>(path.size()), view});
  }
  return path;
}

// Renders the built-in scene for each camera at `time` (seconds; `samples` as in render_scene()).
inline std::vector<Image> scene_images(const Rig& rig, double time = 0, int samples = 1) {
  std::vector<Image> images;
  for (const Camera& c : rig.cameras)
    images.push_back(render_scene({c.width, c.height, c.lens, c.pose}, time, samples));
  return images;
}

// Writes the images of the scene as NAME.png, and rig.json. Returns the images.
inline std::vector<Image> save_photographs(Rig& rig, const TempDir& folder, double time, int samples = 2) {
  std::vector<Image> images = scene_images(rig, time, samples);
  for (size_t i = 0; i < images.size(); i++) {
    rig.cameras[i].image = rig.cameras[i].name + ".png";
    save_image(images[i], folder / rig.cameras[i].image);
  }
  save_rig(rig, folder / "rig.json");
  return images;
}

}  // namespace lf::test
