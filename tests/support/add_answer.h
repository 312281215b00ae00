// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "composite/assembly.h"
#include "support/answer_codec.h"
#include "wire/answer_parser.h"

namespace lf {

// Adds an answer as it comes off the wire.
inline Assembly::Verdict add_answer(Assembly& assembly, const wire::Answer& answer) {
  const std::vector<uint8_t> bytes = wire::encode_answer(answer);
  return assembly.add(wire::parse_answer(bytes).value());
}

}  // namespace lf
