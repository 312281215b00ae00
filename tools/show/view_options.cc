// SPDX-License-Identifier: LGPL-2.1-or-later
#include "show/view_options.h"

#include <cmath>
#include <cstdio>
#include <optional>

#include "base/error.h"
#include "focus/view_focus.h"
#include "render/contribution_map.h"
#include "render/focus_range.h"
#include "rig/rig_json.h"

Scene::Scene(const std::string& rig_file) : rig(lf::load_rig(rig_file)), mesh(lf::build_mesh(rig)), stills_(rig) {}

double Scene::estimated_focus() const {
  const std::optional<lf::FocusRange> range = lf::estimate_focus_range(rig, images);
  return range ? std::sqrt(range->near * range->far) : lf::default_viewpoint(rig).focus_distance;
}

void ViewOptions::add_to(cli::App& command, bool is_sweep) {
  command.add_option("--rig", rig, "Rig file whose cameras name stills (lf-rig snapshot takes them)")->required();
  cli::Option* file =
      command.add_option("--views", file_,
                         is_sweep ? "Views (views.json), of which the first is taken"
                                  : "Views (views.json): the first, or all of them where --out takes several");
  command.add_option("--size", size_, "Of the view, pixels (default: a camera's)")->type_name("WxH")->excludes(file);
  command.add_option("--fov", fov_, "Vertical field of view, degrees (default: what the cameras fill)")
      ->check(cli::Range(lf::kMinFovDeg, lf::kMaxFovDeg))
      ->excludes(file);
  command.add_option("--move", move_, "Metres to the right, down and forward that the eye moves from home")
      ->type_name("X,Y,Z")
      ->delimiter(',')
      ->excludes(file);
  if (is_sweep) return;
  command.add_option("--focus-distance", distance_, "Of the focal plane, metres from the eye (default: estimated)")
      ->check(cli::PositiveNumber)
      ->excludes(file);
  command.add_option("--focus", focus_, "On what: a surface, found from the view's plane, or that plane")
      ->capture_default_str()
      ->check(cli::IsMember({"plane", "surface"}));
}

std::pair<int, int> ViewOptions::size(const Scene& scene) const {
  const lf::Camera& camera = scene.rig.cameras[lf::middle_camera(scene.rig)];
  int width = camera.width, height = camera.height, end = 0;
  if (!size_.empty() && (std::sscanf(size_.c_str(), "%dx%d%n", &width, &height, &end) != 2 || size_[end] != 0 ||
                         width < 1 || height < 1 || width > lf::kMaxImageSize || height > lf::kMaxImageSize))
    throw lf::Error("--size " + size_ + ": must be WIDTHxHEIGHT, at most " + std::to_string(lf::kMaxImageSize));
  return {width, height};
}

double ViewOptions::aspect(const Scene& scene) const {
  const auto [width, height] = size(scene);
  return static_cast<double>(width) / height;
}

double ViewOptions::focus_distance(const Scene& scene) const {
  return distance_ > 0 ? distance_ : scene.estimated_focus();
}

lf::Viewpoint ViewOptions::viewpoint(const lf::Viewpoint& from) const {
  if (!move_.empty() && move_.size() != 3) throw lf::Error("--move: must be three numbers, such as 0.1,0,-0.5");
  lf::Viewpoint at = from;
  if (fov_ > 0) at.fov_y_deg = fov_;
  if (!move_.empty()) {
    at.pose.position += at.pose.rotation() * lf::Vec3(move_[0], move_[1], move_[2]);
    if (distance_ <= 0) at.focus_distance -= move_[2];  // what was in focus still is
    if (!(at.focus_distance > 0)) throw lf::Error("--move: ends behind what is in focus; give --focus-distance");
  }
  return lf::clamped(at);
}

std::vector<lf::NamedView> ViewOptions::views(const Scene& scene, bool many) const {
  if (from_file()) {
    std::vector<lf::NamedView> views = lf::load_views(file_);
    if (!many) views.resize(1);
    return views;
  }
  const auto [width, height] = size(scene);
  const lf::Viewpoint home = lf::VisibleShare(scene.rig).home(aspect(scene), focus_distance(scene));
  return {{"view", 0, lf::make_view(viewpoint(home), width, height)}};
}

lf::View ViewOptions::focused(const Scene& scene, const lf::Mesh& mesh, const lf::View& view) const {
  if (focus_ == "plane") return view;
  return lf::focus_still(scene.rig, mesh, view, scene.images, {.mode = lf::FocusMode::kSurface});
}

lf::Still picture_of(const Scene& scene, const lf::Mesh& mesh, const lf::View& focused) {
  return lf::render_still(scene.rig, mesh, focused, scene.images, lf::Resampling::kSharpened);
}
