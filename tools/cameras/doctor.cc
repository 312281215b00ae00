// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/doctor.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <regex>
#include <set>

#include <nlohmann/json.hpp>

#include "base/maths.h"
#include "base/text.h"
#include "cameras/rig_cameras.h"
#include "rig/source_security.h"

namespace lf::cameras {
namespace {

constexpr double kLookEvery = 0.5;  // seconds between brightness measurements, which are rare because they decode JPEG
// seconds at the start that do not count, because controls and clocks still converge
constexpr double kSettle = 1;
constexpr int kUsualRate = 30;

struct FrameMonitor {
  std::mutex mutex;
  std::vector<double> taken, delays;
  double first = NAN, looked = -INFINITY, began = NAN;
  uint64_t bytes = 0;
  size_t decoded_frames = 0, damaged = 0;
  std::string damage;
  double brightness = NAN, darkest = NAN, brightest = NAN;

  void see(const CameraFrame& frame) {
    const std::lock_guard lock(mutex);
    if (std::isnan(first)) first = frame.arrival_time;
    if (frame.arrival_time < first + kSettle) return;
    taken.push_back(frame.taken);
    delays.push_back(frame.arrival_time - frame.taken);
    if (frame.arrival_time - looked < kLookEvery) return;
    looked = frame.arrival_time;
    decoded_frames++;
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

void read_controls(const GstStructure* stats, CameraReport& exam) {
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
      exam.unsupported_controls.push_back(name);
  }
}

CameraReport result_of(const RigCameras& cameras, CameraIndex index, FrameMonitor& watch, uint64_t bytes,
                       double duration) {
  CameraReport exam{.camera = index, .problem = cameras.problem(index), .format = cameras.format(index)};
  g_autoptr(GstStructure) stats = cameras.stats(index);
  if (const char* stamps = gst_structure_get_string(stats, "capture-time")) exam.stamps = stamps;
  guint64 dropped = 0;
  gst_structure_get_uint64(stats, "dropped", &dropped);
  exam.left_undecoded = dropped;
  read_controls(stats, exam);
  const std::lock_guard lock(watch.mutex);
  exam.times = frame_time_stats(watch.taken);
  exam.delay = watch.delays.empty() ? 0 : median(watch.delays);
  exam.bytes_per_second = static_cast<double>(cameras.source_bytes(index) - bytes) / duration;
  exam.decoded_frames = watch.decoded_frames;
  exam.damaged = watch.damaged;
  exam.damage = watch.damage;
  exam.brightness = watch.brightness;
  exam.darkest = watch.darkest;
  exam.brightest = watch.brightest;
  return exam;
}

// Adds up the bytes per second of all cameras on each link. Cameras without a known link are skipped.
std::vector<LinkLoad> loads(const std::vector<CameraReport>& cameras, const auto& need) {
  std::vector<LinkLoad> all;
  for (const CameraReport& camera : cameras) {
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
    load->max_needed = std::max(load->max_needed, bytes);
    load->raw |= raw;
  }
  return all;
}

bool is_raw_format(const std::string& format) {
  return !format.empty() && format != "JPEG" && format != "H264" && format != "H265" &&
         format.find("RTP") == std::string::npos;
}

}  // namespace

int DoctorReport::errors() const {
  return static_cast<int>(
      std::count_if(findings.begin(), findings.end(), [](const DoctorFinding& f) { return f.error; }));
}

std::vector<LinkLoad> planned_loads(const Rig& rig, const std::vector<CameraReport>& cameras, int fps) {
  return loads(cameras, [&](const CameraReport& exam, double& bytes, double& pixels, bool& raw) {
    const Camera& camera = rig.cameras[exam.camera];
    double rate = fps > 0 ? fps : kUsualRate;
    std::smatch match;
    if (is_launch_description(camera.source) &&
        std::regex_search(camera.source, match, std::regex("framerate=(?:\\(fraction\\))?(\\d+)/(\\d+)")))
      rate = std::stod(match[1]) / std::max(1.0, std::stod(match[2]));
    const bool gige = camera.source.find("aravissrc") != std::string::npos;
    raw = gige || (camera.source.find("video/x-raw") != std::string::npos &&
                   camera.source.find("image/jpeg") == std::string::npos);
    pixels = rate * camera.width * camera.height;
    bytes = pixels * (gige ? 1 : raw ? 2 : kJpegBytesPerPixel);
  });
}

std::vector<LinkLoad> measured_loads(const Rig& rig, const std::vector<CameraReport>& cameras) {
  return loads(cameras, [&](const CameraReport& exam, double& bytes, double& pixels, bool& raw) {
    const Camera& camera = rig.cameras[exam.camera];
    bytes = exam.bytes_per_second;
    pixels = exam.times.rate() * camera.width * camera.height;
    raw = is_raw_format(exam.format);
  });
}

DoctorReport run_doctor(std::shared_ptr<const Rig> rig, const std::string& path, const DoctorOptions& options) {
  DoctorReport exam;
  for (CameraIndex i = 0; i < rig->cameras.size(); i++)
    exam.cameras.push_back({.camera = i, .attachment = find_attachment(*rig, rig->cameras[i])});
  exam.planned = planned_loads(*rig, exam.cameras, options.fps);
  if (options.on_planned) options.on_planned(exam.planned);
  std::vector<FrameMonitor> watches(rig->cameras.size());
  // JPEG is not decoded, as in a light field. Otherwise the decoding speed of this machine would limit the measurement
  // of a large array.
  RigCameras cameras(rig, path, {.decode = false, .trusted = options.trusted, .fps = options.fps},
                     [&](const CameraFrame& frame) { watches[frame.camera].see(frame); });
  cameras.start();
  cameras.wait_for_frames(options.timeout);
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
  for (CameraReport& camera : exam.cameras) {
    Attachment attachment = std::move(camera.attachment);
    camera = result_of(cameras, camera.camera, watches[camera.camera], bytes[camera.camera], duration);
    camera.attachment = std::move(attachment);
  }
  cameras.stop();
  std::vector<FrameTimeStats> times;
  for (const CameraReport& camera : exam.cameras) times.push_back(camera.times);
  exam.skew = camera_skew(times);
  for (size_t i = 0; i < exam.cameras.size(); i++) exam.cameras[i].phase = exam.skew.phase[i];
  exam.measured = measured_loads(*rig, exam.cameras);
  exam.findings = find_problems(*rig, exam);
  if (const std::string warning = secret_warning(*rig, path); !warning.empty())
    exam.findings.push_back({false, path, warning, "change passwords that other users may have read"});
  return exam;
}

namespace {

constexpr double kManyMissing = 0.01;
constexpr double kOtherRate = 0.02;  // relative deviation from the usual frame rate that is reported
constexpr double kUnevenStamps = 0.1;
constexpr double kMovingBrightness = 0.03;  // relative change of brightness that may come from motion in the scene
constexpr double kBlack = 10, kWhite = 245;

bool contains(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

class FindingList {
 public:
  explicit FindingList(const Rig& rig) : rig_(rig) {}
  std::vector<DoctorFinding> take() {
    std::stable_partition(all_.begin(), all_.end(), [](const DoctorFinding& f) { return f.error; });
    return std::move(all_);
  }
  void error(const CameraReport& camera, const std::string& what, const std::string& remedy) {
    all_.push_back({true, place(camera), what, remedy});
  }
  void warning(const CameraReport& camera, const std::string& what, const std::string& remedy) {
    all_.push_back({false, place(camera), what, remedy});
  }
  void add(const DoctorFinding& finding) { all_.push_back(finding); }

 private:
  std::string place(const CameraReport& camera) const { return rig_.cameras[camera.camera].label(); }
  const Rig& rig_;
  std::vector<DoctorFinding> all_;
};

std::string without_place(const Rig& rig, const CameraReport& exam) {
  const std::string name = rig.cameras[exam.camera].label() + ": ";
  const size_t begin = exam.problem.find(name);
  return begin == std::string::npos ? exam.problem : exam.problem.substr(begin + name.size());
}

void look_at_failure(const Rig& rig, const CameraReport& exam, FindingList& findings) {
  findings.error(exam, without_place(rig, exam), remedy_for(rig.cameras[exam.camera], exam.problem));
}

void look_at_frames(const CameraReport& exam, double usual_rate, FindingList& findings) {
  const FrameTimeStats& times = exam.times;
  if (times.frames < 3) {
    findings.error(exam, "gives no frames",
                   "check the camera in another program; then unplug the camera and plug it in again");
    return;
  }
  const double missing = static_cast<double>(times.missing) / static_cast<double>(times.missing + times.frames);
  if (missing > kManyMissing) {
    std::string remedy = "reduce the frame rate";
    if (exam.left_undecoded > 0)
      remedy = "this machine cannot decode all frames in time; use MJPEG, a lower frame rate, or several machines";
    else if (exam.attachment.link.kind == Link::Kind::kUsb)
      remedy =
          "use MJPEG, a lower frame rate, or a port of another USB controller; also use short cables and only powered "
          "hubs";
    else if (exam.attachment.link.kind == Link::Kind::kNetwork)
      remedy = "use a wired network, a packet delay if supported, RTSP over TCP (rtspt://), or a lower bit rate";
    findings.warning(exam,
                     format_text("%.0f %% of its frames are missing (%zu of %zu)", 100 * missing, times.missing,
                                 times.missing + times.frames),
                     remedy);
  }
  if (std::abs(times.rate() / usual_rate - 1) > kOtherRate)
    findings.warning(exam,
                     format_text("delivers %.2f frames/s, but most cameras deliver %.2f", times.rate(), usual_rate),
                     "request the same rate from all cameras (framerate= in their sources); webcams slow down in the "
                     "dark, so add light or set the exposure (lf-rig lock)");
  if (times.backwards > 0)
    findings.warning(exam, format_text("%zu frames have a timestamp before the previous one", times.backwards),
                     "the clock of the camera is unreliable; restart the camera, and look for newer firmware");
  if (times.jitter > kUnevenStamps * times.period)
    findings.warning(
        exam, format_text("its timestamps jitter by %.1f ms", 1e3 * times.jitter),
        exam.stamps == "arrival"
            ? "the camera sends no capture times, so the timestamps include network delays; enable RTCP sender reports "
              "in the camera, and set its clock by NTP"
            : "moving objects will appear double; connect fewer cameras to its link, or replace the camera");
  else if (exam.stamps == "arrival")
    findings.warning(exam, "has no capture times; packet arrival times are used instead",
                     "enable RTCP sender reports in the camera and set its clock by NTP, or measure its time_offset "
                     "with lf-calibrate");
}

void look_at_picture(const CameraReport& exam, FindingList& findings) {
  const std::string remedy = "check its cable and power, reduce the frame rate or size, or change its image format";
  if (exam.damaged > 0 && exam.damaged == exam.decoded_frames)
    return findings.error(exam, "its pictures can't be decoded: " + exam.damage, remedy);
  if (exam.damaged > 0)
    findings.warning(exam,
                     format_text("%zu of %zu pictures are damaged: ", exam.damaged, exam.decoded_frames) + exam.damage,
                     remedy);
  if (exam.brightest < kBlack)
    findings.error(exam, format_text("is black (brightness %.0f of 255)", exam.brightest),
                   "remove the lens cap, or increase the exposure");
  else if (exam.darkest > kWhite)
    findings.error(exam, format_text("is white (brightness %.0f of 255)", exam.darkest), "reduce the exposure");
}

void look_at_controls(const CameraReport& exam, bool brightness_moves, FindingList& findings) {
  std::string automatic;
  for (const auto& [name, value] : exam.controls)
    if (!value) automatic += (automatic.empty() ? "" : ", ") + name;
  if (!automatic.empty())
    findings.warning(exam, "these controls are automatic, so the camera differs from its neighbours: " + automatic,
                     "set the same fixed values for all cameras with lf-rig lock");
  else if (brightness_moves)
    findings.warning(exam,
                     format_text("its brightness varies from %.0f to %.0f of 255, so its exposure may be automatic",
                                 exam.darkest, exam.brightest),
                     "run lf-rig lock; flickering lamps have the same effect (controls: mains_frequency)");
  for (const std::string& name : exam.unsupported_controls)
    findings.warning(exam, "its source does not support the control " + name,
                     "set the control in the camera's own menu or web page, and remove the control from the rig");
}

void look_for_shared_devices(const Rig& rig, const DoctorReport& exam, FindingList& findings) {
  std::map<std::string, const CameraReport*> first;
  for (const CameraReport& camera : exam.cameras) {
    if (camera.attachment.device.empty()) continue;
    const auto [other, is_new] = first.emplace(camera.attachment.device, &camera);
    if (!is_new)
      findings.error(camera,
                     "has the same device as " + rig.cameras[other->second->camera].label() + ", " +
                         redacted_location(camera.attachment.device),
                     "give each camera its own source (lf-rig new --devices lists connected devices)");
  }
}

// Checks the measured loads. An overloaded link delivers less data than planned. Raw formats are therefore checked by
// the planned load, which is exact.
void look_at_links(const DoctorReport& exam, FindingList& findings) {
  for (const LinkLoad& planned : exam.planned) {
    const auto measured = std::find_if(exam.measured.begin(), exam.measured.end(),
                                       [&](const LinkLoad& load) { return load.link.name == planned.link.name; });
    std::vector<LinkWarning> all;
    if (planned.raw) all = check_link(planned);
    if (all.empty() && measured != exam.measured.end()) all = check_link(*measured);
    for (const LinkWarning& advice : all) findings.add({advice.overloaded, "links", advice.what, advice.remedy});
  }
}

double usual_rate(const DoctorReport& exam) {
  std::vector<double> rates;
  for (const CameraReport& camera : exam.cameras)
    if (camera.times.period > 0) rates.push_back(camera.times.rate());
  if (rates.empty()) return 0;
  std::nth_element(rates.begin(), rates.begin() + static_cast<ptrdiff_t>(rates.size() / 2), rates.end());
  return rates[rates.size() / 2];
}

bool brightness_moves(const CameraReport& exam) {
  return exam.brightest - exam.darkest > kMovingBrightness * exam.brightest && exam.brightest - exam.darkest > 2;
}

std::string remedy_for_refusal(const Camera& camera, const std::string& problem) {
  if (contains(problem, "HTTP 403") || contains(problem, "orbidden"))
    return "the camera does not allow this user to see this stream: check the path of the source, and the rights of "
           "the user in the camera's own web page";
  if (has_secret(camera))
    return "the user name or password in the rig is wrong: correct it, then try the source in a browser or player; "
           "special characters in a URI are written as %40 for @, %2F for /, %3A for :";
  if (is_launch_description(camera.source))
    return "the camera requires a user and a password: write user-id=USER user-pw=PASSWORD into its source, then chmod "
           "600 the rig file";
  const size_t end = camera.source.find("://");
  return "the camera requires a user and a password: write " +
         (end == std::string::npos ? "rtsp" : camera.source.substr(0, end)) +
         "://USER:PASSWORD@HOST/... into its source, then chmod 600 the rig file";
}

bool is_of_file(const Camera& camera) {
  const std::string& source = camera.source;
  if (source.empty()) return !camera.image.empty();
  if (is_launch_description(source) || source.starts_with("/dev/")) return false;
  return !contains(source, "://") || source.starts_with("file://");
}

}  // namespace

std::string remedy_for(const Camera& camera, const std::string& problem) {
  if (contains(problem, "--trust-rig"))
    return "run the command again with --trust-rig, but only if you trust the author of the rig file and know the "
           "purpose of this element";
  if (contains(problem, "the rig says"))
    return "write the true width and height into the rig and calibrate again, or set the camera to the size in the "
           "rig";
  if (contains(problem, "gives no pictures of")) return "write a size that the camera supports into the rig";
  if (contains(problem, "busy") || contains(problem, "in use"))
    return "another program uses the camera; close this program (fuser -v /dev/video* shows its name)";
  if (contains(problem, ": missing, while "))
    return "the numbers of a sequence have no gaps: copy the missing picture again, or use a copy of the previous "
           "picture. Otherwise renumber the files of all cameras in the same way, because equal numbers mean one "
           "instant";
  const bool is_missing = contains(problem, "no such file") || contains(problem, "Cannot identify") ||
                          contains(problem, "not found") || contains(problem, "Not Found");
  const bool lacks_elements = contains(problem, "is not installed") || contains(problem, "no element");
  if (is_of_file(camera) && is_missing)
    return "check the path; a path that does not begin with / is relative to the folder of the rig file";
  if (is_of_file(camera) && !lacks_elements)
    return "check that the file is complete and can be played with: gst-launch-1.0 filesrc location=FILE ! decodebin ! "
           "videoconvert ! autovideosink";
  if (contains(problem, "refuses access") || contains(problem, "nauthorized") || contains(problem, "401"))
    return remedy_for_refusal(camera, problem);
  if (is_missing && contains(camera.source, "://") && !camera.source.starts_with("v4l2:"))
    return "the camera has no stream of this name: check the path in the source against the camera's manual";
  if (is_missing) return "the device is not connected; plug it in (lf-rig new --devices lists connected devices)";
  if (contains(problem, "connect") || contains(problem, "resolve"))
    return "there is no answer from this address; check that the camera is switched on and in this network (ping its "
           "host)";
  if (lacks_elements) return "install the GStreamer plugin that contains the element";
  return "check that the camera is plugged in and switched on, and that its source in the rig is right";
}

std::vector<DoctorFinding> find_problems(const Rig& rig, const DoctorReport& exam) {
  FindingList findings(rig);
  const double rate = usual_rate(exam);
  // If the brightness changes in most cameras, the cause is the scene or its light, not the exposure.
  const auto moving = static_cast<size_t>(std::count_if(exam.cameras.begin(), exam.cameras.end(), brightness_moves));
  const bool scene_moves = exam.cameras.size() > 2 && 2 * moving > exam.cameras.size();
  look_for_shared_devices(rig, exam, findings);
  for (const CameraReport& camera : exam.cameras) {
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
                      " cameras vary in brightness, so their exposure may be automatic",
                  "if the light in the room does not change, run lf-rig lock"});
  look_at_links(exam, findings);
  return findings.take();
}

namespace {

using nlohmann::ordered_json;

constexpr size_t kMaxLines = 24;

std::string size_of(const Camera& camera) { return std::to_string(camera.width) + "x" + std::to_string(camera.height); }

std::string line_of(const Rig& rig, const CameraReport& exam) {
  const Camera& camera = rig.cameras[exam.camera];
  std::string line = format_text("%-16s", name_of(camera).c_str());
  if (exam.times.frames < 3) return line + (exam.problem.empty() ? " no frames\n" : " does not work\n");
  line += format_text(" %8.2f  %-12s %-9s %5zu %6.0f ms", exam.times.rate(),
                      exam.format.empty() ? "-" : exam.format.c_str(), size_of(camera).c_str(), exam.times.missing,
                      1e3 * exam.delay);
  line += std::isnan(exam.phase) ? "         -" : format_text(" %+6.1f ms", 1e3 * exam.phase);
  line += format_text(" %5.1f ms %6.0f", 1e3 * exam.times.jitter, exam.brightness);
  return line + "\n";
}

constexpr char kHeader[] =
    "camera           frames/s  format       size      lost     delay      skew   jitter  light\n";

std::string groups_of(const Rig& rig, const DoctorReport& exam, const std::set<std::string>& troubled) {
  struct Group {
    size_t count = 0;
    double least = INFINITY, most = 0, longest = 0;
  };
  std::map<std::string, Group> groups;
  std::string lines;
  for (const CameraReport& camera : exam.cameras) {
    const Camera& what = rig.cameras[camera.camera];
    if (troubled.contains(what.label())) {
      lines += line_of(rig, camera);
      continue;
    }
    Group& group = groups[(camera.format.empty() ? "" : camera.format + " ") + size_of(what)];
    group.count++;
    group.least = std::min(group.least, camera.times.rate());
    group.most = std::max(group.most, camera.times.rate());
    group.longest = std::max(group.longest, camera.delay);
  }
  for (const auto& [what, group] : groups)
    lines += format_text("%zu others: %s, %.2f to %.2f frames/s, delay up to %.0f ms\n", group.count, what.c_str(),
                         group.least, group.most, 1e3 * group.longest);
  return lines;
}

ordered_json json_report(const std::vector<LinkLoad>& loads) {
  ordered_json all = ordered_json::array();
  for (const LinkLoad& load : loads)
    all.push_back({{"link", load.link.name},
                   {"cameras", load.cameras.size()},
                   {"bytes_per_second", load.needed},
                   {"capacity", load.link.capacity > 0 ? ordered_json(load.link.capacity) : ordered_json(nullptr)}});
  return all;
}

}  // namespace

std::string link_table(const std::vector<LinkLoad>& loads, const char* when) {
  std::string lines;
  for (const LinkLoad& load : loads) {
    lines += format_text("%s: %s: %zu camera%s, %.1f", load.link.name.c_str(), when, load.cameras.size(),
                         load.cameras.size() == 1 ? "" : "s", load.needed / 1e6);
    lines += load.link.capacity > 0 ? format_text(" of %.0f MB/s\n", load.link.capacity / 1e6) : " MB/s\n";
  }
  return lines;
}

std::string text_report(const Rig& rig, const DoctorReport& exam) {
  std::set<std::string> troubled;
  for (const DoctorFinding& finding : exam.findings) troubled.insert(finding.cameras);
  std::string page = link_table(exam.measured, "measured") + kHeader;
  if (exam.cameras.size() <= kMaxLines)
    for (const CameraReport& camera : exam.cameras) page += line_of(rig, camera);
  else
    page += groups_of(rig, exam, troubled);
  if (exam.cameras.size() > 1 && exam.skew.spread > 0)
    page += format_text(
        "the capture times of the cameras differ by up to %.1f ms; an object at 1 m/s moves %.0f mm in that time\n",
        1e3 * exam.skew.spread, 1e3 * exam.skew.spread);
  for (const DoctorFinding& finding : exam.findings)
    page += std::string(finding.error ? "error: " : "warning: ") + finding.cameras + ": " + finding.what + "\n   " +
            finding.remedy + "\n";
  const size_t count = exam.cameras.size(), errors = static_cast<size_t>(exam.errors());
  page +=
      format_text("%zu camera%s, %zu error%s, %zu warning%s\n", count, count == 1 ? "" : "s", errors,
                  errors == 1 ? "" : "s", exam.findings.size() - errors, exam.findings.size() - errors == 1 ? "" : "s");
  return page;
}

std::string json_report(const Rig& rig, const DoctorReport& exam) {
  ordered_json cameras = ordered_json::array(), findings = ordered_json::array();
  for (const CameraReport& one : exam.cameras) {
    const Camera& camera = rig.cameras[one.camera];
    ordered_json controls = ordered_json::object();
    for (const auto& [name, value] : one.controls) controls[name] = value ? ordered_json(*value) : ordered_json("auto");
    cameras.push_back({{"id", camera.id},
                       {"name", camera.name},
                       {"problem", one.problem},
                       {"width", camera.width},
                       {"height", camera.height},
                       {"format", one.format},
                       {"frames", one.times.frames},
                       {"frames_per_second", one.times.rate()},
                       {"missing", one.times.missing},
                       {"left_undecoded", one.left_undecoded},
                       {"delay", one.delay},
                       {"skew", one.phase},
                       {"jitter", one.times.jitter},
                       {"stamps", one.stamps},
                       {"bytes_per_second", one.bytes_per_second},
                       {"brightness", one.brightness},
                       {"controls", controls}});
  }
  for (const DoctorFinding& finding : exam.findings)
    findings.push_back({{"severity", finding.error ? "error" : "warning"},
                        {"about", finding.cameras},
                        {"what", finding.what},
                        {"remedy", finding.remedy}});
  return ordered_json{{"cameras", cameras},
                      {"links", {{"planned", json_report(exam.planned)}, {"measured", json_report(exam.measured)}}},
                      {"skew", exam.skew.spread},
                      {"findings", findings}}
      .dump(1);
}

}  // namespace lf::cameras
