// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-show: pictures of the system, from a rig whose cameras name stills: what they saw, and how views are made of it.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "command_line.h"
#include "image/heat_map.h"
#include "quality/quality.h"
#include "render/contribution_map.h"
#include "render/epipolar.h"
#include "render/focus_range.h"
#include "sheet.h"
#include "show/difference_command.h"
#include "show/output.h"
#include "show/text_of.h"
#include "show/view_options.h"
#include "view/view_path.h"

namespace {

struct Options {
  ViewOptions view;
  OutputOptions output;
  // Of one command each.
  int width = 0, stripe = 16, row = -1, column = -1, planes = 32;
  bool behind = false, ids = false;
  double distance = 0, across = 0, near = 0, far = 0;
};

constexpr int kScreen = 1920;

void show_mosaic(const Options& options) {
  const Scene scene(options.view.rig);
  // A camera that gave nothing leaves a dark place with its name.
  const lf::Image dark(lf::PixelFamily::kRgb, scene.rig.cameras[0].width, scene.rig.cameras[0].height);
  const lf::CameraImages images = [&](lf::CameraIndex camera) -> const lf::Image& {
    return scene.rig.cameras[camera].image.empty() ? dark : scene.images(camera);
  };
  if (std::ranges::all_of(scene.rig.cameras, [](const lf::Camera& c) { return c.image.empty(); })) scene.images(0);
  Output output(options.output.out);
  output.add(camera_mosaic(scene.rig, images, options.width > 0 ? options.width : kScreen, true));
  output.finish();
  std::printf("%s: %zu cameras\n", options.output.out.c_str(), scene.rig.cameras.size());
}

// The cameras' ids where they do most, of those that do most first: where there is room for more, more.
void write_ids(lf::Image& map, const Scene& scene, const lf::View& view) {
  const double size = std::max(8.0, view.height / 40.0);  // pixels
  const lf::ViewPlan plan(scene.rig, scene.mesh, view);
  const lf::OwnerMap owners(plan, {0, 0, view.width, view.height});
  std::vector<lf::CameraPlace> places = lf::camera_places(scene.rig, plan, owners);
  std::ranges::stable_sort(places, std::ranges::greater(), &lf::CameraPlace::weight);
  std::vector<lf::Vec2> written;
  for (const lf::CameraPlace& place : places) {
    const std::string text = std::to_string(scene.rig.cameras[place.camera].id);
    const lf::Vec2 room(text_width(text, size) + size, 2 * size);
    if (std::ranges::any_of(written, [&](const lf::Vec2& other) {
          const lf::Vec2 apart = glm::abs(other - place.middle);
          return apart.x < room.x && apart.y < room.y;
        }))
      continue;
    write_text(map, text, place.middle, size, true);
    written.push_back(place.middle);
  }
}

void show_contributions(const Options& options) {
  const Scene scene(options.view.rig);
  std::vector<lf::NamedView> views;
  if (options.behind) {
    if (options.view.from_file()) throw lf::Error("--behind: says where the eye is, as --views does; give one of them");
    const auto [width, height] = options.view.size(scene);
    const lf::Viewpoint behind = options.view.viewpoint(
        lf::viewpoint_behind(scene.rig, options.view.aspect(scene), options.view.focus_distance(scene)));
    views.push_back({"behind", 0, lf::make_view(behind, width, height)});
  } else {
    views = options.view.views(scene, options.output.open().takes_many());
  }
  show_views(options.output, views, [&](const lf::NamedView& named) {
    const lf::View view = options.view.focused(scene, scene.mesh, named.view);
    const lf::Image picture = picture_of(scene, scene.mesh, view).picture;
    lf::Image map = lf::contribution_map(scene.rig, scene.mesh, view, &picture);
    if (options.ids) write_ids(map, scene, view);
    return map;
  });
}

void show_coverage(const Options& options) {
  const Scene scene(options.view.rig);
  const auto views = options.view.views(scene, options.output.open().takes_many());
  show_views(options.output, views, [&](const lf::NamedView& named) {
    const lf::View view = options.view.focused(scene, scene.mesh, named.view);
    const lf::Image picture = picture_of(scene, scene.mesh, view).picture;
    const lf::ViewPlan plan(scene.rig, scene.mesh, view);
    const lf::OwnerMap owners(plan, {0, 0, view.width, view.height});
    const std::vector<float> lost = lf::lost_weights(scene.rig, plan, owners);
    double whole = 0, seen = 0, none = 0;
    for (const float share : lost) {
      if (std::isnan(share)) {
        none++;
        continue;
      }
      whole += share <= 1 - lf::kCovered;
      seen += 1 - share;
    }
    const double percent = 100.0 / static_cast<double>(lost.size());
    return with_scale(lf::heat_map(lost, view.width, view.height, 1, &picture),
                      {"0 % lost",
                       "100 % lost",
                       none > 0 ? "no camera" : "",
                       {text_of("%.1f %% of the pixels whole,", whole * percent),
                        text_of("%.1f %% of all weight seen", seen * percent)}});
  });
}

void show_epipolar(const Options& options) {
  const Scene scene(options.view.rig);
  if ((options.row >= 0) == (options.column >= 0)) throw lf::Error("give --row or --column");
  const std::vector<lf::CameraIndex> line =
      options.row >= 0 ? lf::row_of_cameras(scene.rig, options.row) : lf::column_of_cameras(scene.rig, options.column);
  const lf::Camera& camera = scene.rig.cameras[line[line.size() / 2]];
  lf::EpipolarOptions epi{.distance = options.distance > 0 ? options.distance : scene.estimated_focus(),
                          .across = options.across,
                          .width = options.width > 0  ? options.width
                                   : options.row >= 0 ? camera.width
                                                      : camera.height,
                          .height = options.stripe * static_cast<int>(line.size())};
  Output output(options.output.out);
  output.add(lf::epipolar_image(scene.rig, line, scene.images, epi));
  output.finish();
  std::printf("%s: %zu cameras, %.4g m away\n", options.output.out.c_str(), line.size(), epi.distance);
}

void show_sweep(const Options& options) {
  const Scene scene(options.view.rig);
  if (!options.output.open().takes_many())
    throw lf::Error("--out " + options.output.out +
                    ": of a sweep must be numbered pictures, NAME_%03d.png, or NAME.mkv");
  lf::FocusRange range{options.near, options.far};
  if (!(range.near > 0 && range.far > 0)) {
    const std::optional<lf::FocusRange> found = lf::estimate_focus_range(scene.rig, scene.images);
    if (!found) throw lf::Error("the images don't say how near and how far things are: give --near and --far");
    if (!(range.near > 0)) range.near = range.far > 0 ? std::min(found->near, range.far) : found->near;
    if (!(range.far > 0)) range.far = std::max(found->far, range.near);
  }
  const lf::View view = options.view.views(scene, false)[0].view;
  const auto views = lf::make_focus_sweep(view, range, options.planes);
  show_views(options.output, views,
             [&](const lf::NamedView& named) { return picture_of(scene, scene.mesh, named.view).picture; });
  std::printf("%d planes from %.4g to %.4g m\n", options.planes, range.near, range.far);
}

cli::App* add_command(cli::App& app, const char* name, const char* help, Options& options,
                      void (*show)(const Options&)) {
  cli::App* command = app.add_subcommand(name, help);
  command->callback([&options, show] {
    options.output.check();
    show(options);
  });
  return command;
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  cli::App app("Pictures of a light field at work, of the stills that a rig file names.", "lf-show");
  app.require_subcommand(1);

  cli::App* mosaic = add_command(app, "mosaic", "What all cameras saw, side by side, with their names", o, show_mosaic);
  mosaic->add_option("--rig", o.view.rig, "Rig file whose cameras name stills")->required();
  mosaic->add_option("--out", o.output.out, "Picture to write (.png, .jpg)")->required()->type_name("FILE");
  mosaic->add_option("--width", o.width, "Of the picture, pixels (default: as wide as screens)")
      ->check(cli::Range(1, lf::kMaxImageSize));

  cli::App* contributions = add_command(
      app, "contributions", "Which cameras make which part of a view: each in a colour that its neighbours don't have",
      o, show_contributions);
  o.view.add_to(*contributions);
  contributions->add_flag("--behind", o.behind, "From behind the array, so that all cameras are in the picture");
  contributions->add_flag("--ids", o.ids, "Write the cameras' ids where they do most");
  o.output.add_to(*contributions);

  cli::App* coverage = add_command(app, "coverage", "How much of each pixel's weight no camera sees", o, show_coverage);
  o.view.add_to(*coverage);
  o.output.add_to(*coverage);

  cli::App* epi =
      add_command(app, "epi", "An epipolar-plane image: one line of the world, camera by camera", o, show_epipolar);
  epi->add_option("--rig", o.view.rig, "Rig file of a grid whose cameras name stills")->required();
  cli::Option* row = epi->add_option("--row", o.row, "Row of the grid, 0 at the top")->check(cli::NonNegativeNumber);
  epi->add_option("--column", o.column, "Column of the grid, 0 at the left")
      ->check(cli::NonNegativeNumber)
      ->excludes(row);
  epi->add_option("--focus-distance", o.distance,
                  "Of the line, metres from the cameras: what is there stands still (default: estimated)")
      ->check(cli::PositiveNumber);
  epi->add_option("--across", o.across, "Metres that the line lies below the cameras' axes, of a column to the right")
      ->capture_default_str();
  epi->add_option("--width", o.width, "Of the picture, pixels (default: a camera's)")
      ->check(cli::Range(1, lf::kMaxImageSize));
  epi->add_option("--stripe", o.stripe, "Pixels that each camera is high")
      ->capture_default_str()
      ->check(cli::Range(1, 256));
  epi->add_option("--out", o.output.out, "Picture to write (.png, .jpg)")->required()->type_name("FILE");

  cli::App* sweep =
      add_command(app, "sweep", "A view focused on one plane after the other, from near to far", o, show_sweep);
  o.view.add_to(*sweep, true);
  sweep->add_option("--near", o.near, "Nearest plane, metres from the eye (default: from the images)")
      ->check(cli::PositiveNumber);
  sweep->add_option("--far", o.far, "Farthest")->check(cli::PositiveNumber);
  sweep->add_option("--planes", o.planes, "How many, even in inverse distance")
      ->capture_default_str()
      ->check(cli::Range(2, 100000));
  o.output.add_to(*sweep, "Numbered pictures (NAME_%03d.png) or a film (NAME.mkv)");

  add_difference_command(app);
  return cli::run_tool(app, argc, argv, [] {});
}
