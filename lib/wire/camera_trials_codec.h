// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/byte_buffer.h"
#include "focus/camera_trials.h"
#include "wire/moments_codec.h"

namespace lf::wire {

// What each camera of a node sees through the trials of a request, in place of moments: a unit of the answer stream
// that goes before the node's fragments; see spec.md. `header`: without gains.
struct CameraTrialsUnit : MomentsHeader {
  std::vector<CameraTrials> cameras;  // ascending
};

// Whether a unit of the answer stream is one of those.
bool is_camera_trials(std::span<const uint8_t> bytes);
// Throws Error if the shape is none that a request can ask for, or a camera's trials are not of it.
ByteBuffer encode_camera_trials(const MomentsHeader& header, const MomentsShape& shape,
                                std::span<const CameraTrials> cameras);
// What a unit is about. Nothing, and in *reason (may be null) why, if this is not the beginning of one.
std::optional<MomentsHeader> parse_camera_trials_header(std::span<const uint8_t> bytes, std::string* reason = nullptr);
// Nothing, and in *reason (may be null) why, if this is not exactly one such unit of this shape.
std::optional<CameraTrialsUnit> decode_camera_trials(std::span<const uint8_t> bytes, const MomentsShape& expected,
                                                     std::string* reason = nullptr);

}  // namespace lf::wire
