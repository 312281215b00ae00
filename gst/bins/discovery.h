// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/text.h"
#include "rig/rig.h"

namespace lf {

// The announcement of a camera host by DNS-SD (service type "_lightfield._udp"), made by `lf-rig deploy`. The members
// are fields of its TXT record.
struct AnnouncedHost {
  static constexpr char kType[] = "_lightfield._udp";

  std::string rig;                   // Rig::hash(), 16 hexadecimal digits
  std::string cameras;               // list of camera ids, as for parse_camera_list()
  std::vector<NodeAddress> clients;  // connection of each client; `answer_host` is the address of the client
};
std::string rig_hash_text(const Rig& rig);
// Parses the fields "rig=", "cameras=" and "client0=", "client1=", ... Returns nothing if a field is missing or
// invalid.
std::optional<AnnouncedHost> parse_announcement(const std::vector<std::string>& fields);

// Selects the connections of the announced hosts to this machine, which has these addresses: one for each host with
// cameras of this rig that no earlier host has. Removes these cameras from `missing`.
std::vector<NodeAddress> connections_to(const std::set<std::string>& own_addresses, const Rig& rig,
                                        const std::vector<AnnouncedHost>& hosts, std::set<CameraIndex>& missing);

// Returns the camera hosts in `text`, a value of the property `nodes` of lfviewsrc. "auto" means the hosts that
// announce cameras of this rig and a connection to this machine. The search ends when all cameras are found, or after
// five seconds; `warn` then receives a message about the missing cameras. Throws Error if `text` is invalid, if no host
// is found, or if the service avahi-daemon does not run.
std::vector<NodeAddress> find_nodes(const std::string& text, const Rig& rig,
                                    const std::function<void(const std::string&)>& warn);

}  // namespace lf
