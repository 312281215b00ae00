// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>

#include "view/view.h"
#include "wire/answer.h"
#include "wire/strips.h"

namespace lf {

namespace gl {
class SumDrawer;
}

// How pixels are coded.
struct CodedAs {
  wire::Codec codec = wire::Codec::kRaw;  // kRaw, kRaw16 or kJpeg
  int quality = 0;                        // quality of JPEG, 1 to 100; else 0
  bool operator==(const CodedAs&) const = default;
};

// How what a node has to give for a view is put into its answer.
struct AnswerForm : CodedAs {
  int strip_pixels = wire::kStripPixels;  // most pixels of a fragment in 8 bits
  size_t spare_pixels = 0;                // see sum_tiles()
  gl::SumDrawer* card = nullptr;          // see SumRenderer
  bool may_stay = false;                  // kRaw16: what the card draws may stay there
  bool operator==(const AnswerForm&) const = default;
};

enum class CodecChoice {
  kAuto,   // 16 bits a value within a process; over links JPEG of the quality asked for
  kRaw,    // 8 bits a value
  kRaw16,  // 16 bits a value
  kJpeg,   // JPEG of the quality asked for; raw where that is 0
};

// `in_process`: the compositor takes the bytes as they are, so that bytes cost nothing and coding them does. `quality`:
// of the request, 0 to 100.
CodedAs choose_codec(CodecChoice codec, bool in_process, int quality);
AnswerForm choose_form(const View& view, CodecChoice codec, bool in_process, int quality);

}  // namespace lf
