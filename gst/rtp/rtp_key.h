// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

// The secret of hosts that trust each other, and the keys that are made of it (lib/rtp/spec.md, "Under a key").
namespace lf::rtp {

inline constexpr size_t kMasterKeyBytes = 30;  // a key of AES-128 in counter mode, and its salt
inline constexpr size_t kMkiBytes = 12;
inline constexpr size_t kTagBytes = 10;  // HMAC-SHA1-80
// What comes on top of a packet.
inline constexpr size_t kSealBytes = kMkiBytes + kTagBytes;

// What names the key of one sender for about a minute; travels with each of its packets.
struct KeyName {
  uint32_t ssrc = 0;
  uint32_t minute = 0;  // minutes since 1970
  uint32_t nonce = 0;
};
struct SessionKey {
  std::array<uint8_t, kMasterKeyBytes> key{};
  std::array<uint8_t, kMkiBytes> mki{};  // minute, nonce, and a check that only those who have the secret can make
};

// Immutable. The secret itself is given to nobody: not to GStreamer's elements either, whose properties and caps end in
// logs and pictures of pipelines.
class RtpKey {
 public:
  static constexpr size_t kMinBytes = 32, kMaxBytes = 4096;
  // Takes the file's bytes without white space at either end. Throws Error naming the file, also if other users can
  // read the file.
  explicit RtpKey(const std::string& path);
  ~RtpKey();
  RtpKey(const RtpKey&) = delete;
  RtpKey& operator=(const RtpKey&) = delete;

  // `purpose`: what streams this is for, so that none passes for one of another kind.
  SessionKey session(std::string_view purpose, const KeyName& name) const;

 private:
  std::string secret_;
};

// Minutes since 1970 by this machine's clock.
uint32_t this_minute();
// The minute and nonce of an MKI.
KeyName name_of(uint32_t ssrc, std::span<const uint8_t, kMkiBytes> mki);

}  // namespace lf::rtp
