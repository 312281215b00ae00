// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "wire/commands.h"

namespace lf::wire {

// Commands as units of application/x-lightfield-request, see spec.md. Stateless; every length and number is checked
// before it is used.

// The bytes of a command. Throw Error naming the field if they could not be decoded again.
std::vector<uint8_t> encode_command(const WarpCommand& command);
std::vector<uint8_t> encode_command(const PixelCommand& command);
// Nothing for bytes that are not exactly one valid command of that kind; `reason` (may be null) then says why.
std::optional<WarpCommand> decode_warp_command(std::span<const uint8_t> bytes, std::string* reason = nullptr);
std::optional<PixelCommand> decode_pixel_command(std::span<const uint8_t> bytes, std::string* reason = nullptr);

// Which cameras a unit of the request stream is for, by its type; nothing for types that are not known.
std::optional<Access> access_of_type(uint8_t type);
// These encode and decode a request of any kind, as the functions of that kind do.
std::vector<uint8_t> encode_any_request(const AnyRequest& request);
std::optional<AnyRequest> decode_any_request(std::span<const uint8_t> bytes, std::string* reason = nullptr);

}  // namespace lf::wire
