// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/jpeg_frame.h"

#include <utility>

#include "jpeg/full_decode.h"
#include "jpeg/i420_writer.h"
#include "jpeg/mcu_stream.h"

namespace lf {

std::shared_ptr<JpegFrame> JpegFrame::open(std::shared_ptr<const void> owner, std::span<const uint8_t> bytes,
                                           std::string* reason) {
  const std::optional<jpeg::Header> header = jpeg::parse_header(bytes, reason);
  if (!header) return nullptr;
  return std::shared_ptr<JpegFrame>(new JpegFrame(std::move(owner), bytes, *header));
}

JpegFrame::JpegFrame(std::shared_ptr<const void> owner, std::span<const uint8_t> bytes, const jpeg::Header& header)
    : owner_(std::move(owner)), bytes_(bytes), header_(header) {}

JpegFrame::~JpegFrame() = default;

bool JpegFrame::ensure(const Rect& region, std::string* reason) {
  const Rect pixels = intersect(region, {0, 0, header_.width, header_.height});
  if (pixels.empty()) return true;
  const std::lock_guard lock(mutex_);
  if (!header_.one_baseline_scan) return ensure_whole(reason);
  if (!stream_) {
    stream_ = std::make_unique<jpeg::McuStream>(header_, bytes_);
    writer_ = std::make_unique<jpeg::I420Writer>(header_);
    decoded_.resize(static_cast<size_t>(header_.mcus_x()) * static_cast<size_t>(header_.mcus_y()));
  }
  if (const char* error = stream_->error()) return fail(error, reason);
  // Chroma samples of a pixel lie in its MCU.
  const int w = 8 * header_.h_max, h = 8 * header_.v_max;
  const int begin = pixels.x0 / w, end = (pixels.x1 + w - 1) / w;
  for (int row = pixels.y0 / h; row < (pixels.y1 + h - 1) / h; row++)
    if (!ensure_row(row, begin, end)) return fail("damaged in row " + std::to_string(row * h), reason);
  return true;
}

// MCUs [begin, end) of a row.
bool JpegFrame::ensure_row(int row, int begin, int end) {
  const auto decoded = decoded_.begin() + static_cast<ptrdiff_t>(row) * header_.mcus_x();
  while (begin < end && decoded[begin]) begin++;
  while (begin < end && decoded[end - 1]) end--;
  if (begin == end) return true;
  if (!stream_->seek(begin, row)) return false;
  jpeg::McuStream::Mcu mcu;
  for (int x = begin; x < end; x++) {
    if (decoded[x]) {
      if (!stream_->pass(1)) return false;
      continue;
    }
    if (!stream_->read(mcu)) return false;
    writer_->write(mcu, x, row);
    decoded[x] = true;
  }
  return true;
}

bool JpegFrame::ensure_whole(std::string* reason) {
  if (!whole_ && damage_.empty()) {
    whole_ = jpeg::decode_whole(bytes_, &damage_);
    if (whole_ && (whole_->width() != header_.width || whole_->height() != header_.height)) {
      whole_.reset();
      damage_ = "two image sizes in one frame";
    }
  }
  return whole_ || fail(damage_, reason);
}

bool JpegFrame::fail(std::string text, std::string* reason) const {
  if (reason) *reason = std::move(text);
  return false;
}

ImageView JpegFrame::view() const {
  const std::lock_guard lock(mutex_);
  if (writer_) return writer_->view();
  if (whole_) return whole_->view();
  ImageView view;
  view.family = PixelFamily::kI420;
  view.width = header_.width;
  view.height = header_.height;
  return view;
}

}  // namespace lf
