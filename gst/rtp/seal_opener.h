// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <bitset>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "rtp/hidden_element.h"
#include "rtp/rtp_key.h"

namespace lf::rtp {

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

  // Throws Error if GStreamer's srtpdec is not there.
  SealOpener(std::shared_ptr<const RtpKey> key, const std::string& purpose);

  // Takes the packet; `opened` has what was inside if it was sound.
  Result open(GstBuffer* packet, GstBuffer** opened);
  size_t streams() const { return streams_.size(); }

 private:
  // The latest streams are kept: a sender begins one each minute, or each 65536 packets.
  static constexpr size_t kMostStreams = 1024;
  static constexpr uint32_t kMinutesOff = 1;

  struct Stream {
    uint32_t minute;
    std::array<uint8_t, kMkiBytes> mki;
    std::bitset<1 << 16> seen;  // sequence numbers, which a stream has once each
  };
  static GstCaps* request_key(GstElement* srtpdec, guint ssrc, gpointer self);
  void forget_old(uint32_t minute);
  Result open_known(Stream& stream, guint16 sequence, GstBuffer* packet, GstBuffer** opened);

  std::shared_ptr<const RtpKey> key_;
  std::string purpose_;
  std::map<uint32_t, std::unique_ptr<Stream>> streams_;  // each by its SSRC
  const SessionKey* offered_ = nullptr;                  // while srtpdec asks for the key of a new stream
  GstBuffer* opened_ = nullptr;
  HiddenElement srtpdec_;
};

}  // namespace lf::rtp
