// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <random>
#include <string_view>

#include "fuzz/fuzz.h"
#include "wire/answer_codec.h"
#include "wire/unit.h"

// Custom mutator for files with one target that reads answers after `front` other bytes.
#ifdef LF_FUZZER
extern "C" size_t LLVMFuzzerMutate(uint8_t* data, size_t size, size_t max_size);
#define LF_FUZZ_ANSWERS(name, front)                                                                      \
  extern "C" size_t LLVMFuzzerCustomMutator(uint8_t* data, size_t size, size_t max_size, unsigned seed) { \
    const size_t mutated = LLVMFuzzerMutate(data, size, max_size);                                        \
    if (std::string_view(LF_FUZZER) != #name) return mutated;                                             \
    return lf::fuzz::repair_sometimes(data, mutated, seed, front);                                        \
  }
#else
#define LF_FUZZ_ANSWERS(name, front)
#endif

namespace lf::fuzz {

// Makes the lengths in an answer match its size, so that mutations get past that check.
inline void repair_answer(uint8_t* data, size_t size) {
  if (size < wire::kAnswerHeaderBytes) return;
  const auto number = [&](size_t at, size_t bytes) {
    size_t value = 0;
    for (size_t i = 0; i < bytes; i++) value = value << 8 | data[at + i];
    return value;
  };
  wire::store(data + 8, static_cast<uint32_t>(size));
  const size_t table = wire::kAnswerHeaderBytes + wire::kRangeBytes * (number(54, 2) + number(68, 2));
  const size_t payloads = table + number(56, 4) * wire::kFragmentBytes;
  if (payloads > size) return;
  size_t rest = size - payloads, last = 0;
  for (size_t at = table + 16; at < payloads; at += wire::kFragmentBytes) {
    const size_t length = number(at, 4);
    if (length == 0) continue;
    if (last > 0) rest -= std::min(rest, number(last, 4));
    last = at;
  }
  if (last > 0) wire::store(data + last, static_cast<uint32_t>(rest));
}

// Repairs most inputs. Returns the size.
inline size_t repair_sometimes(uint8_t* data, size_t size, unsigned seed, size_t front) {
  std::minstd_rand random(seed);
  if (size > front && random() % 8 != 0) repair_answer(data + front, size - front);
  return size;
}

}  // namespace lf::fuzz
