// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/board_solve.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <thread>

#include "base/text.h"
#include "base/worker_pool.h"
#include "calibration/intrinsics.h"
#include "calibration/multiview_geometry.h"
#include "calibration/reconstruction.h"

namespace lf {
namespace {

constexpr size_t kMinLensViews = 4, kMaxLensViews = 16;  // views for the first lens of a camera
constexpr double kLeastFocal = 0.1, kMostFocal = 20;     // plausible focal lengths, relative to the image width
constexpr size_t kMinPoseCorners = 4;
constexpr double kAmbiguous = 2;     // the second pose of a board counts if its error is at most this many times larger
constexpr double kPoorView = 10;     // pixels; a view with a larger error shows something else
constexpr double kFits = 8;          // pixels; residual of a corner in a first layout
constexpr double kSameTurn = 0.05;   // radians; agreement of two relative poses
constexpr double kSameShift = 0.05;  // relative to the distance of the board
constexpr size_t kMaxPairInstants = 60;  // per pair of cameras
constexpr size_t kMaxSources = 8;        // views of an instant that may give the pose of the board

Pose inverse(const Pose& b_from_a) {
  const Quat turn = glm::conjugate(glm::normalize(b_from_a.orientation));
  return {-(turn * b_from_a.position), turn};
}
Pose operator*(const Pose& c_from_b, const Pose& b_from_a) {
  return {c_from_b.world_from_camera(b_from_a.position), glm::normalize(c_from_b.orientation * b_from_a.orientation)};
}

// A view with the possible poses camera_from_board, best first. A small or distant board has two similar solutions.
struct PosedView {
  uint32_t camera = 0, instant = 0;
  std::vector<uint32_t> observations;
  std::vector<Pose> poses;
};

class LayoutFinder {
 public:
  LayoutFinder(const BoardSightings& sightings, const Tracks& tracks, const SolveOptions& options)
      : sightings_(sightings),
        tracks_(tracks),
        options_(options),
        corners_(std::make_shared<const std::vector<Vec3>>(tracks.board)),
        scene_(make_scene(tracks, options)) {}

  Reconstruction run() {
    step("lens of each camera");
    estimate_lenses();
    step("first layout: boards");
    pose_views();
    connect_cameras();
    place_boards();
    return std::move(scene_);
  }

  // Returns the views with their poses in the camera, without connecting the cameras.
  std::vector<PosedView> views() {
    step("lens of each camera");
    estimate_lenses();
    pose_views();
    return std::move(views_);
  }

 private:
  void step(const std::string& what) {
    if (options_.progress) options_.progress(what);
  }

  static void in_parallel(size_t count, const std::function<void(size_t)>& task) {
    WorkerPool().run(std::max(1u, std::thread::hardware_concurrency()), count, task);
  }

  // Views with most corners, evenly from the whole sequence.
  std::vector<BoardView> lens_views(size_t camera) const {
    std::vector<const BoardView*> all;
    size_t most = 0;
    for (const auto& s : sightings_.sightings)
      if (s.camera == camera) most = std::max(most, s.view.corners.size());
    for (const auto& s : sightings_.sightings)
      if (s.camera == camera && 2 * s.view.corners.size() >= most) all.push_back(&s.view);
    std::vector<BoardView> views;
    const size_t count = std::min(kMaxLensViews, all.size());
    for (size_t i = 0; i < count; i++) views.push_back(*all[i * all.size() / count]);
    return views;
  }

  std::optional<Lens> lens_from_views(size_t camera) const {
    const std::vector<BoardView> views = lens_views(camera);
    if (views.size() < kMinLensViews) return std::nullopt;
    const int width = scene_.cameras[camera].width, height = scene_.cameras[camera].height;
    for (const bool first : {true, false}) {
      try {
        const Lens lens =
            first ? fit_radial_or_fisheye(views, sightings_.board, width, height).fit.lens
                  : fit_good_views(views, sightings_.board, width, height, {LensModel::kSimplePinhole}).fit.lens;
        if (lens.fx() > kLeastFocal * width && lens.fx() < kMostFocal * width) return lens;
      } catch (const Error&) {
      }
    }
    return std::nullopt;
  }

  // Views of a board do not determine the terms beyond OPENCV_FISHEYE and OPENCV well, so a general lens of the prior
  // rig stays.
  bool is_given(size_t camera) const { return scene_.measured(camera, kF) || scene_.cameras[camera].fixed.is_general; }

  // A camera with too few views gets the typical lens of the other cameras.
  void estimate_lenses() {
    std::vector<std::optional<Lens>> lenses(scene_.cameras.size());
    in_parallel(lenses.size(), [&](size_t i) {
      if (!is_given(i)) lenses[i] = lens_from_views(i);
    });
    std::vector<double> focal;
    for (size_t i = 0; i < lenses.size(); i++) {
      if (lenses[i]) scene_.cameras[i].set_lens(*lenses[i]);
      if (lenses[i] || is_given(i)) focal.push_back(scene_.cameras[i].lens_terms()[kF] / scene_.cameras[i].width);
    }
    if (focal.empty() && !options_.prior)
      throw Error("no camera has enough views of the board for its lens. Each camera needs at least " +
                  std::to_string(kMinLensViews) + " views; tilt the board by 30 to 45 degrees, to all sides");
    const auto fisheye =
        std::ranges::find_if(lenses, [](const auto& lens) { return lens && lens->distortion().fisheye; });
    for (size_t i = 0; i < lenses.size() && !options_.prior; i++) {
      if (lenses[i]) continue;
      if (fisheye != lenses.end()) scene_.cameras[i].set_lens(**fisheye);
      scene_.cameras[i].lens_terms()[kF] = median(focal) * scene_.cameras[i].width;
    }
    for (int k = 0; k < kNumLensTerms; k++) {
      double sum = 0;
      for (const CameraState& camera : scene_.cameras) sum += camera.lens_terms()[k];
      scene_.batch_mean[k] = sum / static_cast<double>(scene_.cameras.size());
    }
  }

  void pose_views() {
    std::map<std::pair<uint32_t, uint32_t>, std::vector<uint32_t>> groups;
    for (uint32_t i = 0; i < tracks_.observations.size(); i++)
      groups[{tracks_.observations[i].camera, tracks_.observations[i].position}].push_back(i);
    for (auto& [key, observations] : groups)
      if (observations.size() >= kMinPoseCorners)
        views_.push_back({key.first, key.second, std::move(observations), {}});
    in_parallel(views_.size(), [&](size_t i) { views_[i].poses = poses_of(views_[i]); });
    std::erase_if(views_, [](const PosedView& view) { return view.poses.empty(); });
  }

  std::vector<Pose> poses_of(const PosedView& view) const {
    std::vector<Vec3> board;
    std::vector<Vec2> corners;
    for (const uint32_t index : view.observations) {
      const Observation& o = tracks_.observations[index];
      board.push_back(tracks_.board[o.light]);
      corners.push_back(o.pixel);
    }
    std::vector<Pose> poses;
    std::optional<double> least;
    for (const Pose& pose : board_poses(scene_.cameras[view.camera].lens(), board, corners)) {
      const double error = median_error({{}, {1, 0, 0, 0}}, pose, view);
      if (!least) least = error;
      if (error < kPoorView && error <= kAmbiguous * std::max(0.1, *least)) poses.push_back(pose);
    }
    return poses;
  }

  // Returns the median distance of the view's corners from their projections, in pixels.
  double median_error(const Pose& world_from_camera, const Pose& world_from_board, const PosedView& view) const {
    CameraState camera = scene_.cameras[view.camera];
    camera.set_pose(world_from_camera);
    TargetState target;
    target.set_board(world_from_board, corners_);
    std::vector<double> lengths;
    for (const uint32_t index : view.observations) {
      const auto e = residual(camera, target, tracks_.observations[index]);
      lengths.push_back(e ? glm::length(*e) : 1e6);
    }
    return median(std::move(lengths));
  }

  struct Link {
    Pose a_from_b;
    double weight = 0;  // number of instants that agree
  };

  // Finds the relative pose that most instants agree on. `shared` has the views of both cameras at the same instants.
  Link link(const std::vector<std::pair<const PosedView*, const PosedView*>>& shared) const {
    std::vector<std::vector<Pose>> ways;  // per instant
    std::vector<double> distances;
    const size_t every = (shared.size() + kMaxPairInstants - 1) / kMaxPairInstants;
    for (size_t i = 0; i < shared.size(); i += every) {
      std::vector<Pose>& list = ways.emplace_back();
      for (const Pose& a : shared[i].first->poses)
        for (const Pose& b : shared[i].second->poses) list.push_back(a * inverse(b));
      distances.push_back(glm::length(shared[i].first->poses[0].position));
    }
    const double reach = kSameShift * median(distances);
    Link best;
    for (const auto& list : ways)
      for (const Pose& pose : list) {
        double weight = 0;
        for (const auto& others : ways) {
          double fit = 0;
          for (const Pose& other : others) {
            const double turn = angle_of(pose.orientation * glm::conjugate(other.orientation)) / kSameTurn;
            const double shift = glm::length(pose.position - other.position) / reach;
            fit = std::max(fit, 1 - (turn * turn + shift * shift) / 2);
          }
          weight += fit;
        }
        if (weight > best.weight) best = {pose, weight};
      }
    best.weight *= static_cast<double>(every);
    return best;
  }

  void connect_cameras() {
    const size_t n = scene_.cameras.size();
    std::vector<std::vector<const PosedView*>> at(tracks_.num_positions);
    for (const PosedView& view : views_) at[view.instant].push_back(&view);
    std::map<std::pair<uint32_t, uint32_t>, std::vector<std::pair<const PosedView*, const PosedView*>>> pairs;
    for (const auto& list : at)
      for (size_t i = 0; i < list.size(); i++)
        for (size_t j = i + 1; j < list.size(); j++)
          pairs[{list[i]->camera, list[j]->camera}].emplace_back(list[i], list[j]);
    if (pairs.empty())
      throw Error(
          "no two cameras see the board at the same instant. Hold the board where several cameras see it, and check "
          "that the recordings are synchronised");
    std::vector<std::pair<uint32_t, uint32_t>> keys;
    for (const auto& [key, shared] : pairs) keys.push_back(key);
    std::vector<Link> links(keys.size());
    in_parallel(keys.size(), [&](size_t i) { links[i] = link(pairs[keys[i]]); });
    // Maximum spanning tree of the largest group, from the strongest link on.
    std::vector<char> best_group;
    std::vector<Pose> best_poses;
    std::vector<char> tried(n);
    for (size_t root = 0; root < n; root++) {
      if (tried[root]) continue;
      std::vector<char> group(n);
      std::vector<Pose> poses(n);
      group[root] = true;
      for (;;) {
        size_t strongest = keys.size();
        for (size_t i = 0; i < keys.size(); i++)
          if (group[keys[i].first] != group[keys[i].second] &&
              (strongest == keys.size() || links[i].weight > links[strongest].weight))
            strongest = i;
        if (strongest == keys.size()) break;
        const auto [a, b] = keys[strongest];
        if (group[a])
          poses[b] = poses[a] * links[strongest].a_from_b;
        else
          poses[a] = poses[b] * inverse(links[strongest].a_from_b);
        group[a] = group[b] = true;
      }
      for (size_t i = 0; i < n; i++) tried[i] = tried[i] || group[i];
      if (std::ranges::count(group, 1) > std::ranges::count(best_group, 1)) best_group = group, best_poses = poses;
    }
    for (size_t i = 0; i < n; i++) {
      scene_.cameras[i].used = best_group[i];
      scene_.cameras[i].set_pose(best_poses[i]);
    }
  }

  // Places each board by the view that all cameras of the instant agree with best.
  void place_boards() {
    std::vector<std::vector<const PosedView*>> at(tracks_.num_positions);
    for (const PosedView& view : views_)
      if (scene_.cameras[view.camera].used) at[view.instant].push_back(&view);
    for (size_t instant = 0; instant < at.size(); instant++) {
      std::ranges::sort(at[instant], std::greater<>(), [](const PosedView* view) { return view->observations.size(); });
      double best = -1;
      for (size_t i = 0; i < std::min(at[instant].size(), kMaxSources); i++) {
        const PosedView* from = at[instant][i];
        for (const Pose& camera_from_board : from->poses) {
          const Pose pose = scene_.cameras[from->camera].pose() * camera_from_board;
          double fit = 0;
          for (const PosedView* view : at[instant]) {
            const double error = median_error(scene_.cameras[view->camera].pose(), pose, *view);
            fit += static_cast<double>(view->observations.size()) / (1 + std::pow(error / kFits, 2));
          }
          if (fit <= best) continue;
          best = fit;
          scene_.targets[instant].set_board(pose, corners_);
        }
      }
    }
  }

  const BoardSightings& sightings_;
  const Tracks& tracks_;
  const SolveOptions& options_;
  const std::shared_ptr<const std::vector<Vec3>> corners_;
  Reconstruction scene_;
  std::vector<PosedView> views_;
};

}  // namespace

Tracks board_tracks(const BoardSightings& sightings) {
  Tracks tracks;
  tracks.cameras = sightings.cameras;
  tracks.num_positions = sightings.num_instants;
  Vec2 middle(0, 0);
  for (size_t i = 0; i < sightings.board.num_corners(); i++) middle += sightings.board.corner(i);
  middle /= static_cast<double>(sightings.board.num_corners());
  for (size_t i = 0; i < sightings.board.num_corners(); i++)
    tracks.board.emplace_back(sightings.board.corner(i) - middle, 0);
  for (const BoardSightings::Sighting& s : sightings.sightings)
    for (size_t i = 0; i < s.view.corners.size(); i++)
      tracks.observations.push_back({s.camera, s.instant, static_cast<uint32_t>(s.view.id(i)), s.view.corners[i],
                                     s.sigmas.empty() ? 1 : s.sigmas[i]});
  return tracks;
}

std::vector<std::optional<Pose>> board_poses(const BoardSightings& sightings, const SolveOptions& options) {
  // Each sighting is an instant of its own, so that views of the same instant remain apart.
  BoardSightings apart = sightings;
  apart.num_instants = apart.sightings.size();
  for (uint32_t i = 0; i < apart.sightings.size(); i++) apart.sightings[i].instant = i;
  const Tracks tracks = board_tracks(apart);
  std::vector<std::optional<Pose>> poses(apart.sightings.size());
  for (const PosedView& view : LayoutFinder(apart, tracks, options).views()) poses[view.instant] = view.poses[0];
  return poses;
}

BoardSolution solve_boards(const BoardSightings& sightings, const SolveOptions& options) {
  check_board(sightings.board);
  if (sightings.board.is_symmetric())
    throw Error("a " + sightings.board.name() +
                " looks the same after half a turn, so cameras may count its corners from opposite ends. Use a "
                "checkerboard with an odd and an even number of corners, a ChArUco board or an AprilGrid");
  BoardSolution result;
  result.tracks = board_tracks(sightings);
  Reconstruction layout = LayoutFinder(sightings, result.tracks, options).run();
  result.solution = solve_from_layout(std::move(layout), result.tracks, options);
  return result;
}

}  // namespace lf
