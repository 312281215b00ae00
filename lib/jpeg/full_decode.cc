// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/full_decode.h"

#include <csetjmp>
#include <cstdio>
#include <utility>
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
  bool in_scan = false;  // the headers have been read
};

[[noreturn]] void fail(j_common_ptr info) {
  auto* const failure = static_cast<Failure*>(info->err);
  failure->format_message(info, failure->text);
  std::longjmp(failure->jump, 1);
}

// Whether the bytes that libjpeg has just skipped in front of a marker are padding. Some cameras pad their pictures.
bool skipped_padding(j_common_ptr info) {
  const jpeg_source_mgr& source = *reinterpret_cast<j_decompress_ptr>(info)->src;
  const JOCTET* const end = source.next_input_byte;
  const JOCTET* byte = end - info->err->msg_parm.i[0];
  while (byte < end && (*byte == 0x00 || *byte == 0xff)) byte++;
  return byte == end;
}

// libjpeg conceals damage with grey or repeated content and only warns. Here the frame fails. Unknown versions and
// skipped bytes in headers are harmless. Skipped bytes in a scan are picture data that damage has displaced.
void on_message(j_common_ptr info, int level) {
  const int code = info->err->msg_code;
  if (level >= 0 || code == JWRN_JFIF_MAJOR || code == JWRN_ADOBE_XFORM) return;
  if (code == JWRN_EXTRANEOUS_DATA && (!static_cast<Failure*>(info->err)->in_scan || skipped_padding(info))) return;
  fail(info);
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

// One row of inverted CMYK, as Adobe stores it, to RGB.
void cmyk_to_rgb(const uint8_t* cmyk, int width, bool inverted, uint8_t* rgb) {
  for (int x = 0; x < width; x++, cmyk += 4, rgb += 3) {
    const auto light = [&](int i) { return inverted ? cmyk[i] : 255 - cmyk[i]; };
    for (int c = 0; c < 3; c++) rgb[c] = static_cast<uint8_t>((light(c) * light(3) + 127) / 255);
  }
}

// Calls `step` with libjpeg's errors caught. Between setjmp() and longjmp() live no objects with destructors: all are
// the caller's.
template <typename Step>
bool decode(jpeg_decompress_struct& info, Failure& failure, std::span<const uint8_t> frame, Step& step) {
  if (setjmp(failure.jump)) return false;
  jpeg_create_decompress(&info);
  jpeg_progress_mgr progress{};
  progress.progress_monitor = on_progress;
  info.progress = &progress;
  jpeg_mem_src(&info, frame.data(), static_cast<unsigned long>(frame.size()));
  jpeg_read_header(&info, TRUE);
  failure.in_scan = true;
  step(info);
  jpeg_finish_decompress(&info);
  return true;
}

template <typename Step>
std::optional<Image> run_decoder(std::span<const uint8_t> frame, std::string* reason, Image& out, Step step) {
  jpeg_decompress_struct info{};
  Failure failure;
  info.err = jpeg_std_error(&failure);
  failure.error_exit = fail;
  failure.emit_message = on_message;
  const bool whole = decode(info, failure, frame, step);
  jpeg_destroy_decompress(&info);
  if (whole) return std::move(out);
  if (reason) *reason = failure.text;
  return std::nullopt;
}

void read_rgb(jpeg_decompress_struct& info, Image& out, std::vector<uint8_t>& memory) {
  const bool cmyk = info.jpeg_color_space == JCS_CMYK || info.jpeg_color_space == JCS_YCCK;
  info.out_color_space = cmyk ? JCS_CMYK : JCS_RGB;
  info.dct_method = JDCT_ISLOW;
  jpeg_start_decompress(&info);
  const int width = static_cast<int>(info.output_width), height = static_cast<int>(info.output_height);
  out = Image(PixelFamily::kRgb, width, height);
  if (cmyk) memory.resize(static_cast<size_t>(width) * 4);
  for (int y = 0; y < height; y++) {
    uint8_t* row = cmyk ? memory.data() : out.pixel(0, y);
    jpeg_read_scanlines(&info, &row, 1);
    if (cmyk) cmyk_to_rgb(memory.data(), width, info.saw_Adobe_marker, out.pixel(0, y));
  }
}

}  // namespace

std::optional<Image> decode_whole(std::span<const uint8_t> frame, std::string* reason) {
  Image out;
  std::vector<uint8_t> memory;
  std::optional<Image> image = run_decoder(frame, reason, out, [&](jpeg_decompress_struct& info) {
    if (info.jpeg_color_space != JCS_YCbCr && info.jpeg_color_space != JCS_GRAYSCALE) {
      read_rgb(info, out, memory);
      return;
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
  });
  return image && image->family() == PixelFamily::kRgb ? std::optional(to_i420(*image)) : std::move(image);
}

std::optional<Image> decode_rgb(std::span<const uint8_t> frame, std::string* reason) {
  Image out;
  std::vector<uint8_t> memory;
  return run_decoder(frame, reason, out, [&](jpeg_decompress_struct& info) { read_rgb(info, out, memory); });
}

}  // namespace lf::jpeg
