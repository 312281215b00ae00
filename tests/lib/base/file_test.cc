// SPDX-License-Identifier: LGPL-2.1-or-later

#include <sys/stat.h>

#include "base/file.h"
#include "base/json_value.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

namespace fs = std::filesystem;
using namespace std::string_literals;

mode_t mode_of(const std::string& path) {
  struct stat status {};
  stat(path.c_str(), &status);
  return status.st_mode & 07777;
}

size_t entries_of(const std::string& folder) {
  size_t count = 0;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator(folder)) count++;
  return count;
}

TEST(ReadFile, RefusesOtherThanRegularFilesWithoutWaiting) {
  const TempDir dir;
  ASSERT_EQ(mkfifo((dir / "fifo").c_str(), 0600), 0);
  fs::create_symlink("/dev/zero", dir / "zero");
  EXPECT_ERROR(read_file(dir / "fifo"), "fifo", "regular file");
  EXPECT_ERROR(read_file(dir / "zero"), "zero", "regular file");
  EXPECT_ERROR(read_file(dir.path()), "read", "folder");
  EXPECT_ERROR(read_file(dir / "none"), "none", "No such file");
}

TEST(ReadFile, LimitsTheSize) {
  const TempDir dir;
  dir.write("ten", "0123456789");
  EXPECT_EQ(read_file(dir / "ten", 10), "0123456789");
  EXPECT_ERROR(read_file(dir / "ten", 9), "ten", "9 bytes");
  dir.write("sparse", "");
  fs::resize_file(dir / "sparse", uintmax_t{1} << 40);
  EXPECT_ERROR(read_file(dir / "sparse"), "sparse", "read");
  EXPECT_FALSE(read_file("/proc/self/stat").empty()) << "reported size 0";
}

TEST(AtomicFileWriter, KeepsTheMode) {
  const TempDir dir;
  for (const mode_t mode : {0600, 0640, 0664, 0444}) {
    dir.write("rig.json", "old");
    chmod((dir / "rig.json").c_str(), mode);
    write_text_file("new", dir / "rig.json");
    EXPECT_EQ(mode_of(dir / "rig.json"), mode);
    fs::remove(dir / "rig.json");
  }
  const mode_t mask = umask(027);
  write_text_file("new", dir / "rig.json");
  umask(mask);
  EXPECT_EQ(mode_of(dir / "rig.json"), 0640u);
}

TEST(AtomicFileWriter, LinksStayLinks) {
  const TempDir dir;
  dir.write("folder/real", "old");
  fs::create_symlink("folder/real", dir / "one");
  fs::create_symlink("one", dir / "two");
  write_text_file("new", dir / "two");
  EXPECT_TRUE(fs::is_symlink(dir / "two"));
  EXPECT_TRUE(fs::is_symlink(dir / "one"));
  EXPECT_EQ(read_text_file(dir / "folder/real"), "new");
  fs::create_symlink("folder/later", dir / "dangling");
  write_text_file("new", dir / "dangling");
  EXPECT_EQ(read_text_file(dir / "folder/later"), "new");
  fs::create_symlink("loop", dir / "loop");
  EXPECT_ERROR(write_text_file("new", dir / "loop"), "loop", "written");
  EXPECT_EQ(entries_of(dir / "folder"), 2u) << "no temporary file is left";
}

TEST(AtomicFileWriter, RefusesLinksOfOtherUsersInWorldWritableFolders) {
  const TempDir dir;
  dir.write("victim", "precious");
  fs::create_symlink("victim", dir / "cam0.png");
  chmod(dir.path().c_str(), 01777);
  constexpr uid_t kOther = 12345;
  if (lchown((dir / "cam0.png").c_str(), kOther, kOther) != 0) GTEST_SKIP() << "only root can give away a link";
  EXPECT_ERROR(write_text_file("new", dir / "cam0.png"), "cam0.png", "symbolic link");
  EXPECT_EQ(read_text_file(dir / "victim"), "precious");
  chmod(dir.path().c_str(), 0755);
  write_text_file("new", dir / "cam0.png");
  EXPECT_EQ(read_text_file(dir / "victim"), "new") << "followed in an own folder";
}

TEST(OutputFolder, RefusesLinksOfOtherUsersInWorldWritableFolders) {
  const TempDir dir;
  fs::create_directory(dir / "shared");
  chmod((dir / "shared").c_str(), 01777);
  dir.write("victim/file", "precious");
  fs::create_directory_symlink(dir / "victim", dir / "shared/out");
  fs::create_directory_symlink(dir / "shared/out", dir / "link");
  constexpr uid_t kOther = 65534;
  if (lchown((dir / "shared/out").c_str(), kOther, kOther) != 0) GTEST_SKIP() << "only root can give away a link";
  const std::vector<std::string> said = {"symbolic link", "another user", "folder"};
  for (const char* const name : {"shared/out", "shared/out/", "link", "shared/../shared/out", "shared/out/new/newer"}) {
    EXPECT_ERROR(make_folder(dir / name), said) << name;
    EXPECT_ERROR(AtomicFolderUpdate(dir / name), said) << name;
    EXPECT_ERROR(write_text_file("new", dir / (name + "/file"s)), said) << name;
  }
  EXPECT_EQ(read_text_file(dir / "victim/file"), "precious");
  EXPECT_EQ(entries_of(dir / "victim"), 1u);

  ASSERT_EQ(lchown((dir / "shared/out").c_str(), geteuid(), getegid()), 0);
  EXPECT_FALSE(make_folder(dir / "link"));
  EXPECT_TRUE(make_folder(dir / "link/new/newer"));
  write_text_file("new", dir / "link/file");
  EXPECT_EQ(read_text_file(dir / "victim/file"), "new");
}

TEST(AtomicFileWriter, DoesNotFollowLinksWithATemporaryName) {
  const TempDir dir;
  dir.write("victim", "precious");
  fs::create_symlink("victim", dir / "rig.json.part");
  write_text_file("new", dir / "rig.json");
  EXPECT_EQ(read_text_file(dir / "victim"), "precious");
}

TEST(AtomicFileWriter, WithoutCommitNothingChanges) {
  const TempDir dir;
  dir.write("file", "old");
  {
    AtomicFileWriter file(dir / "file");
    file.write("half");
    EXPECT_EQ(read_text_file(dir / "file"), "old");
  }
  EXPECT_EQ(read_text_file(dir / "file"), "old");
  EXPECT_EQ(entries_of(dir.path()), 1u);
}

TEST(AtomicFileWriter, FailureKeepsTheOldFileOnly) {
  AtomicFileWriter full("/dev/full");
  EXPECT_ERROR(full.write("x"), "/dev/full", "No space");
  const TempDir dir;
  EXPECT_ERROR(write_text_file("new", dir.path()), "written", "directory");
  EXPECT_ERROR(write_text_file("new", dir / "none/file"), "none/file", "written", "No such file");
  EXPECT_EQ(entries_of(dir.path()), 0u);
}

TEST(AtomicFileWriter, DevicesAreWrittenToDirectly) {
  write_text_file("x", "/dev/null");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST(AtomicFileWriter, ConcurrentWritersLeaveAWholeFile) {
  const TempDir dir;
  const std::string path = dir / "file";
  const auto content = [](char c) { return std::string(100000, c); };
  write_text_file(content('a'), path);
  std::atomic<int> running = 3;
  std::vector<std::thread> writers;
  for (const char c : {'a', 'b', 'c'})
    writers.emplace_back([&, c] {
      for (int i = 0; i < 20; i++) write_text_file(content(c), path);
      running--;
    });
  while (running > 0) {
    const std::string read = read_text_file(path);
    ASSERT_EQ(read, content(read[0]));
  }
  for (std::thread& writer : writers) writer.join();
  EXPECT_EQ(entries_of(dir.path()), 1u);
}

TEST(CopyFile, CopiesWholeRegularFiles) {
  const TempDir dir;
  const std::string content(3000000, 'x');
  dir.write("from", content);
  dir.write("to", "old");
  copy_file(dir / "from", dir / "to");
  EXPECT_EQ(read_file(dir / "to"), content);
  EXPECT_ERROR(copy_file("/dev/zero", dir / "to"), "/dev/zero", "regular file");
  EXPECT_ERROR(copy_file(dir / "none", dir / "to"), "none", "read");
  EXPECT_EQ(read_file(dir / "to"), content);
}

TEST(AtomicFolderUpdate, ReplacesFilesOnCommit) {
  const TempDir dir;
  dir.write("out/a", "old");
  dir.write("out/kept", "kept");
  {
    AtomicFolderUpdate update(dir / "out");
    write_text_file("half", update.staging() + "/a");
  }
  EXPECT_EQ(read_text_file(dir / "out/a"), "old");
  AtomicFolderUpdate update(dir / "out");
  write_text_file("new", update.staging() + "/a");
  fs::create_directory(update.staging() + "/truth");
  write_text_file("view", update.staging() + "/truth/v");
  EXPECT_EQ(read_text_file(dir / "out/a"), "old");
  update.commit();
  EXPECT_EQ(read_text_file(dir / "out/a"), "new");
  EXPECT_EQ(read_text_file(dir / "out/kept"), "kept");
  EXPECT_EQ(read_text_file(dir / "out/truth/v"), "view");
  EXPECT_EQ(entries_of(dir / "out"), 3u) << "no staging folder is left";
}

TEST(AtomicFolderUpdate, RemovesStagingFoldersOfKilledPrograms) {
  const TempDir dir;
  dir.write("out/.new-0123/a", "half");
  const AtomicFolderUpdate young(dir / "out");
  EXPECT_TRUE(fs::exists(dir / "out/.new-0123")) << "may belong to a program that just started";
  const auto old = fs::file_time_type::clock::now() - std::chrono::hours(1);
  fs::last_write_time(dir / "out/.new-0123", old);
  fs::last_write_time(young.staging(), old);
  const AtomicFolderUpdate next(dir / "out");
  EXPECT_FALSE(fs::exists(dir / "out/.new-0123"));
  EXPECT_TRUE(fs::exists(young.staging())) << "in use";
}

TEST(AtomicFolderUpdate, RemovesUnusedFolders) {
  const TempDir dir;
  { const AtomicFolderUpdate update(dir / "out"); }
  EXPECT_FALSE(fs::exists(dir / "out"));
  dir.write("file", "");
  EXPECT_ERROR(AtomicFolderUpdate(dir / "file"), "file", "made");
}

TEST(AtomicFolderUpdate, MessagesNameTheFinalFiles) {
  EXPECT_EQ(without_staging("films/.new-c1a61b9962118843/a.mkv: full; films/.new-1/b.mkv"),
            "films/a.mkv: full; films/b.mkv");
  EXPECT_EQ(without_staging("films/.new-c1a6"), "films/.new-c1a6");
}

TEST(AtomicFolderUpdate, FolderWithTheNameOfAFileIsAnError) {
  const TempDir dir;
  dir.write("a.txt", "old");
  fs::create_directories(dir / "b.txt");
  AtomicFolderUpdate update(dir.path());
  for (const char* name : {"a.txt", "b.txt"}) std::ofstream(update.staging() + "/" + name) << "new";
  EXPECT_THROW(update.commit(), Error);
  EXPECT_EQ(read_file(dir / "a.txt"), "old");
}

class SecretFile : public testing::Test {
 protected:
  void set_mode(mode_t mode) { ASSERT_EQ(chmod(path_.c_str(), mode), 0); }

  const TempDir dir_;
  const std::string path_ = dir_.write_secret("token", "open sesame\n");
};

TEST_F(SecretFile, IsReadUnchanged) {
  for (const mode_t mode : {0600, 0400}) {
    set_mode(mode);
    EXPECT_EQ(read_secret_file(path_), "open sesame\n");
  }
}

TEST_F(SecretFile, MustNotBeAccessibleToOtherUsers) {
  for (const mode_t mode : {0640, 0620, 0610, 0604, 0602, 0644, 0666}) {
    set_mode(mode);
    EXPECT_ERROR(read_secret_file(path_), "chmod 600 " + path_) << std::oct << mode;
  }
}

// Debian's ssl-cert and systemd credentials let a service read root's files through its group.
TEST_F(SecretFile, MayBelongToAnotherUserAndBeReadableByAGroup) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can give a file to another user";
  ASSERT_EQ(chown(path_.c_str(), 65534, 65534), 0);
  set_mode(0640);
  EXPECT_EQ(read_secret_file(path_), "open sesame\n");
  set_mode(0660);
  EXPECT_ERROR(read_secret_file(path_), "chmod 600");
  set_mode(0644);
  EXPECT_ERROR(read_secret_file(path_), "chmod 600");
}

TEST_F(SecretFile, MustBeARegularFileOfLimitedSize) {
  EXPECT_ERROR(read_secret_file(dir_ / "none"), "none", "No such file");
  EXPECT_ERROR(read_secret_file(dir_.path()), "regular file");
  EXPECT_ERROR(read_secret_file("/dev/zero"), "regular file");
  ASSERT_EQ(mkfifo((dir_ / "fifo").c_str(), 0600), 0);
  EXPECT_ERROR(read_secret_file(dir_ / "fifo"), "regular file") << "without blocking";
  EXPECT_ERROR(read_secret_file(path_, 11), "11 bytes");
  EXPECT_EQ(read_secret_file(path_, 12).size(), 12u);
}

TEST(Secret, IsEmptyAfterWiping) {
  std::string secret = "open sesame";
  wipe(secret);
  EXPECT_EQ(secret, "");
}

}  // namespace
}  // namespace lf
