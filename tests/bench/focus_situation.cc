// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/focus_situation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include "bench/surface/worlds.h"
#include "reference/generators.h"
#include "scene/scene.h"

namespace lf::focus {
namespace {

using reference::Random;

double log_uniform(Random& random, double low, double high) {
  return std::exp(random.uniform(std::log(low), std::log(high)));
}

constexpr double kInstant = 0.5;  // seconds

Image film(const std::string& world, const Lens& lens, const Pose& pose, int width, int height) {
  if (world == "built-in") return render_scene({width, height, lens, pose}, kInstant);
  return film_world(world, lens, pose, width, height);
}

struct Draft {
  std::string kind;
  int rows, columns;
  double pitch;
};

Rig draw_rig(Random& random, Draft& draft) {
  constexpr std::array<std::pair<int, int>, 4> kSizes{{{160, 120}, {320, 240}, {240, 240}, {200, 150}}};
  const auto [width, height] = kSizes[random.integer(0, 3)];
  draft.pitch = log_uniform(random, 0.015, 0.15);
  draft.rows = random.one_in(8) ? 1 : random.integer(2, 6);
  draft.columns = random.integer(2, 6);
  const double focal = width / (2 * std::tan(random.uniform(35, 65) * M_PI / 360));
  const int kind = random.integer(0, 3);
  draft.kind = kind == 0 ? "exact grid" : kind < 3 ? "jittered grid" : "scattered";
  const double place = kind == 0 ? 0 : kind == 1 ? 0.02 : kind == 2 ? 0.1 : 0.35;
  const double turn = kind == 0 ? 0 : kind < 3 ? 1 : 4;  // degrees
  Rig rig;
  for (int r = 0; r < draft.rows; r++)
    for (int c = 0; c < draft.columns; c++) {
      const double f = focal * (kind == 0 ? 1 : random.uniform(0.98, 1.02));
      const Vec3 at(c - (draft.columns - 1) / 2., r - (draft.rows - 1) / 2., 0);
      const Vec3 jitter = place * random.point_in_box(1);
      const Lens lens(LensModel::kRadial, {f, (width - 1) / 2.0, (height - 1) / 2.0, kind == 0 ? 0 : -0.1, 0});
      const Quat orientation = kind == 0 ? Quat(1, 0, 0, 0) : random.small_rotation(turn * M_PI / 180);
      rig.cameras.push_back(reference::make_camera(static_cast<uint32_t>(rig.cameras.size()), width, height, lens,
                                                   {draft.pitch * (at + jitter), orientation}));
    }
  if (kind < 3) rig.topology = {Topology::Type::kGrid, draft.rows, draft.columns, {}};
  return rig;
}

}  // namespace

Situation random_situation(uint64_t seed) {
  Random random(seed);
  Situation s;
  Draft draft;
  s.rig = draw_rig(random, draft);
  const std::vector<std::string> worlds = world_names();
  const std::string world =
      random.one_in(2) ? "built-in" : worlds[random.integer(0, static_cast<int>(worlds.size()) - 1)];
  const double gain_error = random.one_in(4) ? 0.1 : 0, noise = random.one_in(3) ? random.uniform(1, 6) : 0;
  for (size_t i = 0; i < s.rig.cameras.size(); i++) {
    const Camera& camera = s.rig.cameras[i];
    s.images.push_back(film(world, camera.lens, camera.pose, camera.width, camera.height));
    const double gain = i % 4 == 0 ? 1 + (i % 8 == 0 ? 1 : -1) * gain_error : 1;
    for (uint8_t& v : s.images.back().data()) {
      double spread = 0;  // of three uniform numbers: about normal
      for (int k = 0; k < 3; k++) spread += random.uniform(-1, 1);
      v = static_cast<uint8_t>(std::lround(std::clamp(gain * v + noise * spread, 0., 255.)));
    }
  }
  constexpr std::array<std::pair<int, int>, 10> kSizes{{{160, 120},
                                                        {320, 240},
                                                        {320, 180},
                                                        {240, 320},
                                                        {400, 240},
                                                        {333, 117},
                                                        {120, 160},
                                                        {480, 270},
                                                        {320, 240},
                                                        {640, 360}}};
  const auto [width, height] = kSizes[random.integer(0, 9)];
  const double fov = random.uniform(20, 50);
  const Camera& some = s.rig.cameras[random.integer(0, static_cast<int>(s.rig.cameras.size()) - 1)];
  const Camera& other = s.rig.cameras[random.integer(0, static_cast<int>(s.rig.cameras.size()) - 1)];
  Vec3 eye = some.pose.position;
  std::string where = "at a camera";
  switch (random.integer(0, 7)) {
    case 0: break;
    case 1: eye += Vec3(0.001, 0, 0), where = "1 mm beside a camera"; break;
    case 2: eye = (some.pose.position + other.pose.position) / 2.0, where = "between two cameras"; break;
    case 3: eye += Vec3(0, 0, random.uniform(-0.6, 0)), where = "behind"; break;
    case 4: eye += Vec3(0, 0, random.uniform(0, 0.4)), where = "before"; break;
    case 5: eye = Vec3(0), where = "in the middle"; break;
    default:
      eye = draft.pitch *
            Vec3(random.uniform(-0.5, 0.5) * (draft.columns - 1), random.uniform(-0.5, 0.5) * (draft.rows - 1), 0);
      where = "somewhere";
  }
  const Quat turned = random.one_in(2) ? Quat(1, 0, 0, 0) : random.small_rotation(0.15);
  const double distance = random.one_in(3) ? random.uniform(1.2, 4.5) : log_uniform(random, 0.1, 20);
  s.mode = random.one_in(2) ? FocusMode::kAuto : FocusMode::kSurface;
  s.moves = random.one_in(4);
  const double step = s.moves ? random.uniform(0.05, 0.5) * draft.pitch : 0;
  s.view = [=, w = width, h = height](int picture) {
    View view;
    view.width = w;
    view.height = h;
    view.lens = Lens::pinhole(h / 2. / std::tan(fov * M_PI / 360), (w - 1) / 2., (h - 1) / 2.);
    view.pose = {eye + Vec3(2 * draft.pitch * std::sin(step / (2 * draft.pitch) * picture), 0, 0), turned};
    view.focus.plane = focal_plane_at(view.pose, distance);
    return view;
  };
  s.truth = [world](const View& v) { return film(world, v.lens, v.pose, v.width, v.height); };
  char text[300];
  std::snprintf(text, sizeof text,
                "%s, %s of %dx%d, pitch %.3f, cameras %dx%d, view %dx%d fov %.0f, eye %s%s, focus %.2f m, %s%s%s",
                world.c_str(), draft.kind.c_str(), draft.rows, draft.columns, draft.pitch, some.width, some.height,
                width, height, fov, where.c_str(), s.moves ? ", moving" : "", distance,
                s.mode == FocusMode::kAuto ? "auto" : "surface", gain_error > 0 ? ", gains 10 %" : "",
                noise > 0 ? ", noise" : "");
  s.text = text;
  return s;
}

}  // namespace lf::focus
