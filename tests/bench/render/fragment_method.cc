// SPDX-License-Identifier: LGPL-2.1-or-later
// A fragment of 8 bits each camera, added up by the compositor's arithmetic: in memory as they are, or by way of an
// answer in JPEG.
#include "bench/render/method.h"
#include "bench/render/output.h"
#include "composite/accumulator.h"
#include "render/fragment_renderer.h"
#include "render/fragment_set.h"
#include "render/render_job.h"
#include "wire/answer_parser.h"
#include "wire/fragment_codec.h"
#include "wire/payload.h"

namespace lf::bench {
namespace {

// The fragments of a view, in memory that lasts until the next call.
class Fragments {
 public:
  virtual ~Fragments() = default;
  virtual std::span<const CameraFragment> render(const RenderJob& job, std::span<const Source> sources,
                                                 PixelFamily family) = 0;
};

class ScalarFragments : public Fragments {
 public:
  std::span<const CameraFragment> render(const RenderJob& job, std::span<const Source> sources, PixelFamily) override {
    own_.clear();
    planes_.clear();
    for (const Source& source : sources)
      if (auto fragment = renderer_->render(job.plan(), job.owners(), source.camera, *source.rig_camera, source.image))
        own_.push_back(std::move(*fragment));
    for (const Fragment& fragment : own_) planes_.push_back({fragment.camera, planes_of(fragment)});
    return planes_;
  }

 private:
  const std::unique_ptr<FragmentRenderer> renderer_ = make_scalar_renderer();
  std::vector<Fragment> own_;
  std::vector<CameraFragment> planes_;
};

class SimdFragments : public Fragments {
 public:
  std::span<const CameraFragment> render(const RenderJob& job, std::span<const Source> sources,
                                         PixelFamily family) override {
    set_.begin(job.plan(), job.runs(), sources, family);
    set_.render_rows(set_.rect().y0, set_.rect().y1);
    return set_.fragments();
  }

 private:
  FragmentSet set_;
};

class FragmentMethod : public Method {
 public:
  FragmentMethod(const Scene& scene, const View& view, std::unique_ptr<Fragments> fragments, Pixels pixels,
                 int jpeg_quality)
      : scene_(scene), view_(view), renderer_(std::move(fragments)), pixels_(pixels), jpeg_quality_(jpeg_quality) {}

  void render() override {
    const RenderJob job(scene_.rig(), scene_.mesh(), view_, scene_.cameras());
    sum_.reset(family_of(pixels_), view_.width, view_.height);
    sources_.clear();
    for (const CameraIndex camera : job.cameras())
      sources_.push_back({camera, &scene_.rig().cameras[camera], scene_.image(camera, pixels_)});
    const auto fragments = renderer_->render(job, sources_, family_of(pixels_));
    if (jpeg_quality_ > 0) {
      send(fragments);
    } else {
      bytes_ = 0;
      for (const CameraFragment& fragment : fragments) {
        const Rect& rect = fragment.planes.rect;
        bytes_ += packed_size(fragment.planes.family, rect.width(), rect.height()) +
                  (fragment.planes.lost ? static_cast<size_t>(rect.width()) * rect.height() : 0);
        sum_.add(fragment.planes);
      }
    }
    resolve_into(sum_, picture_);
  }
  Image picture() const override { return picture_; }
  size_t bytes() const override { return bytes_; }

 private:
  void send(std::span<const CameraFragment> fragments) {
    const wire::AnswerHeader header{
        .view_width = view_.width, .view_height = view_.height, .family = family_of(pixels_)};
    answer_ = encoder_.encode(header, fragments, jpeg_quality_, std::move(answer_));
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
  const std::unique_ptr<Fragments> renderer_;
  const Pixels pixels_;
  const int jpeg_quality_;  // 0: none
  wire::FragmentEncoder encoder_;
  wire::FragmentDecoder decoder_;
  std::vector<Source> sources_;
  ByteBuffer answer_;
  Accumulator sum_;
  Image picture_;
  size_t bytes_ = 0;
};

}  // namespace

void add_fragments(const MethodOptions& options, std::vector<MethodKind>& kinds) {
  const auto add = [&](bool simd, Pixels pixels, int quality) {
    Setting setting{simd ? "simd" : "scalar", pixels, quality > 0 ? "jpeg" : "raw", quality};
    if (simd) setting.grid = std::to_string(kGridStep);
    kinds.push_back({setting, [=](const Scene& scene, const View& view) {
                       std::unique_ptr<Fragments> fragments;
                       if (simd)
                         fragments = std::make_unique<SimdFragments>();
                       else
                         fragments = std::make_unique<ScalarFragments>();
                       return std::make_unique<FragmentMethod>(scene, view, std::move(fragments), pixels, quality);
                     }});
  };
  for (const bool simd : {false, true}) {
    add(simd, Pixels::kI420, 0);
    if (options.all) add(simd, Pixels::kRgb, 0);
  }
  for (const int quality : options.qualities) {
    if (options.all) add(false, Pixels::kI420, quality);
    add(true, Pixels::kI420, quality);
  }
}

}  // namespace lf::bench
