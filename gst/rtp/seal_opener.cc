// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/seal_opener.h"

#include <gst/rtp/gstrtpbuffer.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "wire/bytes.h"

namespace lf::rtp {
namespace {

constexpr guint kReorder = 4096;  // how far packets may overtake each other

GstElement* make_srtpdec() {
  GstElement* srtpdec = gst_element_factory_make("srtpdec", nullptr);
  if (!srtpdec) throw Error("element srtpdec is not installed (it is in gstreamer1.0-plugins-bad)");
  g_object_set(srtpdec, "replay-window-size", kReorder, nullptr);
  return srtpdec;
}

struct Header {
  guint32 ssrc;
  guint16 sequence;
  std::array<uint8_t, kMkiBytes> mki;
};

// Nothing for what is too short to be RTP that is sealed, or of a version or type that srtpdec would take for RTCP.
std::optional<Header> read_header(GstBuffer* packet) {
  const gsize size = gst_buffer_get_size(packet);
  guint8 bytes[12];
  if (size < sizeof bytes + kSealBytes || gst_buffer_extract(packet, 0, bytes, sizeof bytes) != sizeof bytes)
    return std::nullopt;
  const int type = bytes[1] & 0x7f;
  gsize header = sizeof bytes + 4u * (bytes[0] & 0x0f);
  if (bytes[0] >> 6 != 2 || (type >= 64 && type <= 80)) return std::nullopt;
  if (bytes[0] & 0x10) {  // with an extension
    guint8 extension[4];
    if (gst_buffer_extract(packet, header, extension, sizeof extension) != sizeof extension) return std::nullopt;
    header += sizeof extension + 4u * wire::Reader(std::span(extension).subspan(2)).get<uint16_t>();
  }
  if (size < header + kSealBytes) return std::nullopt;
  const std::span<const uint8_t> fields = bytes;
  Header found{wire::Reader(fields.subspan(8)).get<uint32_t>(), wire::Reader(fields.subspan(2)).get<uint16_t>(), {}};
  gst_buffer_extract(packet, size - kSealBytes, found.mki.data(), found.mki.size());
  return found;
}

GstBuffer* to_buffer(std::span<const uint8_t> bytes) { return gst_buffer_new_memdup(bytes.data(), bytes.size()); }

}  // namespace

std::shared_ptr<OpenedPackets> OpenedPackets::of(const RtpKey& key, std::string_view purpose) {
  // Told apart by a key of 1970, which opens nothing.
  using Id = std::array<uint8_t, kMasterKeyBytes>;
  static std::mutex mutex;
  static std::map<Id, std::shared_ptr<OpenedPackets>> all;
  const std::lock_guard lock(mutex);
  const uint32_t now = this_minute();
  std::erase_if(all, [now](const auto& item) {
    item.second->forget_old(now);
    return item.second.use_count() == 1 && item.second->empty();
  });
  std::shared_ptr<OpenedPackets>& opened = all[key.session(purpose, {}).key];
  if (!opened) opened = std::make_shared<OpenedPackets>();
  return opened;
}

std::shared_ptr<OpenedNumbers> OpenedPackets::of_stream(const KeyName& name) {
  const std::lock_guard lock(mutex_);
  std::shared_ptr<OpenedNumbers>& numbers = streams_[{name.minute, name.ssrc, name.nonce}];
  if (!numbers) numbers = std::make_shared<OpenedNumbers>();
  return numbers;
}

void OpenedPackets::forget_old(uint32_t minute) {
  const std::lock_guard lock(mutex_);
  std::erase_if(streams_, [minute](const auto& item) { return !is_of_now(item.first[0], minute); });
}

bool OpenedPackets::empty() const {
  const std::lock_guard lock(mutex_);
  return streams_.empty();
}

SealOpener::SealOpener(std::shared_ptr<const RtpKey> key, const std::string& purpose,
                       std::shared_ptr<OpenedPackets> opened)
    : key_(std::move(key)),
      purpose_(purpose),
      shared_(std::move(opened)),
      srtpdec_(make_srtpdec(), "rtp_sink", "rtp_src", "application/x-srtp", [this](GstBuffer* opened) {
        gst_buffer_replace(&opened_, nullptr);
        opened_ = opened;
        return GST_FLOW_OK;
      }) {
  g_signal_connect(srtpdec_.get(), "request-key", G_CALLBACK(request_key), this);
}

GstCaps* SealOpener::request_key(GstElement*, guint, gpointer self) {
  const SessionKey& offered = *static_cast<SealOpener*>(self)->offered_;
  GstBuffer *key = to_buffer(offered.key), *mki = to_buffer(offered.mki);
  GstCaps* caps = gst_caps_new_simple("application/x-srtp", "srtp-key", GST_TYPE_BUFFER, key, "mki", GST_TYPE_BUFFER,
                                      mki, "srtp-cipher", G_TYPE_STRING, "aes-128-icm", "srtp-auth", G_TYPE_STRING,
                                      "hmac-sha1-80", "srtcp-cipher", G_TYPE_STRING, "aes-128-icm", "srtcp-auth",
                                      G_TYPE_STRING, "hmac-sha1-80", nullptr);
  gst_buffer_unref(key);
  gst_buffer_unref(mki);
  return caps;
}

void SealOpener::forget_old(uint32_t minute) {
  if (shared_) shared_->forget_old(minute);
  std::erase_if(streams_, [&](const auto& item) {
    const bool old = !is_of_now(item.second->minute, minute);
    if (old) g_signal_emit_by_name(srtpdec_.get(), "remove-key", item.first);
    return old;
  });
}

SealOpener::Result SealOpener::open_known(Stream& stream, guint16 sequence, GstBuffer* packet, GstBuffer** opened) {
  srtpdec_.push(gst_buffer_make_writable(packet));  // of GStreamer 1.22.0, which opens a copy and passes on the other
  *opened = std::exchange(opened_, nullptr);
  if (!*opened) return Result::kForged;
  if (stream.seen->add(sequence)) return Result::kOpened;
  gst_clear_buffer(opened);  // another gate has opened the packet meanwhile
  return Result::kReplayed;
}

SealOpener::Result SealOpener::open(GstBuffer* packet, GstBuffer** opened) {
  *opened = nullptr;
  const auto refuse = [&](Result result) {
    gst_buffer_unref(packet);
    return result;
  };
  const std::optional<Header> header = read_header(packet);
  if (!header) return refuse(Result::kMalformed);
  const KeyName name = name_of(header->ssrc, header->mki);
  const uint32_t now = this_minute();
  if (!is_of_now(name.minute, now)) {
    // All bytes name a minute, hardly ever one of these days; only who has the key makes the check that belongs to it.
    const bool is_sealed = key_->session(purpose_, name).mki == header->mki;
    return refuse(is_sealed ? Result::kStale : Result::kUnsealed);
  }
  if (const auto known = streams_.find(name.ssrc); known != streams_.end()) {
    Stream& stream = *known->second;
    if (stream.mki != header->mki) return refuse(Result::kForged);
    if (stream.seen->has(header->sequence)) return refuse(Result::kReplayed);
    return open_known(stream, header->sequence, packet, opened);
  }

  const SessionKey session = key_->session(purpose_, name);
  if (session.mki != header->mki) return refuse(Result::kForged);
  forget_old(now);
  if (streams_.size() >= kMostStreams) return refuse(Result::kForged);
  auto stream = std::make_unique<Stream>(
      Stream{name.minute, session.mki, shared_ ? shared_->of_stream(name) : std::make_shared<OpenedNumbers>()});
  if (stream->seen->has(header->sequence)) return refuse(Result::kReplayed);
  offered_ = &session;
  const Result result = open_known(*stream, header->sequence, packet, opened);
  offered_ = nullptr;
  if (result == Result::kOpened)
    streams_[name.ssrc] = std::move(stream);
  else
    g_signal_emit_by_name(srtpdec_.get(), "remove-key", name.ssrc);
  return result;
}

}  // namespace lf::rtp
