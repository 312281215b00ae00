// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/byte_buffer.h"
#include "render/gl/objects.h"

namespace lf::gl {

// Waits for all that the card was given. False if it does not answer. While the context is current.
bool wait_for_card();

// What a compute shader has computed, in 32-bit words, and the way back of it. All calls while the context is current.
class Computed {
 public:
  // What was fetched, which nobody else has.
  class Fetched {
   public:
    // As many words as were reserved; those that were not fetched mean nothing.
    uint32_t* words() { return reinterpret_cast<uint32_t*>(buffer_.memory() ? buffer_.memory() : memory_.data()); }

   private:
    friend Computed;
    Buffer buffer_{Buffer::Use::kRead};
    UninitializedVector<uint8_t> memory_;  // in its place, where the driver has none that is in both
    std::atomic<bool> is_free_ = true;
  };

  // As many as shaders can write.
  static size_t most_words();
  // Room for so many words; what was in it is lost if there was less. False with the reason in `why` if shaders can't
  // write as many.
  bool reserve(size_t words, std::string& why);
  GLuint name() const { return result_.name(); }
  // What may be fetched into from now on, as large as what was reserved last. This outlives it.
  std::shared_ptr<Fetched> begin_to_fetch();
  struct Words {
    size_t first = 0, end = 0;
  };
  // All these words, to the same place there. False if the card does not answer.
  bool fetch(Fetched& to, std::span<const Words> which);

 private:
  size_t words_ = 0;
  Buffer result_{Buffer::Use::kComputed};
  std::vector<std::unique_ptr<Fetched>> fetched_;  // that somebody has or had
};

}  // namespace lf::gl
