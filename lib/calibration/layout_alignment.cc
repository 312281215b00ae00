// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/layout_alignment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <tuple>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "base/error.h"
#include "base/percentiles.h"
#include "calibration/relative_poses.h"

namespace lf {
namespace {

constexpr double kAt = 0.35;            // of the distance to the nearest other place: a camera stands there
constexpr double kOtherWay = 0.6;       // radians: a camera looks elsewhere than its place has it
constexpr double kTooFar = 0.5;         // of that: it does not
constexpr double kUsualShift = 0.05;    // of that distance, that arrays are off by
constexpr double kUsualTurn = 0.0175;   // radians
constexpr double kUsualCounts = 2;      // as so many cameras
constexpr double kAlignmentRobust = 3;           // sigmas where a camera counts less
constexpr double kClearlyBetter = 1.5;  // cameras that another order must make fit
constexpr int kAlignmentRounds = 12;
constexpr int kAlignmentSamples = 200;
constexpr size_t kSample = 3;  // cameras that a similarity is tried of

Eigen::Vector3d eigen(const Vec3& v) { return {v.x, v.y, v.z}; }
Eigen::Matrix3d eigen(const Mat3& m) {
  Eigen::Matrix3d e;
  for (int c = 0; c < 3; c++) e.col(c) = eigen(m[c]);
  return e;
}

// The proper rotation nearest to what `m` correlates.
Eigen::Matrix3d rotation_of(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

Quat quaternion(const Eigen::Matrix3d& m) {
  Mat3 r;
  for (int c = 0; c < 3; c++) r[c] = {m(0, c), m(1, c), m(2, c)};
  return glm::normalize(glm::quat_cast(r));
}

class LayoutFit {
 public:
  LayoutFit(const std::vector<Pose>& found, const std::vector<Pose>& layout, std::optional<double> scale,
            double common_turn)
      : found_(found), layout_(layout), scale_(scale), common_turn_(common_turn), spacing_(layout.size()) {
    for (size_t i = 0; i < layout.size(); i++) {
      spacing_[i] = std::numeric_limits<double>::infinity();
      for (size_t j = 0; j < layout.size(); j++) {
        const double apart = glm::length(layout[i].position - layout[j].position);
        if (apart > 0) spacing_[i] = std::min(spacing_[i], apart);
      }
    }
    usual_shift_ = kUsualShift * median(spacing_);
  }

  // Fits a similarity to cameras at `places`, robustly, from one that is about right.
  LayoutAlignment refine(Similarity start, std::vector<size_t> places) const {
    LayoutAlignment now{start, std::move(places), std::vector<char>(found_.size(), true), usual_shift_, kUsualTurn};
    for (int round = 0; round < kAlignmentRounds; round++) {
      judge(now);
      step(now);
    }
    judge(now);
    return now;
  }

  // Cameras at their places, softly, that look as these do: an array seen from behind fits its places, too.
  double score(const LayoutAlignment& a) const {
    double sum = 0;
    for (size_t i = 0; i < found_.size(); i++) {
      const double d = off(a.layout_from_scene, i, a.place[i]) / (kTooFar * spacing_[a.place[i]]);
      const double t = turn(a.layout_from_scene, i, a.place[i]) / kOtherWay;
      sum += std::max(0.0, 1 - d * d) * std::max(0.0, 1 - t * t);
    }
    return sum;
  }

  // As the cameras are named: from all of them, and from some, of which one is right where some cameras are not.
  LayoutAlignment as_named(const std::vector<size_t>& own) const {
    LayoutAlignment best = refine(similarity_of(own, all()), own);
    double most = score(best);
    std::mt19937 random(1);
    const double enough = 0.8 * static_cast<double>(found_.size());
    for (int n = 0; n < kAlignmentSamples && most < enough && found_.size() > kSample; n++) {
      std::vector<size_t> sample = all();
      std::shuffle(sample.begin(), sample.end(), random);
      sample.resize(kSample);
      LayoutAlignment trial{similarity_of(own, sample), own, {}, 0, 0};
      if (score(trial) <= 0.7 * most) continue;
      trial = refine(trial.layout_from_scene, own);
      if (score(trial) > most) most = score(trial), best = std::move(trial);
    }
    return best;
  }

  // By where the cameras stand, whatever they are called: turned as they look, the middle and the size of the whole are
  // those of the layout at first.
  LayoutAlignment as_they_stand(const std::vector<size_t>& own) const {
    LayoutAlignment now{whole(own), own, {}, 0, 0};
    std::vector<size_t> before;
    for (int round = 0; round < kAlignmentRounds && before != now.place; round++) {
      before = now.place;
      now.place = nearest_places(now.layout_from_scene, own);
      now = refine(now.layout_from_scene, std::move(now.place));
    }
    return now;
  }

  // One-to-one, shortest ways first; those that are in the way of none keep their own place.
  std::vector<size_t> nearest_places(const Similarity& s, const std::vector<size_t>& own) const {
    std::vector<std::tuple<double, size_t, size_t>> ways;
    for (size_t i = 0; i < found_.size(); i++)
      for (size_t j = 0; j < layout_.size(); j++) ways.emplace_back(off(s, i, j) / spacing_[j], i, j);
    std::sort(ways.begin(), ways.end());
    std::vector<char> taken(layout_.size()), placed(found_.size());
    std::vector<size_t> places = own;
    for (const auto& [way, i, j] : ways) {
      if (placed[i] || taken[j]) continue;
      places[i] = j, placed[i] = taken[j] = true;
    }
    return places;
  }

  // Of cameras that are nowhere near their own place those that are clearly at another's.
  void name_places(LayoutAlignment& a, const std::vector<size_t>& own) const {
    const std::vector<size_t> nearest = nearest_places(a.layout_from_scene, own);
    a.place = own;
    for (size_t i = 0; i < found_.size(); i++)
      if (off(a.layout_from_scene, i, own[i]) > kTooFar * spacing_[own[i]] &&
          off(a.layout_from_scene, i, nearest[i]) < kAt * spacing_[nearest[i]])
        a.place[i] = nearest[i];
    // Who is at a place whose own camera stays there, or seems to, is not.
    for (bool changed = true; changed;) {
      changed = false;
      std::vector<int> at(layout_.size());
      for (const size_t place : a.place) at[place]++;
      for (size_t i = 0; i < found_.size(); i++)
        if (a.place[i] != own[i] && at[a.place[i]] > 1) a.place[i] = own[i], changed = true;
    }
  }

 private:
  std::vector<size_t> all() const {
    std::vector<size_t> list(found_.size());
    for (size_t i = 0; i < list.size(); i++) list[i] = i;
    return list;
  }

  double off(const Similarity& s, size_t i, size_t place) const {
    return glm::length(s(found_[i].position) - layout_[place].position);
  }

  Similarity similarity_of(const std::vector<size_t>& places, const std::vector<size_t>& cameras) const {
    std::vector<Pose> a, b;
    for (const size_t i : cameras) a.push_back(found_[i]), b.push_back(layout_[places[i]]);
    if (scale_)
      for (Pose& pose : a) pose.position *= *scale_;
    Similarity s = align(a, b, scale_.has_value());
    if (scale_) s.scale = *scale_;
    return s;
  }

  Similarity whole(const std::vector<size_t>& own) const {
    Eigen::Matrix3d looks = Eigen::Matrix3d::Zero();
    Vec3 a(0, 0, 0), b(0, 0, 0);
    std::vector<Vec3> from, to;
    for (size_t i = 0; i < found_.size(); i++) {
      looks += eigen(layout_[own[i]].rotation()) * eigen(found_[i].rotation()).transpose();
      from.push_back(found_[i].position), to.push_back(layout_[own[i]].position);
      a += from.back(), b += to.back();
    }
    Similarity s;
    s.scale = scale_.value_or(spread(to) / spread(from));
    s.rotation = quaternion(rotation_of(looks));
    s.translation = (b - s.scale * (s.rotation * a)) / static_cast<double>(found_.size());
    return s;
  }

  double turn(const Similarity& s, size_t i, size_t place) const {
    return angle_of(s.rotation * found_[i].orientation * glm::conjugate(layout_[place].orientation));
  }

  // How far cameras are off, in the median over those that are about where their place is: mistaken ones say nothing.
  void judge(LayoutAlignment& a) const {
    std::vector<double> shifts, turns;
    for (size_t i = 0; i < found_.size(); i++) {
      const double shift = off(a.layout_from_scene, i, a.place[i]);
      a.fits[i] = shift < kTooFar * spacing_[a.place[i]];
      if (!a.fits[i]) continue;
      shifts.push_back(shift * shift / 3);
      turns.push_back(std::pow(turn(a.layout_from_scene, i, a.place[i]), 2) / 3);
    }
    const auto sigma = [](std::vector<double> squares, double usual) {
      constexpr double kMedian = 0.789;  // of the squared length of three normal numbers, over its mean
      const auto n = static_cast<double>(squares.size());
      const double found = squares.empty() ? 0 : median(std::move(squares)) / kMedian;
      return std::sqrt((n * found + kUsualCounts * usual * usual) / (n + kUsualCounts));
    };
    a.position_sigma = sigma(std::move(shifts), usual_shift_);
    a.turn_sigma = sigma(std::move(turns), kUsualTurn);
  }

  // Weighted least squares of centres and axes; scale and rotation in turn.
  void step(LayoutAlignment& a) const {
    Similarity& s = a.layout_from_scene;
    std::vector<double> weight(found_.size());
    Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = from;
    double sum = 0, fitting = 0;
    for (size_t i = 0; i < found_.size(); i++) {
      if (!a.fits[i]) continue;
      const double e = off(s, i, a.place[i]) / (kAlignmentRobust * a.position_sigma);
      weight[i] = 1 / std::pow(1 + e * e, 2);
      from += weight[i] * eigen(found_[i].position), to += weight[i] * eigen(layout_[a.place[i]].position);
      sum += weight[i], fitting++;
    }
    if (fitting < 2) return;
    from /= sum, to /= sum;
    const double shift_variance = a.position_sigma * a.position_sigma;
    // What orientations have in common, no number of cameras takes away.
    const double turn_variance = a.turn_sigma * a.turn_sigma + fitting * common_turn_ * common_turn_;
    Eigen::Matrix3d centres = Eigen::Matrix3d::Zero(), looks = centres;
    double squares = 0;
    for (size_t i = 0; i < found_.size(); i++) {
      if (!a.fits[i]) continue;
      const Eigen::Vector3d p = eigen(found_[i].position) - from, q = eigen(layout_[a.place[i]].position) - to;
      centres += weight[i] * q * p.transpose(), squares += weight[i] * p.squaredNorm();
      const double e = turn(s, i, a.place[i]) / (kAlignmentRobust * a.turn_sigma);
      // Three axes, of which each turn moves two: a half each.
      looks += 0.5 / std::pow(1 + e * e, 2) * eigen(layout_[a.place[i]].rotation()) *
               eigen(found_[i].rotation()).transpose();
    }
    Eigen::Matrix3d r = rotation_of(s.scale / shift_variance * centres + looks / turn_variance);
    if (!scale_ && squares > 0) {
      const double scale = (r * centres.transpose()).trace() / squares;
      if (scale > 0) s.scale = scale;
    }
    s.rotation = quaternion(r);
    s.translation = Vec3(to.x(), to.y(), to.z()) - s.scale * (s.rotation * Vec3(from.x(), from.y(), from.z()));
  }

  const std::vector<Pose>& found_;
  const std::vector<Pose>& layout_;
  std::optional<double> scale_;
  double common_turn_, usual_shift_;
  std::vector<double> spacing_;  // of each place: to the nearest other
};

}  // namespace

LayoutAlignment align_to_layout(const std::vector<Pose>& found, const std::vector<Pose>& layout,
                                const std::vector<size_t>& own, std::optional<double> scale, double common_turn) {
  if (found.size() < 2 || own.size() != found.size()) throw Error("alignment needs two cameras at least");
  const LayoutFit fit(found, layout, scale, common_turn);
  LayoutAlignment best = fit.as_named(own);
  if (fit.score(best) < static_cast<double>(found.size()) - kClearlyBetter) {
    LayoutAlignment other = fit.as_they_stand(own);
    if (fit.score(other) > fit.score(best) + kClearlyBetter) best = std::move(other);
  }
  fit.name_places(best, own);
  return fit.refine(best.layout_from_scene, best.place);
}

}  // namespace lf
