// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/jpeg_frame.h"

#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <utility>
#include <vector>

#include <jerror.h>
#include <jpeglib.h>

#include "base/memory.h"
#include "jpeg/baseline_scan.h"
#include "jpeg/idct.h"

namespace lf::jpeg {
namespace {

// A few hundred bytes of empty scans can occupy a decoder of a large progressive image for minutes. Encoders write
// about ten scans.
constexpr int kMaxScans = 64;

struct Failure : jpeg_error_mgr {
  std::jmp_buf jump;
  char text[JMSG_LENGTH_MAX] = "";
  bool in_scan = false;
};

[[noreturn]] void fail(j_common_ptr info) {
  auto* const failure = static_cast<Failure*>(info->err);
  failure->format_message(info, failure->text);
  std::longjmp(failure->jump, 1);
}

bool skipped_padding(j_common_ptr info) {
  const jpeg_source_mgr& source = *reinterpret_cast<j_decompress_ptr>(info)->src;
  const JOCTET* const end = source.next_input_byte;
  const JOCTET* byte = end - info->err->msg_parm.i[0];
  while (byte < end && (*byte == 0x00 || *byte == 0xff)) byte++;
  return byte == end;
}

// libjpeg only warns of damage, and conceals it with grey or repeated content. Here, the frame fails instead. Unknown
// versions and skipped bytes in headers are harmless, but skipped bytes in a scan are displaced picture data.
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

// Converts one row of CMYK to RGB. `inverted`: the values are inverted, as in Adobe's files.
void cmyk_to_rgb(const uint8_t* cmyk, int width, bool inverted, uint8_t* rgb) {
  for (int x = 0; x < width; x++, cmyk += 4, rgb += 3) {
    const auto light = [&](int i) { return inverted ? cmyk[i] : 255 - cmyk[i]; };
    for (int c = 0; c < 3; c++) rgb[c] = static_cast<uint8_t>((light(c) * light(3) + 127) / 255);
  }
}

// Calls `step` and catches libjpeg's errors. No object with a destructor may live between setjmp() and longjmp(), so
// the caller owns all objects.
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
    info.do_fancy_upsampling = FALSE;  // repeats samples, so that averaging 2x2 returns the original sample
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

// Fills an I420 image MCU by MCU, in uninitialised memory of the pool. Not thread-safe. However, pixels of other MCUs
// may be read during a write().
class I420Writer {
 public:
  // `header` must have one_baseline_scan, and must outlive the writer.
  explicit I420Writer(const Header& header);

  // Returns the whole image. Its planes are padded to whole MCUs.
  ImageView view() const;
  // Transforms the MCU at column x, row y. Averages chroma of full resolution along an axis.
  void write(const McuStream::Mcu& mcu, int x, int y);

 private:
  void write_averaged(const McuStream::Mcu& mcu, int block, int component, int x, int y);

  const Header& header_;
  ptrdiff_t stride_[3];
  PooledBuffer memory_;
  uint8_t* plane_[3];
};

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

  // At an odd edge of the image, the last sample counts twice.
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
  if (!header_.one_baseline_scan) return decode_all(reason);
  if (!stream_) {
    stream_ = std::make_unique<jpeg::McuStream>(header_, bytes_);
    writer_ = std::make_unique<jpeg::I420Writer>(header_);
    decoded_.resize(static_cast<size_t>(header_.mcus_x()) * static_cast<size_t>(header_.mcus_y()));
  }
  if (const char* error = stream_->error()) return fail(error, reason);
  // The chroma samples of a pixel are in the pixel's MCU.
  const int w = 8 * header_.h_max, h = 8 * header_.v_max;
  const int begin = pixels.x0 / w, end = (pixels.x1 + w - 1) / w;
  for (int row = pixels.y0 / h; row < (pixels.y1 + h - 1) / h; row++)
    if (!ensure_row(row, begin, end)) return fail("damaged in row " + std::to_string(row * h), reason);
  return true;
}

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

bool JpegFrame::decode_all(std::string* reason) {
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
