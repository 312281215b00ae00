// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-show: visualizes camera images and rendered views of a rig with still images.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <regex>
#include <string>
#include <vector>

#include <gst/gst.h>

#include "base/text.h"
#include "command_line.h"
#include "composite/still.h"
#include "contact_sheet.h"
#include "focus/still_focus.h"
#include "image/image.h"
#include "mjpeg_writer.h"
#include "progress.h"
#include "quality/image_quality.h"
#include "render/contribution_map.h"
#include "render/epipolar.h"
#include "render/focus_range.h"
#include "rig/mesh.h"
#include "rig/rig_json.h"
#include "rig/still_image_cache.h"
#include "scene/scene.h"
#include "terminal.h"
#include "view/navigator.h"
#include "view/view_path.h"

namespace {

constexpr lf::DepthEstimator::Settings kSurface{.mode = lf::FocusMode::kSurface};

class Scene {
 public:
  explicit Scene(const std::string& rig_file) : rig(lf::load_rig(rig_file)), mesh(lf::build_mesh(rig)), stills_(rig) {}

  lf::Rig rig;
  lf::Mesh mesh;
  const lf::CameraImages images = [this](lf::CameraIndex camera) -> const lf::Image& { return stills_.get(camera); };

  double estimated_focus() const {
    const std::optional<lf::FocusRange> range = lf::estimate_focus_range(rig, images);
    return range ? std::sqrt(range->near * range->far) : lf::default_viewpoint(rig).focus_distance;
  }

 private:
  mutable lf::StillImageCache stills_;
};

class ViewOptions {
 public:
  // Adds the options to a command; this object must outlive the command. If `is_sweep` is true, the command takes only
  // one view and sets the focus itself.
  void add_to(cli::App& command, bool is_sweep = false) {
    command.add_option("--rig", rig, "Rig file with one still image per camera, for example from lf-rig snapshot")
        ->required();
    cli::Option* file = command.add_option(
        "--views", file_,
        is_sweep ? "Views file (views.json). The first view is used"
                 : "Views file (views.json). All views are shown if --out names numbered pictures or a film, otherwise "
                   "only the first view (default: the home view from the middle of the array)");
    command
        .add_option("--size", size_,
                    "Size of the view in pixels, for example 1280x720 (default: the size of a camera "
                    "image)")
        ->type_name("WxH")
        ->excludes(file);
    command.add_option("--fov", fov_, "Vertical field of view, in degrees (default: as large as the cameras can fill)")
        ->check(cli::Range(lf::kMinFovDeg, lf::kMaxFovDeg))
        ->excludes(file);
    command
        .add_option("--move", move_,
                    "Offset of the viewpoint from the home view in the middle of the array, in metres: to the right, "
                    "down and forward. For example, 0.1,0,0 looks from a viewpoint 10 cm to the right")
        ->type_name("X,Y,Z")
        ->delimiter(',')
        ->excludes(file);
    if (is_sweep) return;
    command
        .add_option("--focus-distance", distance_,
                    "Distance of the focal plane from the viewpoint, in metres. Objects at this distance are sharp "
                    "(default: estimated from the images)")
        ->check(cli::PositiveNumber)
        ->excludes(file);
    command
        .add_option("--focus", focus_,
                    "Focus of the view. plane: only the focal plane is in focus. surface: the depth of each pixel is "
                    "estimated, so that the whole picture is in focus")
        ->check(cli::IsMember({"plane", "surface"}));
  }

  // Returns the selected views without a focal surface. These are all views of the views file if `many` is true,
  // otherwise its first view, or the home view if there is no file. Throws lf::Error that names the option.
  std::vector<lf::NamedView> views(const Scene& scene, bool many) const {
    if (from_file()) {
      std::vector<lf::NamedView> views = lf::load_views(file_);
      if (!many) views.resize(1);
      return views;
    }
    const auto [width, height] = size(scene);
    const lf::Viewpoint home = lf::VisibleFraction(scene.rig).home(aspect(scene), focus_distance(scene));
    return {{"view", 0, lf::make_view(viewpoint(home), width, height)}};
  }
  // Returns the viewpoint `from`, modified by the options. Used if there is no views file.
  lf::Viewpoint viewpoint(const lf::Viewpoint& from) const {
    if (!move_.empty() && move_.size() != 3)
      throw lf::Error("--move: must be three numbers in metres (right, down, forward), such as 0.1,0,-0.5");
    lf::Viewpoint at = from;
    if (fov_ > 0) at.fov_y_deg = fov_;
    if (!move_.empty()) {
      at.pose.position += at.pose.rotation() * lf::Vec3(move_[0], move_[1], move_[2]);
      if (distance_ <= 0) at.focus_distance -= move_[2];
      if (!(at.focus_distance > 0))
        throw lf::Error(
            "--move: the viewpoint moves forward past the point in focus; move it less, or give --focus-distance");
    }
    return lf::clamped(at);
  }
  double focus_distance(const Scene& scene) const { return distance_ > 0 ? distance_ : scene.estimated_focus(); }
  double aspect(const Scene& scene) const {
    const auto [width, height] = size(scene);
    return static_cast<double>(width) / height;
  }
  // Returns the depths that focused() needs, without those of the camera `held_out`.
  std::optional<lf::ArrayDepth> depths(const Scene& scene, const std::vector<lf::NamedView>& named,
                                       std::optional<lf::CameraIndex> held_out = {}) const {
    if (focus_ == "plane") return {};
    lf::CameraSet cameras;
    for (lf::CameraIndex i = 0; i < scene.rig.cameras.size(); i++)
      if (i != held_out) cameras.push_back(i);
    std::vector<lf::View> views;
    for (const lf::NamedView& view : named) views.push_back(view.view);
    return lf::estimate_depths(scene.rig, cameras, views, scene.images, kSurface, lf::parallel_for_all_processors());
  }
  // Returns the view with its focal surface, unless the focus is a plane.
  lf::View focused(const Scene& scene, const lf::Mesh& mesh, const std::optional<lf::ArrayDepth>& depths,
                   const lf::View& view) const {
    if (focus_ == "plane") return view;
    return lf::focus_still(scene.rig, mesh, view, scene.images, kSurface, lf::kSettledRounds, nullptr,
                           depths ? &*depths : nullptr);
  }

  std::string rig;
  bool from_file() const { return !file_.empty(); }
  bool places_eye() const { return from_file() || !size_.empty() || fov_ > 0 || !move_.empty(); }
  std::pair<int, int> size(const Scene& scene) const {
    const lf::Camera& camera = scene.rig.cameras[lf::middle_camera(scene.rig)];
    int width = camera.width, height = camera.height, end = 0;
    if (!size_.empty() && (std::sscanf(size_.c_str(), "%dx%d%n", &width, &height, &end) != 2 || size_[end] != 0 ||
                           width < 1 || height < 1 || width > lf::kMaxImageSize || height > lf::kMaxImageSize))
      throw lf::Error("--size " + size_ + ": must be WIDTHxHEIGHT, such as 640x480, with sides of at most " +
                      std::to_string(lf::kMaxImageSize));
    return {width, height};
  }

 private:
  std::string file_, size_, focus_ = "surface";
  std::vector<double> move_;
  double fov_ = 0, distance_ = 0;
};

lf::Still picture_of(const Scene& scene, const lf::Mesh& mesh, const std::optional<lf::ArrayDepth>& depths,
                     const lf::View& focused) {
  return lf::render_still(scene.rig, mesh, focused, scene.images, lf::Resampling::kSharpened, {}, nullptr,
                          depths ? &*depths : nullptr);
}

constexpr int kFilmQuality = 90;

// Writes pictures to a file of this name. NAME.png and NAME.jpg are a single picture, a name with one %d (such as %03d)
// means pictures numbered from 0, and NAME.mkv is a Motion JPEG film. Not thread-safe.
class Output {
 public:
  // Throws lf::Error if the name has another form.
  explicit Output(const std::string& path, FrameRate rate = {}) : path_(path), rate_(rate) {
    static const std::regex still(R"(([^%]*)\.(png|jpg))"), numbered(R"([^%]*%(0[1-9])?d[^%]*\.(png|jpg))"),
        film(R"([^%]*\.mkv)");
    if (std::regex_match(path, still))
      kind_ = Kind::kOne;
    else if (std::regex_match(path, numbered))
      kind_ = Kind::kNumbered;
    else if (std::regex_match(path, film))
      kind_ = Kind::kFilm;
    else
      throw lf::Error("--out " + path +
                      ": must be NAME.png or NAME.jpg for one picture, NAME_%03d.png for numbered pictures, or "
                      "NAME.mkv for a film");
    if (kind_ == Kind::kFilm) gst_init(nullptr, nullptr);
  }

  bool takes_many() const { return kind_ != Kind::kOne; }
  void add(const lf::Image& rgb) {
    if (kind_ == Kind::kFilm) {
      if (!film_) film_ = std::make_unique<MjpegWriter>(path_, rgb.width(), rgb.height(), rate_, kFilmQuality);
      return film_->add(rgb);
    }
    if (kind_ == Kind::kOne) return lf::save_image(rgb, path_);
    // The constructor has checked that the pattern is harmless.
    std::string name(path_.size() + 16, 0);
    name.resize(static_cast<size_t>(std::snprintf(name.data(), name.size(), path_.c_str(), count_++)));
    lf::save_image(rgb, name);
  }
  void finish() {
    if (film_) film_->finish();
  }

 private:
  enum class Kind { kOne, kNumbered, kFilm };
  std::string path_;
  FrameRate rate_;
  Kind kind_;
  int count_ = 0;
  std::unique_ptr<MjpegWriter> film_;
};

struct OutputOptions {
  std::string out;
  double framerate = 15;
  std::vector<const cli::Option*> framerate_options;

  // This object must outlive `command`.
  void add_to(
      cli::App& command,
      const char* what =
          "File to write: one picture (NAME.png or NAME.jpg), numbered pictures (NAME_%03d.png) or a film (NAME.mkv)") {
    command.add_option("--out", out, what)->required()->type_name("FILE");
    framerate_options.push_back(command
                                    .add_option("--framerate", framerate,
                                                "Frame rate of a film (.mkv), in pictures per second. It has no "
                                                "effect on pictures")
                                    ->check(cli::Range(0.1, 1000.0)));
  }
  void check() const {
    const bool given = std::ranges::any_of(framerate_options, [](const cli::Option* option) { return bool(*option); });
    if (given && !out.ends_with(".mkv"))
      throw lf::Error("--framerate: applies only to films (.mkv), but --out " + out + " is a picture");
  }
  Output open() const {
    FrameRate rate;
    gst_util_double_to_fraction(framerate, &rate.numerator, &rate.denominator);
    return Output(out, rate);
  }
};

void show_views(const OutputOptions& options, const std::vector<lf::NamedView>& views,
                const std::function<lf::Image(const lf::NamedView&)>& make) {
  Output output = options.open();
  Progress progress("showing", views.size());
  for (const lf::NamedView& view : views) {
    output.add(make(view));
    progress.step();
  }
  output.finish();
  progress.finish();
  terminal::print("%s: %zu %s\n", options.out.c_str(), views.size(), views.size() == 1 ? "picture" : "pictures");
}

struct Options {
  ViewOptions view;
  OutputOptions output;
  int width = 0, stripe = 16, row = -1, column = -1, planes = 32;
  bool behind = false, ids = false;
  double distance = 0, across = 0, near = 0, far = 0;
};

constexpr int kScreen = 1920;

void show_mosaic(const Options& options) {
  const Scene scene(options.view.rig);
  const lf::Image dark(lf::PixelFamily::kRgb, scene.rig.cameras[0].width, scene.rig.cameras[0].height);
  const lf::CameraImages images = [&](lf::CameraIndex camera) -> const lf::Image& {
    return scene.rig.cameras[camera].image.empty() ? dark : scene.images(camera);
  };
  if (std::ranges::all_of(scene.rig.cameras, [](const lf::Camera& c) { return c.image.empty(); })) scene.images(0);
  Output output(options.output.out);
  output.add(camera_mosaic(scene.rig, images, options.width > 0 ? options.width : kScreen, true));
  output.finish();
  terminal::print("%s: %zu cameras\n", options.output.out.c_str(), scene.rig.cameras.size());
}

// Writes the id of each camera into the picture, at the centre of its contribution. Large contributions come first, and
// ids that would overlap are omitted.
void write_ids(lf::Image& map, const Scene& scene, const lf::View& view) {
  const double size = std::max(8.0, view.height / 40.0);  // pixels
  const lf::ViewPlan plan(scene.rig, scene.mesh, view);
  const lf::FaceIdMap owners(plan, {0, 0, view.width, view.height});
  std::vector<lf::CameraFootprint> places = lf::camera_footprints(scene.rig, plan, owners);
  std::ranges::stable_sort(places, std::ranges::greater(), &lf::CameraFootprint::weight);
  std::vector<lf::Vec2> written;
  for (const lf::CameraFootprint& place : places) {
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
    if (options.view.from_file())
      throw lf::Error("--behind: cannot be used with --views, because both set the viewpoint");
    const auto [width, height] = options.view.size(scene);
    const lf::Viewpoint behind = options.view.viewpoint(
        lf::viewpoint_behind(scene.rig, options.view.aspect(scene), options.view.focus_distance(scene)));
    views.push_back({"behind", 0, lf::make_view(behind, width, height)});
    views.back().view.blending.extrapolates = false;  // the picture shows the mesh
  } else {
    views = options.view.views(scene, options.output.open().takes_many());
  }
  const std::optional<lf::ArrayDepth> depths = options.view.depths(scene, views);
  show_views(options.output, views, [&](const lf::NamedView& named) {
    lf::View view = options.view.focused(scene, scene.mesh, depths, named.view);
    view.blending = named.view.blending;  // as in a live picture
    const lf::Image picture = picture_of(scene, scene.mesh, {}, view).picture;
    lf::Image map = lf::contribution_map(scene.rig, scene.mesh, view, &picture);
    if (options.ids) write_ids(map, scene, view);
    return map;
  });
}

void show_coverage(const Options& options) {
  const Scene scene(options.view.rig);
  const auto views = options.view.views(scene, options.output.open().takes_many());
  const std::optional<lf::ArrayDepth> depths = options.view.depths(scene, views);
  show_views(options.output, views, [&](const lf::NamedView& named) {
    lf::View view = options.view.focused(scene, scene.mesh, depths, named.view);
    view.blending = named.view.blending;  // as in a live picture
    const lf::Image picture = picture_of(scene, scene.mesh, {}, view).picture;
    const lf::ViewPlan plan(scene.rig, scene.mesh, view);
    const lf::FaceIdMap owners(plan, {0, 0, view.width, view.height});
    const std::vector<float> lost = lf::missing_weights(scene.rig, plan, owners);
    double whole = 0, seen = 0, none = 0;
    for (const float share : lost) {
      if (std::isnan(share)) {
        none++;
        continue;
      }
      whole += share <= 1 - lf::kMinCoverage;
      seen += 1 - share;
    }
    const double percent = 100.0 / static_cast<double>(lost.size());
    return with_colour_bar(lf::heat_map(lost, view.width, view.height, 1, &picture),
                           {"0 % missing",
                            "100 % missing",
                            none > 0 ? "no camera" : "",
                            {lf::format_text("%.1f %% of the pixels complete,", whole * percent),
                             lf::format_text("%.1f %% of the weight visible", seen * percent)}});
  });
}

void show_epipolar(const Options& options) {
  const Scene scene(options.view.rig);
  if ((options.row >= 0) == (options.column >= 0))
    throw lf::Error("give either --row or --column, to select the cameras of the picture");
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
  terminal::print("%s: %zu cameras, %.4g m away\n", options.output.out.c_str(), line.size(), epi.distance);
}

void show_sweep(const Options& options) {
  const Scene scene(options.view.rig);
  if (!options.output.open().takes_many())
    throw lf::Error("--out " + options.output.out +
                    ": must be numbered pictures, NAME_%03d.png, or NAME.mkv for a sweep");
  lf::FocusRange range{options.near, options.far};
  if (!(range.near > 0 && range.far > 0)) {
    const std::optional<lf::FocusRange> found = lf::estimate_focus_range(scene.rig, scene.images);
    if (!found) throw lf::Error("the depth range cannot be estimated from the images; give --near and --far");
    if (!(range.near > 0)) range.near = range.far > 0 ? std::min(found->near, range.far) : found->near;
    if (!(range.far > 0)) range.far = std::max(found->far, range.near);
  }
  const lf::View view = options.view.views(scene, false)[0].view;
  const auto views = lf::make_focus_sweep(view, range, options.planes);
  show_views(options.output, views,
             [&](const lf::NamedView& named) { return picture_of(scene, scene.mesh, {}, named.view).picture; });
  terminal::print("%d planes from %.4g to %.4g m\n", options.planes, range.near, range.far);
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

void add_epipolar_command(cli::App& app, Options& o) {
  cli::App* epi = add_command(app, "epi",
                              "Draws an epipolar-plane image. It stacks the images of one scene line in a row or "
                              "column of cameras. The slope of an edge shows its depth",
                              o, show_epipolar);
  epi->add_option("--rig", o.view.rig, "Rig file of a camera grid with one still image per camera")->required();
  cli::Option* row =
      epi->add_option("--row", o.row, "Row of cameras to use; row 0 is at the top. Give either --row or --column")
          ->check(cli::NonNegativeNumber);
  epi->add_option("--column", o.column, "Column of cameras to use; column 0 is at the left")
      ->check(cli::NonNegativeNumber)
      ->excludes(row);
  epi->add_option("--focus-distance", o.distance,
                  "Distance of the scene line from the cameras, in metres. Points at this distance have no disparity, "
                  "so their edges are vertical in the picture (default: estimated)")
      ->check(cli::PositiveNumber);
  epi->add_option("--across", o.across,
                  "Offset of the scene line from the optical axes, in metres: downwards for a row of cameras, to the "
                  "right for a column")
      ->capture_default_str();
  epi->add_option("--width", o.width, "Width of the picture, in pixels (default: the width of a camera image)")
      ->check(cli::Range(1, lf::kMaxImageSize));
  epi->add_option("--stripe", o.stripe,
                  "Height of the stripe that each camera gets in the picture, in pixels. Larger "
                  "values make edges easier to follow")
      ->check(cli::Range(1, 256));
  epi->add_option("--out", o.output.out, "Picture to write, as PNG or JPEG (.png or .jpg)")
      ->required()
      ->type_name("FILE");
}

struct DifferenceOptions {
  ViewOptions view;
  OutputOptions output;
  std::string truth;
  bool scene = false;
  int left_out = -1;
  double full = 64;
};

lf::Image truth_of(const DifferenceOptions& options, const Scene& scene, const lf::NamedView& named, size_t number) {
  const lf::View& view = named.view;
  if (options.left_out >= 0) return scene.images(*scene.rig.index_of_id(static_cast<uint32_t>(options.left_out)));
  if (options.scene) return lf::render_scene({view.width, view.height, view.lens, view.pose}, named.time);
  if (number > 0)
    throw lf::Error("--truth: is a single picture and can be compared with only one view; select a single view");
  lf::Image truth = lf::load_image(options.truth);
  if (truth.width() != view.width || truth.height() != view.height)
    throw lf::Error(options.truth + ": must have the same size as the view, " + std::to_string(view.width) + "x" +
                    std::to_string(view.height));
  return truth;
}

void show_difference(const DifferenceOptions& options) {
  const Scene scene(options.view.rig);
  if ((options.left_out >= 0) + options.scene + !options.truth.empty() != 1)
    throw lf::Error("give exactly one of --truth, --scene and --held-out-camera, to select the expected picture");
  std::vector<lf::NamedView> views;
  lf::Mesh mesh = scene.mesh;
  std::optional<lf::CameraIndex> held_out;
  if (options.left_out >= 0) {
    const lf::CameraIndex camera = lf::parse_camera_list(scene.rig, std::to_string(options.left_out))[0];
    held_out = camera;
    if (options.view.places_eye())
      throw lf::Error(
          "--held-out-camera: cannot be used with --views, --size, --fov or --move, because the held-out camera "
          "defines the view");
    const lf::Camera& at = scene.rig.cameras[camera];
    lf::View view{.width = at.width, .height = at.height, .lens = at.lens, .pose = at.pose, .focus = {}};
    view.focus.plane = lf::focal_plane_at(view.pose, options.view.focus_distance(scene));
    views.push_back({"left out", 0, view});
    mesh = lf::build_mesh(scene.rig, {camera});
  } else {
    views = options.view.views(scene, options.output.open().takes_many());
  }
  size_t number = 0;
  const std::optional<lf::ArrayDepth> depths = options.view.depths(scene, views, held_out);
  show_views(options.output, views, [&](const lf::NamedView& named) {
    const lf::Image truth = truth_of(options, scene, named, number++);
    const lf::Still still = picture_of(scene, mesh, depths, options.view.focused(scene, mesh, depths, named.view));
    const lf::Quality quality = lf::compare(still.picture, truth, still.coverage);
    const std::vector<float> off = lf::differences(still.picture, truth, still.coverage);
    const std::vector<std::string> texts =
        quality.coverage > 0
            ? std::vector{lf::format_text("PSNR %.2f dB, SSIM %.4f,", quality.psnr_db, quality.ssim),
                          lf::format_text("at most %d of 255, %.1f %% compared", quality.max_error,
                                          100 * quality.coverage)}
            : std::vector<std::string>{"nothing compared:",
                                       "no pixel can be compared, because no camera sees any part of the view"};
    terminal::print("%s: %s %s\n", named.name.c_str(), texts[0].c_str(), texts[1].c_str());
    return with_colour_bar(
        lf::heat_map(off, named.view.width, named.view.height, options.full),
        {"off by 0", lf::format_text("%.4g of 255", options.full), quality.coverage < 1 ? "not compared" : "", texts});
  });
}

void add_difference_command(cli::App& app) {
  const auto o = std::make_shared<DifferenceOptions>();
  cli::App* difference = app.add_subcommand("difference",
                                            "Shows the difference between a rendered view and the expected picture in "
                                            "false colours, and prints PSNR and SSIM");
  o->view.add_to(*difference);
  difference->add_option("--truth", o->truth, "File with the expected picture of the view");
  difference->add_flag("--scene", o->scene,
                       "Use the exact picture of the built-in scene as the expected picture. The cameras of the rig "
                       "must have filmed this scene, for example with lf-scene");
  difference
      ->add_option("--held-out-camera", o->left_out,
                   "Id of a camera to hold out. Its own image is the expected picture, and the remaining cameras "
                   "render the view")
      ->check(cli::NonNegativeNumber);
  difference
      ->add_option(
          "--full-scale", o->full,
          "Difference at the end of the colour scale, in levels of 255. Lower values make small differences visible")
      ->check(cli::Range(1.0, 255.0));
  o->output.add_to(*difference);
  difference->callback([o] { show_difference(*o); });
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  cli::App app(
      "Draws pictures that explain a rig with still images: its camera images, the contribution of each camera to a "
      "view, and errors of rendered views.",
      "lf-show");
  app.require_subcommand(1);

  cli::App* mosaic = add_command(
      app, "mosaic", "Draws all camera images side by side, arranged like the array and labelled with the camera names",
      o, show_mosaic);
  mosaic->add_option("--rig", o.view.rig, "Rig file with one still image per camera")->required();
  mosaic->add_option("--out", o.output.out, "Picture to write, as PNG or JPEG (.png or .jpg)")
      ->required()
      ->type_name("FILE");
  mosaic->add_option("--width", o.width, "Width of the picture, in pixels (default: 1920)")
      ->check(cli::Range(1, lf::kMaxImageSize));

  cli::App* contributions = add_command(
      app, "contributions",
      "Colours each pixel of a view by the contributing cameras. Neighbouring cameras have different colours", o,
      show_contributions);
  o.view.add_to(*contributions);
  contributions->add_flag("--behind", o.behind,
                          "Look from behind the array instead of from its middle, so that the contributions of all "
                          "cameras are visible");
  contributions->add_flag("--ids", o.ids,
                          "Write the id of each camera into the region that shows most of its contribution");
  o.output.add_to(*contributions);

  cli::App* coverage = add_command(app, "coverage",
                                   "Shows how much of each pixel is missing: the total weight of the cameras that "
                                   "should contribute to the pixel, but do not see its point",
                                   o, show_coverage);
  o.view.add_to(*coverage);
  o.output.add_to(*coverage);

  add_epipolar_command(app, o);

  cli::App* sweep = add_command(
      app, "sweep", "Renders one view many times, focused on successive planes from near to far", o, show_sweep);
  o.view.add_to(*sweep, true);
  sweep
      ->add_option("--near", o.near,
                   "Distance of the nearest plane from the viewpoint, in metres (default: estimated from the images)")
      ->check(cli::PositiveNumber);
  sweep
      ->add_option("--far", o.far,
                   "Distance of the farthest plane from the viewpoint, in metres (default: estimated from the images)")
      ->check(cli::PositiveNumber);
  sweep
      ->add_option("--planes", o.planes,
                   "Number of planes, and therefore of pictures. The inverse distances of the planes are evenly "
                   "spaced, so that the disparity changes by the same amount at each step")
      ->check(cli::Range(2, 100000));
  o.output.add_to(*sweep, "Numbered pictures (NAME_%03d.png) or a film (NAME.mkv) to write");

  add_difference_command(app);
  return cli::run_tool(app, argc, argv);
}
