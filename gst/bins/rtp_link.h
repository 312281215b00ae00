// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/text.h"

// Helpers for pipelines that send view requests and answers between hosts by RTP. Users are the bins of the plugin and
// lf-serve.
namespace lf {

// Adds elements to a bin for a limited time: the destructor stops all elements that were added and removes them from
// the bin. Destroy the object only while no data flows.
class ScopedElements {
 public:
  explicit ScopedElements(GstBin* bin) : bin_(bin) {}
  ~ScopedElements();
  ScopedElements(const ScopedElements&) = delete;
  ScopedElements& operator=(const ScopedElements&) = delete;

  // Creates an element and adds it to the bin. The bin owns the element, so the returned pointer is borrowed. Throws
  // Error if the element is not installed.
  GstElement* add(const char* factory, const std::string& name);
  GstElement* add(GstElement* element);

 private:
  GstBin* bin_;
  std::vector<GstElement*> elements_;
};

// Returns the view id in a request or an answer, which identifies the viewer of the buffer. Returns nothing if the
// buffer is too short.
std::optional<uint32_t> view_of(GstBuffer* unit);

// Defines which hosts may send packets to this host. If `key_file` is set, every host with the same key may send.
// Otherwise only the hosts in `peers` may send, a list in the format of the property `peers` of lfrtpgate, for example
// "viewer,10.0.0.7".
struct RtpSecurity {
  std::string key_file, peers;
  bool operator==(const RtpSecurity&) const = default;
};

// Completes the settings: if they have neither a key nor peers, only the hosts in `addresses` and this machine may
// send.
RtpSecurity rtp_security_of(const RtpSecurity& settings, const std::vector<std::string>& addresses);

// Posts a warning of `element` if there is no key, because packets are then not encrypted, and an attacker can forge
// the address of an allowed sender.
void warn_without_key(GstElement* element, const RtpSecurity& security);

// Adds the elements that receive packets: a udpsrc with a large socket buffer, an lfrtpgate and an rtplfdepay, linked.
// Returns the rtplfdepay, which the bin owns. `from.host` is an address of this machine, a multicast group, or "" for
// all addresses. `encoding` is the encoding-name of the RTP caps (lib/rtp/spec.md). `name` is the prefix of the element
// names. Throws Error if an element is not installed.
GstElement* add_receiver(ScopedElements& to, const HostPort& from, const char* encoding, const RtpSecurity& security,
                         const std::string& name);

// The RTP connection from one viewer to the hosts that run the cameras. One stream carries the view requests to all
// hosts, and each host sends its answers to a separate port of this machine. The destructor removes the elements from
// the bin.
class CameraHosts {
 public:
  struct Host {
    std::string name;
    GstElement* answers;  // has the pad "src" with the answers; borrowed
  };

  // Creates the elements. `key_file` names the file with the shared secret. If it is "", packets are not encrypted, and
  // answers are accepted only from the addresses of these hosts. Throws Error if an element is not installed or a host
  // name cannot be resolved.
  CameraHosts(GstBin* bin, const std::vector<NodeAddress>& nodes, const std::string& key_file);

  GstElement* requests() const { return requests_; }  // has the pad "sink" for the requests; borrowed
  const std::vector<Host>& hosts() const { return hosts_; }

 private:
  ScopedElements elements_;
  GstElement* requests_;
  std::vector<Host> hosts_;
};

// Applies the property `limits` of `element` to everything in the bin that receives requests: all rtplfdepay and
// lfcameranode. Later changes of the property are applied, too.
void bind_limits(GstBin* bin, GstElement* element);

// Replaces an error of udpsrc by a more helpful error, which names the port and the reason. Other messages are returned
// unchanged. Takes and returns a reference.
GstMessage* with_port(GstMessage* message);

}  // namespace lf
