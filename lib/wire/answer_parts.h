// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>

#include "wire/answer.h"

namespace lf::wire {

// Notes which fragments of one answer have come, part by part, in any order. Memory: as many entries as parts were
// added.
class AnswerParts {
 public:
  // False, and nothing is changed, for a part that repeats fragments or contradicts the ones before.
  bool add(const AnswerPart& part);
  // Whether all fragments have come.
  bool complete() const { return any_ && received_ == total_; }
  void clear() { *this = {}; }

 private:
  bool any_ = false;
  uint32_t total_ = 0, received_ = 0;
  std::map<uint32_t, uint32_t> parts_;  // first to first + count
};

}  // namespace lf::wire
