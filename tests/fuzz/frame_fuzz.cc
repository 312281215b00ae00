// SPDX-License-Identifier: LGPL-2.1-or-later
// Compares the decoder of camera JPEGs with libjpeg-turbo. libjpeg-turbo accepts every accepted frame and decodes the
// same picture. Frames that only libjpeg-turbo accepts contain codes that no encoder writes: re-encoded by libjpeg,
// they are accepted.
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include <jpeglib.h>

#include <jerror.h>

#include "fuzz/fuzz.h"
#include "image/image.h"
#include "jpeg/jpeg_frame.h"

using lf::fuzz::require;

namespace {

constexpr int kMaxPixels = 1 << 16;  // comparing more would be slow

using Bytes = std::span<const uint8_t>;

// Decodes a frame with libjpeg; the last marker may be missing. Warnings are errors, except for warnings about
// extraneous bytes and unknown versions.
class Libjpeg {
 public:
  explicit Libjpeg(Bytes frame) : bytes_(frame.begin(), frame.end()) {
    end_at(bytes_.size());
    for (auto* const manager : {&in_errors_.manager, &out_errors_.manager}) {
      jpeg_std_error(manager);
      manager->error_exit = fail;
      manager->emit_message = [](j_common_ptr info, int level) {
        const int code = info->err->msg_code;
        if (level < 0 && code != JWRN_EXTRANEOUS_DATA && code != JWRN_JFIF_MAJOR && code != JWRN_ADOBE_XFORM)
          fail(info);
      };
    }
    info_.err = &in_errors_.manager;
    out_.err = &out_errors_.manager;
  }
  ~Libjpeg() {
    jpeg_destroy_decompress(&info_);
    jpeg_destroy_compress(&out_);
    std::free(written_);
  }
  Libjpeg(const Libjpeg&) = delete;

  // longjmp() would skip destructors, so no local variable may have a destructor.
  bool decode() {
    if (setjmp(in_errors_.jump)) return false;
    begin();
    info_.out_color_space = info_.jpeg_color_space;
    info_.raw_data_out = TRUE;
    info_.dct_method = JDCT_ISLOW;
    jpeg_start_decompress(&info_);
    components_ = info_.num_components;
    for (int c = 0; c < components_; c++) {
      const jpeg_component_info& from = info_.comp_info[c];
      planes_[c].width = static_cast<int>(from.downsampled_width);
      planes_[c].height = static_cast<int>(from.downsampled_height);
      planes_[c].stride = static_cast<int>(from.width_in_blocks + 8) * 8;
      planes_[c].samples.resize(size_t{info_.total_iMCU_rows} * from.v_samp_factor * 8 * planes_[c].stride);
    }
    for (unsigned row = 0; row < info_.total_iMCU_rows; row++) {
      JSAMPROW rows[3][4 * 8];
      JSAMPARRAY arrays[3] = {rows[0], rows[1], rows[2]};
      for (int c = 0; c < components_; c++) {
        const unsigned lines = static_cast<unsigned>(info_.comp_info[c].v_samp_factor) * 8;
        for (unsigned y = 0; y < lines; y++)
          rows[c][y] = &planes_[c].samples[size_t{row * lines + y} * planes_[c].stride];
      }
      jpeg_read_raw_data(&info_, arrays, static_cast<unsigned>(info_.max_v_samp_factor) * 8);
    }
    // Data after the scan belongs to no picture.
    end_at(bytes_.size() - info_.src->bytes_in_buffer - (info_.unread_marker ? 2 : 0));
    return true;
  }

  // Call after decoding, like the functions below. Returns true if the coefficients are impossible for an 8-bit
  // picture: a mean of twice white, or so many that the 16-bit integer inverse DCT (libjpeg's and ours) overflows.
  bool is_out_of_range() {
    constexpr int kMost = 32767 / 4 / 1.39;  // four fractional bits, sums of up to 1.39 of each
    constexpr int kMaxMean = 2048;
    if (setjmp(in_errors_.jump)) return false;
    jvirt_barray_ptr* const coefficients = begin_coefficients();
    for (int c = 0; c < info_.num_components; c++) {
      const jpeg_component_info& component = info_.comp_info[c];
      const JQUANT_TBL& quant = *info_.quant_tbl_ptrs[component.quant_tbl_no];
      for (JDIMENSION y = 0; y < component.height_in_blocks; y++) {
        JBLOCKARRAY const row =
            info_.mem->access_virt_barray(reinterpret_cast<j_common_ptr>(&info_), coefficients[c], y, 1, FALSE);
        for (JDIMENSION x = 0; x < component.width_in_blocks; x++) {
          int64_t sum = 0;
          for (int k = 0; k < 64; k++) sum += std::abs(int64_t{row[0][x][k]} * quant.quantval[k]);
          if (sum > kMost || std::abs(row[0][x][0]) > kMaxMean) return true;
        }
      }
    }
    return false;
  }

  // Re-encodes the coefficients as an encoder would. Returns an empty vector on failure.
  Bytes reencoded() {
    if (setjmp(out_errors_.jump)) return {};
    if (setjmp(in_errors_.jump)) return {};
    jvirt_barray_ptr* const coefficients = begin_coefficients();
    jpeg_create_compress(&out_);
    jpeg_mem_dest(&out_, &written_, &written_size_);
    jpeg_copy_critical_parameters(&info_, &out_);
    out_.restart_interval = info_.restart_interval;
    out_.optimize_coding = TRUE;
    jpeg_write_coefficients(&out_, coefficients);
    jpeg_finish_compress(&out_);
    return {written_, written_size_};
  }

  int width(int c) const { return planes_[c].width; }
  int height(int c) const { return planes_[c].height; }
  int components() const { return components_; }
  // Returns a sample; the last row and column are repeated.
  int sample(int c, int x, int y) const {
    const Plane& plane = planes_[c];
    return plane.samples[size_t{1} * std::min(y, plane.height - 1) * plane.stride + std::min(x, plane.width - 1)];
  }

 private:
  struct Errors {
    jpeg_error_mgr manager;  // must be first: libjpeg returns a pointer to this member
    std::jmp_buf jump;
  };
  struct Plane {
    int width = 0, height = 0, stride = 0;
    std::vector<uint8_t> samples;
  };
  [[noreturn]] static void fail(j_common_ptr info) { std::longjmp(reinterpret_cast<Errors*>(info->err)->jump, 1); }

  void end_at(size_t size) {
    bytes_.resize(size);
    for (int i = 0; i < 64; i++) bytes_.insert(bytes_.end(), {0xff, JPEG_EOI});
  }
  void begin() {
    jpeg_destroy_decompress(&info_);
    jpeg_create_decompress(&info_);
    jpeg_mem_src(&info_, bytes_.data(), static_cast<unsigned long>(bytes_.size()));
    jpeg_read_header(&info_, TRUE);
  }
  jvirt_barray_ptr* begin_coefficients() {
    begin();
    return jpeg_read_coefficients(&info_);
  }

  std::vector<uint8_t> bytes_;
  Errors in_errors_, out_errors_;
  jpeg_decompress_struct info_{};
  jpeg_compress_struct out_{};
  unsigned char* written_ = nullptr;
  unsigned long written_size_ = 0;
  int components_ = 0;
  Plane planes_[3];
};

// I420 chroma: full resolution is averaged, grey is 128.
int chroma(const Libjpeg& truth, int c, int x, int y, int width, int height) {
  if (truth.components() == 1) return 128;
  const bool half_x = truth.width(c) == width, half_y = truth.height(c) == height;
  int sum = 2;
  for (int v = 0; v < 2; v++)
    for (int u = 0; u < 2; u++) sum += truth.sample(c, half_x ? x : 2 * x + u, half_y ? y : 2 * y + v);
  return sum / 4;
}

bool same(const lf::ImageView& view, const Libjpeg& truth) {
  if (view.width != truth.width(0) || view.height != truth.height(0)) return false;
  for (int y = 0; y < view.height; y++)
    for (int x = 0; x < view.width; x++)
      if (view.plane[0][y * view.stride[0] + x] != truth.sample(0, x, y)) return false;
  const int width = lf::chroma_size(view.width), height = lf::chroma_size(view.height);
  for (int c = 1; c < 3; c++)
    for (int y = 0; y < height; y++)
      for (int x = 0; x < width; x++)
        if (view.plane[c][y * view.stride[c] + x] != chroma(truth, c, x, y, width, height)) return false;
  return true;
}

bool take(lf::JpegFrame& frame, const lf::Rect& region) {
  std::string reason;
  const bool taken = frame.ensure(region, &reason);
  require(taken == reason.empty());
  return taken;
}

}  // namespace

LF_FUZZ_TARGET(frame)(const uint8_t* data, size_t size) {
  const Bytes bytes{data, size};
  std::string reason;
  const std::shared_ptr<lf::JpegFrame> frame = lf::JpegFrame::open(nullptr, bytes, &reason);
  require(frame || !reason.empty());
  if (!frame || frame->width() * frame->height() > kMaxPixels) return 0;
  const int w = frame->width(), h = frame->height();
  bool taken = true;
  for (const lf::Rect& region :
       {lf::Rect{w / 3, h / 3, w / 2 + 1, h / 2 + 1}, {w - 1, h - 1, w, h}, {0, 0, w / 4, h}, {0, 0, w, h}})
    taken = take(*frame, region);
  // Frames without region decoding are decoded by libjpeg itself.
  if (!lf::jpeg::parse_header(bytes, &reason)->one_baseline_scan) return 0;
  Libjpeg truth(bytes);
  const bool taken_there = truth.decode();
  if (taken) require(taken_there && (same(frame->view(), truth) || truth.is_out_of_range()));
  if (taken || !taken_there || truth.is_out_of_range()) return 0;
  const Bytes again = truth.reencoded();
  if (again.empty()) return 0;
  const std::shared_ptr<lf::JpegFrame> sound = lf::JpegFrame::open(nullptr, again, &reason);
  require(sound && take(*sound, {0, 0, w, h}));
  require(truth.decode() && same(sound->view(), truth));
  return 0;
}
