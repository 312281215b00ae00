// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/image_atlas.h"

#include <algorithm>
#include <cmath>

#include "render/camera_projection.h"

namespace lf::gl {
namespace {

int even(int size) { return (size + 1) & ~1; }

// Pixels of as many bytes as the atlas has them, of an image that has others.
void repack(const ImageView& image, const Rect& part, int bytes, std::vector<uint8_t>& out) {
  out.assign(static_cast<size_t>(part.width()) * part.height() * static_cast<size_t>(bytes), 0);
  uint8_t* to = out.data();
  const int offset[3] = {image.layout.r, image.layout.g, image.layout.b};
  for (int y = part.y0; y < part.y1; y++)
    for (int x = part.x0; x < part.x1; x++, to += bytes)
      for (const int c : offset)
        to[c] = image.plane[0][y * image.stride[0] + ptrdiff_t{x} * image.layout.pixel_stride + c];
}

}  // namespace

bool ImageAtlas::lay_out(const simd::SumTask& task, std::span<const Source> sources, int max_size) {
  pieces_.clear();
  offsets_.assign(task.slots.size(), {});
  bytes_ = 1;
  double area = 0;
  int widest = 2;
  for (const Source& source : sources) {
    const int32_t slot = task.slot_of_camera[source.camera];
    if (slot < 0 || source.image.family == PixelFamily::kNone) continue;
    const Rect part = needed_pixels(*task.plan, source.camera, *source.rig_camera);
    pieces_.push_back({&source.image, part, slot});
    area += static_cast<double>(even(part.width())) * even(part.height());
    widest = std::max(widest, even(part.width()));
    if (task.family == PixelFamily::kRgb) bytes_ = std::max(bytes_, source.image.layout.pixel_stride);
  }
  // On shelves, the highest first.
  std::ranges::sort(pieces_, std::ranges::greater(), [](const Piece& piece) { return piece.part.height(); });
  width_ = std::max(widest, even(static_cast<int>(std::sqrt(1.1 * area))));
  int x = 0, y = 0, shelf = 0;
  for (const Piece& piece : pieces_) {
    const int width = even(piece.part.width()), height = even(piece.part.height());
    if (x + width > width_) {
      x = 0;
      y += shelf;
      shelf = 0;
    }
    shelf = std::max(shelf, height);
    offsets_[static_cast<size_t>(piece.slot)] = {x - piece.part.x0, y - piece.part.y0};
    x += width;
  }
  height_ = std::max(y + shelf, 2);
  return std::max(width_, height_) <= max_size;
}

void ImageAtlas::send(const Piece& piece) {
  const auto& [image, part, slot] = piece;
  const GLenum format = bytes_ == 1 ? GL_RED : bytes_ == 3 ? GL_RGB : GL_RGBA;
  const ptrdiff_t stride = image->stride[0];
  const uint8_t* from = image->plane[0] + part.y0 * stride + ptrdiff_t{part.x0} * bytes_;
  int row_pixels = 0;
  if (image->family == PixelFamily::kRgb && image->layout.pixel_stride != bytes_) {
    repack(*image, part, bytes_, packed_);
    from = packed_.data();
  } else if (stride > 0 && stride % bytes_ == 0) {
    row_pixels = static_cast<int>(stride / bytes_);
  } else {
    const size_t row = static_cast<size_t>(part.width()) * static_cast<size_t>(bytes_);
    packed_.resize(row * static_cast<size_t>(part.height()));
    for (int y = 0; y < part.height(); y++) std::copy_n(from + y * stride, row, &packed_[static_cast<size_t>(y) * row]);
    from = packed_.data();
  }
  glPixelStorei(GL_UNPACK_ROW_LENGTH, row_pixels);
  const Offset& at = offset(slot);
  glTexSubImage2D(GL_TEXTURE_2D, 0, at.x + part.x0, at.y + part.y0, part.width(), part.height(), format,
                  GL_UNSIGNED_BYTE, from);
}

void ImageAtlas::upload() {
  pixels_.bind(kImages, bytes_ == 1 ? GL_R8 : bytes_ == 3 ? GL_RGB8 : GL_RGBA8, width_, height_);
  for (const Piece& piece : pieces_) send(piece);
  glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
}

void ImageAtlas::upload_chroma() {
  chroma_.bind(kChromaImages, GL_R16UI, width_ / 2, height_ / 2);
  for (const auto& [image, part, slot] : pieces_) {
    const Rect half{part.x0 / 2, part.y0 / 2, chroma_size(part.x1), chroma_size(part.y1)};
    const int width = half.width();
    packed_chroma_.resize(static_cast<size_t>(width) * half.height());
    uint16_t* __restrict to = packed_chroma_.data();
    for (int y = half.y0; y < half.y1; y++, to += width) {
      const uint8_t* __restrict const cb = image->plane[1] + y * image->stride[1] + half.x0;
      const uint8_t* __restrict const cr = image->plane[2] + y * image->stride[2] + half.x0;
      for (int x = 0; x < width; x++) to[x] = static_cast<uint16_t>(cb[x] | cr[x] << 8);
    }
    const Offset& at = offset(slot);
    glTexSubImage2D(GL_TEXTURE_2D, 0, at.x / 2 + half.x0, at.y / 2 + half.y0, width, half.height(), GL_RED_INTEGER,
                    GL_UNSIGNED_SHORT, packed_chroma_.data());
  }
}

}  // namespace lf::gl
