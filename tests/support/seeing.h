// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "wire/answer.h"

namespace lf::test {

// The cameras that an answer speaks for and that have pictures, ascending.
inline CameraSet seeing(const wire::AnswerHeader& answer) {
  CameraRanges cameras = answer.cameras;
  cameras.remove(answer.blind);
  return cameras.cameras();
}

}  // namespace lf::test
