// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/surface/cases.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <random>

#include "base/error.h"
#include "image/image.h"
#include "rig/rig_json.h"
#include "rig/still_images.h"
#include "scene/scene.h"

namespace lf::focus {
namespace {

constexpr int kWidth = 320, kHeight = 240;
constexpr double kInstant = 0.5;  // seconds

NamedView view_of(const std::string& name, const Lens& lens, const Pose& pose, int width, int height) {
  NamedView named{name, 0, {}};
  named.view = {.width = width, .height = height, .lens = lens, .pose = pose, .focus = {}};
  named.view.focus.plane = focal_plane_at(pose, 1);
  return named;
}

void read_stills(Case& c) {
  struct Stills {
    explicit Stills(const Rig& from) : rig(from), images(rig) {}
    Rig rig;
    StillImages images;
    std::map<CameraIndex, Image> kept;
  };
  const auto stills = std::make_shared<Stills>(c.rig);
  c.image = [stills](CameraIndex camera, size_t) -> const Image& {
    auto found = stills->kept.find(camera);
    if (found == stills->kept.end()) found = stills->kept.emplace(camera, stills->images.get(camera)).first;
    return found->second;
  };
}

// Images of the built-in scene, made when asked for.
void film_scene(Case& c, std::function<double(size_t)> time_of) {
  struct Filmed {
    double time = -1;
    Image image;
  };
  const auto filmed = std::make_shared<std::map<CameraIndex, Filmed>>();
  const auto rig = std::make_shared<Rig>(c.rig);
  c.image = [filmed, rig, time_of](CameraIndex camera, size_t view) -> const Image& {
    Filmed& f = (*filmed)[camera];
    if (const double time = time_of(view); f.time != time) {
      const Camera& at = rig->cameras[camera];
      f = {time, render_scene({at.width, at.height, at.lens, at.pose}, time)};
    }
    return f.image;
  };
  const auto views = std::make_shared<std::vector<NamedView>>(c.views);
  c.truth = [views, time_of](size_t view) {
    const View& v = (*views)[view].view;
    return render_scene({v.width, v.height, v.lens, v.pose}, time_of(view));
  };
}

// Cameras of odd rows and columns, with all their neighbours in the array.
std::vector<CameraIndex> odd_cameras(const Topology& grid) {
  std::vector<CameraIndex> odd;
  for (int r = 1; r + 1 < grid.rows; r += 2)
    for (int k = 1; k + 1 < grid.columns; k += 2) odd.push_back(static_cast<CameraIndex>(r * grid.columns + k));
  return odd;
}

// Cameras that lie between others: no edge of the mesh at them, or no end of its line, is its border.
std::vector<CameraIndex> inner_cameras(const Rig& rig) {
  std::map<std::pair<CameraIndex, CameraIndex>, int> faces_at;  // of an edge, or of a camera in a row
  std::vector<bool> inner(rig.cameras.size(), false);
  for (const MeshFace& face : build_mesh(rig).faces)
    for (int i = 0; i < face.corners(); i++) {
      const CameraIndex a = face.camera[i], b = face.corners() == 3 ? face.camera[(i + 1) % 3] : a;
      faces_at[std::minmax(a, b)]++;
      inner[a] = true;
    }
  for (const auto& [edge, faces] : faces_at)
    if (faces < 2) inner[edge.first] = inner[edge.second] = false;
  std::vector<CameraIndex> found;
  for (CameraIndex i = 0; i < rig.cameras.size(); i++)
    if (inner[i]) found.push_back(i);
  return found;
}

// A picture of each view's size from each file. Throws Error at once if one is missing.
std::function<Image(size_t)> truth_of(const std::vector<NamedView>& views, const std::vector<std::string>& files) {
  for (size_t i = 0; i < files.size(); i++)
    if (!std::filesystem::exists(files[i])) throw Error(files[i] + ": there is no such picture for " + views[i].name);
  return [views, files](size_t view) {
    Image truth = load_image(files[view]);
    const auto size = [](int width, int height) { return std::to_string(width) + "x" + std::to_string(height); };
    if (const View& v = views[view].view; truth.width() != v.width || truth.height() != v.height)
      throw Error(files[view] + ": has " + size(truth.width(), truth.height()) + " pixels, the view has " +
                  size(v.width, v.height));
    return truth;
  };
}

void require_stills(const std::string& path, const Rig& rig) {
  const auto none = std::ranges::find_if(rig.cameras, [](const Camera& camera) { return camera.image.empty(); });
  if (none != rig.cameras.end())
    throw Error(path + ": camera " + std::to_string(none->id) +
                " names no image: stills of all cameras, taken at one instant, are compared");
}

}  // namespace

const CameraSet& Case::without(size_t view) const {
  static const CameraSet kNone;
  return left_out.empty() ? kNone : left_out[view];
}

Case held_out_case(const std::string& path, int views) {
  const Rig all = load_rig(path);
  require_stills(path, all);
  const bool halved = all.topology.type == Topology::Type::kGrid && all.topology.rows >= 3 && all.topology.columns >= 3;
  Case c{.name = path, .rig = halved ? every_nth(all, 2) : all, .views = {}, .truth = {}, .image = {}, .left_out = {}};
  std::vector<CameraIndex> candidates = halved ? odd_cameras(all.topology) : inner_cameras(all);
  if (candidates.empty())
    throw Error(path + ": none of its cameras (" + std::to_string(all.cameras.size()) +
                ") lies between others, so none can be left out and made from these (a row of three would do, or "
                "a grid of 3x3); give --views and --truth");
  const size_t count = std::min(candidates.size(), static_cast<size_t>(views));
  c.name +=
      halved
          ? ": cameras of odd rows and columns, made from the " + std::to_string(c.rig.cameras.size()) + " of even ones"
          : ": cameras that lie between others, each made from the other " + std::to_string(all.cameras.size() - 1);
  std::vector<std::string> files;
  for (size_t i = 0; i < count; i++) {
    const CameraIndex index = candidates[(2 * i + 1) * candidates.size() / (2 * count)];
    const Camera& camera = all.cameras[index];
    const std::string name = camera.name.empty() ? "camera_" + std::to_string(camera.id) : camera.name;
    c.views.push_back(view_of(name, camera.lens, camera.pose, camera.width, camera.height));
    if (!halved) c.left_out.push_back({index});
    files.push_back(all.resolve(camera.image));
  }
  c.truth = truth_of(c.views, files);
  read_stills(c);
  return c;
}

Case truth_case(const std::string& rig, const std::string& views, const std::string& folder) {
  Case c{.name = rig, .rig = load_rig(rig), .views = load_views(views), .truth = {}, .image = {}, .left_out = {}};
  require_stills(rig, c.rig);
  std::vector<std::string> names;
  for (const NamedView& view : c.views) names.push_back(folder + "/" + view.name + ".png");
  c.truth = truth_of(c.views, names);
  read_stills(c);
  return c;
}

Case scene_case() {
  Case c{.name = "built-in scene", .rig = scene_rig(), .views = {}, .truth = {}, .image = {}, .left_out = {}};
  const Vec3 eyes[] = {{0, 0, 0}, {-0.07, 0.03, 0}, {0.05, -0.055, 0.02}, {-0.03, 0.07, -0.05}};
  for (const Vec3& eye : eyes)
    c.views.push_back(view_of("view_" + std::to_string(c.views.size()), c.rig.cameras[0].lens, Pose{eye, {1, 0, 0, 0}},
                              kWidth, kHeight));
  film_scene(c, [](size_t) { return kInstant; });
  return c;
}

Case moving_case(double rate, int frames, double step) {
  Case c{.name = "built-in scene, moving", .rig = scene_rig(), .views = {}, .truth = {}, .image = {}, .left_out = {}};
  for (int i = 0; i < frames; i++) {
    // To and fro inside the array, `step` of the pitch at a time.
    const double way = i * step, span = 4, x = span / 2 - std::abs(std::fmod(way, 2 * span) - span);
    const Vec3 eye(kScenePitch * x, 0.4 * kScenePitch, 0);
    c.views.push_back(
        view_of("view_" + std::to_string(i), c.rig.cameras[0].lens, Pose{eye, {1, 0, 0, 0}}, kWidth, kHeight));
  }
  film_scene(c, [rate](size_t view) { return static_cast<double>(view) / rate; });
  return c;
}

void add_faults(const Faults& faults, Case& c) {
  if (faults.pointing_error != 0) {
    Camera& camera =
        c.rig.cameras[c.rig.cameras.size() / 2 + (c.rig.topology.columns > 1 ? c.rig.topology.columns / 2 : 0)];
    camera.pose.orientation =
        glm::normalize(camera.pose.orientation * glm::angleAxis(faults.pointing_error * M_PI / 180, Vec3(0, 1, 0)));
  }
  if (faults.noise == 0 && faults.gain_error == 0) return;
  const auto spoilt = std::make_shared<std::map<CameraIndex, Image>>();
  c.image = [faults, spoilt, clean = c.image](CameraIndex camera, size_t view) -> const Image& {
    Image& image = (*spoilt)[camera];
    image = clean(camera, view);
    const double gain = camera % 4 == 0 ? 1 + (camera % 8 == 0 ? 1 : -1) * faults.gain_error : 1;
    std::mt19937 random(camera * 1000 + static_cast<uint32_t>(view));
    std::normal_distribution<double> noise(0, std::max(faults.noise, 1e-9));
    for (uint8_t& v : image.data())
      v = static_cast<uint8_t>(std::lround(std::clamp(gain * v + (faults.noise > 0 ? noise(random) : 0), 0., 255.)));
    return image;
  };
}

}  // namespace lf::focus
