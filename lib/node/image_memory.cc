// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/image_memory.h"

#include <algorithm>

namespace lf {

size_t ImageMemory::size() const {
  size_t bytes = 0;
  for (const auto* kind : {&corrected, &matched, &sharpened})
    for (const ByteBuffer& image : *kind) bytes += image.size();
  return bytes;
}

size_t ImageMemory::capacity() const {
  size_t bytes = 0;
  for (const auto* kind : {&corrected, &matched, &sharpened})
    for (const ByteBuffer& image : *kind) bytes += image.capacity();
  return bytes;
}

void ImageMemory::clear() {
  for (auto* kind : {&corrected, &matched, &sharpened})
    for (ByteBuffer& image : *kind) image.clear();
}

void make_room(std::vector<ByteBuffer>& images, size_t count) { images.resize(std::max(images.size(), count)); }

}  // namespace lf
