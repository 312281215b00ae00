// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/secret_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "base/error.h"

namespace lf {
namespace {

struct Descriptor {
  ~Descriptor() {
    if (value >= 0) close(value);
  }
  int value;
};

bool is_exposed(const struct stat& status) {
  const mode_t group = status.st_uid == geteuid() ? S_IRWXG : S_IWGRP | S_IXGRP;
  return status.st_mode & (group | S_IRWXO);
}

}  // namespace

std::string read_secret_file(const std::string& path, size_t most) {
  // Without O_NONBLOCK, opening a FIFO blocks until another process writes to it.
  const Descriptor file{open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY)};
  struct stat status {};
  if (file.value < 0 || fstat(file.value, &status) != 0) throw Error(path + ": can't be read: " + std::strerror(errno));
  if (!S_ISREG(status.st_mode)) throw Error(path + ": can't be read: it is not a regular file");
  if (is_exposed(status)) {
    char mode[8];
    std::snprintf(mode, sizeof mode, "%o", static_cast<unsigned>(status.st_mode & 0777));
    throw Error(path + ": other users can read or change this secret (mode " + mode + "): run chmod 600 " + path);
  }
  std::string text(most + 1, '\0');
  size_t size = 0;
  while (size < text.size()) {
    const ssize_t count = read(file.value, text.data() + size, text.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw Error(path + ": can't be read: " + std::strerror(errno));
    if (count == 0) break;
    size += static_cast<size_t>(count);
  }
  if (size > most) {
    wipe(text);
    throw Error(path + ": a secret has at most " + std::to_string(most) + " bytes");
  }
  text.resize(size);
  return text;
}

void wipe(std::string& secret) {
  explicit_bzero(secret.data(), secret.size());  // a compiler may leave out a plain memset
  secret.clear();
}

}  // namespace lf
