// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "focus/view_focus.h"
#include "wire/moments_codec.h"

namespace lf {

// Adds a unit of moments, which came from a node and belongs to the request, to what other nodes have answered. Why
// not; empty: it was added.
std::string add_moments(std::span<const uint8_t> unit, const wire::MomentsHeader& header, const ViewRequest& request,
                        ViewFocus::Answers& answers);

}  // namespace lf
