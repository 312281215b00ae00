// SPDX-License-Identifier: LGPL-2.1-or-later
// Compares solutions with the theoretical optimum: 8x8 cameras, 100 positions, 0.2 pixels of noise, over the seeds
// LF_SEEDS=FIRST-LAST (default: 1-20). LF_ARRAYS=N compares moving boards and large arrays over N seeds.
// LF_RESULTS=FILE stores one line per seed and skips the seeds in the file, so that a long run can be resumed, or
// shared by several processes.

#include <Eigen/Dense>

#include "calibration/multiview_geometry.h"
#include "calibration/simulator.h"
#include "support/test.h"

namespace lf::sim {
namespace {

// Errors against the truth and against the theoretical bound, of one run or summed over runs. The bound is for the
// chosen model with its prior on lenses: a measurement, or the similarity of lenses of a batch.
struct Errors {
  // kFocals: the focal lengths of an array, normalised by their covariance. An error that all cameras have in common
  // counts once, but in kFocal once for each camera, so the ratio of kFocal varies by chance much more.
  enum Quantity { kPosition, kRotation, kFocal, kTransfer, kFocals, kNumQuantities };
  std::array<double, kNumQuantities> squared{}, bound{};  // cameras; for transfers, pixels
  std::array<double, kTransfer> inside{};                 // cameras inside their 95 % ellipsoids
  double cameras = 0, transfers = 0;
  int converged = 0, runs = 0;
  double seconds = 0;  // the slowest run

  Errors& operator+=(const Errors& other);
  double ratio(Quantity q) const { return std::sqrt(squared[q] / bound[q]); }
  double share_inside(Quantity q) const { return inside[q] / cameras; }
  double rms(Quantity q) const { return std::sqrt(squared[q] / (q == kTransfer ? transfers : cameras)); }
};

struct Study {
  ArrayOptions array;
  PathOptions path;
  std::optional<MovingBoard> motion;  // instead of the path: films of a board, with unknown clocks and readout times
  bool prior = true;                  // lenses have measured priors
  std::optional<DistortionModel> distortion;
};

// 95 % quantiles of normal vectors of 3 dimensions and of 1.
constexpr double kChi3 = 7.815, kChi1 = 3.841;
constexpr double kTransferDistance = 1.5;  // metres
constexpr double kConverged = 5;           // times the bound: a local minimum is much farther off

Eigen::Vector3d eigen(const Vec3& v) { return {v.x, v.y, v.z}; }

double normalised(const Vec3& error, const Eigen::Matrix3d& covariance) {
  return eigen(error).dot(covariance.ldlt().solve(eigen(error)));
}

struct Transfers {
  double squared = 0, count = 0;
};

// New points seen without noise by all cameras but one, and predicted in that camera.
Transfers transfers(const Rig& truth, const std::vector<CameraState>& found) {
  Transfers result;
  for (int n = 0; n < 9; n++) {
    const Vec3 point((n % 3 - 1) * 0.25, (n / 3 - 1) * 0.2, kTransferDistance);
    Tracks tracks;
    std::vector<uint32_t> seen;
    for (uint32_t i = 0; i < truth.cameras.size(); i++) {
      const auto pixel = truth.cameras[i].lens.project(truth.cameras[i].pose.camera_from_world(point));
      if (!pixel) continue;
      seen.push_back(static_cast<uint32_t>(tracks.observations.size()));
      tracks.observations.push_back({i, 0, 0, *pixel});
    }
    const size_t left_out = n * 7 % seen.size();
    const Observation held = tracks.observations[left_out];
    seen.erase(seen.begin() + static_cast<ptrdiff_t>(left_out));
    const auto predicted = triangulate(found, tracks, seen, 4);
    if (!predicted) continue;
    TargetState target;
    target.kind = TargetState::Kind::kPoint;
    for (int k = 0; k < 3; k++) target.v[k] = predicted->point[k];
    const auto e = residual(found[held.camera], target, held);
    result.squared += e ? glm::dot(*e, *e) : 1e6;
    result.count++;
  }
  return result;
}

// Draws cameras that differ from `scene`'s randomly according to the bound, in metres.
std::vector<CameraState> at_the_bound(const Reconstruction& scene, const Uncertainty& bound, double unit,
                                      uint64_t seed) {
  std::mt19937_64 random(seed);
  const Eigen::VectorXd size = bound.covariance.diagonal().cwiseSqrt();
  Eigen::MatrixXd correlation = size.cwiseInverse().asDiagonal() * bound.covariance * size.cwiseInverse().asDiagonal();
  correlation.diagonal().array() += 1e-9;  // no variance along the gauge
  Eigen::VectorXd step(size.size());
  for (double& s : step) s = std::normal_distribution<double>()(random);
  step = size.asDiagonal() * (correlation.llt().matrixL() * step);
  std::vector<CameraState> cameras = scene.cameras;
  for (size_t i = 0; i < cameras.size(); i++) {
    const auto s = step.segment(bound.camera_row[i], bound.camera_size);
    const Pose pose = cameras[i].pose();
    cameras[i].set_pose(
        {(pose.position + Vec3(s[3], s[4], s[5])) * unit, Quat(1, s[0] / 2, s[1] / 2, s[2] / 2) * pose.orientation});
    for (size_t k = 0; k < bound.lens_terms.size(); k++)
      cameras[i].lens_terms()[bound.lens_terms[k]] += s[static_cast<Eigen::Index>(6 + k)];
  }
  return cameras;
}

Errors& Errors::operator+=(const Errors& other) {
  for (int q = 0; q < kNumQuantities; q++) squared[q] += other.squared[q], bound[q] += other.bound[q];
  for (int q = 0; q < kTransfer; q++) inside[q] += other.inside[q];
  cameras += other.cameras, transfers += other.transfers;
  converged += other.converged, runs += other.runs;
  seconds = std::max(seconds, other.seconds);
  return *this;
}

// Solves films of a moving board. Sets `watched` to the interpolated corners: the bound is for these, and for unknown
// clocks and readout times.
MovingBoardSolution solve_films(Rig& truth, const MovingBoard& motion, uint64_t seed, const SolveOptions& options,
                                Watched& watched) {
  const BoardFilms films = film_board(truth, motion, seed);
  std::vector<CameraClock> clocks(truth.cameras.size());
  for (CameraClock& clock : clocks) clock.known = true;
  MovingBoardSolution moving = solve_moving_board(films, motion.instants(), clocks, options);
  watched.tracks = moving.tracks;
  for (const double instant : motion.instants()) watched.boards.push_back(motion.pose(instant, truth, seed));
  watched.good.assign(watched.tracks.observations.size(), true);
  return moving;
}

// Runs one seed: creates the array and its tracks, solves, aligns and compares.
Errors run_seed(const Study& study, uint64_t seed) {
  Rig truth = make_array(study.array, seed);
  Watched watched;
  if (!study.motion) watched = watch(truth, study.path, seed + 1000000);
  SolveOptions options;
  options.distortion = study.distortion;
  if (study.prior) measure_lenses(truth, {}, seed + 2000000, options);
  Errors run;
  run.runs = 1;
  const auto begin = std::chrono::steady_clock::now();
  MovingBoardSolution moving;
  if (study.motion) moving = solve_films(truth, *study.motion, seed + 1000000, options, watched);
  const Solution solution = study.motion ? moving.solution
                            : study.path.board
                                ? solve_boards(sightings_of(watched.tracks, *study.path.board), options).solution
                                : solve_tracks(watched.tracks, options);
  run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  const Reconstruction at_truth = true_scene(truth, watched, options);
  AdjustmentOptions model = solution.model;
  model.sigma = study.motion ? study.motion->noise : study.path.noise;
  const Uncertainty best = estimate_uncertainty(at_truth, watched.tracks.observations, watched.good, model,
                                                study.motion ? &moving.adjustment : nullptr);
  std::vector<Pose> found, expected;
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    if (!solution.scene.cameras[i].used) return run;  // not converged
    found.push_back(solution.scene.cameras[i].pose());
    expected.push_back(truth.cameras[i].pose);
  }
  const Similarity s = align(found, expected, !watched.boards.empty());
  const double unit = study.path.bar > 0 ? study.path.bar : 1;  // unit of the true scene, metres
  const Uncertainty& told = solution.uncertainty;
  const Mat3 turn = glm::mat3_cast(s.rotation);
  Eigen::Matrix3d r;
  for (int row = 0; row < 3; row++)
    for (int column = 0; column < 3; column++) r(row, column) = turn[column][row];
  std::vector<CameraState> aligned = solution.scene.cameras;
  Eigen::VectorXd focals(static_cast<Eigen::Index>(found.size()));
  std::vector<Eigen::Index> focal_rows;
  for (size_t i = 0; i < found.size(); i++) {
    const Pose pose = s(found[i]);
    aligned[i].set_pose(pose);
    const Vec3 shift = pose.position - expected[i].position;
    Quat q = pose.orientation * glm::conjugate(expected[i].orientation);
    if (q.w < 0) q = -q;
    const Vec3 rotation(2 * q.x, 2 * q.y, 2 * q.z);
    const double focal = solution.scene.cameras[i].lens_terms()[kF] - truth.cameras[i].lens.fx();
    run.squared[Errors::kPosition] += glm::dot(shift, shift);
    run.squared[Errors::kRotation] += glm::dot(rotation, rotation);
    run.squared[Errors::kFocal] += focal * focal;
    focals[static_cast<Eigen::Index>(i)] = focal;
    focal_rows.push_back(best.camera_row[i] + 6);
    const int b = best.camera_row[i], t = told.camera_row[i];
    run.bound[Errors::kPosition] += best.covariance.diagonal().segment(b + 3, 3).sum() * unit * unit;
    run.bound[Errors::kRotation] += best.covariance.diagonal().segment(b, 3).sum();
    run.bound[Errors::kFocal] += best.covariance(b + 6, b + 6);
    const Eigen::Matrix3d of_shift = r * told.covariance.block(t + 3, t + 3, 3, 3) * r.transpose() * s.scale * s.scale;
    const Eigen::Matrix3d of_rotation = r * told.covariance.block(t, t, 3, 3) * r.transpose();
    run.inside[Errors::kPosition] += normalised(shift, of_shift) < kChi3;
    run.inside[Errors::kRotation] += normalised(rotation, of_rotation) < kChi3;
    run.inside[Errors::kFocal] += focal * focal / told.covariance(t + 6, t + 6) < kChi1;
  }
  const Eigen::MatrixXd of_focals = best.covariance(focal_rows, focal_rows);
  run.squared[Errors::kFocals] = focals.dot(of_focals.ldlt().solve(focals));
  run.bound[Errors::kFocals] = static_cast<double>(found.size());
  run.cameras = static_cast<double>(found.size());
  const Transfers predicted = transfers(truth, aligned);
  run.squared[Errors::kTransfer] = predicted.squared, run.transfers = predicted.count;
  run.bound[Errors::kTransfer] = transfers(truth, at_the_bound(at_truth, best, unit, seed + 3000000)).squared;
  run.converged = run.ratio(Errors::kPosition) < kConverged && run.ratio(Errors::kRotation) < kConverged;
  return run;
}

// runs that reduce the scatter between arrays; errors within an array are correlated
constexpr int kMany = 500;

struct Seeds {
  int first = 1, last = 20;
};
Seeds seeds() {
  Seeds s;
  const char* text = std::getenv("LF_SEEDS");
  if (text && std::sscanf(text, "%d-%d", &s.first, &s.last) != 2) ADD_FAILURE() << "LF_SEEDS must be FIRST-LAST";
  return s;
}

std::string to_line(const Errors& e) {
  std::ostringstream line;
  line.precision(9);
  line << e.converged << ' ' << e.seconds << ' ' << e.cameras << ' ' << e.transfers;
  for (const double v : e.squared) line << ' ' << v;
  for (const double v : e.bound) line << ' ' << v;
  for (const double v : e.inside) line << ' ' << v;
  return line.str();
}
bool from_line(std::istream& line, Errors& e) {
  e.runs = 1;
  line >> e.converged >> e.seconds >> e.cameras >> e.transfers;
  for (double& v : e.squared) line >> v;
  for (double& v : e.bound) line >> v;
  for (double& v : e.inside) line >> v;
  return !line.fail();
}

// Lines of "NAME SEED figures".
class Results {
 public:
  explicit Results(const std::string& name) : name_(name) {
    const char* path = std::getenv("LF_RESULTS");
    if (!path) return;
    std::ifstream in(path);
    for (std::string text; std::getline(in, text);) {
      std::istringstream line(text);
      std::string study;
      int seed = 0;
      Errors errors;
      if (line >> study >> seed && study == name_ && from_line(line, errors)) of_seed_[seed] = errors;
    }
    out_.open(path, std::ios::app);
  }
  bool has(int seed) const { return of_seed_.contains(seed); }
  void add(int seed, const Errors& errors) {
    of_seed_[seed] = errors;
    if (out_.is_open()) out_ << name_ + " " + std::to_string(seed) + " " + to_line(errors) + "\n" << std::flush;
  }
  const std::map<int, Errors>& all() const { return of_seed_; }

 private:
  std::string name_;
  std::map<int, Errors> of_seed_;
  std::ofstream out_;
};

// `times` multiplies the last seed: small arrays have errors in common, so more arrays are needed. `last` replaces the
// last seed if it is positive.
Errors run(const char* name, const Study& study, int times = 1, int last = 0) {
  Results results(name);
  Seeds range = seeds();
  range.last = last > 0 ? last : range.last * times;
  std::vector<int> open;
  for (int seed = range.first; seed <= range.last; seed++)
    if (!results.has(seed)) open.push_back(seed);
  std::atomic<size_t> next = 0;
  std::mutex mutex;
  const auto work = [&] {
    for (size_t i = next++; i < open.size(); i = next++) {
      const Errors errors = run_seed(study, static_cast<uint64_t>(open[i]));
      const std::lock_guard lock(mutex);
      results.add(open[i], errors);
      if (results.all().size() % 50 == 0) std::fprintf(stderr, "%s: %zu seeds\n", name, results.all().size());
    }
  };
  {
    std::vector<std::jthread> workers;
    for (unsigned i = 1; i < std::thread::hardware_concurrency(); i++) workers.emplace_back(work);
    work();
  }
  Errors errors;
  for (const auto& [seed, of_seed] : results.all()) {
    if (seed < range.first || seed > range.last) continue;
    errors += of_seed;
    if (!of_seed.converged) std::printf("%s: seed %d did not converge\n", name, seed);
  }
  std::printf(
      "%-9s error/bound: position %.3f rotation %.3f focal %.3f focals %.3f transfer %.3f; "
      "inside 95 %%: %.3f %.3f %.3f\n",
      name, errors.ratio(Errors::kPosition), errors.ratio(Errors::kRotation), errors.ratio(Errors::kFocal),
      errors.ratio(Errors::kFocals), errors.ratio(Errors::kTransfer), errors.share_inside(Errors::kPosition),
      errors.share_inside(Errors::kRotation), errors.share_inside(Errors::kFocal));
  std::printf(
      "%-9s rms: %.3f mm, %.3f mrad, f %.3f px; transfer %.4f px at 1.5 m; slowest %.2f s; %d of %d converged\n", "",
      errors.rms(Errors::kPosition) * 1e3, errors.rms(Errors::kRotation) * 1e3, errors.rms(Errors::kFocal),
      errors.rms(Errors::kTransfer), errors.seconds, errors.converged, errors.runs);
  return errors;
}

// `max_focal` is the largest ratio of the errors of focal lengths to the bound.
void expect_good(const Errors& errors, double max_focal = 1.1) {
  EXPECT_EQ(errors.converged, errors.runs);
  const bool many = errors.runs >= kMany;
  for (const auto q : {Errors::kPosition, Errors::kRotation, Errors::kFocal}) {
    EXPECT_LE(errors.ratio(q), q == Errors::kFocal ? max_focal : 1.1) << q;
    EXPECT_GE(errors.share_inside(q), many ? 0.93 : max_focal > 1.1 ? 0.85 : 0.9) << q;
    EXPECT_LE(errors.share_inside(q), many ? 0.97 : 0.99) << q;
  }
  EXPECT_LE(errors.ratio(Errors::kTransfer), 1.1);
}

TEST(Accuracy, OneLightWithMeasuredLenses) {
  const Errors errors = run("prior", {});
  expect_good(errors);
  EXPECT_LE(errors.rms(Errors::kTransfer), 0.05);
}

TEST(Accuracy, BarWithUnknownLenses) {
  Study study;
  study.path.bar = 0.3, study.prior = false;
  const Errors errors = run("bar", study);
  expect_good(errors);
  EXPECT_LE(errors.rms(Errors::kTransfer), 0.05);
}

// An array that looks at a ChArUco board of 8x5 corners at 30 positions, about half a metre away.
Study board_study(int rows) {
  Study study;
  study.array.rows = study.array.columns = rows;
  study.array.width = 640, study.array.height = 480, study.array.f = 700;
  study.path.board = CalibrationBoard{.columns = 8, .rows = 5, .square = 0.03};
  study.path.positions = 30, study.path.near = 0.35, study.path.far = 0.9;
  study.prior = false;
  study.distortion = DistortionModel{2, false};
  return study;
}

TEST(Accuracy, Board) { expect_good(run("board", board_study(3), 3)); }

// Returns the number of arrays that are compared with the bound. 0: the tests only check that one small array
// converges, because a comparison takes minutes.
int num_arrays() {
  const char* arrays = std::getenv("LF_ARRAYS");
  return arrays ? std::atoi(arrays) : 0;
}

// The same with free-running cameras and rolling shutters, in front of a board that never stops. The cameras of an
// array share most of the error of their focal lengths, so kFocal varies by a tenth between samples of 40 arrays.
TEST(Accuracy, MovingBoard) {
  Study study = board_study(num_arrays() > 0 ? 3 : 2);
  study.path.board.reset();
  study.motion = MovingBoard{.offset = 0.015, .readout = 0.02};
  const Errors errors = run("motion", study, 1, std::max(num_arrays(), 1));
  EXPECT_EQ(errors.converged, errors.runs);
  if (num_arrays() > 0) {
    expect_good(errors, 1.3);
    EXPECT_LE(errors.ratio(Errors::kFocals), 1.1);
  }
}

// An 8x8 array, with a board of 60 mm squares at one to two metres. The cameras of an array have errors in common, so a
// tenth of the arrays shows no more than the size of the errors.
TEST(Accuracy, LargeArrays) {
  const int arrays = std::max(num_arrays() / 10, 1);
  Study study = board_study(num_arrays() > 0 ? 8 : 2);
  study.path.board->square = 0.06;
  study.path.near = 0.9, study.path.far = 2;
  const auto check = [&](const char* name) {
    const Errors errors = run(name, study, 1, arrays);
    EXPECT_EQ(errors.converged, errors.runs);
    for (const auto q : {Errors::kPosition, Errors::kRotation, Errors::kFocal}) {
      if (num_arrays() > 0) EXPECT_LE(errors.ratio(q), q == Errors::kFocal ? 1.3 : 1.1) << q;
    }
  };
  check("board8x8");
  study.motion =
      MovingBoard{.board = *study.path.board, .near = 0.9, .far = 2, .offset = 0.015, .readout = 0.02, .speed = 0.3};
  study.path.board.reset();
  check("motion8x8");
}

// The bound is not reached with 60 % of the observations.
TEST(Accuracy, ManyMissedDetectionsAndOutliers) {
  Study study;
  study.path.missed = 0.3, study.path.outliers = 0.15;
  expect_good(run("outliers", study));
}

}  // namespace
}  // namespace lf::sim
