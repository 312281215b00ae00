// SPDX-License-Identifier: LGPL-2.1-or-later
#include "monitor_check.h"
#include "base/number_text.h"

#include <libsoup/soup.h>

#include <cmath>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "base/secret_file.h"
#include "quality/camera_monitor.h"

namespace {

using lf::format_text;
using nlohmann::json;

constexpr guint kPatience = 10;                  // seconds without a byte
constexpr size_t kMostBytes = size_t{32} << 20;  // enough for 65,535 cameras

// Reads a body of at most `kMostBytes`.
std::string read_body(GInputStream* stream, const std::string& address) {
  std::string body;
  std::string part(size_t{1} << 16, '\0');
  for (;;) {
    g_autoptr(GError) error = nullptr;
    const gssize count = g_input_stream_read(stream, part.data(), part.size(), nullptr, &error);
    if (count < 0) throw lf::Error(address + ": " + error->message);
    if (count == 0) return body;
    body.append(part, 0, static_cast<size_t>(count));
    if (body.size() > kMostBytes)
      throw lf::Error(address + ": answers more than " + std::to_string(kMostBytes) + " bytes: is it lf-serve?");
  }
}

std::string fetch(std::string address, const std::string& token_file) {
  // As people copy it: the address of the page, with a view or a token behind it.
  address = address.substr(0, address.find('#'));
  if (!address.ends_with("/")) address += '/';
  address += "monitor.json";
  g_autoptr(SoupSession) session = soup_session_new_with_options("timeout", kPatience, nullptr);
  g_autoptr(SoupMessage) message = soup_message_new("GET", address.c_str());
  if (!message) throw lf::Error(address + ": is no address");
  soup_message_add_flags(message, SOUP_MESSAGE_NO_REDIRECT);  // the token is for this address alone
  if (!token_file.empty()) {
    std::string token = lf::read_secret_file(token_file);
    while (!token.empty() && std::isspace(static_cast<unsigned char>(token.back()))) token.pop_back();
    soup_message_headers_replace(soup_message_get_request_headers(message), "Authorization",
                                 ("Bearer " + token).c_str());
  }
  g_autoptr(GError) error = nullptr;
  g_autoptr(GInputStream) body = soup_session_send(session, message, nullptr, &error);
  if (!body) throw lf::Error(address + ": " + error->message + ": is lf-serve running there?");
  const guint status = soup_message_get_status(message);
  if (status == SOUP_STATUS_UNAUTHORIZED) throw lf::Error(address + ": asks for its token: give --token-file");
  if (status != SOUP_STATUS_OK)
    throw lf::Error(address + ": answers " + std::to_string(status) + " " + soup_status_get_phrase(status));
  return read_body(body, address);
}

// A camera of the monitor's answer. A member that is null counts as missing.
class WatchedCamera {
 public:
  WatchedCamera(const lf::JsonValue& value, const json& raw) : value_(value), raw_(raw) {}
  std::string text(const char* key) const { return has(key) ? value_.at(key).text() : ""; }
  double number(const char* key) const { return has(key) ? value_.at(key).number() : NAN; }

 private:
  bool has(const char* key) const { return value_.find(key) && !raw_[key].is_null(); }

  const lf::JsonValue& value_;
  const json& raw_;
};

// What is wrong with a camera, and what to do; its state goes into `judged`.
std::string judge(const lf::Camera& camera, const std::string& fault, json& judged) {
  const std::string who = "camera " + std::to_string(camera.id) + " (" + camera.name + ")";
  if (fault == "direction") {
    judged["state"] = "moved";
    const double shift = judged["shift_px"];
    return format_text(
        "%s looks elsewhere than the rig says: its picture is off by %.0f pixels or so, about %.1f degrees. Put "
        "it back, or calibrate anew",
        who.c_str(), shift, std::atan(shift / camera.lens.fx()) * 180 / M_PI);
  }
  if (fault == "colour") {
    judged["state"] = "colour";
    return format_text("%s is %.0f %% %s than the others: lock its exposure (lf-rig lock), or run lf-calibrate colour",
                       who.c_str(), 100 * std::abs(judged["gain"].get<double>() - 1),
                       judged["gain"] > 1 ? "brighter" : "darker");
  }
  judged["state"] = "picture";
  return who + " shows another picture than the others foretell: is it out of focus, dirty or covered?";
}

}  // namespace

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
                    ": the monitor has looked at no camera yet: start lf-serve with --monitor 30, and have "
                    "somebody look at the light field for a minute");
  if (cameras.size() != rig.cameras.size())
    throw lf::Error(place + ": shows " + std::to_string(cameras.size()) + " cameras, the rig has " +
                    std::to_string(rig.cameras.size()));
  for (size_t i = 0; i < cameras.size(); i++) {
    const lf::Camera& camera = rig.cameras[i];
    const WatchedCamera watched(cameras[i], said["cameras"][i]);
    const std::string name = watched.text("name");
    if (!camera.name.empty() && !name.empty() && name != camera.name)
      throw lf::Error(place + ": its camera " + std::to_string(i) + " is " + name + ", the rig's is " + camera.name);
    const auto number = [&](const char* key) { return watched.number(key); };
    // The monitor compares every so many pixels of a camera.
    const int step = (camera.width + lf::kProbeColumns - 1) / lf::kProbeColumns;
    const bool seen = std::isfinite(number("psnr"));
    known += seen;
    json judged = {{"id", camera.id}, {"name", camera.name}, {"state", seen ? "holds" : "unknown"}};
    judged["shift_px"] = std::isfinite(number("shift")) ? number("shift") * step : 0;
    judged["gain"] = std::isfinite(number("gain")) ? number("gain") : 1;
    if (const std::string fault = watched.text("fault"); !fault.empty()) {
      const std::string what = judge(camera, fault, judged);
      // Colours are no part of where cameras stand.
      const bool moved = judged["state"] == "moved";
      if (moved) report["holds"] = false;
      report["findings"].push_back(
          {{"severity", moved ? "error" : "warning"}, {"code", judged["state"]}, {"text", what}});
    }
    report["cameras"].push_back(std::move(judged));
  }
  if (known == 0)
    throw lf::Error(place +
                    ": no camera could be foretold from the others yet: cameras at the corners of an array, and "
                    "arrays of two, can't be watched");
  const auto turns = root.find("turns");
  report["turns"] = turns ? turns->integer(0, INT64_MAX) : 0;
  return report;
}
