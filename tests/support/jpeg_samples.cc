// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/jpeg_samples.h"

#include <algorithm>
#include <cmath>
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <stdexcept>

#include <jpeglib.h>

namespace lf::test {
namespace {

[[noreturn]] void throw_message(j_common_ptr info) {
  char text[JMSG_LENGTH_MAX];
  info->err->format_message(info, text);
  throw std::runtime_error(text);
}

void no_message(j_common_ptr, int) {}

uint8_t to_byte(double v) { return static_cast<uint8_t>(std::clamp(v, 0.0, 255.0)); }

}  // namespace

Image noisy_picture(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) { return low + (high - low) * (random() / 4294967296.0); };
  struct Wave {
    double x, y, phase, size[3];
  } waves[6];
  for (Wave& w : waves)
    w = {uniform(-0.2, 0.2), uniform(-0.2, 0.2), uniform(0, 6), {uniform(0, 40), uniform(0, 40), uniform(0, 40)}};
  Image image(PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      const bool edge = (x / 23 + y / 31) % 3 == 0, flat = (x / 64 + y / 48) % 4 == 1;
      const double noise = flat ? 0 : uniform(-12, 12);
      for (int c = 0; c < 3; c++) {
        double v = 110 + (edge ? 60 : 0);
        if (!flat)
          for (const Wave& w : waves) v += w.size[c] * std::sin(w.x * x + w.y * y + w.phase);
        image.pixel(x, y)[c] = to_byte(v + noise);
      }
    }
  return image;
}

std::vector<uint8_t> encode_jpeg(const Image& rgb, const JpegKind& kind) {
  jpeg_compress_struct info{};
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  errors.error_exit = throw_message;
  jpeg_create_compress(&info);
  unsigned char* memory = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &memory, &size);
  info.image_width = static_cast<unsigned>(rgb.width());
  info.image_height = static_cast<unsigned>(rgb.height());
  info.input_components = 3;
  info.in_color_space = JCS_RGB;
  jpeg_set_defaults(&info);
  jpeg_set_colorspace(&info, kind.grey ? JCS_GRAYSCALE : kind.rgb ? JCS_RGB : JCS_YCbCr);
  jpeg_set_quality(&info, kind.quality, TRUE);
  info.comp_info[0].h_samp_factor = kind.h;
  info.comp_info[0].v_samp_factor = kind.v;
  for (int i = 1; i < info.num_components; i++) {
    info.comp_info[i].h_samp_factor = kind.chroma_h;
    info.comp_info[i].v_samp_factor = kind.chroma_v;
  }
  info.restart_interval = static_cast<unsigned>(kind.restart_interval);
  info.optimize_coding = kind.optimise ? TRUE : FALSE;
  info.arith_code = kind.arithmetic ? TRUE : FALSE;
  if (kind.progressive) jpeg_simple_progression(&info);
  jpeg_scan_info scans[3] = {};
  if (kind.one_by_one) {
    for (int i = 0; i < 3; i++) scans[i] = {1, {i, 0, 0, 0}, 0, 63, 0, 0};
    info.scan_info = scans;
    info.num_scans = 3;
  }
  jpeg_start_compress(&info, TRUE);
  for (int y = 0; y < rgb.height(); y++) {
    auto* row = const_cast<uint8_t*>(rgb.pixel(0, y));
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  std::vector<uint8_t> jpeg(memory, memory + size);
  std::free(memory);
  return jpeg;
}

std::vector<uint8_t> without_huffman_tables(const std::vector<uint8_t>& jpeg) {
  std::vector<uint8_t> out(jpeg.begin(), jpeg.begin() + 2);
  size_t at = 2;
  while (jpeg[at + 1] != 0xda) {
    const size_t size = 2 + (static_cast<size_t>(jpeg[at + 2]) << 8 | jpeg[at + 3]);
    if (jpeg[at + 1] != 0xc4) out.insert(out.end(), jpeg.begin() + at, jpeg.begin() + at + size);
    at += size;
  }
  out.insert(out.end(), jpeg.begin() + at, jpeg.end());
  return out;
}

RawPlanes decode_raw(std::span<const uint8_t> jpeg) {
  RawPlanes raw;
  jpeg_decompress_struct info{};
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  errors.error_exit = throw_message;
  errors.emit_message = no_message;
  jpeg_create_decompress(&info);
  jpeg_mem_src(&info, jpeg.data(), static_cast<unsigned long>(jpeg.size()));
  jpeg_read_header(&info, TRUE);
  info.out_color_space = info.jpeg_color_space;
  info.raw_data_out = TRUE;
  info.dct_method = JDCT_ISLOW;
  jpeg_start_decompress(&info);
  for (int i = 0; i < info.num_components; i++) {
    const jpeg_component_info& c = info.comp_info[i];
    RawPlanes::Plane plane;
    plane.width = static_cast<int>(c.downsampled_width);
    plane.height = static_cast<int>(c.downsampled_height);
    plane.stride = static_cast<int>(c.width_in_blocks + 8) * 8;
    plane.samples.resize(static_cast<size_t>(plane.stride) * (info.total_iMCU_rows * c.v_samp_factor * 8));
    raw.planes.push_back(std::move(plane));
  }
  for (unsigned row = 0; info.output_scanline < info.output_height; row++) {
    std::vector<std::vector<JSAMPROW>> rows(raw.planes.size());
    std::vector<JSAMPARRAY> arrays;
    for (size_t i = 0; i < raw.planes.size(); i++) {
      const unsigned lines = static_cast<unsigned>(info.comp_info[i].v_samp_factor) * 8;
      for (unsigned y = 0; y < lines; y++)
        rows[i].push_back(&raw.planes[i].samples[static_cast<size_t>(row * lines + y) * raw.planes[i].stride]);
      arrays.push_back(rows[i].data());
    }
    jpeg_read_raw_data(&info, arrays.data(), static_cast<unsigned>(info.max_v_samp_factor) * 8);
  }
  jpeg_destroy_decompress(&info);
  return raw;
}

Image to_i420(const RawPlanes& raw) {
  const RawPlanes::Plane& luma = raw.planes[0];
  Image out(PixelFamily::kI420, luma.width, luma.height);
  for (int y = 0; y < luma.height; y++)
    std::copy_n(&luma.samples[static_cast<size_t>(y) * luma.stride], luma.width,
                out.plane(0) + static_cast<ptrdiff_t>(y) * luma.width);
  const int cw = chroma_size(luma.width), ch = chroma_size(luma.height);
  for (int i = 1; i < 3; i++)
    for (int y = 0; y < ch; y++)
      for (int x = 0; x < cw; x++) {
        uint8_t& sample = out.plane(i)[static_cast<ptrdiff_t>(y) * cw + x];
        if (raw.planes.size() == 1) {
          sample = 128;
          continue;
        }
        const RawPlanes::Plane& plane = raw.planes[static_cast<size_t>(i)];
        const auto at = [&](int u, int v) {
          const int x_in = plane.width == cw ? x : std::min(2 * x + u, plane.width - 1);
          const int y_in = plane.height == ch ? y : std::min(2 * y + v, plane.height - 1);
          return int{plane.samples[static_cast<size_t>(y_in) * plane.stride + x_in]};
        };
        sample = static_cast<uint8_t>((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4);
      }
  return out;
}

std::shared_ptr<JpegFrame> open_jpeg(const std::vector<uint8_t>& jpeg, std::string* reason) {
  // Allocated with the exact size, so that sanitizers detect reads past the end.
  const auto copy = std::make_shared<std::vector<uint8_t>>(jpeg);
  copy->shrink_to_fit();
  std::string error;
  std::shared_ptr<JpegFrame> frame = JpegFrame::open(copy, *copy, reason ? reason : &error);
  if (!frame && !reason) throw std::runtime_error(error);
  return frame;
}

}  // namespace lf::test
