// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "lib/jpeg/fragment_codec_fixture.h"
#include "wire/answer.h"

// What the tests of answers share.
namespace lf::wire {

inline AnswerHeader header_of_view(PixelFamily family, int width, int height) {
  AnswerHeader header;
  header.view_id = 7;
  header.sequence = 9;
  header.view_width = width;
  header.view_height = height;
  header.family = family;
  header.rig_hash = 0x1122334455667788;
  return header;
}

// `count` fragments of w x h each, side by side in rows of a view of 400 x 400; every third has lost weight.
inline std::vector<Fragment> patterned_fragments(PixelFamily family, int count, int w, int h) {
  std::vector<Fragment> out;
  for (int i = 0, x = 0, y = 0; i < count; i++) {
    out.push_back(jpeg::patterned(family, {x, y, x + w, y + h}, i % 3 == 0, i + 1));
    x += w & ~1;
    if (x + w > 400) x = 0, y += h & ~1;
  }
  return out;
}

}  // namespace lf::wire
