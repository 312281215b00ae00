// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gio/gio.h>

#include <array>
#include <cstdint>
#include <string>

namespace lf::serve {

// The TLS certificate of a server, from two PEM files that may be replaced while the server runs. Not thread-safe.
class Certificate {
 public:
  // Throws Error naming the file that can't be used. The key file must be closed to other users.
  Certificate(std::string certificate_file, std::string key_file);
  ~Certificate() { g_object_unref(certificate_); }
  Certificate(const Certificate&) = delete;

  GTlsCertificate* get() const { return certificate_; }  // borrowed until reload() or the end of this
  // Reads the files again if they have changed since they were read last. Returns whether there is another
  // certificate. Throws Error if the files can't be used: the certificate stays as it was, until they change again.
  bool reload();

 private:
  // What tells two versions of a file apart. Links are followed, because renewing often replaces a link.
  using Version = std::array<int64_t, 4>;
  static Version version_of(const std::string& path);

  const std::string certificate_file_, key_file_;
  std::array<Version, 2> read_;
  GTlsCertificate* certificate_;
};

}  // namespace lf::serve
