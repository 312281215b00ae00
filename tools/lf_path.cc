// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-path: writes a camera path through a rig as views.json.
#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>

#include "command_line.h"
#include "render/focus_range.h"
#include "rig/rig_json.h"
#include "terminal.h"
#include "view/navigator.h"
#include "view/view_path.h"

namespace {

struct Options {
  std::string rig, out;
  double near = 0, far = 0;
  lf::TourOptions tour{.frames = 120};
};

bool stands_still(const lf::Rig& rig) {
  return std::all_of(rig.cameras.begin(), rig.cameras.end(),
                     [](const lf::Camera& c) { return c.source.empty() && !c.image.empty(); });
}

lf::FocusRange focus_of(const Options& options, const lf::Rig& rig) {
  lf::FocusRange focus{options.near, options.far};
  if (focus.near > 0 && focus.far > 0) return focus;
  std::optional<lf::FocusRange> found;
  if (lf::has_images(rig)) {
    lf::StillImageCache images(rig);
    found = lf::estimate_focus_range(rig, [&](lf::CameraIndex i) -> const lf::Image& { return images.get(i); });
  }
  const double guess = lf::default_viewpoint(rig).focus_distance;
  if (!found) found = {guess / 2, guess * 2};
  if (focus.near <= 0) focus.near = focus.far > 0 ? std::min(found->near, focus.far) : found->near;
  if (focus.far <= 0) focus.far = std::max(found->far, focus.near);
  return focus;
}

void run(Options& options) {
  const lf::Rig rig = lf::load_rig(options.rig);
  const lf::FocusRange focus = focus_of(options, rig);
  options.tour.still = stands_still(rig);
  lf::save_views(lf::make_tour(rig, focus, options.tour), options.out);
  terminal::print("%s: %d views, focus from %.4g to %.4g m\n", options.out.c_str(), options.tour.frames, focus.near,
                  focus.far);
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  cli::App app(
      "Writes a smooth camera path through a rig, for lf-render, lf-serve --path or lfviewsrc. The viewpoint stays "
      "inside the array, and the focus distance changes along the path. If the rig has still images instead of videos, "
      "all views have time 0.",
      "lf-path");
  app.add_option("--rig", o.rig, "Rig file of the array")->required()->type_name("RIG.json");
  app.add_option("--out", o.out, "Views file to write")->required()->type_name("VIEWS.json");
  app.add_option("--near", o.near, "Nearest focus distance along the path, in metres (0: estimated from the images)")
      ->check(cli::NonNegativeNumber);
  app.add_option("--far", o.far, "Farthest focus distance along the path, in metres (0: estimated from the images)")
      ->check(cli::NonNegativeNumber);
  app.add_option("--frames", o.tour.frames,
                 "Number of views along the path. At a given --framerate, more views make "
                 "the path longer and slower")
      ->check(cli::Range(1, 1000000));
  app.add_option("--framerate", o.tour.rate_hz,
                 "Frame rate of the path, in views per second. It determines the times of the views")
      ->check(cli::PositiveNumber);
  app.add_option("--width", o.tour.width, "Width of the views, in pixels (0: the width of the camera images)")
      ->check(cli::Range(0, lf::kMaxImageSize));
  app.add_option("--height", o.tour.height, "Height of the views, in pixels (0: the height of the camera images)")
      ->check(cli::Range(0, lf::kMaxImageSize));
  app.add_option("--room", o.tour.room,
                 "Distance between the outermost eyes of a multi-view display, in metres. The path keeps this "
                 "additional distance from the sides of the array, so that all eyes remain inside")
      ->capture_default_str()
      ->check(cli::NonNegativeNumber);
  return cli::run_tool(app, argc, argv, [&] { run(o); });
}
