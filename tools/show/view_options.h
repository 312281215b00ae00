// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "command_line.h"
#include "composite/still.h"
#include "rig/mesh.h"
#include "rig/still_images.h"
#include "view/navigator.h"
#include "view/views_json.h"

// A rig of which lf-show makes pictures, with what its cameras saw.
class Scene {
 public:
  explicit Scene(const std::string& rig_file);

  lf::Rig rig;
  lf::Mesh mesh;
  const lf::CameraImages images = [this](lf::CameraIndex camera) -> const lf::Image& { return stills_.get(camera); };

  // The distance in focus where nobody says one, metres: from the images.
  double estimated_focus() const;

 private:
  mutable lf::StillImages stills_;
};

// Which views, on the command line of a command.
class ViewOptions {
 public:
  // This outlives the command. `is_sweep`: there is one view, focused by the command.
  void add_to(cli::App& command, bool is_sweep = false);

  // The views that are asked for, not focused yet, the first alone unless `many`; of the array's home view where there
  // is no file. Throws lf::Error naming the option.
  std::vector<lf::NamedView> views(const Scene& scene, bool many) const;
  // The eye that the options ask for where there is no file of views.
  lf::Viewpoint viewpoint(const lf::Viewpoint& from) const;
  double focus_distance(const Scene& scene) const;
  double aspect(const Scene& scene) const;
  // As the options say: as it is, or with a focal surface that is found.
  lf::View focused(const Scene& scene, const lf::Mesh& mesh, const lf::View& view) const;

  std::string rig;
  bool from_file() const { return !file_.empty(); }
  // Whether any option says where the eye is or how large its picture.
  bool places_eye() const { return from_file() || !size_.empty() || fov_ > 0 || !move_.empty(); }
  std::pair<int, int> size(const Scene& scene) const;  // pixels

 private:
  std::string file_, size_, focus_ = "surface";
  std::vector<double> move_;
  double fov_ = 0, distance_ = 0;
};

// A view's picture, sampled as lf-render does.
lf::Still picture_of(const Scene& scene, const lf::Mesh& mesh, const lf::View& focused);
