// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/text.h"

// Requests and answers as RTP over UDP, for bins of the plugin and for lf-serve.
namespace lf {

// Elements in a bin. The destructor stops and removes the elements. Call while nothing runs.
class ScopedElements {
 public:
  explicit ScopedElements(GstBin* bin) : bin_(bin) {}
  ~ScopedElements();
  ScopedElements(const ScopedElements&) = delete;
  ScopedElements& operator=(const ScopedElements&) = delete;

  // Creates an element and adds it to the bin. Returns a borrowed pointer. Throws Error if its factory is missing.
  GstElement* add(const char* factory, const std::string& name);
  // Adds a new element and returns it, borrowed.
  GstElement* add(GstElement* element);

 private:
  GstBin* bin_;
  std::vector<GstElement*> elements_;
};

// Returns the view id of a request or answer, nothing if the buffer is too short.
std::optional<uint32_t> view_of(GstBuffer* unit);

// Allowed senders: holders of the key in `key_file`, or, if "", hosts with an address in `peers` (lfrtpgate).
struct RtpSecurity {
  std::string key_file, peers;
  bool operator==(const RtpSecurity&) const = default;
};

// Returns the settings. If neither key nor peers are set, `peers` becomes `addresses` plus this machine.
RtpSecurity rtp_security_of(const RtpSecurity& settings, const std::vector<std::string>& addresses);

// Posts a warning if there is no key: sender addresses can be forged.
void warn_without_key(GstElement* element, const RtpSecurity& security);

// Adds a udpsrc with a large socket buffer, an lfrtpgate and an rtplfdepay, linked. Returns the rtplfdepay, borrowed.
// `from.host` is an address of this machine, a multicast group, or "" for all IPv4 and IPv6 addresses. `encoding` is
// the encoding-name of the RTP caps (lib/rtp/spec.md). `name` is the prefix of the element names. Throws Error.
GstElement* add_receiver(ScopedElements& to, const HostPort& from, const char* encoding, const RtpSecurity& security,
                         const std::string& name);

// RTP connection to camera nodes on other hosts. One stream carries the requests to all hosts. Each host sends its
// answers to a separate port. The destructor removes the elements from the bin.
class CameraHosts {
 public:
  struct Host {
    std::string name;
    GstElement* answers;  // delivers answers at the pad "src"; borrowed
  };

  // `key_file`: shared secret. If "", packets are plain and answers are accepted from the addresses of these hosts
  // only. Throws Error if elements are not installed or a host name cannot be resolved.
  CameraHosts(GstBin* bin, const std::vector<NodeAddress>& nodes, const std::string& key_file);

  GstElement* requests() const { return requests_; }  // takes requests at the pad "sink"; borrowed
  const std::vector<Host>& hosts() const { return hosts_; }

 private:
  ScopedElements elements_;
  GstElement* requests_;
  std::vector<Host> hosts_;
};

// Binds the property `limits` of all rtplfdepay and lfcameranode in the bin to `element`, so that all accept the same
// requests.
void bind_limits(GstBin* bin, GstElement* element);

// Returns the message. A udpsrc error becomes an error that names the port and the reason. Takes and returns a
// reference.
GstMessage* with_port(GstMessage* message);

}  // namespace lf
