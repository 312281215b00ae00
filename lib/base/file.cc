// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/file.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <random>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/text.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail_to_read(const std::string& path, const std::string& reason) {
  throw Error(path + ": can't be read: " + reason);
}

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  operator int() const { return number_; }

 private:
  int number_;
};

std::string folder_of(const std::string& path) {
  const std::string folder = fs::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

bool is_foreign(const struct stat& link, const struct stat& folder) {
  return (folder.st_mode & S_IWOTH) && link.st_uid != geteuid() && link.st_uid != folder.st_uid;
}

// Follows symbolic links to a file, which need not exist. Throws Error if there are too many links, or if a link
// belongs to another user and its folder is world-writable.
std::string follow_links(const std::string& named) {
  constexpr int kMaxLinks = 40;
  std::string path = named;
  for (int i = 0; i < kMaxLinks; i++) {
    struct stat link, folder;
    if (lstat(path.c_str(), &link) != 0 || !S_ISLNK(link.st_mode)) return path;
    if (stat(folder_of(path).c_str(), &folder) == 0 && is_foreign(link, folder))
      throw Error(named + ": can't be written: " + (path == named ? "it" : path) +
                  " is a symbolic link of another user in a world-writable folder");
    std::error_code error;
    const fs::path target = fs::read_symlink(path, error);
    if (error) return path;
    path = (fs::path(path).parent_path() / target).string();  // an absolute target replaces the folder
  }
  throw Error(named + ": can't be written: " + std::strerror(ELOOP));
}

// Applies the rule of follow_links() to each folder in the path, and to the folders in the targets of links.
void check_folder_links(const std::string& folder, int& links) {
  constexpr int kMaxLinks = 40;
  fs::path path;
  for (const fs::path& part : fs::path(folder)) {
    path /= part;
    const std::string name = path.string();
    if (name.ends_with('/')) continue;
    const std::string target = follow_links(name);
    if (target == name) continue;
    if (++links > kMaxLinks) throw Error(folder + ": can't be written: " + std::strerror(ELOOP));
    check_folder_links(folder_of(target), links);
  }
}

void check_folder_links(const std::string& folder) {
  int links = 0;
  check_folder_links(folder, links);
}

std::string random_name(const std::string& beginning, const std::string& ending) {
  std::random_device random;
  char digits[17];
  std::snprintf(digits, sizeof digits, "%08x%08x", random(), random());
  return beginning + digits + ending;
}

// Makes a rename in the folder survive a power failure. Errors are ignored, because some file systems do not support
// fsync() on folders.
void sync_folder(const std::string& folder) {
  const Descriptor opened(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (opened >= 0) fsync(opened);
}

// Gives the new file the owner and mode of the old file. If the group cannot be kept, it gets no permissions.
void copy_owner_and_mode(int descriptor, const struct stat& old) {
  mode_t mode = old.st_mode & 07777;
  if (fchown(descriptor, old.st_uid, old.st_gid) != 0 && fchown(descriptor, static_cast<uid_t>(-1), old.st_gid) != 0) {
    struct stat own;
    if (fstat(descriptor, &own) != 0 || own.st_gid != old.st_gid) mode &= ~static_cast<mode_t>(S_IRWXG);
  }
  fchmod(descriptor, mode & 0777);
}

constexpr char kStaging[] = ".new-";

// Removes staging folders of programs that ended without cleaning up, which have an unlocked lock. A new folder is
// unlocked for an instant, so young folders are kept.
void remove_old_staging(const std::string& folder) {
  constexpr time_t kYoung = 60;  // seconds
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored)) {
    if (!entry.path().filename().string().starts_with(kStaging)) continue;
    const Descriptor opened(open(entry.path().c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    struct stat status;
    if (opened < 0 || fstat(opened, &status) != 0 || time(nullptr) - status.st_mtime < kYoung) continue;
    if (flock(opened, LOCK_EX | LOCK_NB) == 0) fs::remove_all(entry.path(), ignored);
  }
}

int open_regular(const std::string& path, uint64_t& size) {
  const int file = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
  struct stat status;
  if (file < 0 || fstat(file, &status) != 0) {
    const int reason = errno;
    if (file >= 0) close(file);
    fail_to_read(path, std::strerror(reason));
  }
  size = static_cast<uint64_t>(status.st_size);
  if (S_ISREG(status.st_mode)) return file;
  close(file);
  fail_to_read(path, S_ISDIR(status.st_mode) ? "it is a folder" : "it is not a regular file");
}

bool is_exposed(const struct stat& status) {
  const mode_t group = status.st_uid == geteuid() ? S_IRWXG : S_IWGRP | S_IXGRP;
  return status.st_mode & (group | S_IRWXO);
}

std::string mode_text(const struct stat& status) {
  char mode[8];
  std::snprintf(mode, sizeof mode, "%o", static_cast<unsigned>(status.st_mode & 0777));
  return mode;
}

}  // namespace

std::string read_file(const std::string& path, size_t most_bytes) {
  const auto fail = [&](const std::string& reason) { fail_to_read(path, reason); };
  uint64_t file_size = 0;
  const Descriptor file(open_regular(path, file_size));
  const auto too_large = [&] { fail("it has more than " + std::to_string(most_bytes) + " bytes"); };
  if (file_size > most_bytes) too_large();
  std::string text(static_cast<size_t>(file_size), '\0');
  size_t size = 0;
  for (;;) {
    // Files of /proc report size 0, and other files may grow during reading.
    if (size == text.size()) text.resize(std::min(most_bytes + 1, size + 4096));
    const ssize_t count = read(file, text.data() + size, text.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(std::strerror(errno));
    if (count == 0) break;
    size += static_cast<size_t>(count);
    if (size > most_bytes) too_large();
  }
  text.resize(size);
  return text;
}

void copy_file(const std::string& from, const std::string& to) {
  uint64_t size = 0;
  const Descriptor file(open_regular(from, size));
  AtomicFileWriter copy(to);
  std::string bytes(size_t{1} << 20, '\0');
  for (;;) {
    const ssize_t count = read(file, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail_to_read(from, std::strerror(errno));
    if (count == 0) break;
    copy.write(std::string_view(bytes).substr(0, static_cast<size_t>(count)));
  }
  copy.commit();
}

void AtomicFileWriter::fail(int error) const {
  throw Error(path_ + ": can't be written: " + std::strerror(error == 0 ? EIO : error));
}

AtomicFileWriter::AtomicFileWriter(const std::string& path) : path_(path), target_(follow_links(path)) {
  check_folder_links(folder_of(path));
  check_folder_links(folder_of(target_));
  struct stat old;
  const bool exists = lstat(target_.c_str(), &old) == 0;
  if (!exists && errno != ENOENT) fail(errno);
  if (exists && S_ISDIR(old.st_mode)) fail(EISDIR);
  if (exists && !S_ISREG(old.st_mode)) {
    descriptor_ = open(path.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY);
    if (descriptor_ < 0) fail(errno);
    return;
  }
  constexpr size_t kMaxNameBytes = 200;
  const std::string name = fs::path(target_).filename().string().substr(0, kMaxNameBytes);
  if (name.empty()) fail(EISDIR);
  std::string temporary;
  do {
    temporary = random_name(folder_of(target_) + "/." + name + ".", ".part");
    descriptor_ = open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, exists ? 0600 : 0666);
  } while (descriptor_ < 0 && errno == EEXIST);
  if (descriptor_ < 0) fail(errno);
  temporary_ = temporary;
  if (exists) copy_owner_and_mode(descriptor_, old);
}

AtomicFileWriter::~AtomicFileWriter() { discard(); }

void AtomicFileWriter::discard() {
  if (descriptor_ >= 0) close(std::exchange(descriptor_, -1));
  if (!temporary_.empty()) unlink(std::exchange(temporary_, "").c_str());
}

void AtomicFileWriter::write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(descriptor_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(errno);
    bytes.remove_prefix(static_cast<size_t>(count));
  }
}

void AtomicFileWriter::commit() {
  if (!temporary_.empty() && fsync(descriptor_) != 0) fail(errno);
  if (close(std::exchange(descriptor_, -1)) != 0) fail(errno);
  if (temporary_.empty()) return;
  if (std::rename(temporary_.c_str(), target_.c_str()) != 0) fail(errno);
  temporary_.clear();
  sync_folder(folder_of(target_));
}

bool make_folder(const std::string& folder) {
  check_folder_links(folder);
  std::error_code error;
  const bool created = fs::create_directories(folder, error);
  if (error) throw Error(folder + ": can't be made: " + error.message());
  return created;
}

std::string without_staging(std::string text) {
  for (size_t at = 0; (at = text.find(std::string("/") + kStaging, at)) != text.npos;) {
    const size_t end = text.find('/', at + 1);
    if (end == text.npos) break;
    text.erase(at, end - at);
  }
  return text;
}

AtomicFolderUpdate::AtomicFolderUpdate(const std::string& folder) : folder_(folder) {
  const auto fail = [&](const std::string& reason) { throw Error(folder + ": can't be made: " + reason); };
  created_ = make_folder(folder);
  remove_old_staging(folder);
  do {
    staging_ = random_name(folder + "/" + kStaging, "");
  } while (mkdir(staging_.c_str(), 0777) != 0 && errno == EEXIST);
  lock_ = open(staging_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (lock_ >= 0) {
    flock(lock_, LOCK_EX);
    return;
  }
  const int reason = errno;
  staging_.clear();
  fail(std::strerror(reason));
}

AtomicFolderUpdate::~AtomicFolderUpdate() {
  std::error_code ignored;
  if (!staging_.empty()) fs::remove_all(staging_, ignored);
  if (lock_ >= 0) close(lock_);
  if (created_) fs::remove(folder_, ignored);  // fails unless it is empty
}

void AtomicFolderUpdate::commit() {
  const auto fail = [&](const fs::path& path, const std::string& reason) {
    throw Error((fs::path(folder_) / path).string() + ": can't be written: " + reason);
  };
  try {
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(staging_)) {
      const fs::path name = entry.path().lexically_relative(staging_);
      if (entry.is_directory() && !entry.is_symlink())
        make_folder((fs::path(folder_) / name).string());
      else
        files.push_back(name);
    }
    std::ranges::sort(files);
    for (const fs::path& name : files)
      if (fs::is_directory(fs::path(folder_) / name)) fail(name, "it is a folder; remove or rename the folder");
    for (const fs::path& name : files) {
      const std::string target = follow_links((fs::path(folder_) / name).string());
      std::error_code error;
      fs::rename(fs::path(staging_) / name, target, error);
      if (error) fail(name, error.message());
    }
    fs::remove_all(std::exchange(staging_, ""));
  } catch (const fs::filesystem_error& error) {
    throw Error(folder_ + ": can't be written: " + error.code().message());
  }
  sync_folder(folder_);
}

std::string read_secret_file(const std::string& path, size_t most) {
  // Opening a FIFO without O_NONBLOCK blocks until another process writes to the FIFO.
  const Descriptor file(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
  struct stat status {};
  if (file < 0 || fstat(file, &status) != 0) fail_to_read(path, std::strerror(errno));
  if (!S_ISREG(status.st_mode)) fail_to_read(path, "it is not a regular file");
  if (is_exposed(status))
    throw Error(path + ": other users can read or change this secret (mode " + mode_text(status) + "): run chmod 600 " +
                path);
  std::string text(most + 1, '\0');
  size_t size = 0;
  while (size < text.size()) {
    const ssize_t count = read(file, text.data() + size, text.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail_to_read(path, std::strerror(errno));
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

std::string exposed_mode(const std::string& path) {
  struct stat status {};
  return stat(path.c_str(), &status) == 0 && is_exposed(status) ? mode_text(status) : "";
}

void wipe(std::string& secret) {
  explicit_bzero(secret.data(), secret.size());  // a compiler may remove a plain memset
  secret.clear();
}

}  // namespace lf
