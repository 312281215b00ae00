// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/byte_buffer.h"
#include "render/sum_planes.h"
#include "wire/answer.h"

namespace lf::wire {

// Writing an answer in the one buffer it travels in: fragments are rendered or encoded straight into their places.
//
//   AnswerWriter writer(header, 2, std::move(recycled));
//   renderer.render(..., writer.add_sums(sum_header));                                     // sizes known beforehand
//   writer.add(jpeg_header, [&](ByteBuffer& out) { encoder.encode_pixels(..., out); });  // or afterwards
//   ByteBuffer bytes = writer.finish();
//
// Everything throws Error naming the field for what parse_answer() would not take back, and must then not be used
// further. Not thread-safe.
class AnswerWriter {
 public:
  // Room in the table for `max_fragments`; fewer may come (which costs moving the payloads). `memory`: what it holds is
  // thrown away and its capacity used.
  AnswerWriter(const AnswerHeader& header, size_t max_fragments, ByteBuffer memory = {});

  // Reserves the bytes that all payloads will have together, so that nothing is moved while they are added.
  void reserve_payloads(size_t bytes);

  // kRaw and kRaw16: uninitialised memory of the payload's size (see payload.h for what lies where in it), valid until
  // the next call. 16-bit payloads must begin at an even offset: put them in front of others.
  std::span<uint8_t> add(const FragmentHeader& fragment);
  // As add() for kRaw16, with the memory as planes. They stay valid as long as there is room reserved for what else is
  // added.
  SumPlanes add_sums(const FragmentHeader& fragment);

  // The lost weight of some of the fragments added so far, all of them kRaw16, turned out to be nothing: where
  // `is_nothing`(number of the fragment) their planes are taken back. Planes handed out are no longer valid.
  void drop_lost(const std::function<bool(size_t)>& is_nothing);

  // Any codec: `append(ByteBuffer&)` appends the payload to what is there, and leaves that alone.
  template <typename Append>
  void add(const FragmentHeader& fragment, Append append) {
    const size_t begin = begin_payload(fragment);
    append(bytes_);
    end_payload(fragment, begin);
  }

  // The unit has some of an answer's `total` fragments, from number `first` on; unless this is called it has all.
  void set_part(uint32_t first, uint32_t total);

  size_t fragments() const { return fragments_; }
  // The whole unit. The writer is empty then.
  ByteBuffer finish();

 private:
  size_t begin_payload(const FragmentHeader& fragment);
  void end_payload(const FragmentHeader& fragment, size_t begin);
  void put_entry(const FragmentHeader& fragment, size_t length);

  AnswerHeader header_;
  size_t table_;                    // where the fragment table begins
  std::optional<AnswerPart> part_;  // set by set_part(); its count is not used
  size_t max_fragments_, fragments_ = 0;
  std::vector<std::pair<FragmentHeader, size_t>> added_;  // fragments, and where their payloads begin
  ByteBuffer bytes_;
};

}  // namespace lf::wire
