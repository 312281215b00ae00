// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/camera_frames.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace lf {

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

// A frame is passed when the one after it is not later than what is wanted.
void CameraFrames::drop_passed() {
  while (frames_.size() > 1 && frames_[1].time <= wanted_) drop_oldest();
}

// "The newest" must not make a file run through: there it is the frame that stands now. Many views ask for one moment:
// the camera's thread is woken where that makes room for a frame, and not by each of them.
void CameraFrames::want(uint64_t time) {
  if (time != kNoTime) wanted_ = time;
  if (live_) return;
  drop_passed();
  if (frames_.size() < kFileFrames) room_.notify_all();
}

void CameraFrames::advance(uint64_t time) {
  const Lock lock(*this);
  want(time);
}

CameraFrames::Pushed CameraFrames::push(CameraFrame frame) {
  const uint64_t time = frame.time;
  return push_at(time, std::move(frame));
}

CameraFrames::Pushed CameraFrames::push_damaged(uint64_t time) { return push_at(time, std::nullopt); }

// Two frames before the earliest time looked for are kept, too: one may be the nearest, and an answer may be a frame
// later than those before it were.
bool CameraFrames::has_too_many() const {
  if (frames_.size() <= kLiveFrames) return false;
  return frames_.size() > most_frames() || frames_.back().time - frames_[2].time >= reach_;
}

// Raw frames have about 1.5 bytes a pixel, compressed ones a fifth of that.
size_t CameraFrames::most_frames() const {
  const CameraPicture* picture = frames_.back().frame.picture.get();
  if (!picture) return kMostLiveFrames;
  const size_t pixels = static_cast<size_t>(picture->width()) * static_cast<size_t>(picture->height());
  const size_t bytes = std::max<size_t>(picture->is_compressed() ? pixels * 3 / 10 : pixels * 3 / 2, 1);
  return std::clamp(kMostLiveBytes / bytes, kLiveFrames, kMostLiveFrames);
}

CameraFrames::Pushed CameraFrames::push_at(uint64_t time, std::optional<CameraFrame> frame) {
  Lock lock(*this);
  if (!live_)
    room_.wait(lock, [this] {
      drop_passed();
      return mode_ == Mode::kStopped || flushing_ || mode_ == Mode::kFinished || frames_.size() < kFileFrames;
    });
  if (mode_ == Mode::kStopped || flushing_) return Pushed::kStopped;
  if (mode_ == Mode::kFinished && !live_) return Pushed::kEnded;  // who films now may be asked again
  // Time may jump back (a stream started again without a flush): what is held is then of another time line.
  if (!frames_.empty() && frames_.back().time > time) earliest_ = INT64_MAX;
  while (!frames_.empty() && frames_.back().time > time) drop_oldest();
  if (!frames_.empty()) last_period_ = time - frames_.back().time;
  lost_ = false;
  if (!frame) frame = frames_.empty() ? before_ : frames_.back().frame;
  frame->behind = behind_;
  frames_.push_back({time, std::move(*frame)});
  while (has_too_many()) drop_oldest();
  arrived_.notify_all();
  return Pushed::kTaken;
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
  if (!result) result = before_;  // it is no longer held: what was before it is the best there is
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
  wanted_ = 0;  // what comes may be from before
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

// As much later than the newest frame as the frame after it would have been.
bool CameraFrames::is_beyond_last(uint64_t time) const {
  return time == kNoTime || time >= frames_.back().time + std::max<uint64_t>(last_period_, 1);
}

// Several viewers may look back differently far: the farthest counts, and is forgotten by and by.
void CameraFrames::look_back(uint64_t time) {
  const uint64_t newest = frames_.back().time;
  const uint64_t reach = time < newest ? newest - time : 0;
  reach_ = std::max(reach > kLongestReach ? 0 : reach, reach_ - reach_ / 64);
}

void CameraFrames::wake() {
  std::lock_guard lock(mutex_);
  arrived_.notify_all();
}

std::optional<CameraFrame> CameraFrames::find(uint64_t time, bool wait_for_first, const std::atomic<bool>* cancelled) {
  Lock lock(*this);
  want(time);
  arrived_.wait(lock, [&] {
    if (!live_) drop_passed();
    return mode_ == Mode::kStopped || (cancelled && *cancelled) || !must_wait(time, wait_for_first);
  });
  if (mode_ == Mode::kStopped || frames_.empty() || (lost_ && is_beyond_last(time))) return std::nullopt;
  look_back(time);
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

// The median is not that of a camera that was away.
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

}  // namespace lf
