// SPDX-License-Identifier: LGPL-2.1-or-later
// Benchmarks decoding a centre region of a JPEG frame, compared with libjpeg decoding the whole frame (to planes, no
// colour conversion) and cropping. Options: --width, --height, --quality, and files to use instead of the built-in
// scene (scaled to that size). First prints ratios to a whole decode in the same run: the least thread CPU time of many
// interleaved repetitions each. Then prints Google Benchmark's table; its options apply.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <jpeglib.h>
#include <opencv2/imgproc.hpp>

#include "image/image.h"
#include "jpeg/jpeg_frame.h"
#include "scene/scene.h"
#include "support/jpeg_samples.h"

namespace {

using namespace lf;
using Bytes = std::vector<uint8_t>;

double thread_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// The centre of the image, 1/n of its width and height.
Rect centre(int width, int height, int n) {
  const int w = width / n, h = height / n;
  return {(width - w) / 2, (height - h) / 2, (width + w) / 2, (height + h) / 2};
}

// libjpeg, reusing its handle and memory between frames.
class Libjpeg {
 public:
  Libjpeg() {
    info_.err = jpeg_std_error(&errors_);
    jpeg_create_decompress(&info_);
  }
  ~Libjpeg() { jpeg_destroy_decompress(&info_); }

  void whole(const Bytes& jpeg) {
    begin(jpeg);
    info_.raw_data_out = TRUE;
    jpeg_start_decompress(&info_);
    const unsigned lines = static_cast<unsigned>(info_.max_v_samp_factor) * 8;
    while (info_.output_scanline < info_.output_height) {
      JSAMPROW rows[3][32];
      JSAMPARRAY arrays[3];
      for (int i = 0; i < info_.num_components; i++) {
        const jpeg_component_info& c = info_.comp_info[i];
        const unsigned n = static_cast<unsigned>(c.v_samp_factor) * 8, stride = c.width_in_blocks * 8 + 64;
        planes_[i].resize(size_t{stride} * (c.height_in_blocks * 8 + 32));
        const unsigned y = info_.output_scanline / lines * n;
        for (unsigned k = 0; k < n; k++) rows[i][k] = &planes_[i][size_t{y + k} * stride];
        arrays[i] = rows[i];
      }
      jpeg_read_raw_data(&info_, arrays, lines);
    }
    jpeg_finish_decompress(&info_);
  }
  // Crops with libjpeg's own functions, to interleaved YCbCr.
  void cropped(const Bytes& jpeg, const Rect& region) {
    begin(jpeg);
    jpeg_start_decompress(&info_);
    auto x = static_cast<JDIMENSION>(region.x0), width = static_cast<JDIMENSION>(region.width());
    jpeg_crop_scanline(&info_, &x, &width);
    planes_[0].resize(size_t{info_.output_width} * 3);
    jpeg_skip_scanlines(&info_, static_cast<JDIMENSION>(region.y0));
    JSAMPROW row = planes_[0].data();
    for (int y = region.y0; y < region.y1; y++) jpeg_read_scanlines(&info_, &row, 1);
    jpeg_abort_decompress(&info_);
  }

 private:
  void begin(const Bytes& jpeg) {
    jpeg_mem_src(&info_, jpeg.data(), jpeg.size());
    jpeg_read_header(&info_, TRUE);
    info_.out_color_space = info_.jpeg_color_space;
    info_.do_fancy_upsampling = FALSE;
    info_.raw_data_out = FALSE;
  }
  jpeg_decompress_struct info_{};
  jpeg_error_mgr errors_{};
  std::vector<uint8_t> planes_[3];
};

void ours(const Bytes& jpeg, const Rect& region) {
  const auto frame = JpegFrame::open(nullptr, jpeg);
  if (!frame || !frame->ensure(region)) std::abort();
  benchmark::DoNotOptimize(frame->view().plane[0]);
}

struct Source {
  std::string name;
  Image rgb;
};

struct Stream {
  std::string name;
  int width, height;
  Bytes jpeg;
};

std::vector<Stream> streams_of(const Source& source, int quality) {
  std::vector<Stream> streams;
  const int row = (source.rgb.width() + 15) / 16;
  for (const auto& [name, interval] : {std::pair{"no restarts", 0}, {"a row", row}, {"5 MCUs", 5}})
    streams.push_back({source.name + ", " + name, source.rgb.width(), source.rgb.height(),
                       test::encode_jpeg(source.rgb, {.quality = quality, .restart_interval = interval})});
  return streams;
}

// Returns the least times of functions that run in turns.
std::vector<double> least_times(const std::vector<std::function<void()>>& work, int turns) {
  std::vector<double> least(work.size(), 1e9);
  for (int turn = 0; turn < turns; turn++)
    for (size_t i = 0; i < work.size(); i++) {
      const double start = thread_seconds();
      work[i]();
      least[i] = std::min(least[i], thread_seconds() - start);
    }
  return least;
}

void print_ratios(const std::vector<Stream>& streams, int turns) {
  std::printf("%-34s %7s %8s | %-23s | %-31s\n", "", "", "whole", "crop + skip", "ours");
  std::printf("%-34s %7s %8s | %7s %7s %7s | %7s %7s %7s %7s\n", "restart interval", "kB", "us", "1/64", "1/16", "1/4",
              "1/64", "1/16", "1/4", "1/1");
  for (const Stream& s : streams) {
    Libjpeg libjpeg;
    std::vector<std::function<void()>> work = {[&] { libjpeg.whole(s.jpeg); }};
    for (const int n : {8, 4, 2})
      work.push_back([&, region = centre(s.width, s.height, n)] { libjpeg.cropped(s.jpeg, region); });
    for (const int n : {8, 4, 2, 1})
      work.push_back([&, region = centre(s.width, s.height, n)] { ours(s.jpeg, region); });
    const std::vector<double> t = least_times(work, turns);
    std::printf("%-34s %7.1f %8.0f |", s.name.c_str(), static_cast<double>(s.jpeg.size()) / 1e3, t[0] * 1e6);
    for (size_t i = 1; i < t.size(); i++) std::printf(" %7.3f%s", t[i] / t[0], i == 3 ? " |" : "");
    std::printf("\n");
  }
}

Image scaled(const Image& rgb, int width, int height) {
  Image out(PixelFamily::kRgb, width, height);
  const cv::Mat from(rgb.height(), rgb.width(), CV_8UC3, const_cast<uint8_t*>(rgb.data().data()));
  cv::Mat to(height, width, CV_8UC3, out.data().data());
  cv::resize(from, to, to.size(), 0, 0, cv::INTER_AREA);
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  int width = 640, height = 480, quality = 88, turns = 400;
  std::vector<char*> rest = {argv[0]};
  std::vector<std::string> files;
  for (int i = 1; i < argc; i++) {
    const auto number = [&](const char* name, int& value) {
      const size_t size = std::strlen(name);
      if (std::strncmp(argv[i], name, size) != 0) return false;
      value = std::max(1, std::atoi(argv[i] + size));
      return true;
    };
    if (number("--width=", width) || number("--height=", height) || number("--quality=", quality) ||
        number("--turns=", turns))
      continue;
    if (argv[i][0] == '-')
      rest.push_back(argv[i]);
    else
      files.push_back(argv[i]);
  }
  std::vector<Source> sources;
  for (const std::string& file : files)
    sources.push_back({file.substr(file.rfind('/') + 1), scaled(load_image(file), width, height)});
  if (files.empty()) {
    const Camera camera = scene_rig(1, 1, width, height).cameras[0];
    sources.push_back({"scene", render_scene({width, height, camera.lens, camera.pose}, 0.5, 2)});
  }

  std::vector<Stream> streams;
  for (const Source& source : sources)
    for (Stream& stream : streams_of(source, quality)) streams.push_back(std::move(stream));
  std::printf("%dx%d, quality %d; centre regions, fractions of the time of decoding the frame\n", width, height,
              quality);
  print_ratios(streams, turns);

  for (const Stream& s : streams)
    for (const int n : {8, 4, 2})
      benchmark::RegisterBenchmark((s.name + ", 1/" + std::to_string(n * n)).c_str(), [&s, n](benchmark::State& state) {
        for (auto _ : state) ours(s.jpeg, centre(s.width, s.height, n));
      });
  int count = static_cast<int>(rest.size());
  benchmark::Initialize(&count, rest.data());
  benchmark::RunSpecifiedBenchmarks();
}
