// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/disjoint_rects.h"

#include <algorithm>

namespace lf {
namespace {

constexpr int kBits = 64;

// Calls fn(word, mask) for the words of a row that have pixels from x0 to x1 - 1, until it returns true.
template <typename F>
bool any_word(int x0, int x1, const F& fn) {
  for (int word = x0 / kBits; word * kBits < x1; word++) {
    const int from = std::max(x0 - word * kBits, 0), to = std::min(x1 - word * kBits, kBits);
    const uint64_t below = to == kBits ? ~uint64_t{0} : (uint64_t{1} << to) - 1;
    if (fn(static_cast<size_t>(word), below & (~uint64_t{0} << from))) return true;
  }
  return false;
}

}  // namespace

bool DisjointRects::meets(const Rect& rect) const {
  if (rect.empty()) return false;
  if (rects_.size() <= kFew)
    return std::ranges::any_of(rects_, [&rect](const Rect& other) { return !intersect(other, rect).empty(); });
  for (int y = rect.y0; y < std::min(rect.y1, static_cast<int>(rows_.size())); y++) {
    const std::vector<uint64_t>& row = rows_[static_cast<size_t>(y)];
    const int end = std::min(rect.x1, static_cast<int>(row.size()) * kBits);
    if (any_word(rect.x0, end, [&row](size_t word, uint64_t mask) { return (row[word] & mask) != 0; })) return true;
  }
  return false;
}

void DisjointRects::mark(const Rect& rect) {
  if (rect.empty()) return;
  if (rows_.size() < static_cast<size_t>(rect.y1)) rows_.resize(static_cast<size_t>(rect.y1));
  for (int y = rect.y0; y < rect.y1; y++) {
    std::vector<uint64_t>& row = rows_[static_cast<size_t>(y)];
    const size_t words = static_cast<size_t>((rect.x1 + kBits - 1) / kBits);
    if (row.size() < words) row.resize(words);
    any_word(rect.x0, rect.x1, [&row](size_t word, uint64_t mask) { return row[word] |= mask, false; });
  }
}

bool DisjointRects::add(const Rect& rect) {
  if (meets(rect)) return false;
  rects_.push_back(rect);
  if (rects_.size() == kFew + 1)
    std::ranges::for_each(rects_, [this](const Rect& one) { mark(one); });
  else if (rects_.size() > kFew)
    mark(rect);
  return true;
}

}  // namespace lf
