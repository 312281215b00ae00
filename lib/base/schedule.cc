// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/schedule.h"

namespace lf {

namespace {

constexpr uint64_t kSecond = 1'000'000'000;
__extension__ typedef unsigned __int128 Wide;  // clock time times a fraction's part does not fit 64 bits

}  // namespace

uint64_t Schedule::instant(uint64_t k) const {
  return static_cast<uint64_t>(Wide{k} * denominator_ * kSecond / numerator_);
}

uint64_t Schedule::index_at(uint64_t nanoseconds) const {
  // floor(k d S / n) <= t  <=>  k d S < (t + 1) n  <=>  k <= ((t + 1) n - 1) / (d S)
  return static_cast<uint64_t>(((Wide{nanoseconds} + 1) * numerator_ - 1) / (Wide{denominator_} * kSecond));
}

uint64_t Schedule::first_from(uint64_t nanoseconds) const {
  return nanoseconds == 0 ? 0 : index_at(nanoseconds - 1) + 1;
}

}  // namespace lf
