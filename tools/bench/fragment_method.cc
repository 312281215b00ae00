// SPDX-License-Identifier: LGPL-2.1-or-later
// A fragment of 8 bits each camera, added up by the compositor's arithmetic: in memory as they are, or by way of an
// answer in JPEG.
#include "bench/method.h"
#include "bench/output.h"
#include "composite/accumulator.h"
#include "render/fragment_renderer.h"
#include "render/render_job.h"
#include "render/sum_renderer.h"
#include "wire/answer_parser.h"
#include "wire/fragment_codec.h"
#include "wire/payload.h"

namespace lf::bench {
namespace {

using Renderer = std::function<std::optional<Fragment>(const RenderJob& job, CameraIndex camera,
                                                       const Camera& rig_camera, const ImageView& image)>;

class FragmentMethod : public Method {
 public:
  FragmentMethod(const Scene& scene, const View& view, Renderer renderer, Pixels pixels, int jpeg_quality)
      : scene_(scene), view_(view), renderer_(std::move(renderer)), pixels_(pixels), jpeg_quality_(jpeg_quality) {}

  void render() override {
    const RenderJob job(scene_.rig(), scene_.mesh(), view_, scene_.cameras());
    sum_.reset(family_of(pixels_), view_.width, view_.height);
    bytes_ = 0;
    fragments_.clear();
    for (const CameraIndex camera : job.cameras()) {
      auto fragment = renderer_(job, camera, scene_.rig().cameras[camera], scene_.image(camera, pixels_));
      if (!fragment) continue;
      if (jpeg_quality_ > 0) {
        fragments_.push_back(std::move(*fragment));
      } else {
        bytes_ += fragment->bytes();
        sum_.add(*fragment);
      }
    }
    if (jpeg_quality_ > 0) send();
    resolve_into(sum_, picture_);
  }
  Image picture() const override { return picture_; }
  size_t bytes() const override { return bytes_; }

 private:
  void send() {
    const wire::AnswerHeader header{
        .view_width = view_.width, .view_height = view_.height, .family = family_of(pixels_)};
    answer_ = encoder_.encode(header, fragments_, jpeg_quality_, std::move(answer_));
    bytes_ = answer_.size();
    const auto answer = wire::parse_answer(answer_);
    const std::span<const wire::FragmentView> all = answer->fragments;
    for (size_t i = 0, n; i < all.size(); i += n) {
      n = wire::group_size(all.subspan(i));
      for (const FragmentPlanes& planes : decoder_.decode(all.subspan(i, n))) sum_.add(planes);
    }
  }

  const Scene& scene_;
  const View& view_;
  const Renderer renderer_;
  const Pixels pixels_;
  const int jpeg_quality_;  // 0: none
  wire::FragmentEncoder encoder_;
  wire::FragmentDecoder decoder_;
  std::vector<Fragment> fragments_;
  ByteBuffer answer_;
  Accumulator sum_;
  Image picture_;
  size_t bytes_ = 0;
};

}  // namespace

void add_fragments(const MethodOptions& options, std::vector<MethodKind>& kinds) {
  const auto add = [&](const char* name, const Renderer& renderer, Pixels pixels, int quality) {
    Setting setting{name, pixels, quality > 0 ? "jpeg" : "raw", quality};
    if (setting.renderer == "simd") setting.grid = std::to_string(kGridStep);
    kinds.push_back({setting, [=](const Scene& scene, const View& view) {
                       return std::make_unique<FragmentMethod>(scene, view, renderer, pixels, quality);
                     }});
  };
  const std::shared_ptr<const FragmentRenderer> plain = make_scalar_renderer();
  const Renderer scalar = [plain](const RenderJob& job, CameraIndex camera, const Camera& rig_camera,
                                  const ImageView& image) {
    return plain->render(job.plan(), job.owners(), camera, rig_camera, image);
  };
  const Renderer simd = [](const RenderJob& job, CameraIndex camera, const Camera& rig_camera, const ImageView& image) {
    return render_fragment(job.plan(), job.runs(), {camera, &rig_camera, image});
  };
  add("scalar", scalar, Pixels::kI420, 0);
  add("simd", simd, Pixels::kI420, 0);
  if (options.all) {
    add("scalar", scalar, Pixels::kRgb, 0);
    add("simd", simd, Pixels::kRgb, 0);
  }
  for (const int quality : options.qualities) {
    if (options.all) add("scalar", scalar, Pixels::kI420, quality);
    add("simd", simd, Pixels::kI420, quality);
  }
}

}  // namespace lf::bench
