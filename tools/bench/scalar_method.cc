// SPDX-License-Identifier: LGPL-2.1-or-later
// The plain renderer and the compositor's arithmetic, as the elements put them together in one process.
#include "bench/method.h"
#include "composite/accumulator.h"
#include "render/fragment_renderer.h"
#include "render/render_job.h"

namespace lf::bench {
namespace {

class ScalarMethod : public Method {
 public:
  ScalarMethod(const Scene& scene, const View& view, Pixels pixels) : scene_(scene), view_(view), pixels_(pixels) {}

  void render() override {
    const RenderJob job(scene_.rig(), scene_.mesh(), view_, scene_.cameras());
    sum_.reset(family_of(pixels_), view_.width, view_.height);
    bytes_ = 0;
    for (const CameraIndex camera : job.cameras()) {
      const auto fragment = renderer_->render(job.plan(), job.owners(), camera, scene_.rig().cameras[camera],
                                              scene_.image(camera, pixels_));
      if (!fragment) continue;
      bytes_ += fragment->bytes();
      sum_.add(*fragment);
    }
    picture_ = sum_.resolve();
  }
  Image picture() const override { return picture_; }
  size_t bytes() const override { return bytes_; }

 private:
  const Scene& scene_;
  const View& view_;
  const Pixels pixels_;
  const std::unique_ptr<FragmentRenderer> renderer_ = make_scalar_renderer();
  Accumulator sum_;
  Image picture_;
  size_t bytes_ = 0;
};

}  // namespace

void add_scalar(const MethodOptions& options, std::vector<MethodKind>& kinds) {
  for (const Pixels pixels : {Pixels::kI420, Pixels::kRgb}) {
    Setting setting{"scalar", pixels};
    setting.is_default = pixels == Pixels::kI420;
    if (!setting.is_default && !options.all) continue;
    kinds.push_back({setting, [pixels](const Scene& scene, const View& view) {
                       return std::make_unique<ScalarMethod>(scene, view, pixels);
                     }});
  }
}

}  // namespace lf::bench
