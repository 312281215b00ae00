// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/answer_parts.h"

#include <iterator>

namespace lf::wire {

bool AnswerParts::add(const AnswerPart& part) {
  if (any_ && (part.total != total_ || complete())) return false;
  const uint32_t end = part.first + part.count;
  const auto next = parts_.lower_bound(part.first);
  if (next != parts_.end() && next->first < end) return false;
  if (next != parts_.begin() && std::prev(next)->second > part.first) return false;
  any_ = true;
  total_ = part.total;
  received_ += part.count;
  parts_.emplace(part.first, end);
  return true;
}

}  // namespace lf::wire
