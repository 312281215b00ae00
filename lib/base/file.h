// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace lf {

inline constexpr size_t kMostFileBytes = size_t{1} << 29;

// Reads a whole regular file. Throws Error naming the file if it is missing, larger than `most_bytes`, or not a regular
// file: a FIFO may block for ever, and a device may never end.
std::string read_file(const std::string& path, size_t most_bytes = kMostFileBytes);

// Replaces a file as a whole: readers see the old content or the complete new content. All files of this project are
// written by this class.
//
// The new content goes to a temporary file in the same folder; commit() renames it. The file keeps its mode and owner.
// If `path` is a symbolic link, the link stays and its target is replaced. Another user's link in a world-writable
// folder is an Error. A device or a FIFO is written to directly. Without commit() nothing changes. Functions throw
// Error naming `path`. Not thread-safe.
class FileReplacement {
 public:
  explicit FileReplacement(const std::string& path);
  ~FileReplacement();
  FileReplacement(const FileReplacement&) = delete;
  FileReplacement& operator=(const FileReplacement&) = delete;

  void write(std::string_view bytes);
  // For libraries that write to a descriptor. Stays open until commit().
  int descriptor() const { return descriptor_; }
  // Returns when the new content is on the disk under the file's name.
  void commit();

 private:
  [[noreturn]] void fail(int error) const;
  void discard();

  std::string path_, target_, temporary_;  // temporary_ is empty while there is no temporary file
  int descriptor_ = -1;
};

// Replaces the file `to` by the content of the regular file `from`, of any size. Throws Error naming either.
void copy_file(const std::string& from, const std::string& to);

// New content of a folder, which is complete before it replaces anything: files are written to staging(), a hidden
// folder inside; commit() moves them to the places of the same names in the folder. Files of other names stay. Without
// commit() nothing changes. What a program that was killed has left is removed by the next update of the folder. Throws
// Error naming the folder.
class FolderUpdate {
 public:
  explicit FolderUpdate(const std::string& folder);  // creates the folder if needed
  ~FolderUpdate();
  FolderUpdate(const FolderUpdate&) = delete;
  FolderUpdate& operator=(const FolderUpdate&) = delete;

  const std::string& staging() const { return staging_; }
  void commit();

 private:
  std::string folder_, staging_;
  int lock_ = -1;  // held while the staging folder is in use
  bool created_ = false;
};

// A message with the names that files get at the end in place of their names in staging folders.
std::string without_staging(std::string text);

inline constexpr size_t kMaxSecretBytes = 65536;

// Reads a token, key or password file. Throws Error naming the file if it is not a regular file, has more than `most`
// bytes, or if other users can read or write it. A group may read a file that another user owns, such as root's
// 0640 files in /etc/ssl/private and systemd credentials.
std::string read_secret_file(const std::string& path, size_t most = kMaxSecretBytes);

// Overwrites a secret and empties the string.
void wipe(std::string& secret);

}  // namespace lf
