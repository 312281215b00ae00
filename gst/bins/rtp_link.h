// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>
#include <vector>

#include "base/host_list.h"

// Requests and answers as RTP over UDP, for bins.
namespace lf {

// Makes an element and adds it to the bin; borrowed. Throws Error that names the package that it is in.
GstElement* add_element(GstBin* bin, const char* factory, const std::string& name);

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

// What receives RTP: a udpsrc with room for a burst, an lfrtpgate and an rtplfdepay, linked; the pad that units leave
// by, with a reference. `host`: an address of this machine, a multicast group, or "" for all addresses of this machine,
// of either family. `encoding`: of the RTP caps, as lib/rtp/spec.md has them. The names of the elements begin with
// `name`; they are put behind those in *added. Throws Error.
GstPad* add_receiver(GstBin* bin, const HostPort& from, const char* encoding, const Admission& admission,
                     const std::string& name, std::vector<GstElement*>* added);

// What was added to the bin for RTP, and cameras in it, refuse the requests that `element` would, by the limits that it
// has now and those that it is given later: who stands in front of it or beside it must take what it is told to take.
void follow_limits(GstBin* bin, GstElement* element);

// The message, or one that says it so that a person can act on it: of a receiver's error, which port can't be had and
// why. Takes and gives a reference.
GstMessage* with_port(GstMessage* message);

}  // namespace lf
