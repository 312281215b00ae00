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

#include <gst/gst.h>

// RTP under a key: the secret of hosts that trust each other, the keys that are made of it (lib/rtp/spec.md, "Under a
// key"), and what opens sealed packets.
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

// An element of GStreamer's that is in no bin: an application, a picture of the pipeline and `gst-launch-1.0 -v` see
// neither its properties nor its caps, which for SRTP have keys in them. It works in the thread that pushes.
class HiddenElement {
 public:
  // Takes the buffer.
  using OnBuffer = std::function<GstFlowReturn(GstBuffer*)>;
  using OnList = std::function<GstFlowReturn(GstBufferList*)>;

  // Takes the floating element and starts it. `sink` is a pad of its own or one to be requested; `src` is there once
  // that is. The caps are those of what is pushed. Throws Error if it does not start.
  HiddenElement(GstElement* element, const char* sink, const char* src, const char* caps, OnBuffer on_buffer,
                OnList on_list = nullptr);
  ~HiddenElement();
  HiddenElement(const HiddenElement&) = delete;
  HiddenElement& operator=(const HiddenElement&) = delete;

  GstElement* get() const { return element_; }  // borrowed
  // Take what is pushed.
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

// The sequence numbers of one sealed stream whose packets have been opened. Thread-safe.
class OpenedNumbers {
 public:
  bool has(uint16_t sequence) const {
    const std::lock_guard lock(mutex_);
    return numbers_[sequence];
  }
  // False if the packet has been opened before.
  bool add(uint16_t sequence) {
    const std::lock_guard lock(mutex_);
    if (numbers_[sequence]) return false;
    numbers_.set(sequence);
    return true;
  }

 private:
  mutable std::mutex mutex_;
  std::bitset<1 << 16> numbers_;  // a stream has each number once
};

// The packets of one key and purpose that the gates of this process have opened: each passes one gate, once, even if a
// gate is started again meanwhile. Thread-safe.
class OpenedPackets {
 public:
  static std::shared_ptr<OpenedPackets> of(const RtpKey& key, std::string_view purpose);

  // Of one stream; its MKI must be sound.
  std::shared_ptr<OpenedNumbers> of_stream(const KeyName& name);
  // Forgets streams whose packets are too old to be opened.
  void forget_old(uint32_t minute);
  bool empty() const;

 private:
  using Id = std::array<uint32_t, 3>;  // minute, SSRC, nonce
  mutable std::mutex mutex_;
  std::map<Id, std::shared_ptr<OpenedNumbers>> streams_;
};

// Minutes by which a packet's may differ from this one.
inline constexpr uint32_t kMinutesOff = 1;
inline bool is_of_now(uint32_t minute, uint32_t now) {
  return minute + kMinutesOff >= now && minute <= now + kMinutesOff;
}

// Opens what lfrtpseal has sealed. What a packet costs that is not sound is one HMAC, and memory is taken for streams
// of those who have the key alone. To be used by one thread at a time.
class SealOpener {
 public:
  enum class Result {
    kOpened,
    kMalformed,  // no RTP, or too short to be sealed
    kUnsealed,   // the packet has nothing where sealed ones name their minute: it is by somebody without a key
    kStale,      // the packet was sealed with the key, but in a minute that is over, or to come
    kReplayed,   // has been opened before
    kForged,     // the packet is by somebody with another key, or was damaged on the way
  };

  // `opened`: shared with other openers, so that a packet is opened by one of them; null: others get the same packets.
  // Throws Error if GStreamer's srtpdec is not there.
  SealOpener(std::shared_ptr<const RtpKey> key, const std::string& purpose, std::shared_ptr<OpenedPackets> opened);

  // Takes the packet; `opened` has what was inside if it was sound.
  Result open(GstBuffer* packet, GstBuffer** opened);
  size_t streams() const { return streams_.size(); }

 private:
  // The latest streams are kept: a sender begins one each minute, or each 65536 packets.
  static constexpr size_t kMostStreams = 1024;
  struct Stream {
    uint32_t minute;
    std::array<uint8_t, kMkiBytes> mki;
    std::shared_ptr<OpenedNumbers> seen;
  };
  static GstCaps* request_key(GstElement* srtpdec, guint ssrc, gpointer self);
  void forget_old(uint32_t minute);
  Result open_known(Stream& stream, guint16 sequence, GstBuffer* packet, GstBuffer** opened);

  std::shared_ptr<const RtpKey> key_;
  std::string purpose_;
  std::shared_ptr<OpenedPackets> shared_;
  std::map<uint32_t, std::unique_ptr<Stream>> streams_;  // each by its SSRC
  const SessionKey* offered_ = nullptr;                  // while srtpdec asks for the key of a new stream
  GstBuffer* opened_ = nullptr;
  HiddenElement srtpdec_;
};

}  // namespace lf::rtp
