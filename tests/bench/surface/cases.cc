// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/surface/cases.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <random>

#include "base/text.h"
#include "image/image.h"
#include "rig/rig_json.h"
#include "rig/still_image_cache.h"
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
    StillImageCache images;
    std::map<CameraIndex, Image> kept;
  };
  const auto stills = std::make_shared<Stills>(c.rig);
  c.image = [stills](CameraIndex camera, size_t) -> const Image& {
    auto found = stills->kept.find(camera);
    if (found == stills->kept.end()) found = stills->kept.emplace(camera, stills->images.get(camera)).first;
    return found->second;
  };
}

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

// Returns the cameras of odd rows and columns, with all their neighbours in the array.
std::vector<CameraIndex> odd_cameras(const Topology& grid) {
  std::vector<CameraIndex> odd;
  for (int r = 1; r + 1 < grid.rows; r += 2)
    for (int k = 1; k + 1 < grid.columns; k += 2) odd.push_back(static_cast<CameraIndex>(r * grid.columns + k));
  return odd;
}

// Returns the cameras between other cameras: no edge at them is on the border of the mesh, or they are not at the end
// of a line.
std::vector<CameraIndex> inner_cameras(const Rig& rig) {
  std::map<std::pair<CameraIndex, CameraIndex>, int> faces_at;  // per edge, or per camera of a row
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

// Returns each view's picture from its file, at the view's size. Throws Error immediately if a file is missing.
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
  Case c{.name = path,
         .rig = halved ? subsample_grid(all, 2) : all,
         .views = {},
         .truth = {},
         .image = {},
         .left_out = {}};
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

namespace {

constexpr double kWall = 3;  // metres

struct Ray {
  Vec3 origin, direction;
  Vec3 at(double z) const { return origin + (z - origin.z) / direction.z * direction; }
};

double hash(int x, int y, int seed) {
  uint32_t h = static_cast<uint32_t>(x) * 374761393u + static_cast<uint32_t>(y) * 668265263u +
               static_cast<uint32_t>(seed) * 2246822519u;
  h = (h ^ (h >> 13)) * 1274126177u;
  return static_cast<double>((h ^ (h >> 16)) & 0xffff) / 65535;
}

// Smooth noise, 0..1, with cells of 1 x 1.
double noise(double x, double y, int seed) {
  const double x0 = std::floor(x), y0 = std::floor(y);
  const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
  const double u = smooth(x - x0), v = smooth(y - y0);
  const auto at = [&](int i, int j) { return hash(static_cast<int>(x0) + i, static_cast<int>(y0) + j, seed); };
  return std::lerp(std::lerp(at(0, 0), at(1, 0), u), std::lerp(at(0, 1), at(1, 1), u), v);
}

// Four octaves, the finest 25 mm: about five pixels of a camera at 2 m.
Vec3 texture(double x, double y, int seed) {
  Vec3 colour(0);
  double amplitude = 0.5, cells = 5;
  for (int octave = 0; octave < 4; octave++, amplitude /= 1.6, cells *= 2)
    for (int c = 0; c < 3; c++)
      colour[c] += amplitude * (noise(cells * x, cells * y, 16 * seed + 4 * c + octave) - 0.5);
  return glm::clamp(Vec3(128) + 170.0 * colour, 0.0, 255.0);
}

Vec3 wall(const Ray& ray) {
  const Vec3 at = ray.at(kWall);
  return texture(at.x, at.y, 1);
}

std::optional<Vec3> ball(const Ray& ray, const Vec3& centre, double radius) {
  const Vec3 d = glm::normalize(ray.direction), to = centre - ray.origin;
  const double along = glm::dot(to, d), left = radius * radius - (glm::dot(to, to) - along * along);
  if (left < 0) return std::nullopt;
  return ray.origin + (along - std::sqrt(left)) * d;
}

Vec3 flat(const Ray& ray) {
  const Vec3 at = ray.at(2.2);
  return texture(at.x, at.y, 2);
}

Vec3 untextured(const Ray& ray) {
  const Vec3 centre(0.1, 0, 1.8);
  if (const std::optional<Vec3> at = ball(ray, centre, 0.25)) {
    const Vec3 normal = (*at - centre) / 0.25;
    return Vec3(190, 80, 70) * (0.6 + 0.4 * std::max(0.0, glm::dot(normal, Vec3(-0.6, -0.64, -0.48))));
  }
  const Vec3 at = ray.at(kWall);
  return Vec3(150, 160, 170) + Vec3(8 * at.x + 5 * at.y);
}

// The mirror shows a wall behind the cameras, with an apparent distance of 5.4 m.
Vec3 mirror(const Ray& ray) {
  const Vec3 at = ray.at(2.2);
  if (std::abs(at.x) > 0.45 || std::abs(at.y) > 0.3) return wall(ray);
  if (std::abs(at.x) > 0.41 || std::abs(at.y) > 0.26) return {90, 60, 40};
  const Vec3 behind = Ray{at, {ray.direction.x, ray.direction.y, -ray.direction.z}}.at(-1);
  return 0.9 * texture(behind.x, behind.y, 3);
}

Vec3 highlight(const Ray& ray) {
  const Vec3 centre(0, 0, 1.9);
  const std::optional<Vec3> at = ball(ray, centre, 0.4);
  if (!at) return wall(ray);
  const Vec3 normal = (*at - centre) / 0.4, light = glm::normalize(Vec3(-0.4, -0.5, -0.75));
  const Vec3 mirrored = glm::reflect(glm::normalize(ray.direction), normal);
  const double gloss = std::pow(std::max(0.0, glm::dot(mirrored, light)), 60);
  const Vec3 paint = texture(2 * normal.x, 2 * normal.y, 4) * (0.4 + 0.6 * std::max(0.0, glm::dot(normal, light)));
  return glm::min(paint + Vec3(255 * gloss), Vec3(255));
}

Vec3 wires(const Ray& ray) {
  const Vec3 at = ray.at(1.5);
  for (const double slope : {0.0, 0.35}) {
    const double across = at.x + slope * at.y + (slope > 0 ? 0.03 : 0), pitch = 0.16;
    if (std::abs(across - pitch * std::round(across / pitch)) < 0.004) return slope > 0 ? Vec3(30) : Vec3(220, 200, 90);
  }
  return wall(ray);
}

Vec3 fence(const Ray& ray) {
  const Vec3 at = ray.at(1.4);
  constexpr double kPitch = 0.08, kSlat = 0.025;
  if (std::abs(at.x - kPitch * std::round(at.x / kPitch)) < kSlat / 2) return 0.8 * texture(at.x, at.y, 5);
  return wall(ray);
}

struct World {
  const char* name;
  Vec3 (*colour)(const Ray&);
};
constexpr World kWorlds[] = {{"flat", flat},           {"untextured", untextured}, {"mirror", mirror},
                             {"highlight", highlight}, {"wires", wires},           {"fence", fence}};

Image film(const World& world, const Lens& lens, const Pose& pose, int width, int height) {
  constexpr int kRays = 2;
  Image image(PixelFamily::kRgb, width, height);
  const Mat3 rotation = pose.rotation();
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      Vec3 sum(0);
      for (int k = 0; k < kRays * kRays; k++) {
        const Vec2 pixel(x + (k % kRays + 0.5) / kRays - 0.5, y + (k / kRays + 0.5) / kRays - 0.5);
        sum += world.colour({pose.position, rotation * Vec3(*lens.unproject(pixel), 1)});
      }
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>(std::lround(sum[c] / (kRays * kRays)));
    }
  return image;
}

const World& world_of(const std::string& name) {
  const auto* const world = std::ranges::find(kWorlds, name, &World::name);
  if (world == std::end(kWorlds)) throw Error(name + ": no scene of this name");
  return *world;
}

}  // namespace

Image film_world(const std::string& name, const Lens& lens, const Pose& pose, int width, int height) {
  return film(world_of(name), lens, pose, width, height);
}

std::vector<std::string> world_names() {
  std::vector<std::string> names;
  for (const World& world : kWorlds) names.push_back(world.name);
  return names;
}

Case world_case(const std::string& name, int views) {
  const World* const world = &world_of(name);
  Case c = scene_case();
  c.name = name;
  c.views.resize(std::min<size_t>(views, c.views.size()));
  const auto kept = std::make_shared<std::map<CameraIndex, Image>>();
  const auto rig = std::make_shared<Rig>(c.rig);
  c.image = [kept, rig, world](CameraIndex camera, size_t) -> const Image& {
    auto found = kept->find(camera);
    if (found == kept->end()) {
      const Camera& at = rig->cameras[camera];
      found = kept->emplace(camera, film(*world, at.lens, at.pose, at.width, at.height)).first;
    }
    return found->second;
  };
  const auto seen = std::make_shared<std::vector<NamedView>>(c.views);
  c.truth = [seen, world](size_t view) {
    const View& v = (*seen)[view].view;
    return film(*world, v.lens, v.pose, kWidth, kHeight);
  };
  return c;
}

}  // namespace lf::focus
