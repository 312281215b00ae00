// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/guided_recording.h"

#include <cstdio>
#include <ctime>
#include <optional>

#include <nlohmann/json.hpp>
#include <sys/resource.h>
#include <unistd.h>

#include "base/text.h"
#include "calibration/light_detector.h"
#include "cameras/identify_server.h"
#include "cameras/mosaic.h"
#include "progress.h"

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

double now() { return static_cast<double>(g_get_monotonic_time()) / G_USEC_PER_SEC; }

constexpr double kLineEvery = 4;  // seconds: about what a light takes across the pictures

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

namespace {

// The mosaic of cameras that record, on a page of this machine: with the places of each picture that a moved light came
// to, and what the person before the cameras is told. It is served by the thread that makes it, in serve().
class RecordingPage {
 public:
  // `rig` and `watch` outlive this; `watch` is null where no light is moved. `port` 0: any. Throws Error where the port
  // is taken.
  RecordingPage(const Rig& rig, const LightWatch* watch, int port);

  // A frame, in the thread that brings it. Any threads.
  void see(const CameraFrame& frame);
  void say(const std::string& line) { told_ = line; }  // what the page says from now on
  void serve();                                        // answers those who have asked meanwhile
  std::string url() const { return server_.url(); }

 private:
  std::string state() const;

  const Rig& rig_;
  const LightWatch* watch_;
  Mosaic mosaic_;
  std::string told_ = "Cameras are being opened.";
  IdentifyServer server_;
};

RecordingPage::RecordingPage(const Rig& rig, const LightWatch* watch, int port)
    : rig_(rig),
      watch_(watch),
      mosaic_(rig),
      server_(port, {.jpeg = [this] { return mosaic_.jpeg(now()); }, .state = [this] { return state(); }, .swap = {}}) {}

void RecordingPage::see(const CameraFrame& frame) {
  mosaic_.see(rig_.cameras[frame.camera].id, gst_sample_get_buffer(frame.sample), gst_sample_get_caps(frame.sample),
              now());
}

void RecordingPage::serve() {
  while (g_main_context_iteration(nullptr, FALSE)) {
  }
}

std::string RecordingPage::state() const {
  nlohmann::json state = mosaic_.state(now(), [](uint32_t) { return std::string(); });
  state["told"] = told_;
  if (!watch_) return state.dump();
  state["places"] = {PicturePlaces::kColumns, PicturePlaces::kRows};
  for (nlohmann::json& camera : state["cameras"]) {
    const CameraIndex index = *rig_.index_of_id(camera["id"].get<uint32_t>());
    const PicturePlaces places = watch_->places(index);
    for (int row = 0; row < PicturePlaces::kRows; row++)
      for (int column = 0; column < PicturePlaces::kColumns; column++)
        camera["came"].push_back(places.has(column, row));
    camera["wanted"] = watch_->wanted(index);
  }
  return state.dump();
}

// Tells people what record_cameras() is doing, and when to begin with what is to be seen.
class RecordingProgress {
 public:
  // As record_cameras() calls it.
  void tell(double share) {
    if (share < 0) {
      if (!opening_) opening_.emplace("opening cameras", 3);
      return;
    }
    if (!recording_) {
      opening_.reset();
      std::printf("Recording now.\n");
      std::fflush(stdout);
      recording_.emplace("recording", 0);
    }
    recording_->reach(share);
  }
  // A line for the person before the cameras, above the bar.
  void say(const std::string& line) {
    if (recording_) recording_->finish();
    std::printf("%s\n", line.c_str());
    std::fflush(stdout);
  }

 private:
  std::optional<TimedProgress> opening_;
  std::optional<Progress> recording_;
};

}  // namespace

std::vector<Recorded> record_guided(std::shared_ptr<const Rig> rig, const std::string& path, const std::string& folder,
                                    RecordingOptions options, const RecordingGuide& guide,
                                    const std::function<bool()>& going) {
  std::optional<LightWatch> watch;
  if (guide.lights > 0) {
    watch.emplace(*rig, guide.lights);
    options.shown = [&](const CameraFrame& frame) { watch->see(frame); };
  }
  std::optional<RecordingPage> page;
  if (guide.page) {
    page.emplace(*rig, watch ? &*watch : nullptr, *guide.page);
    std::printf("The cameras are at %s\n", page->url().c_str());
    std::fflush(stdout);
    options.seen = [&](const CameraFrame& frame) { page->see(frame); };
  }
  RecordingProgress progress;
  const auto say = [&](const std::string& line) {
    progress.say(line);
    if (page) page->say(line);
  };
  bool begun = false;
  double next_line = kLineEvery;
  size_t said = 0;
  std::vector<Recorded> recorded = record_cameras(rig, path, folder, options, [&](double share) {
    progress.tell(share);
    if (page) page->serve();
    if (share < 0) return going();
    if (watch && !begun)
      say("Left and right are those of the pictures: face the cameras, and the left is on your right.");
    if (page && !watch && !begun) page->say("Recording now.");
    begun = true;
    if (watch && share < 1 && share * options.seconds >= next_line) {
      say(watch->told());
      next_line = share * options.seconds + kLineEvery;
    }
    const auto due = static_cast<size_t>(share * static_cast<double>(guide.prompts.size()));
    for (; said < guide.prompts.size() && said <= due; said++)
      say(std::to_string(said + 1) + "/" + std::to_string(guide.prompts.size()) + "  " + guide.prompts[said]);
    return going();
  });
  if (watch && begun) progress.say(watch->told());
  return recorded;
}

std::vector<std::string> board_prompts() {
  const std::string middle = "Amid the pictures, ", still = ". Keep it still for a moment.";
  return {middle + "flat towards the cameras, as near as all of it stays in the pictures" + still,
          middle + "its left side turned away, by 40 degrees" + still,
          middle + "its right side turned away" + still,
          middle + "its upper side turned away" + still,
          middle + "its lower side turned away" + still,
          "In the upper left corner of the pictures, turned a little away" + still,
          "In the upper right corner, turned a little the other way" + still,
          "In the lower right corner, turned a little away" + still,
          "In the lower left corner, turned a little the other way" + still,
          "Twice as far away, its left side turned away" + still,
          "Twice as far away, its upper side turned away" + still,
          "As near as before, turned about by 90 degrees, its right side turned away" + still};
}

}  // namespace lf::cameras
