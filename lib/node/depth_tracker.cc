// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/depth_tracker.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include <unistd.h>

#include "base/schedule.h"
#include "base/text.h"
#include "focus/focus_array.h"
#include "focus/still_focus.h"

namespace lf {

namespace {

constexpr std::chrono::milliseconds kShortestPause{20};
// Further cameras of live views that get their first depths in the same update.
constexpr size_t kMaxNewCameras = 2;
// Time from a comparison of images that have not changed to the next one, in multiples of its duration.
constexpr uint64_t kRestingPart = 4;

// Frames of cameras, decoded one at a time.
class DecodedFrames {
 public:
  DecodedFrames(const CameraInputs::Array& array, const CameraSet& cameras, PixelFamily family,
                const DepthTracker::FindFrame& find)
      : array_(array), family_(family == PixelFamily::kNone ? PixelFamily::kRgb : family) {
    for (const CameraIndex camera : cameras)
      if (std::optional<CameraFrame> frame = find(camera); frame && frame->fits(array.rig->cameras[camera]))
        frames_[camera] = std::move(*frame);
  }

  CameraSet cameras() const {
    CameraSet cameras;
    for (const auto& [camera, frame] : frames_) cameras.push_back(camera);
    return cameras;
  }

  const std::map<CameraIndex, CameraFrame>& frames() const { return frames_; }

  // Returns the image of a camera, which is valid until the next call. Throws DamagedFrame.
  struct DamagedFrame {};
  ImageView operator()(CameraIndex camera) {
    CameraPicture& picture = *frames_.at(camera).picture;
    const Rect whole{0, 0, picture.width(), picture.height()};
    image_ = picture.view(family_, whole);
    if (!image_) {
      frames_.erase(camera);
      throw DamagedFrame();
    }
    const ColourCorrection* const correction =
        array_.colours && array_.colours->any() ? array_.colours->of(camera, family_) : nullptr;
    return correction ? correction->apply(*image_, whole, corrected_) : *image_;
  }

 private:
  const CameraInputs::Array& array_;
  const PixelFamily family_;
  std::map<CameraIndex, CameraFrame> frames_;
  std::shared_ptr<const ImageView> image_;
  ByteBuffer corrected_;
};

// Returns all cameras in the order of their distance from the eye.
std::vector<CameraIndex> cameras_around(const CameraInputs::Array& array, const Vec3& eye) {
  std::vector<std::pair<double, CameraIndex>> by_distance;
  for (const auto& [camera, frames] : array.cameras)
    by_distance.emplace_back(glm::distance(array.rig->cameras[camera].pose.position, eye), camera);
  std::ranges::sort(by_distance);
  std::vector<CameraIndex> cameras;
  for (const auto& [distance, camera] : by_distance) cameras.push_back(camera);
  return cameras;
}

// Adds the cameras of a view to `chosen`. `with_others` is explained at kCamerasOfView.
void add_cameras(const CameraInputs::Array& array, const Vec3& eye, const std::vector<CameraIndex>& contributing,
                 bool with_others, CameraSet& chosen) {
  const std::vector<CameraIndex> around = cameras_around(array, eye);
  std::vector<CameraIndex> of_view;
  const auto add = [&](CameraIndex camera) {
    if (of_view.size() < DepthTracker::kCamerasOfView && std::ranges::find(of_view, camera) == of_view.end())
      of_view.push_back(camera);
  };
  for (size_t i = 0; i < around.size() && i < DepthTracker::kNearest; i++) add(around[i]);
  for (const CameraIndex camera : contributing)
    if (array.cameras.contains(camera)) add(camera);
  for (size_t i = 0; i < around.size() && with_others; i++) add(around[i]);
  for (const CameraIndex camera : of_view)
    if (chosen.size() < DepthTracker::kMaxTrackedCameras && std::ranges::find(chosen, camera) == chosen.end())
      chosen.push_back(camera);
}

// Lets pictures go before the work of the calling thread from now on.
void lower_priority() {
  constexpr int kNiceness = 5;  // added to the niceness of the process
  thread_local bool is_low = false;
  if (!std::exchange(is_low, true)) std::ignore = nice(kNiceness);  // in Linux, for this thread only
}

// Thrown by the function that stoppable() returns.
struct Stopped {};

// Runs the tasks of `parallel` in small groups. Throws Stopped between groups if `is_stopped` returns true.
ParallelFor stoppable(const ParallelFor& parallel, std::function<bool()> is_stopped) {
  return [&parallel, is_stopped = std::move(is_stopped)](size_t count, const std::function<void(size_t)>& task) {
    const size_t group = std::max(std::thread::hardware_concurrency(), 1u);
    for (size_t first = 0; first < count; first += group) {
      if (is_stopped()) throw Stopped();
      parallel(std::min(group, count - first), [&](size_t i) { task(first + i); });
    }
  };
}

}  // namespace

DepthTracker::~DepthTracker() {
  thread_.request_stop();
  surface_thread_.request_stop();
  changed_.notify_all();
}

std::optional<View> DepthTracker::surface(std::shared_ptr<TrackedView>& tracked, const View& view,
                                          const std::vector<CameraIndex>& contributing) {
  const FocalMap& map = *view.focus.map;
  if (static_cast<size_t>(map.columns) * map.rows > kMaxNodes) return {};
  const std::lock_guard lock(mutex_);
  if (!tracked) tracked = std::make_shared<TrackedView>();
  tracked->used = now_ns();
  tracked->is_new = tracked->is_new || !(tracked->wanted.pose == view.pose && tracked->wanted.lens == view.lens);
  tracked->wanted = view;
  tracked->contributing = contributing;
  if (std::ranges::find(views_, tracked) == views_.end()) {
    if (views_.size() >= kMaxViews) return {};
    tracked->found.reset();
    tracked->is_new = true;
    views_.push_back(tracked);
  }
  if (!thread_.joinable()) {
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
    surface_thread_ = std::jthread([this](const std::stop_token& stop) { run_surfaces(stop); });
  }
  changed_.notify_all();
  return tracked->found;
}

void DepthTracker::clear() {
  const std::lock_guard lock(mutex_);
  views_.clear();
  latest_.reset();
  generation_++;
}

std::optional<ArrayDepth> DepthTracker::depths() const {
  const std::lock_guard lock(mutex_);
  return latest_;
}

// Waits until a view is tracked. Returns false if the thread should end. If no view was tracked before, there are no
// surfaces until forget_if_outdated() has compared the images.
bool DepthTracker::wait_for_views(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  const auto has_any = [this] {
    const uint64_t now = now_ns();
    std::erase_if(views_, [&](const auto& view) { return now - view->used > timeout_; });
    return !views_.empty();
  };
  if (!has_any()) {
    was_idle_ = true;
    latest_.reset();
  }
  return changed_.wait(lock, stop, has_any) && !stop.stop_requested();
}

// Returns the cameras for the next update of the depths, in ascending order. The first update has the most important
// cameras of all live views. Later updates add a few cameras at a time, so that no update takes long.
CameraSet DepthTracker::cameras_of_views(const CameraInputs::Array& array) {
  CameraSet cameras;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& view : views_)
      add_cameras(array, view->wanted.pose.position, view->contributing, depths_.has_value(), cameras);
  }
  if (depths_) {
    const CameraSet known = depths_->cameras();
    size_t added = 0;
    std::erase_if(cameras, [&](CameraIndex camera) {
      return !std::ranges::binary_search(known, camera) && ++added > kMaxNewCameras;
    });
  }
  std::ranges::sort(cameras);
  return cameras;
}

// Returns the cameras that the surfaces of live views need most, in ascending order.
CameraSet DepthTracker::nearest_to_views(const CameraInputs::Array& array) {
  CameraSet nearest;
  const std::lock_guard lock(mutex_);
  for (const auto& view : views_) {
    std::vector<CameraIndex> around = cameras_around(array, view->wanted.pose.position);
    around.resize(std::min(around.size(), kNearest));
    nearest.insert(nearest.end(), around.begin(), around.end());
  }
  std::ranges::sort(nearest);
  nearest.erase(std::unique(nearest.begin(), nearest.end()), nearest.end());
  return nearest;
}

// Drops the depths from before the last call of clear(). The caller holds work_mutex_.
void DepthTracker::forget_if_cleared() {
  const std::lock_guard lock(mutex_);
  if (generation_of_depths_ != generation_) depths_.reset();
  generation_of_depths_ = generation_;
}

// Drops the depths if the rig or an image has changed while no view was tracked: the scene may then be different.
void DepthTracker::forget_if_outdated(const CameraInputs::Array& array) {
  if (!std::exchange(was_idle_, false)) return;
  const auto is_same = [&](const auto& known) {
    const auto camera = array.cameras.find(known.first);
    const std::optional<CameraFrame> frame =
        camera != array.cameras.end() ? camera->second->newest() : std::optional<CameraFrame>();
    return frame && is_unchanged(known.first, *frame);
  };
  if (rig_ != array.rig || !std::ranges::all_of(pictures_, is_same)) depths_.reset();
  publish_depths();
}

// Returns true if the frame is the one that the depths of the camera were estimated from.
bool DepthTracker::is_unchanged(CameraIndex camera, const CameraFrame& frame) const {
  const auto known = pictures_.find(camera);
  return known != pictures_.end() && frame.picture && known->second.lock() == frame.picture;
}

// Estimates the depths of `cameras` from their frames. Returns true if they have changed. Calls show_step() after each
// step of the first estimate except the first and the last. The first estimate is quick, for the cameras in `first`,
// unless this is null. Later calls complete such an estimate.
bool DepthTracker::update_depths(const CameraInputs::Array& array, const CameraSet& cameras, const CameraSet* first,
                                 const FindFrame& find, const ParallelFor& parallel,
                                 const std::function<void()>& show_step) {
  const bool may_be_quick = first != nullptr;
  if (rig_ != array.rig || (depths_ && !may_be_quick && !depths_->is_complete())) depths_.reset();
  rig_ = array.rig;
  if (!depths_) pictures_.clear();
  CameraSet tracked = cameras;
  // Other cameras cost nothing as long as their frames stay the same.
  for (const auto& [camera, picture] : pictures_)
    if (tracked.size() < kMaxTrackedCameras && array.cameras.contains(camera) &&
        !std::ranges::binary_search(cameras, camera))
      if (const std::optional<CameraFrame> frame = find(camera); frame && is_unchanged(camera, *frame))
        tracked.push_back(camera);
  std::ranges::sort(tracked);
  DecodedFrames frames(array, tracked, inputs_.family(), find);
  const MatchedImages images = [&](CameraIndex camera) { return frames(camera); };
  CameraSet unchanged;
  for (const auto& [camera, frame] : frames.frames())
    if (is_unchanged(camera, frame)) unchanged.push_back(camera);
  const auto remember_pictures = [&] {
    pictures_.clear();
    for (const auto& [camera, frame] : frames.frames()) pictures_[camera] = frame.picture;
  };
  const bool is_first = !depths_;
  while (frames.cameras().size() >= 2) {
    try {
      if (depths_) {
        ArrayDepth depths = depths_->updated(*rig_, frames.cameras(), unchanged, images, parallel);
        const bool has_changed = !depths.shares_all(*depths_);
        depths_ = std::move(depths);
        remember_pictures();
        return has_changed;
      }
      const double nearest = kNearestDepth * FocusArray(*rig_).nearest();
      depths_ = ArrayDepth::coarse(*rig_, frames.cameras(), images, 0, nearest, parallel);
      while (!depths_->is_finest(*rig_)) {
        depths_ =
            first ? depths_->quick_finer(*rig_, *first, images, parallel) : depths_->finer(*rig_, images, parallel);
        if (!depths_->is_finest(*rig_)) show_step();
      }
      remember_pictures();
      return true;
    } catch (const DecodedFrames::DamagedFrame&) {  // the camera is left out
      if (is_first) depths_.reset();
    }
  }
  return false;
}

std::optional<DepthTracker::Measured> DepthTracker::measure(const CameraInputs::Array& array, const View& view,
                                                            const std::vector<CameraIndex>& contributing,
                                                            const FindFrame& find, const std::atomic<bool>& cancelled,
                                                            const ParallelFor& parallel) {
  const FocalMap& map = *view.focus.map;
  if (static_cast<size_t>(map.columns) * map.rows > kMaxNodes) return {};
  const std::lock_guard lock(work_mutex_);
  forget_if_cleared();
  CameraSet cameras;
  add_cameras(array, view.pose.position, contributing, true, cameras);
  std::ranges::sort(cameras);
  try {
    update_depths(array, cameras, nullptr, find, stoppable(parallel, [&cancelled] { return cancelled.load(); }), [] {});
  } catch (const Stopped&) {
    depths_.reset();
  }
  if (!depths_) return {};
  View measured = view;
  measured.focus.map = std::make_shared<const FocalMap>(depths_->surface(view, map, parallel));
  const std::lock_guard result_lock(mutex_);
  if (generation_of_depths_ == generation_) latest_ = depths_;
  return Measured{std::move(measured), *depths_};
}

// Lets the surfaces of all views be measured again, with new depths.
void DepthTracker::publish_depths() {
  const std::lock_guard lock(mutex_);
  if (generation_of_depths_ != generation_) return;
  latest_ = depths_;
  for (const auto& view : views_) view->is_new = true;
  changed_.notify_all();
}

// Measures the surface of each view after a change of the view or of its depths, in turn. An update of the depths
// may take seconds on a busy machine, so surfaces have a thread of their own.
void DepthTracker::run_surfaces(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (true) {
    auto next = views_.end();
    const auto has_work = [&] {
      next = std::ranges::find_if(views_, [](const auto& view) { return view->is_new; });
      return latest_ && next != views_.end();
    };
    if (!changed_.wait(lock, stop, has_work) || stop.stop_requested()) return;
    const std::shared_ptr<TrackedView> tracked = *next;
    std::rotate(next, next + 1, views_.end());
    tracked->is_new = false;
    View view = tracked->wanted;
    const ArrayDepth depths = *latest_;
    const uint64_t generation = generation_, begun = now_ns();
    lock.unlock();
    view.focus.map = std::make_shared<const FocalMap>(depths.surface(view, *view.focus.map));
    lock.lock();
    if (generation == generation_) tracked->found = std::move(view);
    lower_priority();  // but not for the first surface, which viewers wait for
    pause(lock, stop, now_ns() - begun);
  }
}

// Waits as long as the thread has worked.
void DepthTracker::pause(std::unique_lock<std::mutex>& lock, const std::stop_token& stop, uint64_t worked) {
  const auto time = std::max<std::chrono::nanoseconds>(std::chrono::nanoseconds(worked), kShortestPause);
  changed_.wait_for(lock, stop, time, [] { return false; });
}

// Updates the depths if it is time. Throws Stopped.
void DepthTracker::work(const std::stop_token& stop) {
  const std::lock_guard lock(work_mutex_);
  forget_if_cleared();
  const auto array = inputs_.array();
  forget_if_outdated(*array);
  const uint64_t begun = now_ns();
  if (!array->rig || (begun < next_update_ && depths_)) return;
  // Nothing else makes the picture sharp, so the first depths may use all processors.
  const ParallelFor on_all_processors = [this](size_t count, const std::function<void(size_t)>& task) {
    workers_.run(std::max(std::thread::hardware_concurrency(), 1u), count, task);
  };
  const bool is_first = !depths_;
  const CameraSet nearest = nearest_to_views(*array);
  const ParallelFor parallel = is_first ? on_all_processors : serial_for;
  const bool has_changed = update_depths(
      *array, cameras_of_views(*array), &nearest,
      [&array](CameraIndex camera) { return array->cameras.at(camera)->newest(); },
      stoppable(parallel, [&stop] { return stop.stop_requested(); }), [this] { publish_depths(); });
  const uint64_t now = now_ns();
  next_update_ = now + (has_changed ? 1 : kRestingPart) * (now - begun);
  if (has_changed) publish_depths();
  // The first depths of a tracker have normal priority, because on a busy machine they would otherwise take minutes.
  // The threads of workers_, which only help with first depths, keep this priority.
  if (is_first && depths_) lower_priority();
}

void DepthTracker::run(const std::stop_token& stop) {
  while (wait_for_views(stop)) {
    const uint64_t begun = now_ns();
    try {
      work(stop);
    } catch (const Stopped&) {
      return;
    }
    std::unique_lock lock(mutex_);
    pause(lock, stop, now_ns() - begun);
  }
}

}  // namespace lf
