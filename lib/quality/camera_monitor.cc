// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/camera_monitor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

#include "base/maths.h"
#include "focus/warp_depth_map.h"

namespace lf {
namespace {

constexpr size_t kNearest = 8;    // the cameras around a camera in a grid
constexpr double kCleared = 0.7;  // a suspect with a smaller deviation is cleared
constexpr double kSigmaPerMad = 1.4826;
constexpr double kScatters = 3;     // minimum deviation, relative to the scatter between parts of the image
constexpr double kAnyDistance = 1;  // metres; in any plane in front of the camera, the camera sees its own image
constexpr double kSameRate = 0.01;  // relative difference of periods
constexpr double kForget = 12;       // seconds
constexpr double kMinChange = 0.08;  // relative to the full range; a hand covers most of the image
constexpr double kMinRatio = 1.8;    // relative to the second-largest change

std::vector<CameraIndex> nearest_to(const Rig& rig, CameraIndex camera) {
  std::vector<CameraIndex> others;
  for (CameraIndex i = 0; i < rig.cameras.size(); i++)
    if (i != camera) others.push_back(i);
  const auto distance = [&](CameraIndex i) {
    return glm::length(rig.cameras[i].pose.position - rig.cameras[camera].pose.position);
  };
  const size_t count = std::min(kNearest, others.size());
  std::ranges::partial_sort(others, others.begin() + static_cast<ptrdiff_t>(count), {}, distance);
  others.resize(count);
  return others;
}

// Pixel x of the new lens is pixel step x + first of `lens`.
Lens subsample_grid(const Lens& lens, int step, int first) {
  std::array<double, Lens::kMaxParams> params = lens.params();
  const auto focal = static_cast<size_t>(lens_model_num_focal(lens.model()));
  for (size_t i = 0; i < focal; i++) params[i] /= step;
  for (size_t i = focal; i < focal + 2; i++) params[i] = (params[i] - first) / step;
  return {lens.model(), params};
}

}  // namespace

CameraMonitor::CameraMonitor(const Rig& rig) : cameras_(rig.cameras.size()) {
  for (CameraIndex i = 0; i < cameras_.size(); i++) {
    cameras_[i].error = kNoPrediction;
    cameras_[i].nearest = nearest_to(rig, i);
  }
}

bool CameraMonitor::is_suspect(CameraIndex camera) const {
  return std::ranges::find(suspects_, camera, &Suspect::camera) != suspects_.end();
}

CameraSet CameraMonitor::suspected() const {
  CameraSet cameras;
  for (const Suspect& suspect : suspects_) cameras.push_back(suspect.camera);
  return cameras;
}

std::optional<CameraIndex> CameraMonitor::next(const CameraSet& out_of_service) {
  for (CameraIndex i = 0; i < cameras_.size(); i++) cameras_[i].out = std::ranges::binary_search(out_of_service, i);
  while (!recheck_.empty()) {
    const CameraIndex camera = recheck_.front();
    recheck_.pop_front();
    if (!cameras_[camera].out) return camera;
  }
  for (size_t i = 0; i < cameras_.size(); i++) {
    const CameraIndex camera = turn_;
    turn_ = static_cast<CameraIndex>((turn_ + 1) % cameras_.size());
    if (!cameras_[camera].out) return camera;
  }
  return std::nullopt;
}

bool CameraMonitor::is_settled() const {
  return recheck_.empty() && std::ranges::all_of(cameras_, [](const CameraRecord& c) { return c.out || c.taken > 0; });
}

void CameraMonitor::recheck(CameraIndex camera) {
  if (std::ranges::find(recheck_, camera) == recheck_.end()) recheck_.push_back(camera);
}

CameraMonitor::Figures CameraMonitor::figures_of(const PredictionError& error) {
  // A perfect prediction has infinite PSNR, which cannot be compared, so PSNR is limited.
  constexpr double kMaxDb = 60;  // pictures that differ only by rounding
  const double psnr = error.psnr_db > kMaxDb ? kMaxDb : error.psnr_db;
  return {psnr, error.gain, error.shift.x, error.shift.y};
}

std::optional<CameraMonitor::FigureStats> CameraMonitor::usual() const {
  constexpr Figures kLeast{kDb, kGain, kShift, kShift};
  std::array<std::vector<double>, kFigures> known;
  for (CameraIndex i = 0; i < cameras_.size(); i++) {
    const CameraRecord& camera = cameras_[i];
    if (camera.out || is_suspect(i)) continue;
    if (camera.taken == 0) return std::nullopt;
    const Figures figures = figures_of(camera.error);
    if (!std::ranges::all_of(figures, [](double v) { return std::isfinite(v); })) continue;
    for (size_t k = 0; k < kFigures; k++) known[k].push_back(figures[k]);
  }
  if (known[0].size() < kMinCameras) return std::nullopt;
  FigureStats usual{};
  for (size_t k = 0; k < kFigures; k++) {
    usual.middle[k] = median(known[k]);
    for (double& v : known[k]) v = std::abs(v - usual.middle[k]);
    usual.most[k] = std::max(kLeast[k], kDeviations * kSigmaPerMad * median(known[k]));
  }
  return usual;
}

double CameraMonitor::deviation(const FigureStats& usual, const PredictionError& error, Fault* fault) {
  Figures odd = figures_of(error);
  const Figures scatter{0, error.gain_scatter, error.shift_scatter, error.shift_scatter};
  for (size_t k = 0; k < kFigures; k++)
    odd[k] = (odd[k] - usual.middle[k]) / std::max(usual.most[k], kScatters * scatter[k]);
  const double picture = -odd[0], colour = std::abs(odd[1]), direction = std::hypot(odd[2], odd[3]);
  // A colour or direction error explains a low PSNR.
  *fault = std::max(colour, direction) <= 1 ? Fault::kPicture : colour > direction ? Fault::kColour : Fault::kDirection;
  const double worst = std::max({picture, colour, direction});
  return std::isfinite(worst) ? worst : 0;
}

void CameraMonitor::take(CameraIndex camera, const PredictionError& error) {
  cameras_[camera].error = error;
  cameras_[camera].taken = ++turns_;
  cameras_[camera].stale = false;
  const std::optional<FigureStats> usual = this->usual();
  if (!usual) return;
  if (is_suspect(camera))
    update_suspect(camera, *usual);
  else
    update_others(*usual);
}

void CameraMonitor::update_suspect(CameraIndex camera, const FigureStats& usual) {
  const auto suspect = std::ranges::find(suspects_, camera, &Suspect::camera);
  Fault fault;
  const double odd = deviation(usual, cameras_[camera].error, &fault);
  if (odd > kCleared) {
    if (odd > 1) suspect->fault = fault;
    return;
  }
  suspects_.erase(suspect);
  cameras_[camera].outlier_since = 0;
}

void CameraMonitor::update_others(const FigureStats& usual) {
  std::optional<Suspect> worst;
  double most = 1;
  for (CameraIndex i = 0; i < cameras_.size(); i++) {
    CameraRecord& camera = cameras_[i];
    if (camera.out || camera.stale || is_suspect(i)) continue;
    Fault fault;
    double odd = deviation(usual, camera.error, &fault);
    // Predictions are worse next to an excluded camera, so a low PSNR is not the camera's fault.
    if (fault == Fault::kPicture && std::ranges::any_of(camera.nearest, [&](CameraIndex n) { return is_suspect(n); }))
      odd = 0;
    if (odd <= 1) {
      camera.outlier_since = 0;
      continue;
    }
    if (camera.outlier_since == 0) {
      camera.outlier_since = turns_;
      recheck(i);
      for (const CameraIndex near : camera.nearest) recheck(near);
    }
    if (odd <= most) continue;
    most = odd;
    worst = {i, fault};
  }
  if (!worst) return;
  const CameraRecord& camera = cameras_[worst->camera];
  const auto seen_since = [&](CameraIndex i) {
    return cameras_[i].out || is_suspect(i) || cameras_[i].taken > camera.outlier_since;
  };
  if (seen_since(worst->camera) && std::ranges::all_of(camera.nearest, seen_since)) add_suspect(*worst);
}

void CameraMonitor::add_suspect(const Suspect& suspect) {
  suspects_.insert(std::ranges::upper_bound(suspects_, suspect.camera, {}, &Suspect::camera), suspect);
  for (CameraIndex i = 0; i < cameras_.size(); i++) {
    if (i == suspect.camera || (cameras_[i].outlier_since == 0 && !is_suspect(i))) continue;
    cameras_[i].outlier_since = 0;
    cameras_[i].stale = true;
    recheck(i);
  }
}

std::string_view to_string(CameraMonitor::Fault fault) {
  switch (fault) {
    case CameraMonitor::Fault::kColour: return "colour";
    case CameraMonitor::Fault::kDirection: return "direction";
    case CameraMonitor::Fault::kPicture: break;
  }
  return "picture";
}

CameraProbe make_probe(const Rig& rig, CameraIndex camera, const View& focused, const CameraSet& without) {
  const Camera& at = rig.cameras[camera];
  const int step = (at.width + kProbeColumns - 1) / kProbeColumns, first = (step - 1) / 2;
  View view{.width = (at.width - first + step - 1) / step,
            .height = (at.height - first + step - 1) / step,
            .lens = subsample_grid(at.lens, step, first),
            .pose = at.pose,
            .focus = {}};
  CameraProbe probe{.camera = camera, .seen = {}, .predicted = {}};
  view.blending.extrapolates = false;  // extrapolated pixels would predict the camera less well
  view.focus.plane = focal_plane_at(view.pose, kAnyDistance);
  probe.seen.view = view;
  for (CameraIndex i = 0; i < rig.cameras.size(); i++)
    if (i != camera) probe.seen.out_of_service.push_back(i);
  view.focus = focused.focus;
  if (view.focus.map) view.focus.map = warp_depth_map(focused, view);
  probe.predicted.view = view;
  probe.predicted.out_of_service = without;
  const auto place = std::ranges::lower_bound(probe.predicted.out_of_service, camera);
  if (place == probe.predicted.out_of_service.end() || *place != camera)
    probe.predicted.out_of_service.insert(place, camera);
  for (ViewRequest* request : {&probe.seen, &probe.predicted}) {
    request->probe = true;
    request->rig_hash = rig.hash();
  }
  return probe;
}

std::optional<CameraProbe> ProbeScheduler::next(const Rig& rig, const ViewRequest& composed, unsigned interval) {
  if (!monitor_ || rig_ != rig.hash()) {
    clear();
    monitor_.emplace(rig);
    rig_ = rig.hash();
  }
  if (++requests_ < (asked_ ? interval + kProbeTimeout : interval)) return {};
  requests_ = 0;
  lose();
  const std::optional<CameraIndex> camera = monitor_->next(composed.out_of_service);
  if (!camera) return {};
  CameraSet without;
  std::ranges::set_union(composed.out_of_service, monitor_->suspected(), std::back_inserter(without));
  asked_ = make_probe(rig, *camera, displayed_view(composed), without);
  return asked_;
}

bool ProbeScheduler::expects(const ViewRequest& probe) {
  // the answer belongs to another client, or is too late
  if (!asked_ || probe.view.pose != asked_->seen.view.pose) return false;
  if (probe.view == asked_->seen.view || (probe.view == asked_->predicted.view && seen_)) return true;
  lose();
  return false;
}

ProbeScheduler::TurnResult ProbeScheduler::take(const ViewRequest& probe, CoverageImage picture) {
  if (probe.view == asked_->seen.view) {
    seen_ = std::move(picture);
    return TurnResult::kFirstProbe;
  }
  const std::vector<CameraMonitor::Suspect> before = monitor_->suspects();
  monitor_->take(asked_->camera, compare_prediction(picture, *seen_));
  lose();
  return monitor_->suspects() != before ? TurnResult::kSuspectsChanged : TurnResult::kBothProbes;
}

void ProbeScheduler::lose() {
  asked_.reset();
  seen_.reset();
}

FrameTimeStats frame_time_stats(std::span<const double> times) {
  FrameTimeStats result{.frames = times.size()};
  std::vector<double> forward;
  for (const double time : times) {
    if (!forward.empty() && !(time > forward.back()))
      result.backwards++;
    else
      forward.push_back(time);
  }
  if (forward.size() < 3) return result;
  std::vector<double> intervals;
  for (size_t i = 1; i < forward.size(); i++) intervals.push_back(forward[i] - forward[i - 1]);
  const double usual = median(intervals);

  // Number the frames, then fit a line through (number, time).
  std::vector<double> numbers{0};
  for (const double interval : intervals)
    numbers.push_back(numbers.back() + std::max(1.0, std::round(interval / usual)));
  const double n = static_cast<double>(forward.size());
  double mean_number = 0, mean_time = 0, covariance = 0, variance = 0;
  for (size_t i = 0; i < forward.size(); i++) mean_number += numbers[i] / n, mean_time += (forward[i] - forward[0]) / n;
  for (size_t i = 0; i < forward.size(); i++) {
    covariance += (numbers[i] - mean_number) * (forward[i] - forward[0] - mean_time);
    variance += (numbers[i] - mean_number) * (numbers[i] - mean_number);
  }
  result.period = covariance / variance;
  const double begin = mean_time - result.period * mean_number;
  result.first = forward[0] + begin;
  double squares = 0;
  for (size_t i = 0; i < forward.size(); i++) {
    const double error = forward[i] - forward[0] - begin - result.period * numbers[i];
    squares += error * error;
  }
  result.jitter = std::sqrt(squares / n);
  result.missing = static_cast<size_t>(numbers.back()) + 1 - forward.size();
  return result;
}

Skew camera_skew(std::span<const FrameTimeStats> cameras) {
  Skew skew;
  skew.phase.assign(cameras.size(), NAN);
  std::vector<double> periods;
  for (const FrameTimeStats& camera : cameras)
    if (camera.period > 0) periods.push_back(camera.period);
  if (periods.empty()) return skew;
  const double period = median(periods);
  const auto counts = [&](const FrameTimeStats& camera) {
    return camera.period > 0 && std::abs(camera.period / period - 1) <= kSameRate;
  };
  // Phases are angles, so their mean is the direction of the sum of unit vectors. All phases are computed for the time
  // when the last camera started, so that different clocks have not drifted far.
  double begin = -INFINITY;
  for (const FrameTimeStats& camera : cameras)
    if (counts(camera)) begin = std::max(begin, camera.first);
  const auto late = [&](const FrameTimeStats& camera) {
    return camera.first + std::ceil((begin - camera.first) / camera.period) * camera.period - begin;
  };
  double x = 0, y = 0;
  for (const FrameTimeStats& camera : cameras) {
    if (!counts(camera)) continue;
    const double angle = 2 * std::numbers::pi * late(camera) / period;
    x += std::cos(angle), y += std::sin(angle);
  }
  const double middle = std::atan2(y, x) / (2 * std::numbers::pi) * period;
  double least = INFINITY, most = -INFINITY, shortest = INFINITY, longest = 0;
  for (size_t i = 0; i < cameras.size(); i++) {
    if (!counts(cameras[i])) continue;
    const double phase = std::remainder(late(cameras[i]) - middle, period);
    skew.phase[i] = phase;
    least = std::min(least, phase), most = std::max(most, phase);
    shortest = std::min(shortest, cameras[i].period), longest = std::max(longest, cameras[i].period);
  }
  skew.spread = most - least;
  skew.drift = longest / shortest - 1;
  return skew;
}

void HandWaveDetector::see(size_t camera, std::span<const float> parts, double time) {
  Camera& c = cameras_[camera];
  if (c.usual.size() != parts.size()) {
    c.usual.assign(parts.begin(), parts.end());
    c.time = time;
    c.change = 0;
    return;
  }
  const auto count = static_cast<double>(std::max<size_t>(parts.size(), 1));
  double whole = 0, change = 0;
  for (size_t i = 0; i < parts.size(); i++) whole += (parts[i] - c.usual[i]) / count;
  for (size_t i = 0; i < parts.size(); i++) change += std::abs(parts[i] - c.usual[i] - whole / 2) / count;
  c.change = change;
  const auto share = static_cast<float>(1 - std::exp(-std::max(0.0, time - c.time) / kForget));
  for (size_t i = 0; i < parts.size(); i++) c.usual[i] += share * (parts[i] - c.usual[i]);
  c.time = time;
}

std::optional<size_t> HandWaveDetector::found() const {
  size_t most = 0;
  double next = 0;
  for (size_t i = 1; i < cameras_.size(); i++)
    if (cameras_[i].change > cameras_[most].change) most = i;
  for (size_t i = 0; i < cameras_.size(); i++)
    if (i != most) next = std::max(next, cameras_[i].change);
  if (cameras_.empty() || cameras_[most].change < kMinChange || cameras_[most].change < kMinRatio * next)
    return std::nullopt;
  return most;
}

}  // namespace lf
