// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/image_arrays.h"

#include <algorithm>

#include "render/camera_projection.h"

namespace lf::gl {
namespace {

// Pixels of as many bytes as the array has them, of an image that has others.
void repack(const ImageView& image, const Rect& part, int bytes, std::vector<uint8_t>& out) {
  out.assign(static_cast<size_t>(part.width()) * part.height() * static_cast<size_t>(bytes), 0);
  uint8_t* to = out.data();
  const int offset[3] = {image.layout.r, image.layout.g, image.layout.b};
  for (int y = part.y0; y < part.y1; y++)
    for (int x = part.x0; x < part.x1; x++, to += bytes)
      for (const int c : offset)
        to[c] = image.plane[0][y * image.stride[0] + ptrdiff_t{x} * image.layout.pixel_stride + c];
}

void send(const Rect& part, int layer, GLenum format, const uint8_t* pixels, int row_pixels) {
  glPixelStorei(GL_UNPACK_ROW_LENGTH, row_pixels);
  glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, part.x0, part.y0, layer, part.width(), part.height(), 1, format,
                  GL_UNSIGNED_BYTE, pixels);
}

}  // namespace

void ImageArrays::send_pixels(const ImageView& image, const Rect& part, int layer, int bytes) {
  const GLenum format = bytes == 1 ? GL_RED : bytes == 3 ? GL_RGB : GL_RGBA;
  const ptrdiff_t stride = image.stride[0];
  if (image.family == PixelFamily::kRgb && image.layout.pixel_stride != bytes) {
    repack(image, part, bytes, packed_);
    return send(part, layer, format, packed_.data(), 0);
  }
  const uint8_t* from = image.plane[0] + part.y0 * stride + ptrdiff_t{part.x0} * bytes;
  if (stride > 0 && stride % bytes == 0) return send(part, layer, format, from, static_cast<int>(stride / bytes));
  const size_t row = static_cast<size_t>(part.width()) * static_cast<size_t>(bytes);
  packed_.resize(row * static_cast<size_t>(part.height()));
  for (int y = 0; y < part.height(); y++) std::copy_n(from + y * stride, row, &packed_[static_cast<size_t>(y) * row]);
  send(part, layer, format, packed_.data(), 0);
}

void ImageArrays::send_chroma(const ImageView& image, const Rect& part, int layer) {
  const Rect half{part.x0 / 2, part.y0 / 2, chroma_size(part.x1), chroma_size(part.y1)};
  const int width = half.width();
  packed_chroma_.resize(static_cast<size_t>(width) * half.height());
  uint16_t* __restrict to = packed_chroma_.data();
  for (int y = half.y0; y < half.y1; y++, to += width) {
    const uint8_t* __restrict const cb = image.plane[1] + y * image.stride[1] + half.x0;
    const uint8_t* __restrict const cr = image.plane[2] + y * image.stride[2] + half.x0;
    for (int x = 0; x < width; x++) to[x] = static_cast<uint16_t>(cb[x] | cr[x] << 8);
  }
  glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, half.x0, half.y0, layer, width, half.height(), 1, GL_RED_INTEGER,
                  GL_UNSIGNED_SHORT, packed_chroma_.data());
}

namespace {

// Calls fn(image, needed pixels, layer) for those that have any.
template <class Fn>
void for_images(const simd::SumTask& task, std::span<const Source> sources, const Fn& fn) {
  for (const Source& source : sources) {
    const int layer = task.slot_of_camera[source.camera];
    if (layer >= 0 && source.image.family != PixelFamily::kNone)
      fn(source.image, needed_pixels(*task.plan, source.camera, *source.rig_camera), layer);
  }
  glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
}

struct ArraySize {
  explicit ArraySize(const simd::SumTask& task) : layers(static_cast<int>(task.slots.size())) {
    for (const simd::Slot& slot : task.slots) {
      width = std::max(width, slot.image.width);
      height = std::max(height, slot.image.height);
      if (slot.image.family == PixelFamily::kRgb) bytes = std::max(bytes, slot.image.layout.pixel_stride);
    }
  }
  int layers, width = 1, height = 1, bytes = 1;
};

}  // namespace

void ImageArrays::upload(const simd::SumTask& task, std::span<const Source> sources) {
  const ArraySize size(task);
  images_.bind(kImages,
               size.bytes == 1   ? GL_R8
               : size.bytes == 3 ? GL_RGB8
                                 : GL_RGBA8,
               size.width, size.height, size.layers);
  for_images(task, sources,
             [&](const ImageView& image, const Rect& part, int layer) { send_pixels(image, part, layer, size.bytes); });
}

void ImageArrays::upload_chroma(const simd::SumTask& task, std::span<const Source> sources) {
  const ArraySize size(task);
  chroma_.bind(kChromaImages, GL_R16UI, chroma_size(size.width), chroma_size(size.height), size.layers);
  for_images(task, sources,
             [&](const ImageView& image, const Rect& part, int layer) { send_chroma(image, part, layer); });
}

}  // namespace lf::gl
