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

// The functions below decode a whole JPEG of any kind that libjpeg reads: progressive, several scans, arithmetic
// coding, any sampling; grey, YCbCr, RGB, CMYK or YCCK. If any part of the frame is damaged, they return nothing and
// set *reason. Thread-safe.

// Decodes to I420. Chroma of more than half resolution is averaged, and chroma of less is repeated. parse_header() must
// have accepted the frame.
std::optional<Image> decode_whole(std::span<const uint8_t> frame, std::string* reason);
// Decodes to RGB with libjpeg's chroma interpolation.
std::optional<Image> decode_rgb(std::span<const uint8_t> frame, std::string* reason);

}  // namespace lf::jpeg

namespace lf {

namespace jpeg {
class I420Writer;
class McuStream;
}  // namespace jpeg

// A camera's compressed frame. Decodes only the requested regions, because a view usually needs only a part of each
// image. Pixels are I420 and bit-identical to libjpeg's JDCT_ISLOW. Chroma of full resolution along an axis is
// averaged, grey gets chroma 128, and RGB and CMYK are converted. Thread-safe: several views may share a frame, and
// calls wait while another call decodes. Baseline frames are decoded in whole MCUs. Other frames, such as progressive
// ones, are decoded as a whole when the first region is requested.
class JpegFrame {
 public:
  // Reads the headers, and keeps `bytes` alive through `owner`. Returns null and sets *reason to a text for users in
  // three cases: the headers are damaged, there are too few bytes for the image's size, or the kind of JPEG is
  // unsupported. Unsupported are other sample sizes than 8 bits, lossless coding, unknown colours, and more than
  // kMaxImageSize pixels a side.
  static std::shared_ptr<JpegFrame> open(std::shared_ptr<const void> owner, std::span<const uint8_t> bytes,
                                         std::string* reason = nullptr);
  ~JpegFrame();
  JpegFrame(const JpegFrame&) = delete;
  JpegFrame& operator=(const JpegFrame&) = delete;

  int width() const { return header_.width; }
  int height() const { return header_.height; }

  // Decodes the pixels of `region`, which must be inside the image. Returns false and sets *reason if the data there is
  // damaged, or the data between the last restart marker and there. Some of the region may then be available, and
  // earlier regions stay available. Damage that leaves valid codes goes unnoticed.
  bool ensure(const Rect& region, std::string* reason = nullptr);

  // Returns the image. Pixels are defined only in regions with a successful ensure(); the rest may be read, but is
  // undefined. Planes are null before the first ensure(), and then keep their address until the frame is destroyed.
  ImageView view() const;

 private:
  JpegFrame(std::shared_ptr<const void> owner, std::span<const uint8_t> bytes, const jpeg::Header& header);
  bool fail(std::string text, std::string* reason) const;
  bool decode_all(std::string* reason);
  bool ensure_row(int row, int begin, int end);

  const std::shared_ptr<const void> owner_;
  const std::span<const uint8_t> bytes_;
  const jpeg::Header header_;

  mutable std::mutex mutex_;  // guards all following members
  std::unique_ptr<jpeg::McuStream> stream_;
  std::unique_ptr<jpeg::I420Writer> writer_;
  std::vector<bool> decoded_;   // one flag per MCU, row by row
  std::optional<Image> whole_;  // the whole picture, if regions cannot be decoded
  std::string damage_;
};

}  // namespace lf
