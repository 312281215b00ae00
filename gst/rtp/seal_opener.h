// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <array>
#include <bitset>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "rtp/hidden_element.h"
#include "rtp/rtp_key.h"

namespace lf::rtp {

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
