// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/rig_trust.h"

#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "base/error.h"
#include "rig/bin_description.h"

namespace lf {
namespace {

// Debian creates a group for each user, with the user's name and no other members.
bool is_private_group(uid_t user, gid_t group) {
  constexpr size_t kMost = 16384;
  std::vector<char> user_text(kMost), group_text(kMost);
  passwd user_entry, *user_found = nullptr;
  ::group group_entry, *group_found = nullptr;
  if (getpwuid_r(user, &user_entry, user_text.data(), kMost, &user_found) != 0 || !user_found) return false;
  if (getgrgid_r(group, &group_entry, group_text.data(), kMost, &group_found) != 0 || !group_found) return false;
  return std::strcmp(user_entry.pw_name, group_entry.gr_name) == 0 && !group_entry.gr_mem[0];
}

void require_own_file(const std::string& path) {
  struct stat status;
  if (stat(path.c_str(), &status) != 0) throw Error(path + ": " + std::strerror(errno));
  const bool others_write =
      (status.st_mode & S_IWOTH) || ((status.st_mode & S_IWGRP) && !is_private_group(status.st_uid, status.st_gid));
  if ((status.st_uid == geteuid() || status.st_uid == 0) && !others_write) return;
  throw Error(path +
              " is written by others, and a source that describes elements may run any program: only rig files "
              "of your own may have one (make it yours with chown and chmod go-w, or copy it)");
}

}  // namespace

void require_trust(const Camera& camera, const std::string& path, bool trusted) {
  if (is_bin_description(camera.source) && !path.empty()) require_own_file(path);
  if (trusted) return;
  // An image is never a description, but may be a URI. It is opened where there is no source.
  const bool is_image = camera.source.empty() && !is_bin_description(camera.image);
  if (const auto part = untrusted_part(is_image ? camera.image : camera.source))
    throw Error("its source has " + *part +
                ", which may write files or run programs. If you trust this rig file, allow it: --trust-rig, or the "
                "property trusted=true");
}

void require_trust(const Rig& rig, const std::string& path, bool trusted) {
  for (const Camera& camera : rig.cameras) {
    if (is_bin_description(camera.source) && !describes_elements(rig, camera.source)) continue;  // a file's name
    try {
      require_trust(camera, path, trusted);
    } catch (const Error& error) {
      throw Error(path + ": camera " + std::to_string(camera.id) +
                  (camera.name.empty() ? "" : " (" + camera.name + ")") + ": " + error.what());
    }
  }
}

}  // namespace lf
