// SPDX-License-Identifier: LGPL-2.1-or-later
// Cameras' trials: what is taken can be written again and is the same.
#include "fuzz/fuzz.h"
#include "wire/camera_trials_codec.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lf;
  std::string reason;
  if (!wire::parse_camera_trials_header({data, size}, &reason)) {
    fuzz::require(!reason.empty());
    return 0;
  }
  const wire::MomentsShape shape{64, 64, 4};  // what might have been asked for
  const std::optional<wire::CameraTrialsUnit> unit = wire::decode_camera_trials({data, size}, shape, &reason);
  fuzz::require(unit || !reason.empty());
  if (!unit) return 0;
  const ByteBuffer bytes = wire::encode_camera_trials(*unit, shape, unit->cameras);
  const std::optional<wire::CameraTrialsUnit> again = wire::decode_camera_trials(bytes, shape);
  fuzz::require(again && again->cameras == unit->cameras);
  return 0;
}
