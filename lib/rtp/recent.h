// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

namespace lf::rtp {

// Keeps a value for each of the keys used last: what is kept of views and sources stays bounded, whatever comes. Values
// stay where they are, however large: to use another key moves a few bytes for each. Not thread-safe.
template <typename Value>
class Recent {
 public:
  explicit Recent(size_t most) : most_(most) {}

  // The value of a key: a new one, in place of that used longest ago, if there is none. Valid until the next call.
  Value& operator[](uint32_t key) {
    auto found = std::ranges::find(entries_, key, &Entry::first);
    if (found == entries_.end()) {
      if (entries_.size() == most_) entries_.erase(entries_.begin());
      entries_.emplace_back(key, std::make_unique<Value>());
    } else {
      std::rotate(found, found + 1, entries_.end());
    }
    return *entries_.back().second;
  }
  void clear() { entries_.clear(); }
  size_t size() const { return entries_.size(); }

 private:
  using Entry = std::pair<uint32_t, std::unique_ptr<Value>>;
  size_t most_;
  std::vector<Entry> entries_;  // the entry that was used last is at the end
};

}  // namespace lf::rtp
