// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/answer_layout.h"

#include "wire/limits.h"

namespace lf::wire {

void check_header(const AnswerHeader& answer, size_t fragments) {
  validate_size("view_width", answer.view_width);
  validate_size("view_height", answer.view_height);
  if (answer.family > PixelFamily::kI420)
    throw Error("family: " + std::to_string(static_cast<int>(answer.family)) + " is unknown");
  if (fragments > kMaxFragments)
    throw Error("fragments: at most " + std::to_string(kMaxFragments) + ", not " + std::to_string(fragments));
  if (answer.family == PixelFamily::kNone && fragments > 0)
    throw Error("family: none, but there are " + std::to_string(fragments) + " fragments");
  const auto ranges = [](const char* name, const CameraRanges& cameras) {
    if (!cameras.empty() && cameras.ranges().back().last >= kMaxCameras)
      throw Error(std::string(name) + ": camera " + std::to_string(cameras.ranges().back().last) + " is beyond " +
                  std::to_string(kMaxCameras - 1));
  };
  ranges("cameras", answer.cameras);
  ranges("blind", answer.blind);
  if (!answer.cameras.contains(answer.blind)) throw Error("blind: cameras that are not the answer's");
}

void check_part(const AnswerPart& part) {
  if (part.total > kMaxFragments)
    throw Error("total: at most " + std::to_string(kMaxFragments) + " fragments, not " + std::to_string(part.total));
  if (part.first > part.total || part.count > part.total - part.first)
    throw Error("total: " + std::to_string(part.total) + " fragments, but this part has " + std::to_string(part.count) +
                " from number " + std::to_string(part.first) + " on");
  if (part.count == 0 && part.total > 0) throw Error("fragments: a part without any");
}

void check_fragment(const AnswerHeader& answer, const FragmentHeader& fragment) {
  const Rect& rect = fragment.rect;
  if (fragment.camera && *fragment.camera >= kMaxCameras)
    throw Error("camera: " + std::to_string(*fragment.camera) + " is beyond " + std::to_string(kMaxCameras - 1));
  if (fragment.family != answer.family) throw Error("family: differs from the answer's");
  if (rect.empty()) throw Error("rectangle: is empty");
  const int right = fragment.camera ? kMaxImageSize : answer.view_width;
  const int bottom = fragment.camera ? kMaxImageSize : answer.view_height;
  if (rect.x0 < 0 || rect.y0 < 0 || rect.x1 > right || rect.y1 > bottom)
    throw Error(std::string("rectangle: is not inside ") + (fragment.camera ? "any image" : "the view"));
  if (fragment.camera && fragment.has_lost) throw Error("flags: pixels of a camera have no lost weight");
  if (fragment.camera && fragment.codec == Codec::kRaw16)
    throw Error("codec: 16 bits are for sums, not for pixels of a camera");
  if (answer.family == PixelFamily::kI420 && (rect.x0 % 2 != 0 || rect.y0 % 2 != 0))
    throw Error("rectangle: x and y must be even in YCbCr");
  if (fragment.codec > Codec::kRaw16)
    throw Error("codec: " + std::to_string(static_cast<int>(fragment.codec)) + " is not supported");
  const bool jpeg = fragment.codec == Codec::kJpeg;
  if (jpeg && (fragment.quality < 1 || fragment.quality > 100))
    throw Error("quality: must be 1 to 100 for JPEG, is " + std::to_string(fragment.quality));
  if (!jpeg && fragment.quality != 0)
    throw Error("quality: must be 0 for raw pixels, is " + std::to_string(fragment.quality));
}

}  // namespace lf::wire
