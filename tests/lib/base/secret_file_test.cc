// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/secret_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "support/expect_error.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

class SecretFile : public testing::Test {
 protected:
  void set_mode(mode_t mode) { ASSERT_EQ(chmod(path_.c_str(), mode), 0); }

  const TempDir dir_;
  const std::string path_ = dir_.write_secret("token", "open sesame\n");
};

TEST_F(SecretFile, IsReadAsItIs) {
  for (const mode_t mode : {0600, 0400}) {
    set_mode(mode);
    EXPECT_EQ(read_secret_file(path_), "open sesame\n");
  }
}

TEST_F(SecretFile, MustBeClosedToOtherUsers) {
  for (const mode_t mode : {0640, 0620, 0610, 0604, 0602, 0644, 0666}) {
    set_mode(mode);
    EXPECT_ERROR(read_secret_file(path_), "chmod 600 " + path_) << std::oct << mode;
  }
}

// A service may read a file of root by its group, as Debian's ssl-cert and systemd's credentials have it.
TEST_F(SecretFile, MayBelongToAnotherUserAndBeReadByAGroup) {
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
  EXPECT_ERROR(read_secret_file(dir_ / "none"), "none: can't be read: No such file");
  EXPECT_ERROR(read_secret_file(dir_.path()), "not a regular file");
  EXPECT_ERROR(read_secret_file("/dev/zero"), "not a regular file");
  ASSERT_EQ(mkfifo((dir_ / "fifo").c_str(), 0600), 0);
  EXPECT_ERROR(read_secret_file(dir_ / "fifo"), "not a regular file") << "and is not waited for";
  EXPECT_ERROR(read_secret_file(path_, 11), "at most 11 bytes");
  EXPECT_EQ(read_secret_file(path_, 12).size(), 12u);
}

TEST(Secret, IsEmptyAfterWiping) {
  std::string secret = "open sesame";
  wipe(secret);
  EXPECT_EQ(secret, "");
}

}  // namespace
}  // namespace lf
