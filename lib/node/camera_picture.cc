// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/camera_picture.h"

#include <algorithm>

namespace lf {
namespace {

// Cameras of both families on one node: rare, and never cheap.
std::shared_ptr<const ImageView> as_rgb(const ImageView& i420) {
  struct Converted {
    Image image;
    ImageView view;
  };
  Image packed(PixelFamily::kI420, i420.width, i420.height);
  for (int c = 0; c < 3; c++) {
    const int w = c ? chroma_size(i420.width) : i420.width, h = c ? chroma_size(i420.height) : i420.height;
    for (int y = 0; y < h; y++)
      std::copy_n(i420.plane[c] + y * i420.stride[c], w, packed.plane(c) + static_cast<ptrdiff_t>(y) * w);
  }
  const auto converted = std::make_shared<Converted>(Converted{to_rgb(packed), {}});
  converted->view = converted->image.view();
  return {converted, &converted->view};
}

}  // namespace

std::shared_ptr<const ImageView> JpegPicture::view(PixelFamily family, const Rect& region) {
  const bool converts = family == PixelFamily::kRgb;
  if (!frame_->ensure(converts ? Rect{0, 0, width(), height()} : region)) return nullptr;
  return converts ? as_rgb(frame_->view()) : std::make_shared<const ImageView>(frame_->view());
}

}  // namespace lf
