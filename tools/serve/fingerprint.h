// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <set>
#include <string>
#include <string_view>

namespace lf::serve {

// The fingerprint of a certificate in SDP, "sha-256 AA:BB:...", as RFC 8122 defines it. It ties the peer of a DTLS
// connection to the offer: webrtcbin itself takes any peer.

enum class FingerprintKind { kKnown, kOfAnotherHash, kMalformed };
// Known hashes: SHA-256, SHA-384, SHA-512.
FingerprintKind fingerprint_kind(std::string_view text);

// Whether the certificate has one of these fingerprints, which are of known hashes.
bool has_fingerprint(const std::string& certificate_pem, const std::set<std::string>& fingerprints);

}  // namespace lf::serve
