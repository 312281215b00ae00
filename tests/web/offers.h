// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

namespace lf::test {

inline std::string browser_offer() {
  return "v=0\r\n"
         "o=- 4611731400430051336 2 IN IP4 127.0.0.1\r\n"
         "s=-\r\n"
         "t=0 0\r\n"
         "a=group:BUNDLE 0 1\r\n"
         "a=msid-semantic: WMS\r\n"
         "m=video 9 UDP/TLS/RTP/SAVPF 96 97 103 104 108 109\r\n"
         "c=IN IP4 0.0.0.0\r\n"
         "a=rtcp:9 IN IP4 0.0.0.0\r\n"
         "a=ice-ufrag:Yzk8\r\n"
         "a=ice-pwd:lrnRvCr0XvB7VlGEhFXcIGWV\r\n"
         "a=ice-options:trickle\r\n"
         "a=fingerprint:sha-256 "
         "D6:1A:11:1D:88:0C:07:AD:E9:67:70:4B:A2:5B:6C:A2:42:5E:39:5D:EC:54:4A:33:99:EF:D1:15:2E:DA:28:5A\r\n"
         "a=setup:actpass\r\n"
         "a=mid:0\r\n"
         "a=recvonly\r\n"
         "a=rtcp-mux\r\n"
         "a=extmap:1 urn:ietf:params:rtp-hdrext:toffset\r\n"
         "a=extmap:5 http://www.webrtc.org/experiments/rtp-hdrext/playout-delay\r\n"
         "a=rtpmap:96 VP8/90000\r\n"
         "a=rtpmap:97 rtx/90000\r\n"
         "a=fmtp:97 apt=96\r\n"
         "a=rtpmap:103 H264/90000\r\n"
         "a=fmtp:103 level-asymmetry-allowed=1;packetization-mode=0;profile-level-id=42e01f\r\n"
         "a=rtpmap:104 H264/90000\r\n"
         "a=fmtp:104 level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=64001f\r\n"
         "a=rtpmap:108 H264/90000\r\n"
         "a=fmtp:108 level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=42e01f\r\n"
         "a=rtpmap:109 rtx/90000\r\n"
         "a=fmtp:109 apt=108\r\n"
         "m=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\n"
         "c=IN IP4 0.0.0.0\r\n"
         "a=ice-ufrag:Yzk8\r\n"
         "a=ice-pwd:lrnRvCr0XvB7VlGEhFXcIGWV\r\n"
         "a=fingerprint:sha-256 "
         "D6:1A:11:1D:88:0C:07:AD:E9:67:70:4B:A2:5B:6C:A2:42:5E:39:5D:EC:54:4A:33:99:EF:D1:15:2E:DA:28:5A\r\n"
         "a=setup:actpass\r\n"
         "a=mid:1\r\n"
         "a=sctp-port:5000\r\n";
}

inline std::string with(std::string text, const std::string& from, const std::string& to) {
  for (size_t at = 0; (at = text.find(from, at)) != text.npos; at += to.size()) text.replace(at, from.size(), to);
  return text;
}

}  // namespace lf::test
