// SPDX-License-Identifier: LGPL-2.1-or-later
#include <sys/stat.h>

#include "gst/gst_test.h"
#include "rtp/srtp.h"
#include "support/expect_error.h"

namespace lf::rtp {
namespace {

using test::TempFile;

const std::string kSecret(32, 'k');

TEST(RtpKey, IgnoresWhiteSpaceInTheFile) {
  const TempFile plain(kSecret), spaced("\n " + kSecret + " \r\n"), other(kSecret + "k");
  const KeyId name{1, 2, 3};
  const SessionKey session = RtpKey(plain.path()).session("A", name);
  EXPECT_EQ(RtpKey(spaced.path()).session("A", name).key, session.key);
  EXPECT_NE(RtpKey(other.path()).session("A", name).key, session.key);
}

// Test vector of lib/rtp/spec.md, computed with another program.
TEST(RtpKey, MatchesTheSpecification) {
  const TempFile file(kSecret);
  const SessionKey session = RtpKey(file.path()).session("X-LIGHTFIELD-ANSWER", {0x11223344, 29000000, 0x55667788});
  const std::array<uint8_t, 12> mki = {0x01, 0xba, 0x81, 0x40, 0x55, 0x66, 0x77, 0x88, 0xb7, 0x9d, 0x5e, 0x09};
  const std::array<uint8_t, 30> key = {0x44, 0xc4, 0x2e, 0xfb, 0x7b, 0xfd, 0x84, 0x9d, 0x42, 0xdb,
                                       0x02, 0x6a, 0xab, 0xb3, 0x16, 0x7a, 0x63, 0x79, 0x8e, 0x4f,
                                       0x98, 0xf4, 0x96, 0x16, 0xbc, 0x86, 0x13, 0x85, 0x5f, 0xc6};
  EXPECT_EQ(session.mki, mki);
  EXPECT_EQ(session.key, key);
}

TEST(RtpKey, EachStreamHasItsOwnKey) {
  const TempFile file(kSecret);
  const RtpKey key(file.path());
  const SessionKey one = key.session("A", {1, 2, 3});
  EXPECT_EQ(key.session("A", {1, 2, 3}).key, one.key);
  for (const SessionKey& other : {key.session("B", {1, 2, 3}), key.session("A", {4, 2, 3}), key.session("A", {1, 4, 3}),
                                  key.session("A", {1, 2, 4})}) {
    EXPECT_NE(other.key, one.key);
    EXPECT_NE(other.mki, one.mki);
  }
  const KeyId name = key_id_of(9, one.mki);
  EXPECT_EQ(name.ssrc, 9u);
  EXPECT_EQ(name.minute, 2u);
  EXPECT_EQ(name.nonce, 3u);
}

TEST(RtpKey, ErrorsNameTheFile) {
  EXPECT_ERROR(RtpKey("/nobody/key"), "/nobody/key", "No such file");
  EXPECT_ERROR(RtpKey("/tmp"), "/tmp", "regular file");
  const TempFile empty(""), few(std::string(31, 'k') + std::string(40, ' ')), many(std::string(4097, 'k'));
  for (const TempFile* bad : {&empty, &few, &many}) EXPECT_ERROR(RtpKey(bad->path()), bad->path(), "32 to");
}

// Opening a FIFO blocks until it has a writer.
TEST(RtpKey, DoesNotWaitForAFifo) {
  const std::string path = std::string(g_get_tmp_dir()) + "/lf_fifo_" + std::to_string(getpid());
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  EXPECT_ERROR(RtpKey(path), path, "read");
  unlink(path.c_str());
}

TEST(RtpKey, RefusesAFileThatOtherUsersCanRead) {
  const TempFile file(kSecret);
  for (const mode_t mode : {0640, 0644, 0604}) {
    ASSERT_EQ(chmod(file.path().c_str(), mode), 0);
    EXPECT_ERROR(RtpKey(file.path()), "chmod 600", file.path());
  }
  ASSERT_EQ(chmod(file.path().c_str(), 0400), 0);
  EXPECT_NO_THROW(RtpKey(file.path()));
}

}  // namespace
}  // namespace lf::rtp
