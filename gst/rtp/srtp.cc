// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/srtp.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include <gst/gst.h>
#include <gst/rtp/gstrtpbuffer.h>
#include <sys/stat.h>

#include "base/file.h"
#include "base/text.h"
#include "wire/unit.h"

namespace lf::rtp {
namespace {

constexpr char kLabel[] = "gst-lightfield SRTP 1";
constexpr char kSpace[] = " \t\r\n";

// Erases memory. Compilers may remove a plain memset() of memory that is not read again.
void forget(void* bytes, size_t count) { explicit_bzero(bytes, count); }

constexpr guint kReorder = 4096;

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

// Reads the header of an SRTP packet. Returns nothing if the packet is too short, or if version or type would make
// srtpdec treat it as RTCP.
std::optional<Header> read_header(GstBuffer* packet) {
  const gsize size = gst_buffer_get_size(packet);
  guint8 bytes[12];
  if (size < sizeof bytes + kSrtpOverheadBytes || gst_buffer_extract(packet, 0, bytes, sizeof bytes) != sizeof bytes)
    return std::nullopt;
  const int type = bytes[1] & 0x7f;
  gsize header = sizeof bytes + 4u * (bytes[0] & 0x0f);
  if (bytes[0] >> 6 != 2 || (type >= 64 && type <= 80)) return std::nullopt;
  if (bytes[0] & 0x10) {  // header extension
    guint8 extension[4];
    if (gst_buffer_extract(packet, header, extension, sizeof extension) != sizeof extension) return std::nullopt;
    header += sizeof extension + 4u * wire::Reader(std::span(extension).subspan(2)).get<uint16_t>();
  }
  if (size < header + kSrtpOverheadBytes) return std::nullopt;
  const std::span<const uint8_t> fields = bytes;
  Header found{wire::Reader(fields.subspan(8)).get<uint32_t>(), wire::Reader(fields.subspan(2)).get<uint16_t>(), {}};
  gst_buffer_extract(packet, size - kSrtpOverheadBytes, found.mki.data(), found.mki.size());
  return found;
}

GstBuffer* to_buffer(std::span<const uint8_t> bytes) { return gst_buffer_new_memdup(bytes.data(), bytes.size()); }

RtpKeys read_keys(const std::string& path) {
  std::string text = read_secret_file(path, KeyFile::kMaxKeys * (RtpKey::kMaxBytes + 1));
  RtpKeys keys;
  bool fits = true;
  for (size_t begin = 0; (begin = text.find_first_not_of(kSpace, begin)) != text.npos;) {
    const size_t end = std::min(text.find_first_of("\r\n", begin), text.size());
    const size_t size = text.find_last_not_of(kSpace, end - 1) + 1 - begin;
    fits = fits && size >= RtpKey::kMinBytes && size <= RtpKey::kMaxBytes;
    keys.push_back(std::make_shared<const RtpKey>(text.substr(begin, size)));
    begin = end;
  }
  wipe(text);
  if (!fits || keys.empty())
    throw Error(path + ": each line must be a key of " + std::to_string(RtpKey::kMinBytes) + " to " +
                std::to_string(RtpKey::kMaxBytes) + " random characters: openssl rand -hex 32 >FILE");
  if (keys.size() > KeyFile::kMaxKeys)
    throw Error(path + ": a file has at most " + std::to_string(KeyFile::kMaxKeys) + " keys, one per line");
  return keys;
}

bool are_equal(const RtpKeys& a, const RtpKeys& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& x, const auto& y) { return *x == *y; });
}

}  // namespace

RtpKey::~RtpKey() { wipe(secret_); }

SessionKey RtpKey::session(std::string_view purpose, const KeyId& name) const {
  SessionKey session;
  wire::store(&session.mki[0], name.minute);
  wire::store(&session.mki[4], name.nonce);
  std::array<uint8_t, 12> fields;
  wire::store(&fields[0], name.ssrc);
  std::copy_n(session.mki.begin(), 8, fields.begin() + 4);
  GHmac* hmac = g_hmac_new(G_CHECKSUM_SHA512, reinterpret_cast<const guchar*>(secret_.data()), secret_.size());
  g_hmac_update(hmac, reinterpret_cast<const guchar*>(kLabel), sizeof kLabel);
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

KeyFile::KeyFile(std::string path)
    : path_(std::move(path)), version_(version()), keys_(read_keys(path_)), checked_(g_get_monotonic_time()) {}

KeyFile::Version KeyFile::version() const {
  struct stat status {};
  if (stat(path_.c_str(), &status) != 0) return {};
  const auto nanoseconds = [](const timespec& time) { return int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec; };
  return {status.st_dev, status.st_ino, static_cast<uint64_t>(status.st_size), nanoseconds(status.st_mtim),
          nanoseconds(status.st_ctim)};
}

bool KeyFile::refresh() {
  const int64_t now = g_get_monotonic_time();
  if (now < checked_ + G_USEC_PER_SEC) return false;
  checked_ = now;
  const Version found = version();
  if (found == version_) return false;
  version_ = found;
  RtpKeys keys = read_keys(path_);
  const bool has_changed = !are_equal(keys, keys_);
  keys_ = std::move(keys);
  return has_changed;
}

uint32_t current_minute() { return static_cast<uint32_t>(g_get_real_time() / G_USEC_PER_SEC / 60); }

KeyId key_id_of(uint32_t ssrc, std::span<const uint8_t, kMkiBytes> mki) {
  wire::Reader reader(mki);
  const auto minute = reader.get<uint32_t>(), nonce = reader.get<uint32_t>();
  return {ssrc, minute, nonce};
}

GstFlowReturn StandaloneElement::chain(GstPad* pad, GstObject*, GstBuffer* buffer) {
  return static_cast<StandaloneElement*>(gst_pad_get_element_private(pad))->on_buffer_(buffer);
}

GstFlowReturn StandaloneElement::chain_list(GstPad* pad, GstObject*, GstBufferList* list) {
  return static_cast<StandaloneElement*>(gst_pad_get_element_private(pad))->on_list_(list);
}

StandaloneElement::StandaloneElement(GstElement* element, const char* sink, const char* src, const char* caps,
                                     OnBuffer on_buffer, OnList on_list)
    : element_(GST_ELEMENT(gst_object_ref_sink(element))),
      on_buffer_(std::move(on_buffer)),
      on_list_(std::move(on_list)),
      in_(gst_pad_new("in", GST_PAD_SRC)),
      out_(gst_pad_new("out", GST_PAD_SINK)) {
  gst_object_ref_sink(in_);
  gst_object_ref_sink(out_);
  gst_pad_set_element_private(out_, this);
  gst_pad_set_chain_function(out_, chain);
  if (on_list_) gst_pad_set_chain_list_function(out_, chain_list);
  gst_pad_set_active(in_, TRUE);
  gst_pad_set_active(out_, TRUE);
  GstPad* sink_pad = gst_element_get_static_pad(element_, sink);
  if (!sink_pad) sink_pad = gst_element_request_pad_simple(element_, sink);
  GstPad* src_pad = gst_element_get_static_pad(element_, src);
  const bool works = sink_pad && src_pad && gst_pad_link(in_, sink_pad) == GST_PAD_LINK_OK &&
                     gst_pad_link(src_pad, out_) == GST_PAD_LINK_OK &&
                     gst_element_set_state(element_, GST_STATE_PLAYING) != GST_STATE_CHANGE_FAILURE;
  gst_clear_object(&sink_pad);
  gst_clear_object(&src_pad);
  if (!works) {
    const std::string name = GST_OBJECT_NAME(element_);
    close();
    throw Error(name + " does not start");
  }
  gst_pad_push_event(in_, gst_event_new_stream_start("hidden"));
  GstCaps* fixed = gst_caps_from_string(caps);
  gst_pad_push_event(in_, gst_event_new_caps(fixed));
  gst_caps_unref(fixed);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_pad_push_event(in_, gst_event_new_segment(&segment));
}

StandaloneElement::~StandaloneElement() { close(); }

void StandaloneElement::close() {
  gst_element_set_state(element_, GST_STATE_NULL);
  gst_pad_set_active(in_, FALSE);
  gst_pad_set_active(out_, FALSE);
  gst_object_unref(in_);
  gst_object_unref(out_);
  gst_object_unref(element_);
}

std::shared_ptr<ReplayProtection> ReplayProtection::of(const RtpKey& key, std::string_view purpose) {
  // Key of this map: the session key for minute 0, which identifies the secret without storing the secret itself. No
  // packet uses this session key.
  using Id = std::array<uint8_t, kMasterKeyBytes>;
  static std::mutex mutex;
  static std::map<Id, std::shared_ptr<ReplayProtection>> all;
  const std::lock_guard lock(mutex);
  const uint32_t now = current_minute();
  std::erase_if(all, [now](const auto& item) {
    item.second->forget_old(now);
    return item.second.use_count() == 1 && item.second->empty();
  });
  std::shared_ptr<ReplayProtection>& opened = all[key.session(purpose, {}).key];
  if (!opened) opened = std::make_shared<ReplayProtection>();
  return opened;
}

std::shared_ptr<ReplayList> ReplayProtection::of_stream(const KeyId& name) {
  const std::lock_guard lock(mutex_);
  std::shared_ptr<ReplayList>& numbers = streams_[{name.minute, name.ssrc, name.nonce}];
  if (!numbers) numbers = std::make_shared<ReplayList>();
  return numbers;
}

void ReplayProtection::forget_old(uint32_t minute) {
  const std::lock_guard lock(mutex_);
  std::erase_if(streams_, [minute](const auto& item) { return !is_current(item.first[0], minute); });
}

bool ReplayProtection::empty() const {
  const std::lock_guard lock(mutex_);
  return streams_.empty();
}

SrtpDecryptor::SrtpDecryptor(const RtpKeys& keys, const std::string& purpose, bool is_shared)
    : purpose_(purpose),
      is_shared_(is_shared),
      srtpdec_(make_srtpdec(), "rtp_sink", "rtp_src", "application/x-srtp", [this](GstBuffer* opened) {
        gst_buffer_replace(&opened_, nullptr);
        opened_ = opened;
        return GST_FLOW_OK;
      }) {
  g_signal_connect(srtpdec_.get(), "request-key", G_CALLBACK(request_key), this);
  set_keys(keys);
}

void SrtpDecryptor::set_keys(const RtpKeys& keys) {
  keys_.clear();
  for (const auto& key : keys) keys_.push_back({key, is_shared_ ? ReplayProtection::of(*key, purpose_) : nullptr});
  erase_streams_if([&](const Stream& stream) {
    return std::none_of(keys.begin(), keys.end(), [&](const auto& key) { return *key == *stream.key; });
  });
}

GstCaps* SrtpDecryptor::request_key(GstElement*, guint, gpointer self) {
  const SessionKey& offered = *static_cast<SrtpDecryptor*>(self)->offered_;
  g_autoptr(GstBuffer) key = to_buffer(offered.key);
  g_autoptr(GstBuffer) mki = to_buffer(offered.mki);
  return gst_caps_new_simple("application/x-srtp", "srtp-key", GST_TYPE_BUFFER, key, "mki", GST_TYPE_BUFFER, mki,
                             "srtp-cipher", G_TYPE_STRING, "aes-128-icm", "srtp-auth", G_TYPE_STRING, "hmac-sha1-80",
                             "srtcp-cipher", G_TYPE_STRING, "aes-128-icm", "srtcp-auth", G_TYPE_STRING, "hmac-sha1-80",
                             nullptr);
}

template <typename Condition>
void SrtpDecryptor::erase_streams_if(Condition condition) {
  std::erase_if(streams_, [&](const auto& item) {
    const bool ends = condition(*item.second);
    if (ends) g_signal_emit_by_name(srtpdec_.get(), "remove-key", item.first);
    return ends;
  });
}

void SrtpDecryptor::forget_old(uint32_t minute) {
  for (const Key& key : keys_)
    if (key.opened) key.opened->forget_old(minute);
  erase_streams_if([minute](const Stream& stream) { return !is_current(stream.minute, minute); });
}

const SrtpDecryptor::Key* SrtpDecryptor::key_of(const KeyId& name, const std::array<uint8_t, kMkiBytes>& mki,
                                                SessionKey* session) const {
  for (const Key& key : keys_) {
    *session = key.key->session(purpose_, name);
    if (session->mki == mki) return &key;
  }
  return nullptr;
}

SrtpDecryptor::Result SrtpDecryptor::open_known(Stream& stream, guint16 sequence, GstBuffer* packet,
                                                GstBuffer** opened) {
  // makes the buffer writable, because GStreamer 1.22.0 otherwise decrypts a copy and forwards the original
  srtpdec_.push(gst_buffer_make_writable(packet));
  *opened = std::exchange(opened_, nullptr);
  if (!*opened) return Result::kForged;
  if (stream.seen->add(sequence)) return Result::kOpened;
  gst_clear_buffer(opened);
  return Result::kReplayed;
}

SrtpDecryptor::Result SrtpDecryptor::open(GstBuffer* packet, GstBuffer** opened) {
  *opened = nullptr;
  const auto refuse = [&](Result result) {
    gst_buffer_unref(packet);
    return result;
  };
  const std::optional<Header> header = read_header(packet);
  if (!header) return refuse(Result::kMalformed);
  const KeyId name = key_id_of(header->ssrc, header->mki);
  const uint32_t now = current_minute();
  if (!is_current(name.minute, now)) {
    // An unencrypted packet has arbitrary bytes here, which are rarely a current minute. The check value requires the
    // key, so it distinguishes old packets of key holders from unencrypted packets.
    SessionKey session;
    return refuse(key_of(name, header->mki, &session) ? Result::kStale : Result::kUnsealed);
  }
  if (const auto known = streams_.find(name.ssrc); known != streams_.end()) {
    Stream& stream = *known->second;
    if (stream.mki != header->mki) return refuse(Result::kForged);
    if (stream.seen->has(header->sequence)) return refuse(Result::kReplayed);
    return open_known(stream, header->sequence, packet, opened);
  }

  SessionKey session;
  const Key* key = key_of(name, header->mki, &session);
  if (!key) return refuse(Result::kForged);
  forget_old(now);
  if (streams_.size() >= kMaxStreams) return refuse(Result::kForged);
  auto stream = std::make_unique<Stream>(Stream{
      key->key, name.minute, session.mki, key->opened ? key->opened->of_stream(name) : std::make_shared<ReplayList>()});
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
