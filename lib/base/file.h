// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace lf {

inline constexpr size_t kMaxFileBytes = size_t{1} << 29;

// Reads a whole file. Throws Error with the file's name if the file is missing, is not a regular file, or has more than
// `most_bytes` bytes.
std::string read_file(const std::string& path, size_t most_bytes = kMaxFileBytes);

// Replaces a file atomically, so that readers see either the old content or the complete new content.
// Writes the new content to a temporary file in the same folder. commit() renames the temporary file. Without commit(),
// nothing changes. The file keeps its mode and owner. If `path` is a symbolic link, the link stays and its target is
// replaced. A link of another user in a world-writable folder is an error, because it could redirect the output. The
// same holds for links to folders in `path`. A device or a FIFO is written to directly. All functions throw Error with
// `path`. Not thread-safe.
class AtomicFileWriter {
 public:
  explicit AtomicFileWriter(const std::string& path);
  ~AtomicFileWriter();
  AtomicFileWriter(const AtomicFileWriter&) = delete;
  AtomicFileWriter& operator=(const AtomicFileWriter&) = delete;

  void write(std::string_view bytes);
  // Returns the file descriptor of the temporary file, for libraries that write to a descriptor. It is open until
  // commit().
  int descriptor() const { return descriptor_; }
  // Returns when the new content is on disk under the final name.
  void commit();

 private:
  [[noreturn]] void fail(int error) const;
  void discard();

  std::string path_, target_, temporary_;
  int descriptor_ = -1;
};

// Replaces the file `to` by the content of the regular file `from`, of any size. Throws Error with the file's name.
void copy_file(const std::string& from, const std::string& to);

// Creates an output folder and its parents, if they do not exist. Returns true if it creates the folder. Throws Error
// if that fails, or if a folder in the path is a symbolic link of another user in a world-writable folder.
bool make_folder(const std::string& folder);

// Updates several files of a folder together. Write the new files to staging(), which is a hidden subfolder. commit()
// then moves them to the same relative paths in the folder; other files stay. Without commit(), nothing changes. If the
// program is killed, the next update removes its staging folder. Throws Error with the folder's name.
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

// Removes the name of a staging folder from paths in a text, because error messages must show the final paths.
std::string without_staging(std::string text);

inline constexpr size_t kMaxSecretBytes = 65536;

// Reads a file with a token, key or password. Throws Error with the file's name if it is not a regular file, has more
// than `most` bytes, or can be read or changed by other users. A group may read a file that belongs to another user,
// such as root's 0640 files in /etc/ssl/private and systemd credentials.
std::string read_secret_file(const std::string& path, size_t most = kMaxSecretBytes);

// Returns the mode of a file, such as "644", if other users can read or change it by the rules of read_secret_file();
// otherwise "", also for a file that does not exist.
std::string exposed_mode(const std::string& path);

// Overwrites a secret in memory, and empties the text.
void wipe(std::string& secret);

}  // namespace lf
