// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate check: checks a calibrated rig against a later recording, or with the camera monitor of lf-serve.
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include <gst/gst.h>
#include <libsoup/soup.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "calibration/moving_light.h"
#include "calibration/rig_check.h"
#include "commands.h"
#include "quality/camera_monitor.h"
#include "recordings.h"
#include "rig/rig_json.h"
#include "rig/source_security.h"
#include "terminal.h"

namespace {

using lf::format_text;
using nlohmann::json;

constexpr guint kPatience = 10;                    // seconds without data until the request fails
constexpr std::chrono::seconds kWholeRequest{20};  // for the whole answer, so that a slow server can't block for ever
constexpr size_t kMaxBytes = size_t{32} << 20;

// Cancels a request that takes longer than kWholeRequest.
class Deadline {
 public:
  Deadline() = default;
  ~Deadline() {
    timer_ = {};
    g_object_unref(cancellable_);
  }
  Deadline(const Deadline&) = delete;
  Deadline& operator=(const Deadline&) = delete;
  GCancellable* cancellable() { return cancellable_; }

 private:
  GCancellable* const cancellable_ = g_cancellable_new();
  std::mutex mutex_;
  std::condition_variable_any ended_;
  std::jthread timer_{[this](const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    ended_.wait_for(lock, stop, kWholeRequest, [] { return false; });
    if (!stop.stop_requested()) g_cancellable_cancel(cancellable_);
  }};
};

[[noreturn]] void fail(const std::string& address, const GError& error) {
  if (error.domain == G_IO_ERROR && error.code == G_IO_ERROR_CANCELLED)
    throw lf::Error(address + ": the answer takes longer than " + std::to_string(kWholeRequest.count()) +
                    " s; check that the address is of lf-serve");
  throw lf::Error(address + ": " + error.message + "; check that lf-serve is running at this address");
}

std::string read_body(GInputStream* stream, const std::string& address, Deadline& deadline) {
  std::string body;
  std::string part(size_t{1} << 16, '\0');
  for (;;) {
    g_autoptr(GError) error = nullptr;
    const gssize count = g_input_stream_read(stream, part.data(), part.size(), deadline.cancellable(), &error);
    if (count < 0) fail(address, *error);
    if (count == 0) return body;
    body.append(part, 0, static_cast<size_t>(count));
    if (body.size() > kMaxBytes)
      throw lf::Error(address + ": the answer has more than " + std::to_string(kMaxBytes) +
                      " bytes; check that the address is of lf-serve");
  }
}

std::string fetch(std::string address, const std::string& token_file) {
  // The address may be copied from a browser, with a view or a token in its fragment.
  address = address.substr(0, address.find('#'));
  if (!address.ends_with("/")) address += '/';
  address += "monitor.json";
  g_autoptr(SoupSession) session = soup_session_new_with_options("timeout", kPatience, nullptr);
  g_autoptr(SoupMessage) message = soup_message_new("GET", address.c_str());
  if (!message)
    throw lf::Error(address +
                    ": is not a valid address; give the address of lf-serve, such as "
                    "http://127.0.0.1:8080");
  soup_message_add_flags(message, SOUP_MESSAGE_NO_REDIRECT);  // a redirection must not send the token to another server
  if (!token_file.empty()) {
    std::string token = lf::read_secret_file(token_file);
    while (!token.empty() && std::isspace(static_cast<unsigned char>(token.back()))) token.pop_back();
    soup_message_headers_replace(soup_message_get_request_headers(message), "Authorization",
                                 ("Bearer " + token).c_str());
  }
  g_autoptr(GError) error = nullptr;
  Deadline deadline;
  g_autoptr(GInputStream) body = soup_session_send(session, message, deadline.cancellable(), &error);
  if (!body) fail(address, *error);
  const guint status = soup_message_get_status(message);
  if (status == SOUP_STATUS_UNAUTHORIZED)
    throw lf::Error(address + ": the server requires a token; give it with --token-file");
  if (status != SOUP_STATUS_OK)
    throw lf::Error(address + ": answers " + std::to_string(status) + " " + soup_status_get_phrase(status));
  return read_body(body, address, deadline);
}

class MonitoredCamera {
 public:
  MonitoredCamera(const lf::JsonValue& value, const json& raw) : value_(value), raw_(raw) {}
  std::string text(const char* key) const { return has(key) ? value_.at(key).text() : ""; }
  double number(const char* key) const { return has(key) ? value_.at(key).number() : NAN; }

 private:
  bool has(const char* key) const { return value_.find(key) && !raw_[key].is_null(); }

  const lf::JsonValue& value_;
  const json& raw_;
};

// Writes the verdict on one camera into `judged`. Returns a message for the user that states the problem and its
// remedy, or an empty text if there is no problem.
std::string judge(const lf::Camera& camera, const std::string& fault, json& judged) {
  const std::string who = camera.label();
  if (fault == "direction") {
    judged["state"] = "moved";
    const double shift = judged["shift_px"];
    return format_text(
        "%s looks in another direction than the rig states: its image is off by about %.0f pixels, or %.1f degrees. "
        "Put the camera back, or calibrate again",
        who.c_str(), shift, std::atan(shift / camera.lens.fx()) * 180 / M_PI);
  }
  if (fault == "colour") {
    judged["state"] = "colour";
    return format_text(
        "%s is %.0f %% %s than most cameras. Lock its exposure with lf-rig lock, or run lf-calibrate colour",
        who.c_str(), 100 * std::abs(judged["gain"].get<double>() - 1), judged["gain"] > 1 ? "brighter" : "darker");
  }
  judged["state"] = "picture";
  return who + " shows an image that its neighbours do not predict. Check whether it is out of focus, dirty or covered";
}

// Asks the camera monitor of lf-serve and returns the result in the format of check_report(). "from" is "monitor". Each
// camera has "id", "name", "state" (holds, moved, colour, picture or unknown), "shift_px" and "gain".
//
// `place` is the address of the server, or a file with its monitor.json. `token_file` has the bearer token and may be
// empty. Throws lf::Error if there is no answer, or if the server has another rig.
json check_monitor(const lf::Rig& rig, const std::string& place, const std::string& token_file) {
  const bool remote = place.starts_with("http://") || place.starts_with("https://");
  const json said = lf::parse_json(remote ? fetch(place, token_file) : lf::read_text_file(place), place);
  const lf::JsonValue root(said, place);
  json report = {
      {"format", "lightfield-check"}, {"version", 1}, {"from", "monitor"}, {"holds", true}, {"findings", json::array()},
      {"cameras", json::array()}};
  size_t known = 0;
  const std::vector<lf::JsonValue> cameras = root.at("cameras").elements();
  if (cameras.empty())
    throw lf::Error(place +
                    ": the monitor has not checked any camera yet; start lf-serve with --monitor 30, and watch the "
                    "light field in a browser for a minute");
  if (cameras.size() != rig.cameras.size())
    throw lf::Error(place + ": has " + std::to_string(cameras.size()) + " cameras, but the rig file has " +
                    std::to_string(rig.cameras.size()));
  for (size_t i = 0; i < cameras.size(); i++) {
    const lf::Camera& camera = rig.cameras[i];
    const MonitoredCamera watched(cameras[i], said["cameras"][i]);
    const std::string name = watched.text("name");
    if (!camera.name.empty() && !name.empty() && name != camera.name)
      throw lf::Error(place + ": its camera " + std::to_string(i) + " is called " + name +
                      ", but its name in the rig file is " + camera.name);
    const auto number = [&](const char* key) { return watched.number(key); };
    // The monitor compares subsampled images, so shifts are scaled.
    const int step = (camera.width + lf::kProbeColumns - 1) / lf::kProbeColumns;
    const bool seen = std::isfinite(number("psnr"));
    known += seen;
    json judged = {{"id", camera.id}, {"name", camera.name}, {"state", seen ? "holds" : "unknown"}};
    judged["shift_px"] = std::isfinite(number("shift")) ? number("shift") * step : 0;
    judged["gain"] = std::isfinite(number("gain")) ? number("gain") : 1;
    if (const std::string fault = watched.text("fault"); !fault.empty()) {
      const std::string what = judge(camera, fault, judged);
      // A camera with another colour has not moved.
      const bool moved = judged["state"] == "moved";
      if (moved) report["holds"] = false;
      report["findings"].push_back(
          {{"severity", moved ? "error" : "warning"}, {"code", judged["state"]}, {"text", what}});
    }
    report["cameras"].push_back(std::move(judged));
  }
  if (known == 0)
    throw lf::Error(place +
                    ": no camera could be predicted from its neighbours yet. The monitor cannot check cameras at the "
                    "corners, nor arrays of only two cameras");
  const auto turns = root.find("turns");
  report["turns"] = turns ? turns->integer(0, INT64_MAX) : 0;
  return report;
}

struct CheckArguments {
  std::string rig, recordings, tracks, monitor, token_file, json;
  double bar = 0;
  int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
};

// Returns the prior knowledge for the check, which is only the lenses. The poses are left out, because the check must
// not assume what it checks.
lf::SolveOptions with_lenses(const lf::Rig& rig, const std::string& path) {
  lf::SolveOptions options;
  options.prior = rig;
  const json text = lf::parse_json(lf::read_text_file(path), path);
  for (const lf::JsonValue& camera : lf::JsonValue(text, path).at("cameras").elements()) {
    auto known = lf::parse_camera_covariance(camera);
    if (known) {
      lf::CameraCovariance lens;
      for (const std::string& name : known->parameters)
        if (std::string("x y z rx ry rz").find(name) == std::string::npos) lens.parameters.push_back(name);
      for (const std::string& row : lens.parameters)
        for (const std::string& column : lens.parameters)
          lens.matrix.push_back(known->at(*known->index_of(row), *known->index_of(column)));
      *known = std::move(lens);
      if (known->parameters.empty()) known.reset();
    }
    options.prior_covariances.push_back(std::move(known));
  }
  return options;
}

// Returns tracks at common instants. The clocks of the cameras are estimated again, because a recording can start at
// any time.
lf::Tracks tracks_of(const CheckArguments& o, const lf::Rig& rig) {
  std::optional<lf::LightDetections> sights;
  if (o.tracks.empty()) {
    gst_init(nullptr, nullptr);
    const LightRecordings recordings = detect_lights(rig, o.recordings, o.bar > 0, o.threads);
    for (const std::string& trouble : recordings.troubles(rig)) terminal::print("warning: %s\n", trouble.c_str());
    if (recordings.useful() < 3)
      throw lf::Error(
          "fewer than three cameras saw a moving light, which is too few for a check. Record again in a "
          "dark room, with the light switched on and in view of all cameras");
    sights = recordings.sights;
  } else {
    const std::string text = lf::read_text_file(o.tracks);
    sights = lf::parse_light_detections(text, o.tracks);
    if (!sights) return lf::parse_tracks(text, o.tracks);
  }
  lf::SolveOptions options = with_lenses(rig, o.rig);
  SolveProgress progress("comparing", options.progress);
  return lf::solve_lights(*sights, {options}).tracks;
}

json check_tracks(const CheckArguments& o, const lf::Rig& rig) {
  const lf::RigCheck check = lf::check_calibration(rig, tracks_of(o, rig));
  const std::vector<lf::Finding> findings = lf::diagnose_check(rig, check, o.bar);
  terminal::print("%-8s %-16s %8s %12s %10s\n", "camera", "name", "sights", "residual px", "moved px");
  for (const lf::RigCheck::Camera& camera : check.cameras)
    terminal::print("%-8u %-16s %8zu %12.3f %10.3f\n", camera.id, rig.cameras[*rig.index_of_id(camera.id)].name.c_str(),
                    camera.sights, camera.residual_px, camera.shift_px);
  if (check.bar)
    terminal::print("bar         %.1f mm in this rig, +-%.1f\n", 1e3 * *check.bar, 1e3 * *check.bar_spread);
  return json::parse(lf::check_report(rig, check, findings).dump());
}

int check(const CheckArguments& o) {
  const lf::Rig rig = lf::load_rig(o.rig);
  const json report = o.monitor.empty() ? check_tracks(o, rig) : check_monitor(rig, o.monitor, o.token_file);
  for (const json& finding : report["findings"])
    terminal::print("%s: %s\n", finding["severity"].get<std::string>().c_str(),
                    finding["text"].get<std::string>().c_str());
  size_t off = 0, unknown = 0;
  for (const json& camera : report["cameras"]) {
    unknown += camera["state"] == "unknown";
    off += camera["state"] != "unknown" && camera["state"] != "holds";
  }
  const bool holds = report["holds"];
  const size_t all = report["cameras"].size();
  if (holds)
    terminal::print("%s holds: %zu of %zu cameras are where the rig states\n", o.rig.c_str(), all - unknown, all);
  else
    terminal::print("%s does not hold: %zu of %zu cameras are off\n", o.rig.c_str(), off, all);
  if (!o.json.empty()) lf::write_text_file(report.dump(1) + "\n", o.json);
  return holds ? 0 : 1;
}

}  // namespace

void add_check_command(cli::App& app) {
  const auto o = std::make_shared<CheckArguments>();
  cli::App* command = app.add_subcommand(
      "check",
      "Checks whether the calibration of a rig still holds, and reports cameras that have moved. The check uses a "
      "later recording of a moving light, or the camera monitor of lf-serve. The exit status is 0 if the calibration "
      "holds, 1 if it does not, and 2 after an error or with too little data");
  command->add_option("RIG", o->rig, "Calibrated rig file to check")->required();
  cli::App* what = command->add_option_group("source of the check");
  what->add_option(
          "--recordings", o->recordings,
          "Folder with a recording NAME.* of each camera. The recordings show a light that moves through the dark")
      ->type_name("DIR");
  what->add_option("--tracks", o->tracks,
                   "JSON file with the tracks of such a recording (the positions of the light in all images), written "
                   "by lf-calibrate track")
      ->type_name("FILE");
  cli::Option* monitor = what->add_option("--monitor", o->monitor,
                                          "URL of an lf-serve that shows this rig with --monitor 30, for example "
                                          "http://127.0.0.1:8080. A saved monitor.json of this server works, too")
                             ->type_name("URL|FILE");
  what->require_option(1);
  command
      ->add_option("--token-file", o->token_file,
                   "File with the bearer token, as for --token-file of lf-serve. Required if lf-serve uses a token")
      ->type_name("FILE")
      ->needs(monitor);
  command
      ->add_option(
          "--bar", o->bar,
          "Distance between the two lights on a bar, in metres. If this option is given, the scale of the rig is "
          "checked, too")
      ->check(cli::PositiveNumber)
      ->excludes(monitor);
  command->add_option("--json", o->json, "JSON file that receives the report, for lf-calibrate report")
      ->type_name("FILE");
  command->callback([o] { return check(*o); });
  command->set_error_status(2);  // 1 is the result of a rig that does not hold
}
