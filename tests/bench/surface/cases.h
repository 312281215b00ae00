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

// What is wrong with the cameras.
struct Faults {
  double noise = 0;           // standard deviation of each colour, of 255
  double gain_error = 0;      // of every fourth camera, up and down in turn
  double pointing_error = 0;  // of the camera in the middle, degrees
};

// An array, its views and what they should look like.
struct Case {
  std::string name;
  Rig rig;
  std::vector<NamedView> views;
  std::function<Image(size_t view)> truth;
  // What a camera sees while view `view` is made; the reference stays until the next call for the same camera.
  std::function<const Image&(CameraIndex camera, size_t view)> image;
  std::vector<CameraSet> left_out;  // the cameras that don't help to make a view, by view; or empty
  const CameraSet& without(size_t view) const;
};

// Some cameras of a rig are the views, and are not used for them. Of a grid of 3x3 and more: cameras of odd rows and
// columns, made from those of even ones. Of other rigs: each that lies between others, made from all others.
Case held_out_case(const std::string& rig, int views);
// The views of a file and their pictures NAME.png in a folder.
Case truth_case(const std::string& rig, const std::string& views, const std::string& folder);
// The built-in scene at one instant, from four places between the cameras.
Case scene_case();
// The built-in scene as it moves, `frames` pictures at `rate` a second, while the eye moves `step` of the pitch from
// each to the next.
Case moving_case(double rate, int frames, double step);

void add_faults(const Faults& faults, Case& c);

// Small scenes that are hard for what finds focal surfaces, each for one reason; in front of the array of scene_rig(),
// within the depths of the built-in scene.
std::vector<std::string> world_names();
// One of them by its name, seen from between the cameras. Throws Error if there is none of that name.
Case world_case(const std::string& name, int views);
// What any camera sees of one: four rays a pixel.
Image film_world(const std::string& name, const Lens& lens, const Pose& pose, int width, int height);

}  // namespace lf::focus
