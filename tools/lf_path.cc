// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-path: writes a camera path through a rig as views.json.
#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>

#include "command_line.h"
#include "render/focus_range.h"
#include "rig/rig_json.h"
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

// Returns the focus range from the command line, otherwise from the images, otherwise from the size of the array.
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
  std::printf("%s: %d views, focus from %.4g to %.4g m\n", options.out.c_str(), options.tour.frames, focus.near,
              focus.far);
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  cli::App app(
      "Writes a smooth camera path with changing focus through a rig. All views have time 0 if the rig has stills.",
      "lf-path");
  app.add_option("--rig", o.rig, "rig file")->required()->type_name("RIG.json");
  app.add_option("--out", o.out, "file to write")->required()->type_name("VIEWS.json");
  app.add_option("--near", o.near, "nearest focus, metres (0: from the images)")->check(cli::NonNegativeNumber);
  app.add_option("--far", o.far, "farthest focus, metres (0: from the images)")->check(cli::NonNegativeNumber);
  app.add_option("--frames", o.tour.frames, "number of views")->capture_default_str()->check(cli::Range(1, 1000000));
  app.add_option("--framerate", o.tour.rate_hz, "views per second")->capture_default_str()->check(cli::PositiveNumber);
  app.add_option("--width", o.tour.width, "width of the views, pixels (0: as the cameras)")
      ->check(cli::Range(0, lf::kMaxImageSize));
  app.add_option("--height", o.tour.height, "height of the views, pixels (0: as the cameras)")
      ->check(cli::Range(0, lf::kMaxImageSize));
  app.add_option("--room", o.tour.room, "width reserved for sets of views: metres between the outermost eyes")
      ->capture_default_str()
      ->check(cli::NonNegativeNumber);
  return cli::run_tool(app, argc, argv, [&] { run(o); });
}
