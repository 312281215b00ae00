// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <string>

namespace lf {

inline constexpr size_t kMaxSecretBytes = 65536;

// Reads a token, key or password file. Throws Error naming the file if it is not a regular file, has more than `most`
// bytes, or if other users can read or write it. A group may read a file that another user owns, such as root's
// 0640 files in /etc/ssl/private and systemd credentials.
std::string read_secret_file(const std::string& path, size_t most = kMaxSecretBytes);

// Overwrites a secret and empties the string.
void wipe(std::string& secret);

}  // namespace lf
