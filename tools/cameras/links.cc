// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/links.h"

#include <ifaddrs.h>
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <regex>

#include "rig/source_security.h"

namespace lf::cameras {
namespace {

namespace fs = std::filesystem;

constexpr double kEthernetPictures = 0.94;  // payload fraction with packets of 1500 bytes
constexpr double kLittleLeft = 0.8;

std::optional<int> read_number(const fs::path& path) {
  std::ifstream file(path);
  int number = 0;
  if (file >> number) return number;
  return std::nullopt;
}

std::string property_in(const std::string& line, const std::string& name) {
  std::smatch match;
  if (!std::regex_search(line, match, std::regex("(^|\\s)" + name + "\\s*=\\s*(\"([^\"]*)\"|(\\S+))"))) return "";
  return match[3].matched ? match[3].str() : match[4].str();
}

std::string device_path(const std::string& source) {
  if (source.starts_with("v4l2://")) return source.substr(7);
  if (is_launch_description(source) && source.find("v4l2src") != std::string::npos) {
    const std::string device = property_in(source, "device");
    return device.empty() ? "/dev/video0" : device;
  }
  return "";
}

std::string address_of(const std::string& source) {
  const std::string uri = is_launch_description(source) ? property_in(source, "(?:location|uri)") : source;
  for (const char* scheme : {"rtsp", "http", "udp", "rtp", "srt"})
    if (uri.starts_with(scheme)) return uri;
  return "";
}

Link usb_of(const std::string& device, const std::string& sys) {
  std::error_code error;
  fs::path place = fs::canonical(fs::path(sys) / "class/video4linux" / fs::path(device).filename() / "device", error);
  for (; !error && place.has_relative_path(); place = place.parent_path()) {
    const auto bus = read_number(place / "busnum"), speed = read_number(place / "speed");
    if (bus && speed) return usb_link(*bus, *speed);
  }
  return {};
}

std::string host_of(const std::string& uri) {
  std::smatch match;
  if (!std::regex_match(uri, match, std::regex("\\w+://(?:[^/@]*@)?(?:\\[([^\\]]*)\\]|([^:/?]*)).*"))) return "";
  return match[1].matched ? match[1].str() : match[2].str();
}

std::string interface_to(const std::string& host) {
  addrinfo hints = {}, *found = nullptr;
  hints.ai_socktype = SOCK_DGRAM;
  if (host.empty() || getaddrinfo(host.c_str(), "9", &hints, &found) != 0) return "";
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(found, freeaddrinfo);
  sockaddr_storage own = {};
  socklen_t size = sizeof own;
  const int handle = socket(found->ai_family, SOCK_DGRAM, 0);
  const bool known = handle >= 0 && connect(handle, found->ai_addr, found->ai_addrlen) == 0 &&
                     getsockname(handle, reinterpret_cast<sockaddr*>(&own), &size) == 0;
  if (handle >= 0) close(handle);
  ifaddrs* all = nullptr;
  if (!known || getifaddrs(&all) != 0) return "";
  std::string name;
  for (const ifaddrs* one = all; one && name.empty(); one = one->ifa_next) {
    if (!one->ifa_addr || one->ifa_addr->sa_family != own.ss_family) continue;
    const auto ipv4 = [](const void* address) { return &static_cast<const sockaddr_in*>(address)->sin_addr; };
    const auto ipv6 = [](const void* address) { return &static_cast<const sockaddr_in6*>(address)->sin6_addr; };
    const bool same = own.ss_family == AF_INET ? std::memcmp(ipv4(one->ifa_addr), ipv4(&own), sizeof(in_addr)) == 0
                                               : std::memcmp(ipv6(one->ifa_addr), ipv6(&own), sizeof(in6_addr)) == 0;
    if (same) name = one->ifa_name;
  }
  freeifaddrs(all);
  return name;
}

Link network_to(const std::string& uri, const std::string& sys) {
  const std::string name = interface_to(host_of(uri));
  Link link{.kind = Link::Kind::kNetwork, .name = name.empty() ? "network" : "network " + name};
  if (const auto speed = read_number(fs::path(sys) / "class/net" / name / "speed"); speed && *speed > 0) {
    link.capacity = *speed * 1e6 / 8 * kEthernetPictures;
    link.name += " (" + std::to_string(*speed) + " Mbit/s)";
  }
  return link;
}

std::string megabytes(double bytes) {
  char text[40];
  std::snprintf(text, sizeof text, bytes < 9.95e6 ? "%.1f" : "%.0f", bytes / 1e6);
  return text;
}

}  // namespace

Link usb_link(int bus, int speed) {
  Link link{.kind = Link::Kind::kUsb,
            .name = "USB bus " + std::to_string(bus) + " (" + std::to_string(speed) + " Mbit/s)"};
  if (speed <= 12) {
    link.capacity = link.camera_capacity = 1.0e6;  // one isochronous endpoint, 1023 bytes per millisecond
  } else if (speed <= 480) {
    link.capacity = 480e6 / 8 * 0.8;
    link.camera_capacity = 3072 * 8000.0;
  } else {
    link.capacity = speed * 1e6 / 8 * 0.8 * 0.9;  // 8b/10b or similar coding; headers and other traffic
  }
  return link;
}

Attachment find_attachment(const Rig& rig, const Camera& camera, const std::string& sys) {
  Attachment found;
  const std::string& source = camera.source;
  if (const std::string path = device_path(source); !path.empty()) {
    std::error_code error;
    const fs::path real = fs::canonical(path, error);
    found.device = error ? path : real.string();
    found.link = usb_of(found.device, sys);
  } else if (const std::string address = address_of(source); !address.empty()) {
    found.link = network_to(address, sys);
    // Several clients may watch a stream. But a stream that appears twice in a rig is one camera at two positions.
    found.device = address;
  } else if (is_launch_line(rig, source)) {
    if (source.find("aravissrc") != std::string::npos)
      found.link = {
          .kind = Link::Kind::kNetwork, .name = "GigE Vision (1000 Mbit/s)", .capacity = 125e6 * kEthernetPictures};
    if (const std::string name = property_in(source, "camera-name"); !name.empty()) found.device = name;
  } else if (is_uri(source) && !source.starts_with("file:")) {
    found.device = source;
  } else if (!source.empty()) {
    found.device = fs::path(rig.resolve(source)).lexically_normal().string();
  }
  return found;
}

std::vector<LinkWarning> check_link(const LinkLoad& load) {
  std::vector<LinkWarning> all;
  const Link& link = load.link;
  const size_t count = load.cameras.size();
  if (link.camera_capacity > 0 && load.max_needed > link.camera_capacity)
    all.push_back({true,
                   link.name + ": a camera needs " + megabytes(load.max_needed) + " MB/s, but USB allows at most " +
                       megabytes(link.camera_capacity) + " per camera",
                   load.raw ? "use MJPEG (\"... ! image/jpeg\" in its source), a smaller size, or a lower frame rate"
                            : "use a smaller size or a lower frame rate"});
  if (link.capacity <= 0 || load.needed <= kLittleLeft * link.capacity) return all;
  const bool overloaded = load.needed > link.capacity;
  LinkWarning advice{overloaded,
                     link.name + ": " + std::to_string(count) + (count == 1 ? " camera needs " : " cameras need ") +
                         megabytes(load.needed) + " of " + megabytes(link.capacity) + " MB/s",
                     ""};
  const int percent = static_cast<int>(100 * kLittleLeft * link.capacity / load.needed);
  const size_t fit = std::max<size_t>(1, count * static_cast<size_t>(percent) / 100);
  std::vector<std::string> ways;
  const double as_jpeg = load.pixels * kJpegBytesPerPixel;
  if (load.raw && as_jpeg < kLittleLeft * link.capacity)
    ways.push_back("MJPEG (about " + megabytes(as_jpeg) + " MB/s)");
  ways.push_back(std::to_string(percent) + " % of the frame rate");
  if (count > fit)
    ways.push_back(link.kind == Link::Kind::kUsb
                       ? std::to_string(count - fit) + " of the cameras on ports of another controller"
                       : std::to_string(count - fit) + " of the cameras on another network adapter");
  if (link.kind == Link::Kind::kNetwork)
    ways.push_back("a packet delay that spreads each frame over its period, if only bursts are too large");
  for (size_t i = 0; i < ways.size(); i++) advice.remedy += (i ? "; or " : "") + ways[i];
  all.push_back(advice);
  return all;
}

}  // namespace lf::cameras
