// SPDX-License-Identifier: LGPL-2.1-or-later
// A node's sum with coordinates projected for every pixel, added up in memory: what interpolating them gains and costs.
#include "bench/render/method.h"
#include "bench/render/output.h"
#include "composite/accumulator.h"
#include "render/render_job.h"
#include "render/sum_renderer.h"

namespace lf::bench {
namespace {

class ExactSumMethod : public Method {
 public:
  ExactSumMethod(const Scene& scene, const View& view, Pixels pixels)
      : scene_(scene),
        view_(view),
        pixels_(pixels),
        samples_(packed_size(family_of(pixels), view.width, view.height)),
        lost_(static_cast<size_t>(view.width) * view.height) {}

  void render() override {
    const PixelFamily family = family_of(pixels_);
    const RenderJob job(scene_.rig(), scene_.mesh(), view_, scene_.cameras());
    std::vector<Source> sources;
    for (const CameraIndex camera : job.cameras())
      sources.push_back({camera, &scene_.rig().cameras[camera], scene_.image(camera, pixels_)});
    const SumRenderer renderer(job.plan(), job.runs(), sources, family, Coordinates::kExact);
    const Rect& rect = renderer.rect();
    const bool any_lost =
        renderer.render_rows(rect.y0, rect.y1, packed_sums(family, rect, samples_.data(), lost_.data()));
    sum_.reset(family, view_.width, view_.height);
    sum_.add_kept(
        packed_sums<const int16_t, const uint16_t>(family, rect, samples_.data(), any_lost ? lost_.data() : nullptr));
    resolve_into(sum_, picture_);
  }
  Image picture() const override { return picture_; }
  size_t bytes() const override { return samples_.size() * sizeof(int16_t); }

 private:
  const Scene& scene_;
  const View& view_;
  const Pixels pixels_;
  std::vector<int16_t> samples_;
  std::vector<uint16_t> lost_;
  Accumulator sum_;
  Image picture_;
};

}  // namespace

void add_exact_sums(const MethodOptions& options, std::vector<MethodKind>& kinds) {
  if (!options.all) return;
  for (const Pixels pixels : {Pixels::kI420, Pixels::kRgb}) {
    Setting setting{"simd", pixels};
    setting.sum = "node";
    kinds.push_back({setting, [=](const Scene& scene, const View& view) {
                       return std::make_unique<ExactSumMethod>(scene, view, pixels);
                     }});
  }
}

}  // namespace lf::bench
