// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/full_decode.h"

#include <csetjmp>
#include <cstdio>
#include <vector>

#include <jerror.h>
#include <jpeglib.h>

namespace lf::jpeg {
namespace {

// A few hundred bytes of empty scans can keep a decoder of a large progressive image busy for minutes. What encoders
// make has about ten.
constexpr int kMaxScans = 64;

struct Failure : jpeg_error_mgr {
  std::jmp_buf jump;
  char text[JMSG_LENGTH_MAX] = "";
};

[[noreturn]] void fail(j_common_ptr info) {
  auto* const failure = static_cast<Failure*>(info->err);
  failure->format_message(info, failure->text);
  std::longjmp(failure->jump, 1);
}

// libjpeg goes on after damage with grey or repeated content; here the frame is lost then. Bytes that are nobody's and
// versions that nobody knows are no damage.
void on_message(j_common_ptr info, int level) {
  const int code = info->err->msg_code;
  if (level < 0 && code != JWRN_EXTRANEOUS_DATA && code != JWRN_JFIF_MAJOR && code != JWRN_ADOBE_XFORM) fail(info);
}

void on_progress(j_common_ptr info) {
  if (reinterpret_cast<j_decompress_ptr>(info)->input_scan_number <= kMaxScans) return;
  std::snprintf(static_cast<Failure*>(info->err)->text, JMSG_LENGTH_MAX, "more than %d scans", kMaxScans);
  std::longjmp(static_cast<Failure*>(info->err)->jump, 1);
}

// Two rows of interleaved YCbCr at full resolution, or of grey, to a row of I420 chroma and two of luma.
void store_rows(const uint8_t* const rows[2], int components, int y, Image& out) {
  const int w = out.width(), cw = chroma_size(w);
  for (int i = 0; i < 2 && y + i < out.height(); i++) {
    uint8_t* const luma = out.plane(0) + static_cast<ptrdiff_t>(y + i) * w;
    for (int x = 0; x < w; x++) luma[x] = rows[i][x * components];
  }
  for (int c = 1; c < 3; c++) {
    uint8_t* const chroma = out.plane(c) + static_cast<ptrdiff_t>(y / 2) * cw;
    for (int x = 0; x < cw; x++) {
      const int left = 2 * x * components + c, right = 2 * x + 1 < w ? left + components : left;
      chroma[x] = static_cast<uint8_t>(
          components == 1 ? 128 : (rows[0][left] + rows[0][right] + rows[1][left] + rows[1][right] + 2) >> 2);
    }
  }
}

// Between setjmp() and longjmp() live no objects with destructors: all are the caller's.
bool decode(jpeg_decompress_struct& info, Failure& failure, std::span<const uint8_t> frame, Image& out,
            std::vector<uint8_t>& memory) {
  if (setjmp(failure.jump)) return false;
  jpeg_create_decompress(&info);
  jpeg_progress_mgr progress{};
  progress.progress_monitor = on_progress;
  info.progress = &progress;
  jpeg_mem_src(&info, frame.data(), static_cast<unsigned long>(frame.size()));
  jpeg_read_header(&info, TRUE);
  if (info.jpeg_color_space != JCS_YCbCr && info.jpeg_color_space != JCS_GRAYSCALE) {
    std::snprintf(failure.text, sizeof failure.text, "only grey and YCbCr are supported");
    return false;
  }
  info.out_color_space = info.jpeg_color_space;
  info.dct_method = JDCT_ISLOW;
  info.do_fancy_upsampling = FALSE;  // samples repeated, so that the mean of 2x2 of them is the one sample again
  jpeg_start_decompress(&info);
  const int width = static_cast<int>(info.output_width), height = static_cast<int>(info.output_height);
  const int components = info.output_components;
  const size_t row_bytes = static_cast<size_t>(width) * static_cast<size_t>(components);
  out = Image(PixelFamily::kI420, width, height);
  memory.resize(2 * row_bytes);
  for (int y = 0; y < height; y += 2) {
    uint8_t* rows[2] = {memory.data(), memory.data() + row_bytes};
    if (y + 1 == height) rows[1] = rows[0];
    for (int i = 0; i < 2 && y + i < height; i++) jpeg_read_scanlines(&info, &rows[i], 1);
    store_rows(rows, components, y, out);
  }
  jpeg_finish_decompress(&info);
  return true;
}

}  // namespace

std::optional<Image> decode_whole(std::span<const uint8_t> frame, std::string* reason) {
  std::optional<Image> image(std::in_place);
  std::vector<uint8_t> rows;
  jpeg_decompress_struct info{};
  Failure failure;
  info.err = jpeg_std_error(&failure);
  failure.error_exit = fail;
  failure.emit_message = on_message;
  const bool whole = decode(info, failure, frame, *image, rows);
  jpeg_destroy_decompress(&info);
  if (whole) return image;
  if (reason) *reason = failure.text;
  return std::nullopt;
}

}  // namespace lf::jpeg
