// SPDX-License-Identifier: LGPL-2.1-or-later
// The fast path: SIMD sums in 16 bits, of all cameras at once as a node has them, or one camera each fragment.
#include "bench/method.h"
#include "bench/output.h"
#include "composite/accumulator.h"
#include "render/sum_renderer.h"
#include "render/sum_rounding.h"
#include "wire/answer_parser.h"
#include "wire/fragment_codec.h"
#include "wire/payload.h"

namespace lf::bench {
namespace {

// 16-bit planes of a whole view, and a sum rendered into them.
struct Planes {
  Planes(PixelFamily family, const View& view) {
    const int w = view.width, h = view.height;
    const size_t area = static_cast<size_t>(w) * h;
    const bool i420 = family == PixelFamily::kI420;
    const size_t small = i420 ? static_cast<size_t>(chroma_size(w)) * chroma_size(h) : area;
    samples.resize(area + 2 * small);
    lost.resize(area);
    sum.family = family;
    sum.rect = {0, 0, w, h};
    sum.plane[0] = samples.data();
    sum.plane[1] = samples.data() + area;
    sum.plane[2] = samples.data() + area + small;
    sum.stride[0] = w;
    sum.stride[1] = sum.stride[2] = i420 ? chroma_size(w) : w;
    sum.lost = lost.data();
    sum.lost_stride = w;
  }
  std::vector<int16_t> samples;
  std::vector<uint16_t> lost;
  SumPlanes sum;
};

class SumMethod : public Method {
 public:
  SumMethod(const Scene& scene, const View& view, Pixels pixels, Coordinates coordinates, int jpeg_quality)
      : scene_(scene),
        view_(view),
        pixels_(pixels),
        coordinates_(coordinates),
        jpeg_quality_(jpeg_quality),
        planes_(family_of(pixels), view) {}

  void render() override {
    const PixelFamily family = family_of(pixels_);
    const ViewPlan plan(scene_.rig(), scene_.mesh(), view_);
    const OwnerRuns runs(plan, {0, 0, view_.width, view_.height});
    std::vector<Source> sources;
    for (const CameraIndex camera : plan.contributors())
      sources.push_back({camera, &scene_.rig().cameras[camera], scene_.image(camera, pixels_)});
    const SumRenderer renderer(plan, runs, sources, family, coordinates_);
    SumPlanes out = planes_.sum;
    if (!renderer.render_rows(0, view_.height, out)) out.lost = nullptr;
    accumulator_.reset(family, view_.width, view_.height);
    ConstSumPlanes sums{.family = out.family, .rect = out.rect};
    for (int i = 0; i < 3; i++) {
      sums.plane[i] = out.plane[i];
      sums.stride[i] = out.stride[i];
    }
    sums.lost = out.lost;
    sums.lost_stride = out.lost_stride;
    if (jpeg_quality_ > 0)
      send(sums);
    else
      accumulator_.add_kept(sums);
    resolve_into(accumulator_, picture_);
  }
  Image picture() const override { return picture_; }
  size_t bytes() const override { return jpeg_quality_ > 0 ? answer_.size() : planes_.samples.size() * 2; }

 private:
  void send(const ConstSumPlanes& sums) {
    const wire::AnswerHeader header{.view_width = view_.width, .view_height = view_.height, .family = sums.family};
    const Fragment fragment = rounded_fragment(Fragment::kSum, sums);
    answer_ = encoder_.encode(header, {&fragment, 1}, jpeg_quality_, std::move(answer_));
    const auto answer = wire::parse_answer(answer_);
    for (const FragmentPlanes& planes : decoder_.decode(answer->fragments)) accumulator_.add(planes);
  }

  const Scene& scene_;
  const View& view_;
  const Pixels pixels_;
  const Coordinates coordinates_;
  const int jpeg_quality_;  // 0: none
  wire::FragmentEncoder encoder_;
  wire::FragmentDecoder decoder_;
  ByteBuffer answer_;
  Planes planes_;
  Accumulator accumulator_;
  Image picture_;
};

}  // namespace

void add_sums(const MethodOptions& options, std::vector<MethodKind>& kinds) {
  const auto add = [&](Pixels pixels, Coordinates coordinates, int quality) {
    Setting setting{"simd", pixels, quality > 0 ? "jpeg" : "raw", quality};
    setting.grid = coordinates == Coordinates::kGrid ? std::to_string(kGridStep) : "exact";
    setting.sum = "node";
    setting.is_default =
        pixels == Pixels::kI420 && coordinates == Coordinates::kGrid && (quality == 0 || quality == 90);
    kinds.push_back({setting, [=](const Scene& scene, const View& view) {
                       return std::make_unique<SumMethod>(scene, view, pixels, coordinates, quality);
                     }});
  };
  add(Pixels::kI420, Coordinates::kGrid, 0);
  if (options.all) {
    add(Pixels::kI420, Coordinates::kExact, 0);
    add(Pixels::kRgbx, Coordinates::kGrid, 0);
    add(Pixels::kRgb, Coordinates::kGrid, 0);
    add(Pixels::kRgb, Coordinates::kExact, 0);
  }
  for (const int quality : options.qualities) add(Pixels::kI420, Coordinates::kGrid, quality);
}

}  // namespace lf::bench
