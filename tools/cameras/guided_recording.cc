// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/guided_recording.h"

#include <cstdio>
#include <ctime>
#include <optional>

#include <sys/resource.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "base/text.h"
#include "calibration/light_detector.h"
#include "cameras/identify_server.h"
#include "cameras/mosaic.h"
#include "progress.h"
#include "terminal.h"

namespace lf::cameras {
namespace {

constexpr double kEvery = 0.2;    // seconds between examined frames of a camera; meanwhile, a light moves about 0.1 m
constexpr int kMinWidth = 240;    // minimum width of downscaled frames, pixels
constexpr int kNiceIncrement = 10;  // nice(1) increment of the detection thread

int smaller_of(const Camera& camera) {
  int smaller = 8;
  while (smaller > 1 && camera.width / smaller < kMinWidth) smaller /= 2;
  return smaller;
}

double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double now() { return static_cast<double>(g_get_monotonic_time()) / G_USEC_PER_SEC; }

constexpr double kLineEvery = 4;  // seconds; a light needs about this long to cross the image

}  // namespace

struct LightTracker::CameraState {
  int smaller = 1;
  std::atomic<double> next = 0;
  // The camera's thread writes these members while `full` is false, and the detection thread reads the members while
  // `full` is true.
  std::atomic<bool> full = false;
  double taken = 0;
  std::vector<uint8_t> jpeg;
  GreyImage grey;
  std::optional<LightDetector> detector;
  int width = 0, height = 0;
};

LightTracker::LightTracker(const Rig& rig, int lights) : rig_(rig), coverage_(rig, lights) {
  for (const Camera& camera : rig.cameras)
    all_.emplace_back(std::make_unique<CameraState>())->smaller = smaller_of(camera);
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}
LightTracker::~LightTracker() = default;

void LightTracker::see(const CameraFrame& frame) {
  CameraState& one = *all_[frame.camera];
  if (one.full || frame.arrival_time < one.next) return;
  one.next = frame.arrival_time + kEvery;
  one.taken = frame.taken;
  try {
    one.jpeg.clear();
    if (is_jpeg(frame.sample))
      one.jpeg = bytes_of(frame.sample);
    else
      one.grey = small_grey_of(frame.sample, one.smaller);
  } catch (const Error&) {
    return;
  }
  one.full = true;
  const std::lock_guard lock(mutex_);
  waiting_.push_back(frame.camera);
  frame_arrived_.notify_one();
}

void LightTracker::work(const std::stop_token& stop) {
  // On Linux, this changes the priority of the calling thread only.
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNiceIncrement);
  std::unique_lock lock(mutex_);
  while (frame_arrived_.wait(lock, stop, [&] { return !waiting_.empty(); }) && !stop.stop_requested()) {
    const CameraIndex camera = waiting_.front();
    waiting_.erase(waiting_.begin());
    lock.unlock();
    process_frame(camera);
    lock.lock();
  }
}

void LightTracker::process_frame(CameraIndex camera) {
  CameraState& one = *all_[camera];
  const double begun = processor_seconds();
  std::vector<LightDetection> sights;
  try {
    if (!one.jpeg.empty()) one.grey = decode_jpeg_luma(one.jpeg, one.smaller);
    if (!one.detector) one.detector.emplace(one.width = one.grey.width, one.height = one.grey.height);
    if (one.width == one.grey.width && one.height == one.grey.height)
      sights = one.detector->detect(one.grey.samples.data(), one.grey.width);
  } catch (const Error&) {
  }
  for (LightDetection& sight : sights) sight.pixel = static_cast<double>(one.smaller) * (sight.pixel + 0.5) - 0.5;
  {
    const std::lock_guard lock(mutex_);
    coverage_.add_frame(camera, one.taken, sights);
  }
  one.full = false;
  busy_ = busy_ + processor_seconds() - begun;
  frames_processed_++;
}

std::string LightTracker::summary() const {
  const std::lock_guard lock(mutex_);
  return coverage_.summary();
}

CoverageGrid LightTracker::places(CameraIndex camera) const {
  const std::lock_guard lock(mutex_);
  return coverage_.places(camera);
}

std::string LightTracker::wanted(CameraIndex camera) const {
  const std::lock_guard lock(mutex_);
  return coverage_.wanted(camera);
}

namespace {

// The local web page of a recording: live images, instructions, and the image regions that a moved light has not
// reached yet. serve() must be called on the thread that creates the page.
class RecordingPage {
 public:
  // `rig` and `watch` must outlive the page; `watch` is null if no light is moved. If `port` is 0, the system selects a
  // port. Throws Error if the port is in use.
  RecordingPage(const Rig& rig, const LightTracker* watch, int port)
      : rig_(rig),
        watch_(watch),
        mosaic_(rig),
        server_(port,
                {.jpeg = [this] { return mosaic_.jpeg(now()); }, .state = [this] { return state(); }, .swap = {}}) {}

  // Called on the thread that delivers the frame. Thread-safe.
  void see(const CameraFrame& frame) {
    mosaic_.see(rig_.cameras[frame.camera].id, gst_sample_get_buffer(frame.sample), gst_sample_get_caps(frame.sample),
                now());
  }
  void say(const std::string& line) { message_ = line; }
  void serve() {
    while (g_main_context_iteration(nullptr, FALSE)) {
    }
  }
  std::string url() const { return server_.url(); }

 private:
  std::string state() const {
    nlohmann::json state = mosaic_.state(now(), [](uint32_t) { return std::string(); });
    state["told"] = message_;
    if (!watch_) return state.dump();
    state["places"] = {CoverageGrid::kColumns, CoverageGrid::kRows};
    for (nlohmann::json& camera : state["cameras"]) {
      const CameraIndex index = *rig_.index_of_id(camera["id"].get<uint32_t>());
      const CoverageGrid places = watch_->places(index);
      for (int row = 0; row < CoverageGrid::kRows; row++)
        for (int column = 0; column < CoverageGrid::kColumns; column++)
          camera["came"].push_back(places.has(column, row));
      camera["wanted"] = watch_->wanted(index);
    }
    return state.dump();
  }

  const Rig& rig_;
  const LightTracker* watch_;
  Mosaic mosaic_;
  std::string message_ = "Cameras are being opened.";
  IdentifyServer server_;
};

class RecordingProgress {
 public:
  void tell(double share) {
    if (share < 0) {
      if (!opening_) opening_.emplace("opening cameras", 3);
      return;
    }
    if (!recording_) {
      opening_.reset();
      terminal::print("Recording now.\n");
      std::fflush(stdout);
      recording_.emplace("recording", 0);
    }
    recording_->reach(share);
  }
  void say(const std::string& line) {
    if (recording_) recording_->finish();
    terminal::print("%s\n", line.c_str());
    std::fflush(stdout);
  }

 private:
  std::optional<TimedProgress> opening_;
  std::optional<Progress> recording_;
};

}  // namespace

std::vector<RecordedCamera> record_guided(std::shared_ptr<const Rig> rig, const std::string& path,
                                          const std::string& folder, RecordingOptions options,
                                          const RecordingGuide& guide, const std::function<bool()>& going) {
  std::optional<LightTracker> watch;
  if (guide.lights > 0) {
    watch.emplace(*rig, guide.lights);
    options.shown = [&](const CameraFrame& frame) { watch->see(frame); };
  }
  std::optional<RecordingPage> page;
  if (guide.page) {
    page.emplace(*rig, watch ? &*watch : nullptr, *guide.page);
    terminal::print("The cameras are at %s\n", page->url().c_str());
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
  std::vector<RecordedCamera> recorded = record_cameras(rig, path, folder, options, [&](double share) {
    progress.tell(share);
    if (page) page->serve();
    if (share < 0) return going();
    if (watch && !begun)
      say("Left and right refer to the images. When you face the cameras, left in the images is on your right.");
    if (page && !watch && !begun) page->say("Recording now.");
    begun = true;
    if (watch && share < 1 && share * options.seconds >= next_line) {
      say(watch->summary());
      next_line = share * options.seconds + kLineEvery;
    }
    const auto due = static_cast<size_t>(share * static_cast<double>(guide.prompts.size()));
    for (; said < guide.prompts.size() && said <= due; said++)
      say(std::to_string(said + 1) + "/" + std::to_string(guide.prompts.size()) + "  " + guide.prompts[said]);
    return going();
  });
  if (watch && begun) progress.say(watch->summary());
  return recorded;
}

std::vector<std::string> board_prompts() {
  const std::string middle = "In the middle of the images, ", still = ". Keep it still for a moment.";
  return {middle + "facing the cameras, as close as possible but fully visible" + still,
          middle + "its left side turned away, by 40 degrees" + still,
          middle + "its right side turned away" + still,
          middle + "its upper side turned away" + still,
          middle + "its lower side turned away" + still,
          "In the upper left corner of the images, turned slightly away" + still,
          "In the upper right corner, turned slightly the other way" + still,
          "In the lower right corner, turned slightly away" + still,
          "In the lower left corner, turned slightly the other way" + still,
          "Twice as far away, its left side turned away" + still,
          "Twice as far away, its upper side turned away" + still,
          "At the first distance, rotated by 90 degrees, its right side turned away" + still};
}

}  // namespace lf::cameras
