// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <span>
#include <stdexcept>
#include <string>

// Fuzz target helpers. libFuzzer calls a target with generated inputs (tests/fuzz.sh); corpus_test.cc calls it with the
// inputs in corpus/ and corrupted copies.
//
//   LF_FUZZ_TARGET(name)(const uint8_t* data, size_t size) { ...; return 0; }
#define LF_FUZZ_TARGET(name)                                         \
  static int name##_target(const uint8_t*, size_t);                  \
  [[maybe_unused]] static const bool name##_is_there = [] {          \
    return lf::fuzz::targets().emplace(#name, name##_target).second; \
  }();                                                               \
  static int name##_target

namespace lf::fuzz {

using Target = int (*)(const uint8_t*, size_t);
inline std::map<std::string, Target>& targets() {
  static std::map<std::string, Target> all;
  return all;
}

inline void require(bool condition) {
  if (condition) return;
#ifdef LF_FUZZER
  abort();
#else
  throw std::logic_error("a law of the target is broken");
#endif
}

// Reads numbers from the front of the input; 0 after its end.
class Input {
 public:
  Input(const uint8_t* data, size_t size) : rest_(data, size) {}
  uint32_t number(int bytes) {
    uint32_t value = 0;
    for (const uint8_t byte : take(static_cast<size_t>(bytes))) value = value << 8 | byte;
    return value;
  }
  std::span<const uint8_t> take(size_t count) {
    const std::span<const uint8_t> out = rest_.first(std::min(count, rest_.size()));
    rest_ = rest_.subspan(out.size());
    return out;
  }
  bool empty() const { return rest_.empty(); }

 private:
  std::span<const uint8_t> rest_;
};

}  // namespace lf::fuzz

// libFuzzer programs have one file each; LF_FUZZER is the name of their target.
#ifdef LF_FUZZER
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const lf::fuzz::Target target = lf::fuzz::targets().at(LF_FUZZER);
  return target(data, size);
}
#endif
