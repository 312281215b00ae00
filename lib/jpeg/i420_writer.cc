// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/i420_writer.h"

#include <cstring>

#include "jpeg/idct.h"

namespace lf::jpeg {
I420Writer::I420Writer(const Header& header) : header_(header) {
  const ptrdiff_t width = ptrdiff_t{8} * header.h_max * header.mcus_x();
  const ptrdiff_t height = ptrdiff_t{8} * header.v_max * header.mcus_y();
  stride_[0] = width;
  stride_[1] = stride_[2] = width / 2;
  memory_ = take_buffer(static_cast<size_t>(width * height / 2 * 3));
  plane_[0] = memory_.get();
  plane_[1] = plane_[0] + width * height;
  plane_[2] = plane_[1] + width * height / 4;
}

ImageView I420Writer::view() const {
  ImageView view;
  view.family = PixelFamily::kI420;
  view.width = header_.width;
  view.height = header_.height;
  for (int i = 0; i < 3; i++) {
    view.plane[i] = plane_[i];
    view.stride[i] = stride_[i];
  }
  return view;
}

void I420Writer::write(const McuStream::Mcu& mcu, int x, int y) {
  const int h_max = header_.h_max, v_max = header_.v_max;
  int block = 0;
  for (int by = 0; by < v_max; by++)
    for (int bx = 0; bx < h_max; bx++, block++)
      idct(mcu.block[block], mcu.last[block], plane_[0] + (y * v_max + by) * 8 * stride_[0] + (x * h_max + bx) * 8,
           stride_[0]);
  for (int i = 1; i < 3; i++) {
    uint8_t* const chroma = plane_[i] + y * 4 * v_max * stride_[i] + x * 4 * h_max;
    if (header_.components == 1) {
      for (int row = 0; row < 4 * v_max; row++)
        std::memset(chroma + row * stride_[i], 128, static_cast<size_t>(4 * h_max));
      continue;
    }
    const Component& c = header_.component[i];
    if (2 * c.h == h_max && 2 * c.v == v_max)
      idct(mcu.block[block], mcu.last[block], chroma, stride_[i]);
    else
      write_averaged(mcu, block, i, x, y);
    block += c.h * c.v;
  }
}

void I420Writer::write_averaged(const McuStream::Mcu& mcu, int block, int component, int x, int y) {
  const Component& c = header_.component[component];
  uint8_t full[16][16];
  for (int by = 0; by < c.v; by++)
    for (int bx = 0; bx < c.h; bx++, block++)
      idct(mcu.block[block], mcu.last[block], &full[by * 8][bx * 8], sizeof full[0]);

  // What lies beyond an odd edge of the image is no part of it: the last sample counts for two.
  const int step_x = 2 * c.h / header_.h_max, step_y = 2 * c.v / header_.v_max;
  const int last_x = step_x == 2 ? header_.width - 1 - x * 8 * c.h : 16;
  const int last_y = step_y == 2 ? header_.height - 1 - y * 8 * c.v : 16;
  const int width = 4 * header_.h_max, height = 4 * header_.v_max;
  uint8_t* out = plane_[component] + ptrdiff_t{y} * height * stride_[component] + x * width;
  for (int v = 0; v < height; v++, out += stride_[component]) {
    const uint8_t* const upper = full[v * step_y];
    const uint8_t* const lower = full[v * step_y + (step_y == 2 && v * 2 < last_y)];
    for (int u = 0; u < width; u++) {
      const int left = u * step_x, right = left + (step_x == 2 && left < last_x);
      out[u] = static_cast<uint8_t>((upper[left] + upper[right] + lower[left] + lower[right] + 2) >> 2);
    }
  }
}

}  // namespace lf::jpeg
