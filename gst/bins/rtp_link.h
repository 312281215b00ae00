// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/text.h"

// Requests and answers as RTP over UDP, for bins: those of the plugin, and the pipeline of lf-serve.
namespace lf {

// Elements that were added to a bin, and leave it when this goes. Call while nothing runs.
class AddedElements {
 public:
  explicit AddedElements(GstBin* bin) : bin_(bin) {}
  ~AddedElements();
  AddedElements(const AddedElements&) = delete;
  AddedElements& operator=(const AddedElements&) = delete;

  // Makes an element and adds it; borrowed. Throws Error that names the package that it is in.
  GstElement* add(const char* factory, const std::string& name);
  // Adds an element that has just been made, and returns it; borrowed.
  GstElement* add(GstElement* element);

 private:
  GstBin* bin_;
  std::vector<GstElement*> elements_;
};

// The view that a request or an answer is of; nothing for what is too short to be one.
std::optional<uint32_t> view_of(GstBuffer* unit);

// Who may send: who has the key, or, without one, who has one of these addresses (lfrtpgate).
struct Admission {
  std::string key_file, peers;
  bool operator==(const Admission&) const = default;
};

// Who may send, as the settings have it; where they name no peers and no key: a host at these addresses, which packets
// are expected from, and this machine.
Admission admission_of(const Admission& settings, const std::vector<std::string>& addresses);

// Posts a warning, if there is no key, that those who are let in are not all who can get in.
void warn_without_key(GstElement* element, const Admission& admission);

// Adds what receives RTP: a udpsrc with room for a burst, an lfrtpgate and an rtplfdepay, linked. Returns the last one,
// whose pad "src" units leave by; borrowed. `from.host`: an address of this machine, a multicast group, or "" for all
// addresses of this machine, of either family. `encoding`: of the RTP caps, as lib/rtp/spec.md has them. The names of
// the elements begin with `name`. Throws Error.
GstElement* add_receiver(AddedElements& to, const HostPort& from, const char* encoding, const Admission& admission,
                         const std::string& name);

// The way to cameras on other hosts and back: requests go to all of them in one stream, and the answers of each come in
// at a port of their own. The elements are the bin's, and leave it when this goes.
class CameraHosts {
 public:
  struct Host {
    std::string name;     // "HOST:PORT", as users name it
    GstElement* answers;  // its answers leave by the pad "src"; borrowed
  };

  // `key_file`: what the hosts share; "" where packets are plain, and answers come from the addresses of these hosts.
  // Throws Error where GStreamer's elements for that are not there, or nobody knows a host.
  CameraHosts(GstBin* bin, const std::vector<NodeAddress>& nodes, const std::string& key_file);

  GstElement* requests() const { return requests_; }  // takes requests at its pad "sink"; borrowed
  const std::vector<Host>& hosts() const { return hosts_; }

 private:
  AddedElements elements_;
  GstElement* requests_;
  std::vector<Host> hosts_;
};

// What was added to the bin for RTP, and cameras in it, refuse the requests that `element` would, by the limits that it
// has now and those that it is given later: who stands in front of it or beside it must take what it is told to take.
void follow_limits(GstBin* bin, GstElement* element);

// The message, or one that says it so that a person can act on it: of a receiver's error, which port can't be had and
// why. Takes and gives a reference.
GstMessage* with_port(GstMessage* message);

}  // namespace lf
