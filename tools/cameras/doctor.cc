// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/doctor.h"

#include <algorithm>
#include <mutex>
#include <regex>

#include "base/error.h"
#include "base/percentiles.h"
#include "cameras/frame_picture.h"
#include "cameras/rig_cameras.h"
#include "rig/bin_description.h"

namespace lf::cameras {
namespace {

constexpr double kLookEvery = 0.5;  // seconds between pictures whose brightness is measured: JPEG is decoded for it
constexpr double kSettle = 1;       // seconds at the start in which cameras adjust, and clocks are found
constexpr int kUsualRate = 30;

// What is seen of one camera, under a lock of its own.
struct Watch {
  std::mutex mutex;
  std::vector<double> taken, delays;
  double first = NAN, looked = -INFINITY, began = NAN;
  uint64_t bytes = 0;
  size_t looked_at = 0, damaged = 0;
  std::string damage;
  double brightness = NAN, darkest = NAN, brightest = NAN;

  void see(const CameraFrame& frame) {
    const std::lock_guard lock(mutex);
    if (std::isnan(first)) first = frame.came;
    if (frame.came < first + kSettle) return;
    taken.push_back(frame.taken);
    delays.push_back(frame.came - frame.taken);
    if (frame.came - looked < kLookEvery) return;
    looked = frame.came;
    looked_at++;
    try {
      brightness = brightness_of(rgb_of(frame.sample));
    } catch (const Error& error) {
      damaged++;
      damage = error.what();
      return;
    }
    darkest = std::isnan(darkest) ? brightness : std::min(darkest, brightness);
    brightest = std::isnan(brightest) ? brightness : std::max(brightest, brightness);
  }
};

void read_controls(const GstStructure* stats, CameraExam& exam) {
  const GValue* controls = gst_structure_get_value(stats, "controls");
  if (!controls || !GST_VALUE_HOLDS_STRUCTURE(controls)) return;
  const GstStructure* all = gst_value_get_structure(controls);
  for (int i = 0; i < gst_structure_n_fields(all); i++) {
    const char* name = gst_structure_nth_field_name(all, static_cast<guint>(i));
    double number = 0;
    if (gst_structure_get_double(all, name, &number))
      exam.controls[name] = number;
    else if (g_strcmp0(gst_structure_get_string(all, name), "auto") == 0)
      exam.controls[name] = std::nullopt;
    else
      exam.not_taken.push_back(name);
  }
}

CameraExam result_of(const RigCameras& cameras, CameraIndex index, Watch& watch, uint64_t bytes, double duration) {
  CameraExam exam{.camera = index, .problem = cameras.problem(index), .format = cameras.format(index)};
  GstStructure* stats = cameras.stats(index);
  if (const char* stamps = gst_structure_get_string(stats, "capture-time")) exam.stamps = stamps;
  guint64 dropped = 0;
  gst_structure_get_uint64(stats, "dropped", &dropped);
  exam.left_undecoded = dropped;
  read_controls(stats, exam);
  gst_structure_free(stats);
  const std::lock_guard lock(watch.mutex);
  exam.times = measure_frame_times(watch.taken);
  exam.delay = watch.delays.empty() ? 0 : median(watch.delays);
  exam.bytes_per_second = static_cast<double>(cameras.source_bytes(index) - bytes) / duration;
  exam.looked_at = watch.looked_at;
  exam.damaged = watch.damaged;
  exam.damage = watch.damage;
  exam.brightness = watch.brightness;
  exam.darkest = watch.darkest;
  exam.brightest = watch.brightest;
  return exam;
}

// Of the cameras by the name of their link; those without one are left out.
std::vector<LinkLoad> loads(const std::vector<CameraExam>& cameras, const auto& need) {
  std::vector<LinkLoad> all;
  for (const CameraExam& camera : cameras) {
    const Link& link = camera.attachment.link;
    if (link.kind == Link::Kind::kNone) continue;
    auto load = std::find_if(all.begin(), all.end(), [&](const LinkLoad& l) { return l.link.name == link.name; });
    if (load == all.end()) load = all.insert(all.end(), LinkLoad{.link = link});
    load->cameras.push_back(camera.camera);
    double bytes = 0, pixels = 0;
    bool raw = false;
    need(camera, bytes, pixels, raw);
    load->needed += bytes;
    load->pixels += pixels;
    load->most_needed = std::max(load->most_needed, bytes);
    load->raw |= raw;
  }
  return all;
}

bool is_raw_format(const std::string& format) {
  return !format.empty() && format != "JPEG" && format != "H264" && format != "H265" &&
         format.find("RTP") == std::string::npos;
}

}  // namespace

int Exam::errors() const {
  return static_cast<int>(std::count_if(findings.begin(), findings.end(), [](const Finding& f) { return f.error; }));
}

std::vector<LinkLoad> planned_loads(const Rig& rig, const std::vector<CameraExam>& cameras, int fps) {
  return loads(cameras, [&](const CameraExam& exam, double& bytes, double& pixels, bool& raw) {
    const Camera& camera = rig.cameras[exam.camera];
    double rate = fps > 0 ? fps : kUsualRate;
    std::smatch match;
    if (is_bin_description(camera.source) &&
        std::regex_search(camera.source, match, std::regex("framerate=(?:\\(fraction\\))?(\\d+)/(\\d+)")))
      rate = std::stod(match[1]) / std::max(1.0, std::stod(match[2]));
    const bool gige = camera.source.find("aravissrc") != std::string::npos;
    raw = gige || (camera.source.find("video/x-raw") != std::string::npos &&
                   camera.source.find("image/jpeg") == std::string::npos);
    pixels = rate * camera.width * camera.height;
    bytes = pixels * (gige ? 1 : raw ? 2 : kJpegBytesPerPixel);
  });
}

std::vector<LinkLoad> measured_loads(const Rig& rig, const std::vector<CameraExam>& cameras) {
  return loads(cameras, [&](const CameraExam& exam, double& bytes, double& pixels, bool& raw) {
    const Camera& camera = rig.cameras[exam.camera];
    bytes = exam.bytes_per_second;
    pixels = exam.times.rate() * camera.width * camera.height;
    raw = is_raw_format(exam.format);
  });
}

Exam examine(std::shared_ptr<const Rig> rig, const std::string& path, const ExamOptions& options) {
  Exam exam;
  for (CameraIndex i = 0; i < rig->cameras.size(); i++)
    exam.cameras.push_back({.camera = i, .attachment = find_attachment(*rig, rig->cameras[i])});
  exam.planned = planned_loads(*rig, exam.cameras, options.fps);
  if (options.on_plan) options.on_plan(exam.planned);
  std::vector<Watch> watches(rig->cameras.size());
  // JPEG stays JPEG, as in the light field: otherwise a large array would be measured by what this machine decodes.
  RigCameras cameras(rig, path, {.decode = false, .trusted = options.trusted, .fps = options.fps},
                     [&](const CameraFrame& frame) { watches[frame.camera].see(frame); });
  cameras.start();
  cameras.wait(options.patience, [&] {
    return std::all_of(cameras.cameras().begin(), cameras.cameras().end(),
                       [&](CameraIndex i) { return cameras.frames(i) > 0 || !cameras.problem(i).empty(); });
  });
  const double settled = cameras.now() + kSettle;
  const auto progress = [&] {
    const double left = settled + options.seconds - cameras.now();
    if (options.on_progress) options.on_progress(1 - left / (kSettle + options.seconds));
    return false;
  };
  cameras.wait(kSettle, progress);
  std::vector<uint64_t> bytes;
  for (const CameraIndex i : cameras.cameras()) bytes.push_back(cameras.source_bytes(i));
  const double begin = cameras.now();
  cameras.wait(options.seconds, progress);
  const double duration = cameras.now() - begin;
  for (CameraExam& camera : exam.cameras) {
    Attachment attachment = std::move(camera.attachment);
    camera = result_of(cameras, camera.camera, watches[camera.camera], bytes[camera.camera], duration);
    camera.attachment = std::move(attachment);
  }
  cameras.stop();
  std::vector<FrameTimes> times;
  for (const CameraExam& camera : exam.cameras) times.push_back(camera.times);
  exam.skew = measure_skew(times);
  for (size_t i = 0; i < exam.cameras.size(); i++) exam.cameras[i].phase = exam.skew.phase[i];
  exam.measured = measured_loads(*rig, exam.cameras);
  exam.findings = find_trouble(*rig, exam);
  return exam;
}

}  // namespace lf::cameras
