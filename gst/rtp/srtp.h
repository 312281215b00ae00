// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gst/gst.h>

// Encryption of RTP packets with SRTP. All hosts have a file with the same secret. Each sender derives a session key
// from the secret about once per minute, and each packet names its key, so hosts need no key exchange. lib/rtp/spec.md,
// "Under a key", defines the format.
namespace lf::rtp {

inline constexpr size_t kMasterKeyBytes = 30;  // AES-128 counter mode key and salt
inline constexpr size_t kMkiBytes = 12;
inline constexpr size_t kTagBytes = 10;  // HMAC-SHA1-80
inline constexpr size_t kSrtpOverheadBytes = kMkiBytes + kTagBytes;

// Identifies a session key: the sender (SSRC), the minute, and a random number that makes the key unique. Receivers
// read the SSRC in the RTP header, and minute and nonce in the MKI (master key identifier) at the end of each packet.
struct KeyId {
  uint32_t ssrc = 0;
  uint32_t minute = 0;  // minutes since 1970
  uint32_t nonce = 0;
};
struct SessionKey {
  std::array<uint8_t, kMasterKeyBytes> key{};
  // The master key identifier at the end of each packet: the minute, the nonce, and a check value that only holders of
  // the secret can compute.
  std::array<uint8_t, kMkiBytes> mki{};
};

// A secret that all hosts share. The secret never leaves this object, because properties and caps of GStreamer elements
// appear in logs and pipeline graphs. Immutable.
class RtpKey {
 public:
  static constexpr size_t kMinBytes = 32, kMaxBytes = 4096;
  explicit RtpKey(std::string secret) : secret_(std::move(secret)) {}
  ~RtpKey();
  RtpKey(const RtpKey&) = delete;
  RtpKey& operator=(const RtpKey&) = delete;
  bool operator==(const RtpKey& other) const { return secret_ == other.secret_; }

  // Derives a session key. `purpose` is the kind of stream (requests or answers), so that an attacker cannot send a
  // recorded request as an answer.
  SessionKey session(std::string_view purpose, const KeyId& name) const;

 private:
  std::string secret_;
};

// Never empty. Senders use the first key, and receivers accept all keys, so that keys can be replaced one host after
// another.
using RtpKeys = std::vector<std::shared_ptr<const RtpKey>>;

// The keys in a file, one per line, without surrounding white space. Not thread-safe.
class KeyFile {
 public:
  static constexpr size_t kMaxKeys = 8;

  // Throws Error with the file name if reading fails, the number or the size of keys is wrong, or other users can read
  // the file.
  explicit KeyFile(std::string path);

  const RtpKeys& keys() const { return keys_; }
  // Reads the file again if it has changed. Looks at the file at most once per second. Returns true if there are other
  // keys. If the file cannot be read, the keys remain, and Error is thrown once for each change of the file.
  bool refresh();

 private:
  // Metadata that change when the file changes. All values are 0 if there is no file.
  struct Version {
    uint64_t device = 0, inode = 0, size = 0;
    int64_t modified = 0, changed = 0;  // nanoseconds since 1970
    bool operator==(const Version&) const = default;
  };
  Version version() const;

  std::string path_;
  Version version_;
  RtpKeys keys_;
  int64_t checked_;  // g_get_monotonic_time()
};

uint32_t current_minute();
KeyId key_id_of(uint32_t ssrc, std::span<const uint8_t, kMkiBytes> mki);

// Runs a single GStreamer element outside of all bins, in the thread that pushes data. The properties and caps of the
// SRTP elements contain keys. In a bin, these would be visible to applications, in pipeline graphs and in the output of
// `gst-launch-1.0 -v`.
class StandaloneElement {
 public:
  using OnBuffer = std::function<GstFlowReturn(GstBuffer*)>;
  using OnList = std::function<GstFlowReturn(GstBufferList*)>;

  // Starts the floating element, and takes its reference. `sink` and `src` are the names of its pads. `sink` may be a
  // request pad; `src` must exist after `sink` has been requested. `caps` are the caps of the pushed data. `on_buffer`
  // and `on_list` receive the output of the element. Throws Error if the element does not start.
  StandaloneElement(GstElement* element, const char* sink, const char* src, const char* caps, OnBuffer on_buffer,
                    OnList on_list = nullptr);
  ~StandaloneElement();
  StandaloneElement(const StandaloneElement&) = delete;
  StandaloneElement& operator=(const StandaloneElement&) = delete;

  GstElement* get() const { return element_; }  // borrowed
  GstFlowReturn push(GstBuffer* buffer) { return gst_pad_push(in_, buffer); }
  GstFlowReturn push(GstBufferList* list) { return gst_pad_push_list(in_, list); }

 private:
  static GstFlowReturn chain(GstPad* pad, GstObject* parent, GstBuffer* buffer);
  static GstFlowReturn chain_list(GstPad* pad, GstObject* parent, GstBufferList* list);
  void close();

  GstElement* element_;
  OnBuffer on_buffer_;
  OnList on_list_;
  GstPad *in_, *out_;
};

// Remembers the sequence numbers of the packets of one stream that have been decrypted, to detect packets that an
// attacker sends again. Thread-safe.
class ReplayList {
 public:
  bool has(uint16_t sequence) const {
    const std::lock_guard lock(mutex_);
    return numbers_[sequence];
  }
  // Records a packet. Returns false if the packet was recorded before.
  bool add(uint16_t sequence) {
    const std::lock_guard lock(mutex_);
    if (numbers_[sequence]) return false;
    numbers_.set(sequence);
    return true;
  }

 private:
  mutable std::mutex mutex_;
  std::bitset<1 << 16> numbers_;
};

// Prevents replay attacks: remembers the decrypted packets of one key and purpose, for all lfrtpgate elements of the
// process. Each packet therefore passes only once, even if an element restarts. Thread-safe.
class ReplayProtection {
 public:
  static std::shared_ptr<ReplayProtection> of(const RtpKey& key, std::string_view purpose);

  std::shared_ptr<ReplayList> of_stream(const KeyId& name);
  void forget_old(uint32_t minute);
  bool empty() const;

 private:
  using Id = std::array<uint32_t, 3>;  // minute, SSRC, nonce
  mutable std::mutex mutex_;
  std::map<Id, std::shared_ptr<ReplayList>> streams_;
};

inline constexpr uint32_t kMaxClockSkewMinutes = 1;
inline bool is_current(uint32_t minute, uint32_t now) {
  return minute + kMaxClockSkewMinutes >= now && minute <= now + kMaxClockSkewMinutes;
}

// Decrypts the packets of lfrtpseal. Attackers cannot exhaust the machine: an invalid packet costs one HMAC, and only
// holders of the key can cause memory to be allocated. Not thread-safe.
class SrtpDecryptor {
 public:
  enum class Result {
    kOpened,
    kMalformed,  // the packet is not RTP or too short
    kUnsealed,   // no valid minute in the MKI: the sender has no key
    kStale,      // valid key, but a past or future minute
    kReplayed,
    kForged,  // wrong key or damaged
  };

  // If `is_shared`, all decryptors of this process with the same key and purpose together decrypt each packet only
  // once. Throws Error if srtpdec is not installed.
  SrtpDecryptor(const RtpKeys& keys, const std::string& purpose, bool is_shared);

  // Replaces the keys. Streams of other keys end.
  void set_keys(const RtpKeys& keys);

  // Takes the packet. On success, `opened` becomes the decrypted packet.
  Result open(GstBuffer* packet, GstBuffer** opened);
  size_t streams() const { return streams_.size(); }

 private:
  // Maximum number of recent streams. A sender starts a stream each minute, or every 65536 packets.
  static constexpr size_t kMaxStreams = 1024;
  struct Key {
    std::shared_ptr<const RtpKey> key;
    std::shared_ptr<ReplayProtection> opened;  // null: not shared
  };
  struct Stream {
    std::shared_ptr<const RtpKey> key;
    uint32_t minute;
    std::array<uint8_t, kMkiBytes> mki;
    std::shared_ptr<ReplayList> seen;
  };
  static GstCaps* request_key(GstElement* srtpdec, guint ssrc, gpointer self);
  void forget_old(uint32_t minute);
  template <typename Condition>
  void erase_streams_if(Condition condition);
  // Finds the key that made the identifier, and sets `session`. Returns null if there is no such key.
  const Key* key_of(const KeyId& name, const std::array<uint8_t, kMkiBytes>& mki, SessionKey* session) const;
  Result open_known(Stream& stream, guint16 sequence, GstBuffer* packet, GstBuffer** opened);

  std::vector<Key> keys_;
  std::string purpose_;
  bool is_shared_;
  std::map<uint32_t, std::unique_ptr<Stream>> streams_;  // key: SSRC
  const SessionKey* offered_ = nullptr;                  // set while srtpdec requests the key of a new stream
  GstBuffer* opened_ = nullptr;
  StandaloneElement srtpdec_;
};

}  // namespace lf::rtp
