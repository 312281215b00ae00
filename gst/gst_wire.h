// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>

#include <gst/gst.h>

#include "wire/answer_codec.h"
#include "wire/request_codec.h"

// Buffers hold exactly the bytes of one unit of the wire format.
namespace lf {

std::optional<ViewRequest> decode_request_buffer(GstBuffer* buffer, std::string* reason = nullptr);
std::optional<wire::Answer> decode_answer_buffer(GstBuffer* buffer, std::string* reason = nullptr);
std::optional<wire::Answer> decode_answer_buffer_header(GstBuffer* buffer, std::string* reason = nullptr);

// New buffers, owned by the caller.
GstBuffer* encode_request_buffer(const ViewRequest& request);
GstBuffer* encode_answer_buffer(const wire::Answer& answer);

}  // namespace lf
