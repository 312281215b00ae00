// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <map>

#include "base/number_text.h"
#include "cameras/doctor.h"
#include "cameras/rig_cameras.h"
#include "rig/bin_description.h"
#include "rig/location_text.h"

namespace lf::cameras {
namespace {

constexpr double kManyMissing = 0.01;       // of the frames
constexpr double kOtherRate = 0.02;         // off the array's
constexpr double kUnevenStamps = 0.1;       // of the time between frames
constexpr double kMovingBrightness = 0.03;  // while nothing but the scene may have moved
constexpr double kBlack = 10, kWhite = 245;

bool contains(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

class Findings {
 public:
  explicit Findings(const Rig& rig) : rig_(rig) {}
  std::vector<Finding> take() {
    std::stable_partition(all_.begin(), all_.end(), [](const Finding& f) { return f.error; });
    return std::move(all_);
  }
  void error(const CameraExam& camera, const std::string& what, const std::string& remedy) {
    all_.push_back({true, place(camera), what, remedy});
  }
  void warning(const CameraExam& camera, const std::string& what, const std::string& remedy) {
    all_.push_back({false, place(camera), what, remedy});
  }
  void add(const Finding& finding) { all_.push_back(finding); }

 private:
  std::string place(const CameraExam& camera) const { return "camera " + name_of(rig_.cameras[camera.camera]); }
  const Rig& rig_;
  std::vector<Finding> all_;
};

// The light field's own words, without the camera's name before them.
std::string without_place(const Rig& rig, const CameraExam& exam) {
  const std::string name = "camera " + name_of(rig.cameras[exam.camera]) + ": ";
  const size_t begin = exam.problem.find(name);
  return begin == std::string::npos ? exam.problem : exam.problem.substr(begin + name.size());
}

void look_at_failure(const Rig& rig, const CameraExam& exam, Findings& findings) {
  findings.error(exam, without_place(rig, exam), remedy_of(rig.cameras[exam.camera], exam.problem));
}

void look_at_frames(const CameraExam& exam, double usual_rate, Findings& findings) {
  const FrameTimes& times = exam.times;
  if (times.frames < 3) {
    findings.error(exam, "gives no frames",
                   "see whether the picture comes in another program, and unplug it for a moment");
    return;
  }
  const double missing = static_cast<double>(times.missing) / static_cast<double>(times.missing + times.frames);
  if (missing > kManyMissing) {
    std::string remedy = "ask for fewer frames";
    if (exam.left_undecoded > 0)
      remedy = "this machine can't decode them all: take MJPEG from it, fewer frames, or cameras on several machines";
    else if (exam.attachment.link.kind == Link::Kind::kUsb)
      remedy = "take MJPEG from it, fewer frames, or a port of another controller; short cables, no hub without power";
    else if (exam.attachment.link.kind == Link::Kind::kNetwork)
      remedy =
          "a wired network, a packet delay where the camera has one, RTSP over TCP (rtspt://), or a lower bit rate";
    findings.warning(exam,
                     format_text("%.0f %% of its frames are missing (%zu of %zu)", 100 * missing, times.missing,
                                 times.missing + times.frames),
                     remedy);
  }
  if (std::abs(times.rate() / usual_rate - 1) > kOtherRate)
    findings.warning(exam, format_text("gives %.2f frames/s, most others %.2f", times.rate(), usual_rate),
                     "ask all for one rate (framerate= in their sources); webcams give fewer frames in the dark: more "
                     "light, or a set exposure (lf-rig lock)");
  if (times.backwards > 0)
    findings.warning(exam, format_text("%zu frames have stamps that are not after the one before", times.backwards),
                     "its clock is not to be trusted: restart the camera, and look for newer firmware");
  if (times.jitter > kUnevenStamps * times.period)
    findings.warning(exam, format_text("its stamps are uneven by %.1f ms", 1e3 * times.jitter),
                     exam.stamps == "arrival"
                         ? "it tells no times of its own, so that the network's delays count: have "
                           "it send RTCP sender reports, with its clock set by NTP"
                         : "moving things will be seen double: fewer cameras on its link, or "
                           "another camera");
  else if (exam.stamps == "arrival")
    findings.warning(exam, "is dated by when its packets arrive, not by when it took them",
                     "have it send RTCP sender reports and set its clock by NTP; or measure time_offset");
}

void look_at_picture(const CameraExam& exam, Findings& findings) {
  const std::string remedy =
      "look at its cable and power, take fewer or smaller frames; or have it code its pictures in another way";
  if (exam.damaged > 0 && exam.damaged == exam.looked_at)
    return findings.error(exam, "its pictures can't be decoded: " + exam.damage, remedy);
  if (exam.damaged > 0)
    findings.warning(exam, format_text("%zu of %zu pictures are damaged: ", exam.damaged, exam.looked_at) + exam.damage,
                     remedy);
  if (exam.brightest < kBlack)
    findings.error(exam, format_text("is black (brightness %.0f of 255)", exam.brightest),
                   "take the lid off, or more exposure");
  else if (exam.darkest > kWhite)
    findings.error(exam, format_text("is white (brightness %.0f of 255)", exam.darkest), "less exposure");
}

void look_at_controls(const CameraExam& exam, bool brightness_moves, Findings& findings) {
  std::string automatic;
  for (const auto& [name, value] : exam.controls)
    if (!value) automatic += (automatic.empty() ? "" : ", ") + name;
  if (!automatic.empty())
    findings.warning(exam, "automatic: " + automatic,
                     "lf-rig lock sets all cameras alike, so that none goes its own way");
  else if (brightness_moves)
    findings.warning(exam,
                     format_text("its brightness moves, %.0f to %.0f of 255: exposure may be automatic", exam.darkest,
                                 exam.brightest),
                     "lf-rig lock sets all cameras alike; lamps that flicker move it, too (controls: mains_frequency)");
  for (const std::string& name : exam.not_taken)
    findings.warning(exam, "its source does not take the control " + name,
                     "set it in the camera's own menu or web page, and take it out of the rig");
}

void look_for_shared_devices(const Rig& rig, const Exam& exam, Findings& findings) {
  std::map<std::string, const CameraExam*> first;
  for (const CameraExam& camera : exam.cameras) {
    if (camera.attachment.device.empty()) continue;
    const auto [other, is_new] = first.emplace(camera.attachment.device, &camera);
    if (!is_new)
      findings.error(camera,
                     "has the device of camera " + name_of(rig.cameras[other->second->camera]) + ", " +
                         location_text(camera.attachment.device),
                     "give each its own source (lf-rig new --devices lists what is plugged in)");
  }
}

// As measured; and as planned where that is certain, as a link that is too small passes less than it should.
void look_at_links(const Exam& exam, Findings& findings) {
  for (const LinkLoad& planned : exam.planned) {
    const auto measured = std::find_if(exam.measured.begin(), exam.measured.end(),
                                       [&](const LinkLoad& load) { return load.link.name == planned.link.name; });
    std::vector<LinkAdvice> all;
    if (planned.raw) all = advise(planned);
    if (all.empty() && measured != exam.measured.end()) all = advise(*measured);
    for (const LinkAdvice& advice : all) findings.add({advice.too_much, "links", advice.what, advice.remedy});
  }
}

double usual_rate(const Exam& exam) {
  std::vector<double> rates;
  for (const CameraExam& camera : exam.cameras)
    if (camera.times.period > 0) rates.push_back(camera.times.rate());
  if (rates.empty()) return 0;
  std::nth_element(rates.begin(), rates.begin() + static_cast<ptrdiff_t>(rates.size() / 2), rates.end());
  return rates[rates.size() / 2];
}

bool brightness_moves(const CameraExam& exam) {
  return exam.brightest - exam.darkest > kMovingBrightness * exam.brightest && exam.brightest - exam.darkest > 2;
}

// Not of what is plugged in or in the network.
bool is_of_file(const Camera& camera) {
  const std::string& source = camera.source;
  if (source.empty()) return !camera.image.empty();
  if (is_bin_description(source) || source.starts_with("/dev/")) return false;
  return !contains(source, "://") || source.starts_with("file://");
}

}  // namespace

std::string remedy_of(const Camera& camera, const std::string& problem) {
  if (contains(problem, "--trust-rig"))
    return "run it again with --trust-rig if you know who wrote the rig file, and why it needs this element";
  if (contains(problem, "the rig says"))
    return "write the true width and height into the rig (lens and poses then need another calibration), or set the "
           "camera to the rig's";
  if (contains(problem, "gives no pictures of")) return "choose a size that the camera has, and write it into the rig";
  if (contains(problem, "busy") || contains(problem, "in use"))
    return "another program has it: close that one (fuser -v /dev/video* names it)";
  const bool is_missing =
      contains(problem, "no such file") || contains(problem, "Cannot identify") || contains(problem, "not found");
  const bool lacks_elements = contains(problem, "is not installed") || contains(problem, "no element");
  if (is_of_file(camera) && is_missing)
    return "is the path right? One that does not begin with / is relative to the rig file";
  if (is_of_file(camera) && !lacks_elements)
    return "is the file whole? See whether it plays: "
           "gst-launch-1.0 filesrc location=FILE ! decodebin ! videoconvert ! autovideosink";
  if (is_missing) return "nothing is there under this name: plug it in, or lf-rig new --devices lists what is";
  if (contains(problem, "nauthorized") || contains(problem, "401"))
    return "it wants a user and a password: rtsp://USER:PASSWORD@HOST/...";
  if (contains(problem, "connect") || contains(problem, "resolve"))
    return "nobody answers at this address: see whether the camera is on and in this network (ping its host)";
  if (lacks_elements) return "install the GStreamer plugin that has the element";
  return "see whether it is plugged in and switched on, and whether its source in the rig is right";
}

std::vector<Finding> find_trouble(const Rig& rig, const Exam& exam) {
  Findings findings(rig);
  const double rate = usual_rate(exam);
  // What moves in front of all cameras is the scene, or its light.
  const auto moving = static_cast<size_t>(std::count_if(exam.cameras.begin(), exam.cameras.end(), brightness_moves));
  const bool scene_moves = exam.cameras.size() > 2 && 2 * moving > exam.cameras.size();
  look_for_shared_devices(rig, exam, findings);
  for (const CameraExam& camera : exam.cameras) {
    if (!camera.problem.empty()) {
      look_at_failure(rig, camera, findings);
      continue;
    }
    look_at_frames(camera, rate, findings);
    look_at_picture(camera, findings);
    look_at_controls(camera, brightness_moves(camera) && !scene_moves, findings);
  }
  if (scene_moves)
    findings.add({false, "the array",
                  std::to_string(moving) + " of " + std::to_string(exam.cameras.size()) +
                      " cameras change their brightness: exposures may be automatic",
                  "if the light does not change: lf-rig lock"});
  look_at_links(exam, findings);
  return findings.take();
}

}  // namespace lf::cameras
