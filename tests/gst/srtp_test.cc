// SPDX-License-Identifier: LGPL-2.1-or-later
#include <sys/stat.h>

#include "gst/gst_test.h"
#include "rtp/srtp.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"

namespace lf::rtp {
namespace {

using test::TempFile;

const std::string kSecret(32, 'k');

SessionKey session_of(const std::shared_ptr<const RtpKey>& key) { return key->session("A", {1, 2, 3}); }

TEST(KeyFile, HasOneKeyPerLineWithoutWhiteSpace) {
  const std::string other(40, 'o');
  const struct {
    const char* name;
    std::string text;
    std::vector<std::string> keys;
  } cases[] = {{"one", kSecret, {kSecret}},
               {"spaces", "\n " + kSecret + " \r\n", {kSecret}},
               {"two", kSecret + "\n" + other + "\n", {kSecret, other}},
               {"empty lines", "\r\n\t" + other + "\r\n\n \r\n" + kSecret + "\n", {other, kSecret}},
               {"spaces inside", kSecret + " \t" + other, {kSecret + " \t" + other}},
               {"longest", std::string(4096, 'k') + "\n" + other, {std::string(4096, 'k'), other}}};
  for (const auto& [name, text, keys] : cases) {
    const TempFile file(text);
    const RtpKeys read = KeyFile(file.path()).keys();
    ASSERT_EQ(read.size(), keys.size()) << name;
    for (size_t i = 0; i < keys.size(); i++) EXPECT_EQ(*read[i], RtpKey(keys[i])) << name;
  }
  EXPECT_NE(session_of(std::make_shared<RtpKey>(kSecret)).key, session_of(std::make_shared<RtpKey>(other)).key);
}

// Waits until refresh() checks the file again.
bool refresh_later(KeyFile& file) {
  g_usleep(1'050'000);
  return file.refresh();
}

TEST(KeyFile, IsReadAgainWhenItChanges) {
  const TempDir folder;
  const std::string path = folder.write_secret("key", kSecret), other(32, 'o');
  KeyFile file(path);
  EXPECT_FALSE(refresh_later(file));
  folder.write("key", kSecret + "\n" + other);
  EXPECT_FALSE(KeyFile(path).refresh()) << "the file was read less than a second ago";
  EXPECT_TRUE(refresh_later(file));
  EXPECT_EQ(file.keys().size(), 2u);
  folder.write("key", "\n" + kSecret + "\n" + other);
  EXPECT_FALSE(refresh_later(file)) << "same keys";
  folder.write("key", "short");
  EXPECT_ERROR(refresh_later(file), path, "32 to");
  EXPECT_FALSE(refresh_later(file)) << "one error per change";
  EXPECT_EQ(file.keys().size(), 2u);
  std::filesystem::remove(path);
  EXPECT_ERROR(refresh_later(file), path, "No such file");
  folder.write_secret("key", other);
  EXPECT_TRUE(refresh_later(file));
  ASSERT_EQ(file.keys().size(), 1u);
  EXPECT_EQ(*file.keys()[0], RtpKey(other));
}

// Test vector of lib/rtp/spec.md, computed with another program.
TEST(RtpKey, MatchesTheSpecification) {
  const SessionKey session = RtpKey(kSecret).session("X-LIGHTFIELD-ANSWER", {0x11223344, 29000000, 0x55667788});
  const std::array<uint8_t, 12> mki = {0x01, 0xba, 0x81, 0x40, 0x55, 0x66, 0x77, 0x88, 0xb7, 0x9d, 0x5e, 0x09};
  const std::array<uint8_t, 30> key = {0x44, 0xc4, 0x2e, 0xfb, 0x7b, 0xfd, 0x84, 0x9d, 0x42, 0xdb,
                                       0x02, 0x6a, 0xab, 0xb3, 0x16, 0x7a, 0x63, 0x79, 0x8e, 0x4f,
                                       0x98, 0xf4, 0x96, 0x16, 0xbc, 0x86, 0x13, 0x85, 0x5f, 0xc6};
  EXPECT_EQ(session.mki, mki);
  EXPECT_EQ(session.key, key);
}

TEST(RtpKey, EachStreamHasItsOwnKey) {
  const RtpKey key(kSecret);
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

TEST(KeyFile, ErrorsNameTheFile) {
  EXPECT_ERROR(KeyFile("/nobody/key"), "/nobody/key", "No such file");
  EXPECT_ERROR(KeyFile("/tmp"), "/tmp", "regular file");
  const TempFile empty(""), few(std::string(31, 'k') + std::string(40, ' ')), many(std::string(4097, 'k')),
      second(kSecret + "\nshort");
  for (const TempFile* bad : {&empty, &few, &many, &second}) EXPECT_ERROR(KeyFile(bad->path()), bad->path(), "32 to");
  std::string nine;
  for (int i = 0; i < 9; i++) nine += kSecret + "\n";
  EXPECT_ERROR(KeyFile(TempFile(nine).path()), "at most 8 keys");
}

// Opening a FIFO blocks until it has a writer.
TEST(KeyFile, DoesNotWaitForAFifo) {
  const std::string path = std::string(g_get_tmp_dir()) + "/lf_fifo_" + std::to_string(getpid());
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  EXPECT_ERROR(KeyFile(path), path, "read");
  unlink(path.c_str());
}

TEST(KeyFile, RefusesAFileThatOtherUsersCanRead) {
  const TempFile file(kSecret);
  for (const mode_t mode : {0640, 0644, 0604}) {
    ASSERT_EQ(chmod(file.path().c_str(), mode), 0);
    EXPECT_ERROR(KeyFile(file.path()), "chmod 600", file.path());
  }
  ASSERT_EQ(chmod(file.path().c_str(), 0400), 0);
  EXPECT_NO_THROW(KeyFile(file.path()));
}

}  // namespace
}  // namespace lf::rtp
