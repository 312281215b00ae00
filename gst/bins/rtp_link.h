// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/text.h"

// RTP connections for requests and answers, used by the bins of the plugin and by lf-serve.
namespace lf {

// A group of elements in a bin. The destructor stops and removes them; call it while nothing runs.
class ScopedElements {
 public:
  explicit ScopedElements(GstBin* bin) : bin_(bin) {}
  ~ScopedElements();
  ScopedElements(const ScopedElements&) = delete;
  ScopedElements& operator=(const ScopedElements&) = delete;

  // Creates an element and adds it to the bin. The returned pointer is borrowed. Throws Error if the factory is
  // missing.
  GstElement* add(const char* factory, const std::string& name);
  // Adds an existing element.
  GstElement* add(GstElement* element);

 private:
  GstBin* bin_;
  std::vector<GstElement*> elements_;
};

// Returns the view id in a request or answer. Nothing if the buffer is too short.
std::optional<uint32_t> view_of(GstBuffer* unit);

// Defines the hosts that may send packets. If `key_file` is set, every holder of the key may. Otherwise the hosts in
// `peers` may, as in lfrtpgate.
struct RtpSecurity {
  std::string key_file, peers;
  bool operator==(const RtpSecurity&) const = default;
};

// Returns the settings with a default for `peers`: if neither key nor peers are set, `addresses` and this machine.
RtpSecurity rtp_security_of(const RtpSecurity& settings, const std::vector<std::string>& addresses);

// Posts a warning if there is no key, because sender addresses can be forged.
void warn_without_key(GstElement* element, const RtpSecurity& security);

// Adds a receiver: a udpsrc with a large socket buffer, an lfrtpgate and an rtplfdepay, linked. Returns the rtplfdepay,
// borrowed. `from.host` is an address of this machine, a multicast group, or "" for all addresses. `encoding` is the
// encoding-name of the RTP caps (lib/rtp/spec.md). `name` is the prefix of the element names. Throws Error.
GstElement* add_receiver(ScopedElements& to, const HostPort& from, const char* encoding, const RtpSecurity& security,
                         const std::string& name);

// The RTP connection from a viewer to camera nodes on other hosts. One stream carries the requests to all hosts, and
// each host sends its answers to a separate port. The destructor removes the elements from the bin.
class CameraHosts {
 public:
  struct Host {
    std::string name;
    GstElement* answers;  // has the pad "src" with the answers; borrowed
  };

  // `key_file` names the file with the shared secret. If it is "", packets are not encrypted, and answers are accepted
  // only from the addresses of these hosts. Throws Error if an element is not installed or a host name cannot be
  // resolved.
  CameraHosts(GstBin* bin, const std::vector<NodeAddress>& nodes, const std::string& key_file);

  GstElement* requests() const { return requests_; }  // has the pad "sink" for the requests; borrowed
  const std::vector<Host>& hosts() const { return hosts_; }

 private:
  ScopedElements elements_;
  GstElement* requests_;
  std::vector<Host> hosts_;
};

// Binds the property `limits` of all rtplfdepay and lfcameranode in the bin to the property of `element`.
void bind_limits(GstBin* bin, GstElement* element);

// Makes errors of udpsrc useful: returns an error that names the port and the reason. Returns other messages unchanged.
// Takes and returns a reference.
GstMessage* with_port(GstMessage* message);

}  // namespace lf
