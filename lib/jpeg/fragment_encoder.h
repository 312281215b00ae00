// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "base/byte_buffer.h"
#include "render/sum_planes.h"

namespace lf::jpeg {

// Fragments as JPEG, without what the receiver knows: a scan and nothing else. Baseline, 4:2:0, the Huffman tables of
// Annex K, its quantisation tables scaled by the quality as the IJG's library does; see spec.md of wire/.
//
// Keeps libjpeg's state from call to call. One for each thread.
class FragmentEncoder {
 public:
  FragmentEncoder();
  ~FragmentEncoder();
  FragmentEncoder(FragmentEncoder&&) noexcept;
  FragmentEncoder& operator=(FragmentEncoder&&) noexcept;

  // Append one scan to `out`: of the pixels; of the lost weight, which the fragment has. `quality` 1 to 100. A fragment
  // without a family or with more than 65,500 pixels a side is an Error.
  void encode_pixels(const FragmentPlanes& fragment, int quality, ByteBuffer& out);
  void encode_lost(const FragmentPlanes& fragment, int quality, ByteBuffer& out);

 private:
  class Picture;
  std::unique_ptr<Picture> ycbcr_, rgb_, lost_;
};

}  // namespace lf::jpeg
