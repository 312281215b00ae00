// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "image/image_file.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/temp_dir.h"

namespace lf::test {

// Renders each camera of the built-in scene at `time` (seconds; `samples` as in render_scene()). Writes NAME.png files
// and rig.json. Returns the images.
inline std::vector<Image> save_photographs(Rig& rig, const TempDir& folder, double time, int samples = 2) {
  std::vector<Image> images;
  for (Camera& camera : rig.cameras) {
    camera.image = camera.name + ".png";
    images.push_back(render_scene({camera.width, camera.height, camera.lens, camera.pose}, time, samples));
    save_image(images.back(), folder / camera.image);
  }
  save_rig(rig, folder / "rig.json");
  return images;
}

}  // namespace lf::test
