// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/camera_inputs.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "view/view_request.h"

namespace lf {
namespace {

// Converts I420 to RGB. This is slow, but only needed if a node has cameras of both families.
std::shared_ptr<const ImageView> as_rgb(const ImageView& i420) {
  struct Converted {
    Image image;
    ImageView view;
  };
  Image packed(PixelFamily::kI420, i420.width, i420.height);
  for (int c = 0; c < 3; c++) {
    const int w = c ? chroma_size(i420.width) : i420.width, h = c ? chroma_size(i420.height) : i420.height;
    for (int y = 0; y < h; y++)
      std::copy_n(i420.plane[c] + y * i420.stride[c], w, packed.plane(c) + static_cast<ptrdiff_t>(y) * w);
  }
  const auto converted = std::make_shared<Converted>(Converted{to_rgb(packed), {}});
  converted->view = converted->image.view();
  return {converted, &converted->view};
}

}  // namespace

std::shared_ptr<const ImageView> JpegPicture::view(PixelFamily family, const Rect& region) {
  const bool converts = family == PixelFamily::kRgb;
  if (!frame_->ensure(converts ? Rect{0, 0, width(), height()} : region)) return nullptr;
  return converts ? as_rgb(frame_->view()) : std::make_shared<const ImageView>(frame_->view());
}

class CameraFrames::Lock : public std::unique_lock<std::mutex> {
 public:
  explicit Lock(CameraFrames& frames) : std::unique_lock<std::mutex>(frames.mutex_), frames_(frames) {}
  ~Lock() {
    const std::vector<CameraFrame> dropped = std::exchange(frames_.dropped_, {});
    unlock();
  }

 private:
  CameraFrames& frames_;
};

void CameraFrames::wake_all() {
  room_.notify_all();
  arrived_.notify_all();
}

void CameraFrames::set_mode(Mode mode) {
  std::lock_guard lock(mutex_);
  mode_ = mode;
  wake_all();
}

void CameraFrames::start_stream(bool live) {
  std::lock_guard lock(mutex_);
  started_ = true;
  live_ = live;
  ended_ = lost_ = false;
  wake_all();
}

void CameraFrames::note_arrival(int64_t late) {
  std::lock_guard lock(mutex_);
  earliest_ = std::min(earliest_, late);
  behind_ = static_cast<uint64_t>(late - earliest_);
}

void CameraFrames::drop_oldest() {
  const CameraPicture* picture = frames_.front().frame.picture.get();
  if (picture && picture->is_compressed())
    before_ = std::move(frames_.front().frame);
  else
    dropped_.push_back(std::move(frames_.front().frame));
  frames_.pop_front();
}

void CameraFrames::drop_all() {
  for (Held& held : frames_) dropped_.push_back(std::move(held.frame));
  frames_.clear();
  before_ = {};
}

void CameraFrames::drop_outdated() {
  while (frames_.size() > 1 && frames_[1].time <= wanted_) drop_oldest();
}

// Notes that a request needs the frame of this time. For a file, kNoTime (the newest frame) means the current frame;
// otherwise each request would advance the file. The camera's thread is woken only if there is room for a frame,
// because many views may request the same time.
void CameraFrames::want(uint64_t time) {
  if (time != kNoTime) wanted_ = time;
  if (live_) return;
  drop_outdated();
  if (frames_.size() < kFileFrames) room_.notify_all();
}

void CameraFrames::advance(uint64_t time) {
  const Lock lock(*this);
  want(time);
}

CameraFrames::PushResult CameraFrames::push(CameraFrame frame) {
  const uint64_t time = frame.time;
  return push_at(time, std::move(frame));
}

CameraFrames::PushResult CameraFrames::push_damaged(uint64_t time) { return push_at(time, std::nullopt); }

// Keeps two frames before the earliest requested time. One of them may be the nearest, and an answer may be one frame
// later than its predecessors.
bool CameraFrames::has_too_many() const {
  if (frames_.size() <= kLiveFrames) return false;
  return frames_.size() > most_frames() || frames_.back().time - frames_[2].time >= reach_;
}

// Assumes 1.5 bytes per pixel for raw frames and a fifth of that for compressed frames.
size_t CameraFrames::most_frames() const {
  const CameraPicture* picture = frames_.back().frame.picture.get();
  if (!picture) return kMaxLiveFrames;
  const size_t pixels = static_cast<size_t>(picture->width()) * static_cast<size_t>(picture->height());
  const size_t bytes = std::max<size_t>(picture->is_compressed() ? pixels * 3 / 10 : pixels * 3 / 2, 1);
  return std::clamp(kMaxLiveBytes / bytes, kLiveFrames, kMaxLiveFrames);
}

CameraFrames::PushResult CameraFrames::push_at(uint64_t time, std::optional<CameraFrame> frame) {
  Lock lock(*this);
  if (!live_)
    room_.wait(lock, [this] {
      drop_outdated();
      return mode_ == Mode::kStopped || flushing_ || mode_ == Mode::kFinished || frames_.size() < kFileFrames;
    });
  if (mode_ == Mode::kStopped || flushing_) return PushResult::kStopped;
  if (mode_ == Mode::kFinished && !live_) return PushResult::kEnded;  // a live camera may still be requested again
  // Time may jump back if a stream restarts without a flush. The held frames then belong to another timeline.
  if (!frames_.empty() && frames_.back().time > time) earliest_ = INT64_MAX;
  while (!frames_.empty() && frames_.back().time > time) drop_oldest();
  if (!frames_.empty()) last_period_ = time - frames_.back().time;
  lost_ = false;
  if (!frame) frame = frames_.empty() ? before_ : frames_.back().frame;
  frame->behind = behind_;
  frames_.push_back({time, std::move(*frame)});
  while (has_too_many()) drop_oldest();
  arrived_.notify_all();
  return PushResult::kTaken;
}

std::optional<CameraFrame> CameraFrames::replace_damaged(const CameraPicture* damaged, bool* first) {
  std::lock_guard lock(mutex_);
  bool known = before_.picture.get() == damaged;
  if (known) before_ = {};
  CameraFrame serves = before_;
  std::optional<CameraFrame> result;
  for (Held& held : frames_) {
    if (held.frame.picture.get() == damaged) {
      held.damaged = std::exchange(held.frame, serves).picture;
      known = true;
      result = serves;
    } else if (held.damaged && held.damaged.get() == damaged) {
      result = held.frame;
    } else if (!result) {
      serves = held.frame;
    }
  }
  if (first) *first = known;
  if (!result) result = before_;  // no longer held: use the frame before
  if (!result->picture) return std::nullopt;
  return result;
}

void CameraFrames::end_stream() {
  std::lock_guard lock(mutex_);
  ended_ = true;
  arrived_.notify_all();
}

void CameraFrames::lose_stream() {
  std::lock_guard lock(mutex_);
  lost_ = true;
  arrived_.notify_all();
}

void CameraFrames::set_flushing(bool flushing) {
  const Lock lock(*this);
  flushing_ = flushing;
  drop_all();
  ended_ = lost_ = false;
  wanted_ = 0;  // the stream may resume at an earlier time
  wake_all();
}

void CameraFrames::clear() {
  const Lock lock(*this);
  drop_all();
  started_ = live_ = ended_ = lost_ = flushing_ = false;
  wanted_ = reach_ = last_period_ = behind_ = 0;
  earliest_ = INT64_MAX;
}

bool CameraFrames::must_wait(uint64_t time, bool wait_for_first) const {
  if (flushing_) return !live_;
  if (ended_ || lost_) return false;
  if (live_ || !started_) return frames_.empty() && wait_for_first;
  return frames_.empty() || (time != kNoTime && frames_.back().time < time);
}

bool CameraFrames::is_beyond_last(uint64_t time) const {
  return time == kNoTime || time >= frames_.back().time + std::max<uint64_t>(last_period_, 1);
}

// Makes the history of a live camera long enough for this request. Viewers may request frames of different ages; the
// largest age counts, and is forgotten slowly.
void CameraFrames::extend_history(uint64_t time) {
  const uint64_t newest = frames_.back().time;
  const uint64_t reach = time < newest ? newest - time : 0;
  reach_ = std::max(reach > kMaxReach ? 0 : reach, reach_ - reach_ / 64);
}

void CameraFrames::wake() {
  std::lock_guard lock(mutex_);
  arrived_.notify_all();
}

std::optional<CameraFrame> CameraFrames::find(uint64_t time, bool wait_for_first, const std::atomic<bool>* cancelled) {
  Lock lock(*this);
  want(time);
  arrived_.wait(lock, [&] {
    if (!live_) drop_outdated();
    return mode_ == Mode::kStopped || (cancelled && *cancelled) || !must_wait(time, wait_for_first);
  });
  if (mode_ == Mode::kStopped || frames_.empty() || (lost_ && is_beyond_last(time))) return std::nullopt;
  extend_history(time);
  auto best = frames_.end() - 1;
  if (time != kNoTime)
    best = std::min_element(frames_.begin(), frames_.end(), [time](const Held& a, const Held& b) {
      return time_between(a.time, time) < time_between(b.time, time);
    });
  return best->frame;
}

std::optional<CameraFrame> CameraFrames::newest() const {
  std::lock_guard lock(mutex_);
  return frames_.empty() ? std::nullopt : std::optional(frames_.back().frame);
}

bool CameraFrames::is_live() const {
  std::lock_guard lock(mutex_);
  return live_;
}

bool CameraFrames::has_ended() const {
  std::lock_guard lock(mutex_);
  return ended_;
}

// Uses the median, because one long gap after an outage of the camera must not change the result.
uint64_t CameraFrames::period() const {
  std::lock_guard lock(mutex_);
  if (frames_.size() < 2) return 0;
  std::vector<uint64_t> between;
  for (size_t i = 1; i < frames_.size(); i++) between.push_back(frames_[i].time - frames_[i - 1].time);
  const auto middle = between.begin() + static_cast<ptrdiff_t>((between.size() - 1) / 2);
  std::ranges::nth_element(between, middle);
  return *middle;
}

uint64_t CameraFrames::mean_period() const {
  std::lock_guard lock(mutex_);
  return frames_.size() < 2 ? 0 : (frames_.back().time - frames_.front().time) / (frames_.size() - 1);
}

size_t CameraFrames::held() const {
  std::lock_guard lock(mutex_);
  return frames_.size();
}

std::string list_of_ids(const std::vector<uint32_t>& ids) {
  constexpr size_t kNamed = 8;
  std::string list;
  for (size_t i = 0; i < std::min(ids.size(), kNamed); i++) list += (i ? ", " : "") + std::to_string(ids[i]);
  if (ids.size() > kNamed) list += " and " + std::to_string(ids.size() - kNamed) + " more";
  return list;
}

// Requests in progress keep the array that they started with.
void CameraInputs::rebuild_array() {
  auto array = std::make_shared<Array>(*array_);
  array->cameras.clear();
  for (const auto& [frames, input] : inputs_)
    if (const auto index = input.id ? array->rig->index_of_id(*input.id) : std::nullopt)
      array->cameras.emplace(*index, frames);
  array_ = std::move(array);
  changed_.notify_all();
}

std::string CameraInputs::set_rig(std::shared_ptr<const Rig> rig) {
  std::lock_guard lock(mutex_);
  auto array = std::make_shared<Array>();
  array->rig_hash = rig->hash();
  array->extent = array_extent(*rig);
  array->colours = std::make_shared<const RigColourCorrections>(*rig);
  array->rig = std::move(rig);
  array_ = std::move(array);
  rebuild_array();
  std::vector<uint32_t> unknown, other_size;
  for (const auto& [frames, input] : inputs_) {
    if (!input.id) continue;
    const auto index = array_->rig->index_of_id(*input.id);
    const std::optional<CameraFrame> frame = frames->newest();
    if (!index)
      unknown.push_back(*input.id);
    else if (frame && !frame->fits(array_->rig->cameras[*index]))
      other_size.push_back(*input.id);
  }
  std::ranges::sort(unknown);
  std::ranges::sort(other_size);
  std::string text;
  if (!unknown.empty()) text = "it has no camera " + list_of_ids(unknown);
  if (!other_size.empty())
    text += (text.empty() ? "" : "; ") + ("it has another image size for camera " + list_of_ids(other_size));
  return text;
}

std::shared_ptr<const Camera> CameraInputs::camera(uint32_t id) const {
  const std::shared_ptr<const Array> array = this->array();
  const auto index = array->rig ? array->rig->index_of_id(id) : std::nullopt;
  return index ? std::shared_ptr<const Camera>(array->rig, &array->rig->cameras[*index]) : nullptr;
}

void CameraInputs::add(Frames frames) {
  std::lock_guard lock(mutex_);
  inputs_.try_emplace(std::move(frames));
}

bool CameraInputs::set_camera(const Frames& frames, uint32_t id) {
  std::lock_guard lock(mutex_);
  for (const auto& [other, input] : inputs_)
    if (input.id == id && other != frames) return false;
  inputs_[frames].id = id;
  rebuild_array();
  return true;
}

void CameraInputs::set_family(const Frames& frames, PixelFamily family) {
  std::lock_guard lock(mutex_);
  if (const auto input = inputs_.find(frames); input != inputs_.end()) input->second.family = family;
  changed_.notify_all();
}

void CameraInputs::give_up(const Frames& frames) {
  std::lock_guard lock(mutex_);
  if (const auto input = inputs_.find(frames); input != inputs_.end()) input->second.given_up = true;
  changed_.notify_all();
}

void CameraInputs::remove(const Frames& frames) {
  std::lock_guard lock(mutex_);
  if (inputs_.erase(frames) > 0) rebuild_array();
}

std::shared_ptr<const CameraInputs::Array> CameraInputs::array() const {
  std::lock_guard lock(mutex_);
  return array_;
}

std::shared_ptr<const CameraInputs::Array> CameraInputs::wait_for_all(const std::atomic<bool>& cancelled) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] {
    return !running_ || cancelled ||
           std::ranges::all_of(inputs_, [](const auto& entry) { return entry.second.is_known(); });
  });
  return array_;
}

void CameraInputs::set_running(bool running) {
  std::lock_guard lock(mutex_);
  running_ = running;
  changed_.notify_all();
}

void CameraInputs::wake() {
  std::lock_guard lock(mutex_);
  changed_.notify_all();
  for (const auto& [frames, input] : inputs_) frames->wake();
}

PixelFamily CameraInputs::choose_family() {
  std::lock_guard lock(mutex_);
  if (family_ != PixelFamily::kNone) return family_;
  PixelFamily chosen = PixelFamily::kNone;
  for (const auto& [frames, input] : inputs_)
    if (input.family != PixelFamily::kNone && chosen != PixelFamily::kRgb) chosen = input.family;
  return family_ = chosen;
}

}  // namespace lf
