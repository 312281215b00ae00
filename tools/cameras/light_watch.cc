// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/light_watch.h"

#include <sys/resource.h>
#include <unistd.h>

#include <ctime>
#include <optional>

#include "base/error.h"
#include "calibration/light_detector.h"
#include "cameras/frame_picture.h"

namespace lf::cameras {
namespace {

constexpr double kEvery = 0.2;    // seconds between two looks at a camera: a light goes 0.1 m meanwhile
constexpr int kLeastWidth = 240;  // pixels of the small picture, unless the camera has fewer
constexpr int kGivesWay = 10;     // of the thread, in nice(1)'s steps

int smaller_of(const Camera& camera) {
  int smaller = 8;
  while (smaller > 1 && camera.width / smaller < kLeastWidth) smaller /= 2;
  return smaller;
}

double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

struct LightWatch::One {
  int smaller = 1;
  std::atomic<double> next = 0;  // when another frame is of use
  // Written by the camera's thread while `full` is false, read by the watching one while it is true.
  std::atomic<bool> full = false;
  double taken = 0;
  std::vector<uint8_t> jpeg;
  GreyPicture grey;
  std::optional<LightDetector> detector;
  int width = 0, height = 0;  // of its pictures
};

LightWatch::LightWatch(const Rig& rig, int lights) : rig_(rig), coverage_(rig, lights) {
  for (const Camera& camera : rig.cameras) all_.emplace_back(std::make_unique<One>())->smaller = smaller_of(camera);
  thread_ = std::thread([this] { work(); });
}

LightWatch::~LightWatch() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  come_.notify_one();
  thread_.join();
}

void LightWatch::see(const CameraFrame& frame) {
  One& one = *all_[frame.camera];
  if (one.full || frame.came < one.next) return;
  one.next = frame.came + kEvery;
  one.taken = frame.taken;
  try {
    // Decoding is left to the thread that looks.
    one.jpeg.clear();
    if (is_jpeg(frame.sample))
      one.jpeg = bytes_of(frame.sample);
    else
      one.grey = small_grey_of(frame.sample, one.smaller);
  } catch (const Error&) {
    return;  // a damaged frame; the next one may be whole
  }
  one.full = true;
  const std::lock_guard lock(mutex_);
  waiting_.push_back(frame.camera);
  come_.notify_one();
}

void LightWatch::work() {
  // Of this thread alone, as Linux has it; where that is not so the process has more to give way to, and no harm is
  // done.
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kGivesWay);
  std::unique_lock lock(mutex_);
  while (true) {
    come_.wait(lock, [&] { return ending_ || !waiting_.empty(); });
    if (ending_) return;
    const CameraIndex camera = waiting_.front();
    waiting_.erase(waiting_.begin());
    lock.unlock();
    look(camera);
    lock.lock();
  }
}

void LightWatch::look(CameraIndex camera) {
  One& one = *all_[camera];
  const double begun = processor_seconds();
  std::vector<Sight> sights;
  try {
    if (!one.jpeg.empty()) one.grey = decode_grey_jpeg(one.jpeg, one.smaller);
    if (!one.detector) one.detector.emplace(one.width = one.grey.width, one.height = one.grey.height);
    if (one.width == one.grey.width && one.height == one.grey.height)
      sights = one.detector->look(one.grey.samples.data(), one.grey.width);
  } catch (const Error&) {
    // What can't be decoded, or is of no size to be searched, shows no light.
  }
  for (Sight& sight : sights) sight.pixel = static_cast<double>(one.smaller) * (sight.pixel + 0.5) - 0.5;
  {
    const std::lock_guard lock(mutex_);
    coverage_.look(camera, one.taken, sights);
  }
  one.full = false;
  busy_ = busy_ + processor_seconds() - begun;
  looks_++;
}

std::string LightWatch::told() const {
  const std::lock_guard lock(mutex_);
  return coverage_.told();
}

PicturePlaces LightWatch::places(CameraIndex camera) const {
  const std::lock_guard lock(mutex_);
  return coverage_.places(camera);
}

std::string LightWatch::wanted(CameraIndex camera) const {
  const std::lock_guard lock(mutex_);
  return coverage_.wanted(camera);
}

}  // namespace lf::cameras
