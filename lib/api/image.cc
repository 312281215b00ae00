// SPDX-License-Identifier: LGPL-2.1-or-later
#include <lightfield/image.h>

#include <lightfield/error.h>

#include "image/image.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lightfield {

static_assert(static_cast<int>(PixelFormat::kRgb) == static_cast<int>(lf::PixelFamily::kRgb));
static_assert(static_cast<int>(PixelFormat::kI420) == static_cast<int>(lf::PixelFamily::kI420));

Image make_image(PixelFormat format, int width, int height) {
  if (format != PixelFormat::kRgb && format != PixelFormat::kI420) throw Error("format: must be kRgb or kI420");
  lf::validate_size("width", width);
  lf::validate_size("height", height);
  lf::Image image(static_cast<lf::PixelFamily>(format), width, height);
  if (format == PixelFormat::kI420)  // chroma has its zero in the middle
    std::fill(image.plane(1), image.data().data() + image.data().size(), uint8_t{128});
  return {format, width, height, std::move(image.data())};
}

ImageView::ImageView(const Image& image) : format(image.format), width(image.width), height(image.height) {
  if (format == PixelFormat::kNone) return;
  const auto family = static_cast<lf::PixelFamily>(format);
  const bool known = format == PixelFormat::kRgb || format == PixelFormat::kI420;
  if (!known || width < 1 || height < 1 || width > lf::kMaxImageSize || height > lf::kMaxImageSize ||
      image.pixels.size() != lf::packed_size(family, width, height))
    throw Error("image: " + std::to_string(image.pixels.size()) + " bytes are not those of an image of " +
                std::to_string(width) + "x" + std::to_string(height) + " pixels in its format");
  plane[0] = image.pixels.data();
  stride[0] = format == PixelFormat::kRgb ? ptrdiff_t{3} * width : width;
  if (format == PixelFormat::kRgb) return;
  const size_t luma = static_cast<size_t>(width) * height;
  plane[1] = plane[0] + luma;
  plane[2] = plane[1] + (image.pixels.size() - luma) / 2;
  stride[1] = stride[2] = lf::chroma_size(width);
}

}  // namespace lightfield
