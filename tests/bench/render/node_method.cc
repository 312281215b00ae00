// SPDX-License-Identifier: LGPL-2.1-or-later
// The default way: a node adds up its cameras and answers as lffragment does, in 16 bits within a process or in JPEG; a
// compositor reads the answer. The node's half is shared among threads.
#include "bench/render/method.h"
#include "bench/render/output.h"
#include "bench/render/pool.h"
#include "composite/accumulator.h"
#include "image/colour_correction.h"
#include "node/answer_renderer.h"
#include "render/camera_projection.h"
#include "wire/answer_parser.h"
#include "wire/fragment_codec.h"

namespace lf::bench {
namespace {

class NodeMethod : public Method {
 public:
  NodeMethod(const Scene& scene, const View& view, Pixels pixels, int jpeg_quality, int threads,
             const ColourModel& colour)
      : scene_(scene), view_(view), pixels_(pixels), pool_(threads), parallel_(pool_.parallel()) {
    for (const Camera& camera : scene.rig().cameras)
      colours_.emplace_back(colour, family_of(pixels), camera.width, camera.height, camera.principal_point());
    corrected_.resize(colours_.size());
    form_ = choose_form(view, CodecChoice::kAuto, jpeg_quality == 0, jpeg_quality);
  }

  void render() override {
    const RenderJob job(scene_.rig(), scene_.mesh(), view_, scene_.cameras());
    sources_.clear();
    for (const CameraIndex camera : job.cameras())
      sources_.push_back({camera, &scene_.rig().cameras[camera], scene_.image(camera, pixels_)});
    parallel_(sources_.size(), [&](size_t i) {
      Source& source = sources_[i];
      const ColourCorrection& colour = colours_[source.camera];
      if (colour.is_identity()) return;
      source.image =
          colour.apply(source.image, needed_pixels(job.plan(), source.camera, *source.rig_camera), corrected_[i]);
    });
    const wire::AnswerHeader header{
        .view_width = view_.width, .view_height = view_.height, .family = family_of(pixels_)};
    sum_.reset(header.family, view_.width, view_.height);  // it refers to the answer
    answer_ = render_answer(header, job, sources_, form_, std::move(answer_), parallel_).bytes;

    const auto answer = wire::parse_answer(answer_);
    for (const wire::FragmentView& fragment : answer->fragments) {
      if (form_.codec == wire::Codec::kRaw16)
        sum_.add_kept(decoder_.sums(fragment));
      else
        sum_.add(decoder_.decode(fragment).value());
    }
    resolve_into(sum_, picture_);
  }
  Image picture() const override { return picture_; }
  size_t bytes() const override { return answer_.size(); }

 private:
  const Scene& scene_;
  const View& view_;
  const Pixels pixels_;
  Pool pool_;
  const ParallelFor parallel_;
  AnswerForm form_;
  wire::FragmentDecoder decoder_;
  std::vector<Source> sources_;
  std::vector<ColourCorrection> colours_;
  std::vector<ByteBuffer> corrected_;
  ByteBuffer answer_;
  Accumulator sum_;
  Image picture_;
};

}  // namespace

void add_nodes(const MethodOptions& options, std::vector<MethodKind>& kinds) {
  const auto add = [&](Pixels pixels, int quality, int threads, const std::string& name = "simd",
                       const ColourModel& colour = {}) {
    Setting setting{name, pixels, quality > 0 ? "jpeg" : "raw", quality};
    setting.threads = threads;
    setting.is_default = name == "simd" && pixels == Pixels::kI420 && (quality == 0 || quality == 90);
    kinds.push_back({setting, [=](const Scene& scene, const View& view) {
                       return std::make_unique<NodeMethod>(scene, view, pixels, quality, threads, colour);
                     }});
  };
  for (const int threads : options.threads) {
    add(Pixels::kI420, 0, threads);
    for (const int quality : options.qualities)
      if (threads == 1 || quality == 90 || options.qualities.size() == 1) add(Pixels::kI420, quality, threads);
  }
  if (!options.all) return;
  add(Pixels::kRgbx, 0, 1);
  add(Pixels::kRgb, 0, 1);
  // With cameras' colours corrected: all that there is to a model, and what is next to a factor.
  const ColourModel all{.black = {3, 4, 5},
                        .gamma = 2.1,
                        .matrix = {1.05, -0.02, 0.01, 0.01, 0.97, 0, 0, 0.03, 1.02},
                        .vignetting = {-0.25, -0.05}};
  const ColourModel balance{.matrix = {1.05, 0, 0, 0, 0.97, 0, 0, 0, 1.02}, .vignetting = {-0.25, -0.05}};
  for (const Pixels pixels : {Pixels::kI420, Pixels::kRgb}) {
    add(pixels, 0, 1, "simd colour", all);
    add(pixels, 0, 1, "simd balance", balance);
  }
}

}  // namespace lf::bench
