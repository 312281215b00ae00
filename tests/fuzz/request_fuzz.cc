// SPDX-License-Identifier: LGPL-2.1-or-later
// View requests: what is taken can be written again, and is the same.
#include "fuzz/fuzz.h"
#include "wire/request_codec.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::string reason;
  const std::optional<lf::ViewRequest> request = lf::wire::decode_request({data, size}, &reason);
  lf::fuzz::require(request || !reason.empty());
  if (request) lf::fuzz::require(lf::wire::decode_request(lf::wire::encode_request(*request)) == request);
  return 0;
}
