// SPDX-License-Identifier: LGPL-2.1-or-later
// Benchmarks adding fragments and resolving the picture. Items are added pixels, or pixels of the picture.
#include <benchmark/benchmark.h>

#include "composite/accumulator.h"

namespace {

using namespace lf;

constexpr struct { int width, height; } kSizes[] = {{320, 240}, {640, 480}, {1280, 720}, {1920, 1080}};

std::string size_name(int size) {
  return std::to_string(kSizes[size].width) + "x" + std::to_string(kSizes[size].height);
}

// The fragments of an 8x8 array: rectangles of a quarter of the picture's sides, four deep.
std::vector<Fragment> tiles(PixelFamily family, int width, int height) {
  std::vector<Fragment> out;
  for (int y = -1; y < 8; y++)
    for (int x = -1; x < 8; x++) {
      const Rect cell{x * width / 8 & ~1, y * height / 8 & ~1, (x + 2) * width / 8 & ~1, (y + 2) * height / 8 & ~1};
      Fragment f{family, intersect(cell, {0, 0, width, height}), {}, {}};
      f.pixels.assign(packed_size(family, f.rect.width(), f.rect.height()), 30);
      out.push_back(std::move(f));
    }
  return out;
}

struct Sums {
  Sums(PixelFamily family, int width, int height)
      : samples(packed_size(family, width, height), 3000),
        planes(packed_sums<const int16_t, const uint16_t>(family, {0, 0, width, height}, samples.data(), nullptr)) {}
  std::vector<int16_t> samples;
  ConstSumPlanes planes;
};

void add_fragments(benchmark::State& state, PixelFamily family, int size) {
  const auto [width, height] = kSizes[size];
  const std::vector<Fragment> fragments = tiles(family, width, height);
  Accumulator sum;
  int64_t pixels = 0;
  for (auto _ : state) {
    sum.reset(family, width, height);
    for (const Fragment& f : fragments) {
      sum.add(f);
      pixels += f.rect.width() * f.rect.height();
    }
  }
  state.SetItemsProcessed(pixels);
}

void add_sums(benchmark::State& state, PixelFamily family, int size) {
  const auto [width, height] = kSizes[size];
  const Sums sums(family, width, height);
  Accumulator sum;
  for (auto _ : state) {
    sum.reset(family, width, height);
    for (int i = 0; i < 4; i++) sum.add(sums.planes);
  }
  state.SetItemsProcessed(state.iterations() * 4 * width * height);
}

enum class How { kOwn, kKept, kLost };

void resolve_to(benchmark::State& state, PixelFamily family, RgbLayout layout, How how, int size) {
  const auto [width, height] = kSizes[size];
  const Sums sums(family, width, height);
  Accumulator sum;
  sum.reset(family, width, height);
  how == How::kKept ? sum.add_borrowed(sums.planes) : sum.add(sums.planes);
  const Rect all{0, 0, width, height};
  if (how == How::kLost) sum.add_missing_weights(all, std::vector<float>(static_cast<size_t>(width) * height, 0.1f));
  std::vector<uint8_t> out(static_cast<size_t>(width) * height * 4);
  const size_t area = static_cast<size_t>(width) * height;
  uint8_t* const plane[3] = {out.data(), out.data() + area, out.data() + area * 2};
  const ptrdiff_t step = family == PixelFamily::kRgb ? layout.pixel_stride : 1;
  const ptrdiff_t stride[3] = {step * width, chroma_size(width), chroma_size(width)};
  for (auto _ : state) {
    sum.resolve({}, layout, plane, stride);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(area));
}

void register_all() {
  const auto add = [](const std::string& name, auto run) {
    for (int size = 0; size < static_cast<int>(std::size(kSizes)); size++)
      benchmark::RegisterBenchmark((name + "/" + size_name(size)).c_str(), [=](benchmark::State& state) {
        run(state, size);
      })->Unit(benchmark::kMicrosecond);
  };
  const RgbLayout rgb, bgrx{4, 2, 1, 0};
  for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb}) {
    const std::string name = family == PixelFamily::kRgb ? "rgb" : "i420";
    add("add/fragments/" + name, [=](auto& state, int size) { add_fragments(state, family, size); });
    add("add/sums/" + name, [=](auto& state, int size) { add_sums(state, family, size); });
    add("resolve/" + name, [=](auto& state, int size) { resolve_to(state, family, rgb, How::kOwn, size); });
    add("resolve/kept/" + name, [=](auto& state, int size) { resolve_to(state, family, rgb, How::kKept, size); });
    add("resolve/lost/" + name, [=](auto& state, int size) { resolve_to(state, family, rgb, How::kLost, size); });
  }
  add("resolve/bgrx", [=](auto& state, int size) { resolve_to(state, PixelFamily::kRgb, bgrx, How::kOwn, size); });
}

}  // namespace

int main(int argc, char** argv) {
  register_all();
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
