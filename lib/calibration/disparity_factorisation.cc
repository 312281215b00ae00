// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/disparity_factorisation.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

namespace lf {
namespace {

constexpr int kDisparitySamples = 200;
constexpr int kDisparityRounds = 12;
constexpr int kLeastCommon = 6;  // sights that two cameras must share

double weight_of(double squared_error, double threshold) {
  const double w = threshold * threshold / (threshold * threshold + squared_error);
  return w * w;  // Geman-McClure: what is far off counts nothing
}

// y = offset + slope t, for points of the plane.
struct DisparityLine {
  Vec2 offset{0, 0}, slope{0, 0};
  double score = 0;  // how many agree, softly
};

struct LinePoint {
  double t;
  Vec2 y;
  double weight = 1;
};

double line_score(const std::vector<LinePoint>& points, const DisparityLine& line, double threshold) {
  double score = 0;
  for (const LinePoint& p : points) {
    const Vec2 e = p.y - line.offset - line.slope * p.t;
    score += p.weight * std::max(0.0, 1 - glm::dot(e, e) / (threshold * threshold));
  }
  return score;
}

// Weighted least squares, reweighted from where `line` is.
void refine_line(const std::vector<LinePoint>& points, double threshold, int rounds, DisparityLine& line) {
  for (int round = 0; round < rounds; round++) {
    double s = 0, st = 0, stt = 0;
    Vec2 sy(0, 0), sty(0, 0);
    for (const LinePoint& p : points) {
      const Vec2 e = p.y - line.offset - line.slope * p.t;
      const double w = p.weight * weight_of(glm::dot(e, e), threshold);
      s += w, st += w * p.t, stt += w * p.t * p.t, sy += w * p.y, sty += w * p.t * p.y;
    }
    const double det = s * stt - st * st;
    if (!(det > 1e-12 * s * stt)) return;
    line.slope = (s * sty - st * sy) / det;
    line.offset = (sy - line.slope * st) / s;
  }
  line.score = line_score(points, line, threshold);
}

DisparityLine fit_line(const std::vector<LinePoint>& points, double threshold, std::mt19937& random) {
  DisparityLine best;
  for (int sample = 0; sample < kDisparitySamples; sample++) {
    const LinePoint& a = points[random() % points.size()];
    const LinePoint& b = points[random() % points.size()];
    if (a.t == b.t) continue;
    DisparityLine line;
    line.slope = (b.y - a.y) / (b.t - a.t);
    line.offset = a.y - line.slope * a.t;
    line.score = line_score(points, line, threshold);
    if (line.score > best.score) best = line;
  }
  refine_line(points, threshold, 5, best);
  return best;
}

class Factorisation {
 public:
  Factorisation(const std::vector<ColumnSight>& sights, size_t num_cameras, size_t num_columns, double threshold)
      : threshold_(threshold), by_camera_(num_cameras), by_column_(num_columns) {
    for (const ColumnSight& s : sights) {
      by_camera_[s.camera].push_back(s);
      by_column_[s.column].push_back(s);
    }
    factors_.cameras.resize(num_cameras);
    factors_.columns.resize(num_columns);
  }

  DisparityFactors run() {
    if (!start()) return factors_;
    for (int round = 0; round < kDisparityRounds; round++) {
      for (size_t j = 0; j < by_column_.size(); j++) solve_column(j, round <= 1 || !factors_.columns[j].known);
      for (size_t i = 0; i < by_camera_.size(); i++) solve_camera(i, round <= 1);
    }
    upgrade();
    count();
    return factors_;
  }

 private:
  // Differences against one camera lie on a line, each camera its own, and the place on it is the disparity.
  bool start() {
    const auto reference =
        static_cast<uint32_t>(std::max_element(by_camera_.begin(), by_camera_.end(),
                                               [](const auto& a, const auto& b) { return a.size() < b.size(); }) -
                              by_camera_.begin());
    std::vector<std::optional<Vec2>> at(by_column_.size());
    for (const ColumnSight& s : by_camera_[reference]) at[s.column] = s.uv;
    const auto differences = [&](size_t i) {
      std::vector<std::pair<size_t, Vec2>> list;
      for (const ColumnSight& s : by_camera_[i])
        if (at[s.column]) list.push_back({s.column, s.uv - *at[s.column]});
      return list;
    };
    // The camera whose differences spread most along a line that most agree with.
    double best_score = 0;
    std::vector<std::optional<double>> t(by_column_.size());
    for (size_t i = 0; i < by_camera_.size(); i++) {
      const auto list = differences(i);
      if (i == reference || list.size() < kLeastCommon) continue;
      double score = 0;
      Vec2 origin(0, 0), along(0, 0);
      for (int sample = 0; sample < kDisparitySamples; sample++) {
        const Vec2 a = list[random_() % list.size()].second, b = list[random_() % list.size()].second;
        const double length = glm::length(b - a);
        if (!(length > threshold_)) continue;
        const Vec2 u = (b - a) / length;
        double agree = 0;
        std::vector<double> places;
        for (const auto& [column, y] : list) {
          const double off = u.x * (y - a).y - u.y * (y - a).x;
          if (std::abs(off) > threshold_) continue;
          agree += 1 - off * off / (threshold_ * threshold_);
          places.push_back(glm::dot(u, y - a));
        }
        if (places.size() < kLeastCommon) continue;
        // Mistaken ones on the line do not widen it.
        std::sort(places.begin(), places.end());
        const double range = places[places.size() - 1 - places.size() / 5] - places[places.size() / 5];
        const double s = agree * std::min(range, 20 * threshold_);
        if (s > score) score = s, origin = a, along = u;
      }
      if (score <= best_score) continue;
      best_score = score;
      std::fill(t.begin(), t.end(), std::nullopt);
      for (const auto& [column, y] : list)
        if (std::abs(along.x * (y - origin).y - along.y * (y - origin).x) <= threshold_)
          t[column] = glm::dot(along, y - origin);
    }
    if (best_score == 0) return false;
    known_.assign(by_camera_.size(), false);
    known_[reference] = true;
    for (size_t i = 0; i < by_camera_.size(); i++) {
      if (i == reference) continue;
      std::vector<LinePoint> points;
      for (const auto& [column, y] : differences(i))
        if (t[column]) points.push_back({*t[column], y});
      if (points.size() < kLeastCommon) continue;
      const DisparityLine line = fit_line(points, threshold_, random_);
      if (line.score < std::max(4.0, 0.25 * static_cast<double>(points.size()))) continue;
      factors_.cameras[i].centre = -line.slope;
      factors_.cameras[i].turn = line.offset;
      known_[i] = true;
    }
    return true;
  }

  // direction - C d = uv - o. From pairs of cameras where nothing is known of it.
  void solve_column(size_t j, bool search) {
    DisparityFactors::ColumnFactor& column = factors_.columns[j];
    const std::vector<ColumnSight>& sights = by_column_[j];
    const auto error = [&](const ColumnSight& s, const Vec2& direction, double d) {
      const auto& camera = factors_.cameras[s.camera];
      const Vec2 e = direction - camera.centre * d + camera.turn - s.uv;
      return glm::dot(e, e);
    };
    if (search) {
      column.known = false;
      if (sights.empty()) return;
      double best = 0;
      for (int sample = 0; sample < kDisparitySamples; sample++) {
        const ColumnSight& a = sights[random_() % sights.size()];
        const ColumnSight& b = sights[random_() % sights.size()];
        if (!known_[a.camera] || !known_[b.camera]) continue;
        const auto &ca = factors_.cameras[a.camera], &cb = factors_.cameras[b.camera];
        const Vec2 base = ca.centre - cb.centre;
        const double squared = glm::dot(base, base);
        if (!(squared > 1e-18)) continue;
        const double d = -glm::dot(base, (a.uv - ca.turn) - (b.uv - cb.turn)) / squared;
        const Vec2 direction = a.uv - ca.turn + ca.centre * d;
        double score = 0;
        for (const ColumnSight& s : sights)
          if (known_[s.camera]) score += std::max(0.0, 1 - error(s, direction, d) / (threshold_ * threshold_));
        if (score > best) best = score, column.direction = direction, column.disparity = d;
      }
      if (best < 1.5) return;
      column.known = true;
    }
    if (!column.known) return;
    for (int round = 0; round < (search ? 5 : 1); round++) {
      double s = 0, cc = 0, cy = 0;
      Vec2 c(0, 0), y(0, 0);
      for (const ColumnSight& sight : sights) {
        if (!known_[sight.camera]) continue;
        const auto& camera = factors_.cameras[sight.camera];
        const double w = weight_of(error(sight, column.direction, column.disparity), threshold_);
        const Vec2 value = sight.uv - camera.turn;
        s += w, c += w * camera.centre, y += w * value;
        cc += w * glm::dot(camera.centre, camera.centre), cy += w * glm::dot(camera.centre, value);
      }
      const double det = s * cc - glm::dot(c, c);
      if (!(det > 1e-12 * s * cc)) return;
      column.disparity = (glm::dot(c, y) - s * cy) / det;
      column.direction = (y + c * column.disparity) / s;
    }
  }

  void solve_camera(size_t i, bool search) {
    DisparityFactors::CameraFactor& camera = factors_.cameras[i];
    std::vector<LinePoint> points;
    for (const ColumnSight& s : by_camera_[i]) {
      const auto& column = factors_.columns[s.column];
      if (column.known) points.push_back({column.disparity, s.uv - column.direction});
    }
    if (points.size() < kLeastCommon) return;
    DisparityLine line{camera.turn, -camera.centre};
    if (search || !known_[i]) {
      const DisparityLine found = fit_line(points, threshold_, random_);
      if (!known_[i] || found.score > line_score(points, line, threshold_)) line = found;
    }
    refine_line(points, threshold_, 1, line);
    known_[i] = line.score > std::max(4.0, 0.25 * static_cast<double>(points.size()));
    camera.centre = -line.slope;
    camera.turn = line.offset;
  }

  // Chooses among the equal: centred, turns without a part along C, disparities positive, C of unit spread.
  void upgrade() {
    double n = 0;
    Vec2 mean_c(0, 0), mean_o(0, 0);
    for (size_t i = 0; i < known_.size(); i++)
      if (known_[i]) n++, mean_c += factors_.cameras[i].centre, mean_o += factors_.cameras[i].turn;
    mean_c /= n, mean_o /= n;
    double cc = 0, co = 0;
    for (size_t i = 0; i < known_.size(); i++) {
      auto& camera = factors_.cameras[i];
      camera.centre -= mean_c, camera.turn -= mean_o;
      if (known_[i]) cc += glm::dot(camera.centre, camera.centre), co += glm::dot(camera.centre, camera.turn);
    }
    if (!(cc > 0)) return;
    const double slope = co / cc, spread = std::sqrt(cc / n);
    std::vector<double> disparities;
    for (auto& column : factors_.columns) {
      column.direction += mean_o - mean_c * column.disparity;
      column.disparity -= slope;
      if (column.known) disparities.push_back(column.disparity);
    }
    if (disparities.empty()) return;
    std::nth_element(disparities.begin(), disparities.begin() + disparities.size() / 2, disparities.end());
    const double middle = disparities[disparities.size() / 2], scale = middle < 0 ? -spread : spread;
    for (auto& camera : factors_.cameras) {
      camera.turn -= camera.centre * slope;
      camera.centre /= scale;
    }
    const double least = std::abs(middle * spread) / 20;
    for (auto& column : factors_.columns) column.disparity = std::max(column.disparity * scale, least);
  }

  void count() {
    double all = 0, agree = 0;
    for (size_t i = 0; i < by_camera_.size(); i++) {
      double fit = 0;
      for (const ColumnSight& s : by_camera_[i]) {
        const auto& column = factors_.columns[s.column];
        const Vec2 e =
            column.direction - factors_.cameras[i].centre * column.disparity + factors_.cameras[i].turn - s.uv;
        if (known_[i] && column.known && glm::dot(e, e) < threshold_ * threshold_) fit++;
      }
      all += static_cast<double>(by_camera_[i].size()), agree += fit;
      factors_.cameras[i].inliers = known_[i] ? fit / static_cast<double>(by_camera_[i].size()) : 0;
    }
    factors_.inliers = all > 0 ? agree / all : 0;
  }

  double threshold_;
  std::vector<std::vector<ColumnSight>> by_camera_, by_column_;
  std::vector<char> known_;
  DisparityFactors factors_;
  std::mt19937 random_{1};
};

}  // namespace

DisparityFactors factorise_disparities(const std::vector<ColumnSight>& sights, size_t num_cameras, size_t num_columns,
                                       double threshold) {
  return Factorisation(sights, num_cameras, num_columns, threshold).run();
}

}  // namespace lf
