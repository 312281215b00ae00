// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_form.h"

#include "wire/payload.h"

namespace lf {
namespace {

// Neighbouring cameras' rectangles overlap: with many of them the sum is what has fewer pixels, with few that lie far
// apart it is mostly empty.
bool sum_is_smaller(const RenderJob& job) {
  Rect all;
  size_t total = 0;
  for (const CameraIndex camera : job.cameras()) {
    const Rect rect = job.plan().camera_rect(camera);
    all = unite(all, rect);
    total += wire::area(rect);
  }
  return all.empty() || wire::area(all) <= total;
}

}  // namespace

AnswerForm choose_form(const RenderJob& job, SumChoice sum, CodecChoice codec, bool in_process, int quality) {
  const bool add = sum == SumChoice::kNode || (sum == SumChoice::kAuto && sum_is_smaller(job));
  return {choose_codec(codec, add, in_process, quality), add};
}

CodedAs choose_codec(CodecChoice codec, bool sum, bool in_process, int quality) {
  CodedAs form;
  if (codec == CodecChoice::kAuto && in_process)
    form.codec = sum ? wire::Codec::kRaw16 : wire::Codec::kRaw;
  else if (codec == CodecChoice::kRaw16)
    form.codec = wire::Codec::kRaw16;
  else if (codec != CodecChoice::kRaw && quality > 0)
    form.codec = wire::Codec::kJpeg;
  if (form.codec == wire::Codec::kJpeg) form.quality = quality;
  return form;
}

}  // namespace lf
