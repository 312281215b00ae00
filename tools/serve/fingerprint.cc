// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fingerprint.h"

#include <glib.h>

#include <algorithm>
#include <cctype>
#include <optional>

namespace lf::serve {
namespace {

std::string_view hash_name(std::string_view text) { return text.substr(0, text.find(' ')); }

std::optional<GChecksumType> hash_of(std::string_view text) {
  constexpr std::pair<std::string_view, GChecksumType> kHashes[] = {
      {"sha-256", G_CHECKSUM_SHA256}, {"sha-384", G_CHECKSUM_SHA384}, {"sha-512", G_CHECKSUM_SHA512}};
  const std::string_view name = hash_name(text);
  for (const auto& [known, type] : kHashes)
    if (name.size() == known.size() && g_ascii_strncasecmp(name.data(), known.data(), known.size()) == 0) return type;
  return std::nullopt;
}

// The digits in lower case; nothing where they are not pairs with colons between them.
std::optional<std::string> digits_of(std::string_view text) {
  std::string_view value = text.substr(std::min(text.size(), hash_name(text).size() + 1));
  std::string digits;
  for (size_t i = 0; i < value.size(); i++) {
    const auto c = static_cast<unsigned char>(value[i]);
    if (i % 3 == 2 ? c != ':' : !std::isxdigit(c)) return std::nullopt;
    if (i % 3 != 2) digits += static_cast<char>(std::tolower(c));
  }
  return digits;
}

// The bytes of the first certificate.
std::string der_of(const std::string& pem) {
  constexpr std::string_view kBegin = "-----BEGIN CERTIFICATE-----", kEnd = "-----END CERTIFICATE-----";
  const size_t begin = pem.find(kBegin), end = pem.find(kEnd);
  if (begin == pem.npos || end == pem.npos || end < begin) return "";
  const std::string base64 = pem.substr(begin + kBegin.size(), end - begin - kBegin.size());
  gsize size = 0;
  g_autofree guchar* bytes = g_base64_decode(base64.c_str(), &size);
  return {reinterpret_cast<const char*>(bytes), size};
}

}  // namespace

FingerprintKind fingerprint_kind(std::string_view text) {
  const auto hash = hash_of(text);
  if (!hash) return hash_name(text).empty() ? FingerprintKind::kMalformed : FingerprintKind::kOfAnotherHash;
  const auto digits = digits_of(text);
  const auto size = static_cast<size_t>(2 * g_checksum_type_get_length(*hash));
  return digits && digits->size() == size ? FingerprintKind::kKnown : FingerprintKind::kMalformed;
}

bool has_fingerprint(const std::string& certificate_pem, const std::set<std::string>& fingerprints) {
  const std::string der = der_of(certificate_pem);
  return !der.empty() && std::ranges::any_of(fingerprints, [&](const std::string& fingerprint) {
    const auto hash = hash_of(fingerprint);
    if (!hash) return false;
    g_autofree gchar* digits =
        g_compute_checksum_for_data(*hash, reinterpret_cast<const guchar*>(der.data()), der.size());
    return digits_of(fingerprint) == std::string(digits);
  });
}

}  // namespace lf::serve
