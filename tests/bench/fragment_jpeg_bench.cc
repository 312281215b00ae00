// SPDX-License-Identifier: LGPL-2.1-or-later
// What a fragment costs in JPEG, alone and in stacks: the measurements behind FragmentEncoder's rule for atlases.
// Counters: microseconds and bytes a fragment, and the PSNR of what comes back.
#include <map>

#include <benchmark/benchmark.h>

#include "jpeg/fragment_decoder.h"
#include "jpeg/fragment_encoder.h"
#include "lib/jpeg/fragment_codec_fixture.h"
#include "support/weighted_fragments.h"

namespace {

using namespace lf;
using namespace lf::jpeg;

constexpr struct {
  const char* name;
  int side, width, height, count;
} kSets[] = {
    {"40x30", 16, 320, 240, 48}, {"64x48", 10, 320, 240, 32}, {"96x72", 8, 384, 288, 24}, {"320x240", 8, 1280, 960, 8}};

// Rendered once: Google Benchmark calls a function many times.
const std::vector<Fragment>& fragments_of(PixelFamily family, int set) {
  static std::map<std::pair<PixelFamily, int>, std::vector<Fragment>> cache;
  std::vector<Fragment>& fragments = cache[{family, set}];
  if (!fragments.empty()) return fragments;
  const auto& s = kSets[set];
  fragments = weighted_fragments(family, s.side, s.width, s.height, s.count);
  std::ranges::stable_sort(fragments, {}, [](const Fragment& f) { return (f.rect.width() + 15) / 16; });
  return fragments;
}

struct Stacks {
  // As FragmentEncoder does: members of a stack are as wide as one another.
  Stacks(PixelFamily family, int set, size_t members) : all(planes_of_all(fragments_of(family, set))) {
    const std::span<const FragmentPlanes> rest = all;
    for (size_t i = 0, n; i < rest.size(); i += n) {
      const auto width = [&](size_t k) { return (rest[k].rect.width() + 15) / 16; };
      for (n = 1; n < members && i + n < rest.size() && width(i + n) == width(i);) n++;
      stacks.push_back(rest.subspan(i, n));
    }
  }
  std::vector<FragmentPlanes> all;
  std::vector<std::span<const FragmentPlanes>> stacks;
};

void codec(benchmark::State& state, PixelFamily family, int set, int quality, size_t members, bool decode) {
  const Stacks input(family, set, members);
  FragmentEncoder encoder;
  FragmentDecoder decoder;
  std::vector<ByteBuffer> scans;
  size_t bytes = 0;
  Errors8 luma, chroma;
  for (const auto stack : input.stacks) {
    encoder.encode_pixels(stack, quality, scans.emplace_back());
    bytes += scans.back().size();
    std::vector<FragmentPlanes> out = empty_like(stack);
    if (!decoder.decode_pixels(scans.back(), quality, out)) state.SkipWithError("damaged");
    for (size_t i = 0; i < out.size(); i++) compare_pixels(stack[i], out[i], luma, chroma);
  }
  std::vector<FragmentPlanes> out;
  for (auto _ : state)
    for (size_t i = 0; i < input.stacks.size(); i++) {
      if (decode) {
        out.assign(input.stacks[i].begin(), input.stacks[i].end());
        benchmark::DoNotOptimize(decoder.decode_pixels(scans[i], quality, out));
      } else {
        scans[i].clear();
        encoder.encode_pixels(input.stacks[i], quality, scans[i]);
      }
    }
  const auto count = static_cast<double>(input.all.size());
  state.counters["each"] = benchmark::Counter(count * static_cast<double>(state.iterations()),
                                              benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  state.counters["bytes"] = static_cast<double>(bytes) / count;
  state.counters["psnr"] = luma.psnr();
  state.counters["worst"] = luma.worst;
}

void register_all() {
  const auto add = [](PixelFamily family, int set, int quality, size_t members) {
    for (const bool decode : {false, true}) {
      const std::string name = std::string(decode ? "decode/" : "encode/") +
                               (family == PixelFamily::kRgb ? "rgb/" : "i420/") + kSets[set].name + "/q" +
                               std::to_string(quality) + "/stack:" + std::to_string(members);
      benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
        codec(state, family, set, quality, members, decode);
      })->Unit(benchmark::kMicrosecond);
    }
  };
  for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
    for (int set = 0; set < static_cast<int>(std::size(kSets)); set++) {
      for (const size_t members : {1, 2, 4, 8, 16}) add(family, set, 90, members);
      for (const int quality : {50, 75, 95}) add(family, set, quality, 1);
    }
}

}  // namespace

int main(int argc, char** argv) {
  register_all();
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
