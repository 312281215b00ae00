// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_form.h"

namespace lf {
namespace {

// Empty pixels that cost as much as one more fragment. Its entry in the table has 20 bytes, beginning a scan costs some
// more, and 16 x 16 empty pixels are 4 bytes of JPEG. Within a process a fragment costs a microsecond or so, which is
// next to nothing, but the sum of a whole view is used where it lies.
size_t spare_pixels(const View& view, wire::Codec codec, bool in_process) {
  if (in_process) return static_cast<size_t>(view.width) * view.height / 4;
  return codec == wire::Codec::kJpeg ? 12 * 16 * 16 : 16;
}

}  // namespace

CodedAs choose_codec(CodecChoice codec, bool in_process, int quality) {
  CodedAs form;
  if (codec == CodecChoice::kRaw16 || (codec == CodecChoice::kAuto && in_process))
    form.codec = wire::Codec::kRaw16;
  else if (codec != CodecChoice::kRaw && quality > 0)
    form.codec = wire::Codec::kJpeg;
  if (form.codec == wire::Codec::kJpeg) form.quality = quality;
  return form;
}

AnswerForm choose_form(const View& view, CodecChoice codec, bool in_process, int quality) {
  AnswerForm form{choose_codec(codec, in_process, quality)};
  form.spare_pixels = spare_pixels(view, form.codec, in_process);
  return form;
}

}  // namespace lf
