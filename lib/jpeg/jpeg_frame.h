// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/maths.h"
#include "image/image.h"
#include "jpeg/header.h"

namespace lf::jpeg {

// Both decode a whole JPEG of any kind that libjpeg reads: progressive, several scans, arithmetic coding, any sampling;
// grey, YCbCr, RGB, CMYK or YCCK. They return nothing, and the cause in *reason, if any part of the frame is damaged.
// Thread-safe.

// Decodes to I420. Chroma of more than half resolution is averaged, chroma of less is repeated. The frame's header has
// passed parse_header().
std::optional<Image> decode_whole(std::span<const uint8_t> frame, std::string* reason);
// Decodes to RGB, with libjpeg's interpolation of chroma.
std::optional<Image> decode_rgb(std::span<const uint8_t> frame, std::string* reason);

}  // namespace lf::jpeg

namespace lf {

namespace jpeg {
class I420Writer;
class McuStream;
}  // namespace jpeg

// A camera's compressed frame, with what has been decoded of it so far: pixels exist where a view has asked for them.
// Pixels are what libjpeg's JDCT_ISLOW makes of the file, bit by bit, as I420; chroma of full resolution along an axis
// is averaged, grey gets chroma of 128, RGB and CMYK are converted. Thread-safe: views may share a frame. A call waits
// while another one decodes.
//
// A baseline frame (every Motion JPEG camera's) is decoded in whole MCUs. What lies before them has to be passed over,
// at a fraction of the cost, from the last restart marker or the start of a row that was met before. Other frames, such
// as progressive ones, are decoded as a whole when the first region is asked for.
class JpegFrame {
 public:
  // Reads the headers and keeps `bytes` alive through `owner` (both may be dropped by the caller). Returns null, and
  // the cause in *reason, fit to be shown to a person, if the headers are damaged, there are too few bytes for the
  // image's size, or the kind of JPEG is not supported: not 8 bits a sample, lossless, unknown colours, more than
  // kMaxImageSize pixels a side.
  static std::shared_ptr<JpegFrame> open(std::shared_ptr<const void> owner, std::span<const uint8_t> bytes,
                                         std::string* reason = nullptr);
  ~JpegFrame();
  JpegFrame(const JpegFrame&) = delete;
  JpegFrame& operator=(const JpegFrame&) = delete;

  int width() const { return header_.width; }    // pixels, >= 1
  int height() const { return header_.height; }  // pixels, >= 1

  // Makes the pixels of `region` available, as far as it lies in the image; an empty one always is. False, and why in
  // *reason, if the data there, or before it since the last restart marker, is damaged: then some of it may be
  // available, and pixels asked for earlier still are. Damage that leaves the codes valid goes unnoticed.
  bool ensure(const Rect& region, std::string* reason = nullptr);

  // The image: pixels are defined in the regions for which ensure() returned true to somebody, everything else in its
  // rectangle may be read and is anything. Planes are null before the first ensure(), then stay where they are as long
  // as the frame lives.
  ImageView view() const;

 private:
  JpegFrame(std::shared_ptr<const void> owner, std::span<const uint8_t> bytes, const jpeg::Header& header);
  bool fail(std::string text, std::string* reason) const;
  bool ensure_whole(std::string* reason);
  bool ensure_row(int row, int begin, int end);

  const std::shared_ptr<const void> owner_;
  const std::span<const uint8_t> bytes_;
  const jpeg::Header header_;

  mutable std::mutex mutex_;  // guards what follows
  std::unique_ptr<jpeg::McuStream> stream_;
  std::unique_ptr<jpeg::I420Writer> writer_;
  std::vector<bool> decoded_;   // whether each MCU is decoded, row by row
  std::optional<Image> whole_;  // the whole picture, in place of the above where regions can't be decoded
  std::string damage_;          // why there will never be anything
};

}  // namespace lf
