// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "image/image.h"
#include "jpeg/buffer_pool.h"
#include "jpeg/header.h"
#include "jpeg/mcu_stream.h"

namespace lf::jpeg {

// An I420 image that is filled MCU by MCU. Its memory is not initialised and comes from the pool. Not thread-safe, but
// for reading other MCUs' pixels during a write().
class I420Writer {
 public:
  // `header`: one_baseline_scan; has to outlive the writer.
  explicit I420Writer(const Header& header);

  // The whole image. Planes go on beyond it to whole MCUs.
  ImageView view() const;
  // Transforms the MCU at column x, row y of them. Chroma of full resolution along an axis is averaged, two and two.
  void write(const McuStream::Mcu& mcu, int x, int y);

 private:
  void write_averaged(const McuStream::Mcu& mcu, int block, int component, int x, int y);

  const Header& header_;
  ptrdiff_t stride_[3];
  PooledBuffer memory_;
  uint8_t* plane_[3];
};

}  // namespace lf::jpeg
