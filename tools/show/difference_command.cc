// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-show difference: how far a view is from what it should look like.
#include "show/difference_command.h"

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "image/heat_map.h"
#include "quality/quality.h"
#include "scene/scene.h"
#include "sheet.h"
#include "show/output.h"
#include "show/text_of.h"
#include "show/view_options.h"

namespace {

struct DifferenceOptions {
  ViewOptions view;
  OutputOptions output;
  std::string truth;
  bool scene = false;
  int left_out = -1;
  double full = 64;
};

// What a view should look like: a file, the built-in scene, or what the camera saw that was left out.
lf::Image truth_of(const DifferenceOptions& options, const Scene& scene, const lf::NamedView& named, size_t number) {
  const lf::View& view = named.view;
  if (options.left_out >= 0) return scene.images(*scene.rig.index_of_id(static_cast<uint32_t>(options.left_out)));
  if (options.scene) return lf::render_scene({view.width, view.height, view.lens, view.pose}, named.time);
  if (number > 0) throw lf::Error("--truth: is one picture, for one view");
  lf::Image truth = lf::load_image(options.truth);
  if (truth.width() != view.width || truth.height() != view.height)
    throw lf::Error(options.truth + ": must have the view's size, " + std::to_string(view.width) + "x" +
                    std::to_string(view.height));
  return truth;
}

void show_difference(const DifferenceOptions& options) {
  const Scene scene(options.view.rig);
  if ((options.left_out >= 0) + options.scene + !options.truth.empty() != 1)
    throw lf::Error("give one of --truth, --scene and --left-out");
  std::vector<lf::NamedView> views;
  lf::Mesh mesh = scene.mesh;
  if (options.left_out >= 0) {
    const lf::CameraIndex camera = lf::parse_camera_list(scene.rig, std::to_string(options.left_out))[0];
    if (options.view.places_eye())
      throw lf::Error("--left-out: the view is the camera's; leave out --views, --size, --fov and --move");
    const lf::Camera& at = scene.rig.cameras[camera];
    lf::View view{.width = at.width, .height = at.height, .lens = at.lens, .pose = at.pose, .focus = {}};
    view.focus.plane = lf::focal_plane_at(view.pose, options.view.focus_distance(scene));
    views.push_back({"left out", 0, view});
    mesh = lf::build_mesh(scene.rig, {camera});
  } else {
    views = options.view.views(scene, options.output.open().takes_many());
  }
  size_t number = 0;
  show_views(options.output, views, [&](const lf::NamedView& named) {
    const lf::Image truth = truth_of(options, scene, named, number++);
    const lf::Still still = picture_of(scene, mesh, options.view.focused(scene, mesh, named.view));
    const lf::Quality quality = lf::compare(still.picture, truth, still.coverage);
    const std::vector<float> off = lf::differences(still.picture, truth, still.coverage);
    const std::vector<std::string> texts =
        quality.coverage > 0
            ? std::vector{text_of("PSNR %.2f dB, SSIM %.4f,", quality.psnr_db, quality.ssim),
                          text_of("at most %d of 255, %.1f %% compared", quality.max_error, 100 * quality.coverage)}
            : std::vector<std::string>{"nothing compared:", "the cameras cover no pixel of it"};
    std::printf("%s: %s %s\n", named.name.c_str(), texts[0].c_str(), texts[1].c_str());
    return with_scale(
        lf::heat_map(off, named.view.width, named.view.height, options.full),
        {"off by 0", text_of("%.4g of 255", options.full), quality.coverage < 1 ? "not compared" : "", texts});
  });
}

}  // namespace

void add_difference_command(cli::App& app) {
  const auto o = std::make_shared<DifferenceOptions>();
  cli::App* difference = app.add_subcommand("difference", "How far a view is from what it should look like");
  o->view.add_to(*difference);
  difference->add_option("--truth", o->truth, "A picture of what it should look like");
  difference->add_flag("--scene", o->scene, "The cameras filmed the built-in scene: compare with that");
  difference->add_option("--left-out", o->left_out, "Id of a camera that is left out, to compare with what it saw")
      ->check(cli::NonNegativeNumber);
  difference->add_option("--full", o->full, "The difference, of 255, that is the end of the scale")
      ->capture_default_str()
      ->check(cli::Range(1.0, 255.0));
  o->output.add_to(*difference);
  difference->callback([o] { show_difference(*o); });
}
