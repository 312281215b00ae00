// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "image/image.h"
#include "rig/mesh.h"
#include "view/view_path.h"

namespace lf::focus {

// Camera faults.
struct Faults {
  double noise = 0;           // standard deviation of each colour, of 255
  double gain_error = 0;      // gain error of every fourth camera, alternating up and down
  double pointing_error = 0;  // pointing error of the centre camera, degrees
};

struct Case {
  std::string name;
  Rig rig;
  std::vector<NamedView> views;
  std::function<Image(size_t view)> truth;
  // Returns a camera's image for view `view`; the reference is valid until the next call for the same camera.
  std::function<const Image&(CameraIndex camera, size_t view)> image;
  std::vector<CameraSet> left_out;  // unused cameras by view; or empty
  const CameraSet& without(size_t view) const;
};

// Uses some cameras of a rig as views instead of sources. In a grid of 3x3 or more: cameras of odd rows and columns,
// rendered from the cameras of even rows and columns. In other rigs: each camera between others, rendered from all
// remaining cameras.
Case held_out_case(const std::string& rig, int views);
// The views of a file, with their true pictures NAME.png in a folder.
Case truth_case(const std::string& rig, const std::string& views, const std::string& folder);
// The built-in scene at one instant, from four viewpoints between the cameras.
Case scene_case();
// The moving built-in scene, `frames` pictures at `rate` per second; the viewpoint moves by `step` of the pitch per
// picture.
Case moving_case(double rate, int frames, double step);

void add_faults(const Faults& faults, Case& c);

// Small scenes that are hard for the search for focal surfaces, each for one reason; in front of the array of
// scene_rig(), within the depths of the built-in scene.
std::vector<std::string> world_names();
Case world_case(const std::string& name, int views);
Image film_world(const std::string& name, const Lens& lens, const Pose& pose, int width, int height);

}  // namespace lf::focus
