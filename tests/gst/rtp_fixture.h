// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/rtp/gstrtpbuffer.h>

#include "gst/gst_test.h"
#include "lib/rtp/rtp_test.h"

namespace lf::test {

using Bytes = std::vector<uint8_t>;

inline constexpr char kRequestCaps[] = "application/x-lightfield-request, framerate=(fraction)30/1";
inline constexpr char kAnswerCaps[] = "application/x-lightfield-answer";
inline constexpr char kRtpRequestCaps[] =
    "application/x-rtp, media=(string)application, clock-rate=(int)90000, encoding-name=(string)X-LIGHTFIELD-REQUEST";
inline constexpr char kRtpAnswerCaps[] =
    "application/x-rtp, media=(string)application, clock-rate=(int)90000, encoding-name=(string)X-LIGHTFIELD-ANSWER";

struct RtpPacket {
  Bytes bytes;
  GstClockTime time;
  uint16_t sequence = 0;
  uint32_t timestamp = 0;
  uint8_t payload_type = 0;
  bool marker = false;
};

inline RtpPacket to_packet(GstBuffer* buffer) {
  RtpPacket packet{to_bytes(buffer), GST_BUFFER_PTS(buffer)};
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  if (!gst_rtp_buffer_map(buffer, GST_MAP_READ, &rtp)) {
    ADD_FAILURE() << "no RTP";
    return packet;
  }
  packet.sequence = gst_rtp_buffer_get_seq(&rtp);
  packet.timestamp = gst_rtp_buffer_get_timestamp(&rtp);
  packet.payload_type = gst_rtp_buffer_get_payload_type(&rtp);
  packet.marker = gst_rtp_buffer_get_marker(&rtp);
  gst_rtp_buffer_unmap(&rtp);
  return packet;
}

class RtpElement {
 public:
  RtpElement(const char* element, const char* src_caps) : harness_(gst_harness_new_parse(element)) {
    if (src_caps) gst_harness_set_src_caps_str(h(), src_caps);
    gst_harness_use_systemclock(h());  // answers are paced
  }
  GstHarness* h() { return harness_.get(); }
  GstElement* element() { return GST_ELEMENT(GST_BIN_CHILDREN(h()->element)->data); }
  GstFlowReturn push(const Bytes& bytes, GstClockTime time = 0) {
    GstBuffer* buffer = bytes.empty() ? gst_buffer_new() : to_buffer(bytes);
    GST_BUFFER_PTS(buffer) = time;
    return gst_harness_push(h(), buffer);
  }
  std::vector<RtpPacket> packets() {
    std::vector<RtpPacket> out;
    while (const BufferPtr buffer{gst_harness_try_pull(h())}) out.push_back(to_packet(buffer.get()));
    return out;
  }
  std::vector<Bytes> units() {
    std::vector<Bytes> out;
    while (const BufferPtr buffer{gst_harness_try_pull(h())}) {
      out.push_back(to_bytes(buffer.get()));
      times.push_back(GST_BUFFER_PTS(buffer.get()));
    }
    return out;
  }
  std::string caps() { return caps_of(h()->sinkpad); }

  std::vector<GstClockTime> times;  // timestamps of units()

 private:
  HarnessPtr harness_;
};

// Checks that the element forwards the query for a compositor in the same process.
inline bool passes_in_process_query(const char* element, const char* src_caps) {
  RtpElement under_test(element, src_caps);
  gst_pad_set_query_function(under_test.h()->sinkpad, [](GstPad* pad, GstObject* parent, GstQuery* query) -> gboolean {
    return GST_QUERY_TYPE(query) == GST_QUERY_CUSTOM || gst_pad_query_default(pad, parent, query);
  });
  GstQuery* query = gst_query_new_custom(GST_QUERY_CUSTOM, gst_structure_new_empty("lightfield-in-process"));
  const gboolean passed = gst_pad_peer_query(under_test.h()->srcpad, query);
  gst_query_unref(query);
  return passed;
}

}  // namespace lf::test
