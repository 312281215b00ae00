// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <span>

#include "base/byte_buffer.h"
#include "render/fragment_planes.h"

namespace lf::jpeg {

// Fragments as JPEG, without what the receiver knows: a scan and nothing else. Baseline, 4:2:0, the Huffman tables of
// Annex K, its quantisation tables scaled by the quality as the IJG's library does; see spec.md of wire/.
//
// Several fragments of one family may share a picture (a stack, see stack.h), which spares small ones the cost of
// beginning one. Keeps libjpeg's state from call to call. One for each thread.
class FragmentEncoder {
 public:
  FragmentEncoder();
  ~FragmentEncoder();
  FragmentEncoder(FragmentEncoder&&) noexcept;
  FragmentEncoder& operator=(FragmentEncoder&&) noexcept;

  // Append one scan to `out`: the pixels of all members; the lost weight of those members that have some (at least
  // one). `quality` 1 to 100. Members are of one family and their stack is at most 65,500 pixels a side, else Error.
  void encode_pixels(std::span<const FragmentPlanes> members, int quality, ByteBuffer& out);
  void encode_lost(std::span<const FragmentPlanes> members, int quality, ByteBuffer& out);

 private:
  class Picture;
  std::unique_ptr<Picture> ycbcr_, rgb_, lost_;
};

}  // namespace lf::jpeg
