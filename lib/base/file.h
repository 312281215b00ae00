// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace lf {

inline constexpr size_t kMaxFileBytes = size_t{1} << 29;

// Reads a whole regular file. Throws Error naming the file if it is missing, larger than `most_bytes`, or not a regular
// file. FIFOs are refused because they may block, devices because they may never end.
std::string read_file(const std::string& path, size_t most_bytes = kMaxFileBytes);

// Atomically replaces a file: readers see the old content or the complete new content. All files of this project are
// written by this class.
//
// The new content goes to a temporary file in the same folder; commit() renames it. The file keeps its mode and owner.
// If `path` is a symbolic link, the link stays and its target is replaced. Another user's link in a world-writable
// folder is an Error. A device or a FIFO is written to directly. Without commit() nothing changes. Functions throw
// Error naming `path`. Not thread-safe.
class AtomicFileWriter {
 public:
  explicit AtomicFileWriter(const std::string& path);
  ~AtomicFileWriter();
  AtomicFileWriter(const AtomicFileWriter&) = delete;
  AtomicFileWriter& operator=(const AtomicFileWriter&) = delete;

  void write(std::string_view bytes);
  // For libraries that write to a descriptor. Open until commit().
  int descriptor() const { return descriptor_; }
  // Returns when the new content is on disk under the final name.
  void commit();

 private:
  [[noreturn]] void fail(int error) const;
  void discard();

  std::string path_, target_, temporary_;
  int descriptor_ = -1;
};

// Replaces the file `to` by the content of the regular file `from`, of any size. Throws Error naming the file.
void copy_file(const std::string& from, const std::string& to);

// Updates several files of a folder. Write the files to staging(), a hidden subfolder; commit() moves them to the same
// relative paths in the folder. Other files stay. Without commit() nothing changes. The next update removes staging
// folders of killed programs. Throws Error naming the folder.
class AtomicFolderUpdate {
 public:
  explicit AtomicFolderUpdate(const std::string& folder);  // creates the folder if needed
  ~AtomicFolderUpdate();
  AtomicFolderUpdate(const AtomicFolderUpdate&) = delete;
  AtomicFolderUpdate& operator=(const AtomicFolderUpdate&) = delete;

  const std::string& staging() const { return staging_; }
  void commit();

 private:
  std::string folder_, staging_;
  int lock_ = -1;  // held while the staging folder is in use
  bool created_ = false;
};

// Returns the message with staging folders removed from its paths.
std::string without_staging(std::string text);

inline constexpr size_t kMaxSecretBytes = 65536;

// Reads a token, key or password file. Throws Error naming the file if it is not a regular file, has more than `most`
// bytes, or is readable or writable for other users. A group may read a file of another user, such as root's 0640 files
// in /etc/ssl/private and systemd credentials.
std::string read_secret_file(const std::string& path, size_t most = kMaxSecretBytes);

void wipe(std::string& secret);

}  // namespace lf
