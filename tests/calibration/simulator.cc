// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/simulator.h"

#include <cmath>
#include <map>

#include "calibration/adjustment.h"
#include "calibration/reconstruction.h"
#include "composite/still.h"
#include "focus/still_focus.h"
#include "image/colour_correction.h"
#include "quality/image_quality.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "scene/scene.h"

namespace lf::sim {
namespace {

using Random = std::mt19937_64;

double normal(Random& random, double sigma) { return std::normal_distribution<double>(0, 1)(random) * sigma; }
double uniform(Random& random, double from, double to) {
  return std::uniform_real_distribution<double>(from, to)(random);
}
Vec3 normal3(Random& random, double sigma) {
  return {normal(random, sigma), normal(random, sigma), normal(random, sigma)};
}

// A point in the field of view of the array's centre, uniform in inverse depth.
Vec3 place(const Rig& rig, const PathOptions& options, int i, Random& random) {
  if (options.shape == PathOptions::Shape::kBall)
    return options.near * std::cbrt(uniform(random, 0, 1)) * glm::normalize(normal3(random, 1));
  double t = uniform(random, 0, 1), x = uniform(random, -1, 1), y = uniform(random, -1, 1);
  if (options.shape == PathOptions::Shape::kPlane) t = 0.5;
  if (options.shape == PathOptions::Shape::kLine) t = 0.5, x = 2.0 * i / options.positions - 1, y = 0.3 * x;
  const double z = 1 / (t / options.near + (1 - t) / options.far);
  const Camera& camera = rig.cameras[0];
  return {x * z * camera.width / 2.3 / camera.lens.fx(), y * z * camera.height / 2.3 / camera.lens.fx(), z};
}

}  // namespace

Rig make_array(const ArrayOptions& o, uint64_t seed) {
  Random random(seed);
  Rig rig = make_grid_rig({o.rows, o.columns, o.pitch, 40, o.width, o.height});
  for (Camera& camera : rig.cameras) {
    camera.pose.position += normal3(random, o.position_jitter * o.pitch);
    const Vec3 turn = normal3(random, o.pointing_jitter);
    const double angle = glm::length(turn);
    if (angle > 0) camera.pose.orientation = glm::angleAxis(angle, turn / angle);
    camera.lens = Lens(LensModel::kRadial, {o.f * (1 + normal(random, o.focal_spread)),
                                            (o.width - 1) / 2.0 + normal(random, o.centre_spread),
                                            (o.height - 1) / 2.0 + normal(random, o.centre_spread),
                                            o.k1 + normal(random, o.k1_spread), o.k2 + normal(random, o.k2_spread)});
  }
  return rig;
}

Rig make_rig_around(Around shape, int count, uint64_t seed) {
  Random random(seed);
  Rig rig;
  for (int i = 0; i < count; i++) {
    Vec3 direction = glm::normalize(normal3(random, 1));
    const double turn = 2 * M_PI * i / count, height = (i + 0.5) / count;
    if (shape == Around::kRing) direction = {std::cos(turn), 0, std::sin(turn)};
    if (shape == Around::kDome) {  // golden angles
      const double across = std::sqrt(1 - height * height), angle = i * M_PI * (3 - std::sqrt(5.0));
      direction = {across * std::cos(angle), -height, across * std::sin(angle)};
    }
    Camera camera;
    camera.id = static_cast<uint32_t>(i);
    camera.width = 640, camera.height = 480;
    camera.lens = Lens(LensModel::kRadial, {600 * (1 + normal(random, 0.01)), 319.5 + normal(random, 3),
                                            239.5 + normal(random, 3), -0.1, 0.02});
    camera.pose.position = direction * uniform(random, 2, 3);
    const Vec3 z = glm::normalize(normal3(random, 0.1) - camera.pose.position);
    const Vec3 x = glm::normalize(glm::cross(std::abs(z.y) < 0.9 ? Vec3(0, 1, 0) : Vec3(1, 0, 0), z));
    camera.pose.orientation =
        glm::quat_cast(Mat3(x, glm::cross(z, x), z)) * glm::angleAxis(uniform(random, -0.3, 0.3), Vec3(0, 0, 1));
    rig.cameras.push_back(camera);
  }
  return rig;
}

namespace {

// Adds what a camera sees of a point.
void observe(const Rig& truth, const PathOptions& options, const Vec3& point, Observation o, Random& random,
             Watched& watched) {
  const Camera& camera = truth.cameras[o.camera];
  const bool missed = uniform(random, 0, 1) < options.missed;
  const auto pixel = camera.lens.project(camera.pose.camera_from_world(point));
  if (missed || !pixel || pixel->x < -0.5 || pixel->y < -0.5 || pixel->x > camera.width - 0.5 ||
      pixel->y > camera.height - 0.5)
    return;
  o.pixel = *pixel + Vec2(normal(random, options.noise), normal(random, options.noise));
  const bool outlier = uniform(random, 0, 1) < options.outliers;
  if (outlier) o.pixel = {uniform(random, 0, camera.width - 1), uniform(random, 0, camera.height - 1)};
  watched.tracks.observations.push_back(o);
  watched.good.push_back(!outlier);
}

Watched watch_board(const Rig& truth, const PathOptions& options, Random& random) {
  Watched watched;
  const CalibrationBoard& board = *options.board;
  Vec2 middle(0, 0);
  for (size_t i = 0; i < board.num_corners(); i++) middle += board.corner(i) / static_cast<double>(board.num_corners());
  for (size_t i = 0; i < board.num_corners(); i++) watched.tracks.board.emplace_back(board.corner(i) - middle, 0);
  watched.tracks.num_positions = static_cast<size_t>(options.positions);
  for (const Camera& camera : truth.cameras) watched.tracks.cameras.push_back({camera.id, camera.width, camera.height});
  for (int j = 0; j < options.positions; j++) {
    const Vec3 at = place(truth, options, j, random);
    const Quat turn = glm::angleAxis(uniform(random, -0.6, 0.6), Vec3(1, 0, 0)) *
                      glm::angleAxis(uniform(random, -0.6, 0.6), Vec3(0, 1, 0)) *
                      glm::angleAxis(uniform(random, -M_PI, M_PI), Vec3(0, 0, 1));
    watched.boards.push_back({at, turn});
    for (uint32_t i = 0; i < truth.cameras.size(); i++)
      for (uint32_t corner = 0; corner < watched.tracks.board.size(); corner++)
        observe(truth, options, watched.boards.back().world_from_camera(watched.tracks.board[corner]),
                {i, static_cast<uint32_t>(j), corner}, random, watched);
  }
  return watched;
}

}  // namespace

BoardSightings sightings_of(const Tracks& tracks, const CalibrationBoard& board) {
  std::map<std::pair<uint32_t, uint32_t>, BoardView> views;
  for (const Observation& o : tracks.observations) {
    BoardView& view = views[{o.camera, o.position}];
    view.corners.push_back(o.pixel);
    view.ids.push_back(static_cast<int>(o.light));
  }
  BoardSightings sightings{board, tracks.cameras, tracks.num_positions, {}};
  for (auto& [key, view] : views) sightings.sightings.push_back({key.first, key.second, std::move(view)});
  return sightings;
}

std::vector<double> MovingBoard::instants() const {
  std::vector<double> times;
  for (int j = 0; j < positions; j++) times.push_back(j + 0.5);
  return times;
}

Pose MovingBoard::pose(double time, const Rig& rig, uint64_t seed) const {
  Vec3 at, turn;
  if (every_frame) {
    at = {0.1 * std::sin(2.1 * time) + 0.05 * std::sin(5.3 * time), 0.08 * std::sin(1.7 * time + 1),
          0.6 + 0.15 * std::sin(1.1 * time)};
    turn = {0.4 * std::sin(1.3 * time), 0.4 * std::sin(2.3 * time + 2), 0.6 * std::sin(0.9 * time + 1)};
  } else {
    const double instant = std::floor(time) + 0.5;
    Random random(seed + static_cast<uint64_t>(instant));
    at = place(rig, {.near = near, .far = far}, 0, random);
    turn = {uniform(random, -0.6, 0.6), uniform(random, -0.6, 0.6), uniform(random, -M_PI, M_PI)};
    const Vec3 shifting = normal3(random, speed), turning = normal3(random, 4 * speed);
    at += shifting * (time - instant), turn += turning * (time - instant);
  }
  const Quat q = glm::angleAxis(turn.x, Vec3(1, 0, 0)) * glm::angleAxis(turn.y, Vec3(0, 1, 0)) *
                 glm::angleAxis(turn.z, Vec3(0, 0, 1));
  return {at, q};
}

BoardFilms film_board(Rig& truth, const MovingBoard& motion, uint64_t seed) {
  Random random(seed);
  BoardFilms films{motion.board, {}, {}, {}};
  const Vec2 middle_corner = motion.board.corner(motion.board.num_corners() - 1) / 2.0;
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    Camera& camera = truth.cameras[i];
    camera.time_offset = uniform(random, -motion.offset, motion.offset);
    films.cameras.push_back({camera.id, camera.width, camera.height});
    films.frame_times.push_back(1 / motion.rate);
    std::vector<BoardFilms::Frame>& frames = films.frames.emplace_back();
    const double phase = uniform(random, 0, 1), middle = 0.5 * motion.positions;
    for (int n = 0; n < motion.positions * motion.rate; n++) {
      const double stamp = (n + phase) / motion.rate;
      if (!motion.every_frame && std::abs(stamp - std::floor(stamp) - 0.5) > 2 / motion.rate) continue;
      const double time = stamp + camera.time_offset + (i % 2 ? motion.drift * (stamp - middle) : 0);
      BoardView view;
      for (size_t k = 0; k < motion.board.num_corners(); k++) {
        std::optional<Vec2> pixel = Vec2(0, (camera.height - 1) / 2.0);
        // The capture time depends on the row, and the row on the time.
        for (int round = 0; round < 6 && pixel; round++) {
          const double row = (pixel->y - (camera.height - 1) / 2.0) / camera.height;
          const Pose board = motion.pose(time + motion.readout * row, truth, seed);
          pixel = camera.lens.project(
              camera.pose.camera_from_world(board.world_from_camera(Vec3(motion.board.corner(k) - middle_corner, 0))));
        }
        if (!pixel || pixel->x < 0 || pixel->y < 0 || pixel->x > camera.width - 1 || pixel->y > camera.height - 1)
          continue;
        view.ids.push_back(static_cast<int>(k));
        view.corners.push_back(*pixel + Vec2(normal(random, motion.noise), normal(random, motion.noise)));
      }
      if (view.corners.size() >= 6) frames.push_back({stamp, std::move(view)});
    }
  }
  return films;
}

Watched watch(const Rig& truth, const PathOptions& options, uint64_t seed) {
  Random random(seed);
  if (options.board) return watch_board(truth, options, random);
  Watched watched;
  Tracks& tracks = watched.tracks;
  tracks.bar = options.bar > 0;
  tracks.num_positions = options.positions;
  for (const Camera& camera : truth.cameras) tracks.cameras.push_back({camera.id, camera.width, camera.height});
  for (int j = 0; j < options.positions; j++) {
    Vec3 lights[2] = {place(truth, options, j, random)};
    lights[1] = lights[0];
    if (tracks.bar) {
      const Vec3 half = glm::normalize(normal3(random, 1)) * (options.bar / 2);
      lights[0] -= half, lights[1] += half;
    }
    watched.lights.insert(watched.lights.end(), lights, lights + (tracks.bar ? 2 : 1));
    for (uint32_t i = 0; i < truth.cameras.size(); i++)
      for (uint32_t light = 0; light < (tracks.bar ? 2u : 1u); light++)
        observe(truth, options, lights[light], {i, static_cast<uint32_t>(j), light}, random, watched);
  }
  return watched;
}

void measure_lenses(const Rig& truth, const LensSigmas& sigmas, uint64_t seed, SolveOptions& options) {
  Random random(seed);
  options.prior = truth;
  const double sigma[] = {sigmas.f, sigmas.c, sigmas.c, sigmas.k1, sigmas.k2};
  CameraCovariance covariance{{"f", "cx", "cy", "k1", "k2"}, std::vector<double>(25, 0)};
  for (int k = 0; k <= kK2; k++) covariance.matrix[k * 6] = sigma[k] * sigma[k];
  options.prior_covariances.assign(truth.cameras.size(), covariance);
  for (Camera& camera : options.prior->cameras) {
    auto params = camera.lens.params();
    for (int k = 0; k <= kK2; k++) params[k] += normal(random, sigma[k]);
    camera.lens = Lens(LensModel::kRadial, params);
  }
}

Reconstruction true_scene(const Rig& truth, const Watched& watched, const SolveOptions& options) {
  Reconstruction scene = make_scene(watched.tracks, options);
  const bool bar = watched.tracks.bar;
  const double unit = bar ? glm::length(watched.lights[1] - watched.lights[0]) : 1;
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    Pose pose = truth.cameras[i].pose;
    pose.position /= unit;
    scene.cameras[i].set_pose(pose);
    scene.cameras[i].set_lens(truth.cameras[i].lens);
    scene.cameras[i].used = true;
  }
  const auto corners = std::make_shared<const std::vector<Vec3>>(watched.tracks.board);
  for (size_t j = 0; j < watched.boards.size(); j++) scene.targets[j].set_board(watched.boards[j], corners);
  for (size_t j = 0; j < scene.targets.size() && watched.boards.empty(); j++) {
    TargetState& target = scene.targets[j];
    target.kind = bar ? TargetState::Kind::kBar : TargetState::Kind::kPoint;
    const Vec3 a = watched.lights[bar ? 2 * j : j] / unit, b = watched.lights[bar ? 2 * j + 1 : j] / unit;
    for (int k = 0; k < 3; k++) target.v[k] = (a[k] + b[k]) / 2, target.v[3 + k] = b[k] - a[k];
  }
  return scene;
}

namespace {

constexpr double kPitch = 0.06, kFieldOfView = 35;  // metres; degrees, vertical
constexpr double kTime = 0.55;                      // time of the scene, seconds

std::vector<Pose> poses_of(const Rig& rig) {
  std::vector<Pose> poses;
  for (const Camera& camera : rig.cameras) poses.push_back(camera.pose);
  return poses;
}

}  // namespace

PlannedArray::PlannedArray(int rows, int columns, int width, int height)
    : nominal(make_grid_rig({rows, columns, kPitch, kFieldOfView, width, height})) {
  ArrayOptions options{.rows = rows,
                       .columns = columns,
                       .pitch = kPitch,
                       .f = nominal.cameras[0].lens.fx(),
                       .width = width,
                       .height = height};
  options.k2 = options.k1_spread = options.k2_spread = 0;
  truth = make_array(options, 3);
  const double offsets[] = {0.02, -0.013, 0.004, 0.017, -0.02, 0.011, -0.008, 0.0, -0.011};
  for (size_t i = 0; i < truth.cameras.size(); i++) truth.cameras[i].time_offset = offsets[i % std::size(offsets)];
  faults = random_faults(truth.cameras.size(), kFaultSeed);
  faults[stuck()].gain = kStuckGain;
}

double PlannedArray::clock_error(const Rig& rig) const {
  const double n = static_cast<double>(truth.cameras.size());
  double mean = 0, squares = 0;
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    const double error = rig.cameras[i].time_offset - truth.cameras[i].time_offset;
    mean += error / n, squares += error * error / n;
  }
  return std::sqrt(squares - mean * mean);
}

std::vector<double> PlannedArray::shown_db(const Rig& rig) const {
  std::vector<Image> images;
  for (CameraIndex i = 0; i < truth.cameras.size(); i++) {
    const Camera &camera = truth.cameras[i], &known = rig.cameras[i];
    const double frame = std::round((kTime - known.time_offset) * rate_of(i)) / rate_of(i);
    Image image = render_scene({camera.width, camera.height, camera.lens, camera.pose}, frame + camera.time_offset);
    image = apply_fault(image, faults[i], camera.principal_point(), i);
    if (known.colour) image = corrected(image, *known.colour, known.principal_point());
    images.push_back(std::move(image));
  }
  const CameraImages image_of = [&](CameraIndex i) -> const Image& { return images[i]; };
  const Similarity truth_from_rig = align(poses_of(rig), poses_of(truth));
  const Quat back = glm::inverse(truth_from_rig.rotation);
  const Mesh mesh = build_mesh(rig);
  const Vec3 corner = nominal.cameras.back().pose.position - nominal.cameras.front().pose.position;
  std::vector<double> shown;
  for (const Vec3 eye : {Vec3{-0.022, -0.017, 0}, Vec3{0.29 * corner.x, 0.22 * corner.y, 0}, Vec3{0.01, 0.02, -0.05}}) {
    View view{.width = nominal.cameras[0].width,
              .height = nominal.cameras[0].height,
              .lens = nominal.cameras[0].lens,
              .pose = {eye, {1, 0, 0, 0}},
              .focus = {}};
    const Image scene = render_scene({view.width, view.height, view.lens, view.pose}, kTime);
    view.pose = {back * ((eye - truth_from_rig.translation) / truth_from_rig.scale), back};
    view.focus.plane =
        plane_through(view.pose.world_from_camera({0, 0, kSceneMiddle / truth_from_rig.scale}), view.pose.forward());
    const View focused = focus_still(rig, mesh, view, image_of, {.mode = FocusMode::kSurface});
    const Still still = render_still(rig, mesh, focused, image_of, Resampling::kSharpened);
    shown.push_back(compare(still.picture, scene, still.coverage).psnr_db);
  }
  return shown;
}

Rig PlannedArray::truth_with_colours_of(const Rig& rig) const {
  Rig known = truth;
  for (size_t i = 0; i < known.cameras.size(); i++) known.cameras[i].colour = rig.cameras[i].colour;
  return known;
}

}  // namespace lf::sim
