// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "base/byte_buffer.h"
#include "base/kept_memory.h"

namespace lf {

// The images that one answer is made of where cameras' own are not as they are to be drawn, by their place among the
// answer's: each as large as the camera's.
struct ImageMemory {
  std::vector<ByteBuffer> corrected, matched, sharpened;

  // Bytes of all of them, as KeptMemory asks.
  size_t size() const;
  size_t capacity() const;
  void clear();
};

// At least `count` of a kind.
void make_room(std::vector<ByteBuffer>& images, size_t count);

// Those of answers that have been made, for those that come: there are as many as answers at once, of whichever views.
using KeptImages = KeptMemory<ImageMemory>;

}  // namespace lf
