// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/rtp_key.h"

#include <algorithm>
#include <cstring>

#include <gst/gst.h>

#include "base/error.h"
#include "base/secret_file.h"
#include "wire/bytes.h"

namespace lf::rtp {
namespace {

constexpr char kLabel[] = "gst-lightfield SRTP 1";
constexpr char kSpace[] = " \t\r\n";

// A compiler may leave out a plain memset of memory that nothing reads afterwards.
void forget(void* bytes, size_t count) { explicit_bzero(bytes, count); }

}  // namespace

RtpKey::RtpKey(const std::string& path) {
  std::string text = read_secret_file(path);
  const size_t begin = std::min(text.find_first_not_of(kSpace), text.size());
  const size_t end = text.find_last_not_of(kSpace);
  const bool fits = text.size() <= kMaxBytes;
  secret_ = text.substr(begin, end == text.npos ? 0 : end + 1 - begin);
  wipe(text);
  if (fits && secret_.size() >= kMinBytes) return;
  wipe(secret_);
  throw Error(path + ": a key has " + std::to_string(kMinBytes) + " to " + std::to_string(kMaxBytes) +
              " random characters: openssl rand -hex 32 >FILE");
}

RtpKey::~RtpKey() { wipe(secret_); }

SessionKey RtpKey::session(std::string_view purpose, const KeyName& name) const {
  SessionKey session;
  wire::store(&session.mki[0], name.minute);
  wire::store(&session.mki[4], name.nonce);
  std::array<uint8_t, 12> fields;
  wire::store(&fields[0], name.ssrc);
  std::copy_n(session.mki.begin(), 8, fields.begin() + 4);
  GHmac* hmac = g_hmac_new(G_CHECKSUM_SHA512, reinterpret_cast<const guchar*>(secret_.data()), secret_.size());
  g_hmac_update(hmac, reinterpret_cast<const guchar*>(kLabel), sizeof kLabel);  // with the zero at its end
  g_hmac_update(hmac, reinterpret_cast<const guchar*>(purpose.data()), static_cast<gssize>(purpose.size()));
  g_hmac_update(hmac, fields.data(), fields.size());
  std::array<uint8_t, 64> made;
  gsize size = made.size();
  g_hmac_get_digest(hmac, made.data(), &size);
  g_hmac_unref(hmac);
  std::copy_n(made.begin(), session.key.size(), session.key.begin());
  std::copy_n(made.begin() + kMasterKeyBytes, 4, session.mki.begin() + 8);
  forget(made.data(), made.size());
  return session;
}

uint32_t this_minute() { return static_cast<uint32_t>(g_get_real_time() / G_USEC_PER_SEC / 60); }

KeyName name_of(uint32_t ssrc, std::span<const uint8_t, kMkiBytes> mki) {
  wire::Reader reader(mki);
  const auto minute = reader.get<uint32_t>(), nonce = reader.get<uint32_t>();
  return {ssrc, minute, nonce};
}

}  // namespace lf::rtp
