// SPDX-License-Identifier: LGPL-2.1-or-later
// The default way: a node adds up its cameras and answers as lffragment does, in 16 bits within a process or in JPEG; a
// compositor reads the answer. The node's half is shared among threads.
#include "bench/render/method.h"
#include "bench/render/output.h"
#include "bench/render/pool.h"
#include "composite/accumulator.h"
#include "node/answer_renderer.h"
#include "wire/answer_parser.h"
#include "wire/fragment_codec.h"

namespace lf::bench {
namespace {

class NodeMethod : public Method {
 public:
  NodeMethod(const Scene& scene, const View& view, Pixels pixels, int jpeg_quality, int threads)
      : scene_(scene), view_(view), pixels_(pixels), pool_(threads), parallel_(pool_.parallel()) {
    form_ = choose_form(view, CodecChoice::kAuto, jpeg_quality == 0, jpeg_quality);
  }

  void render() override {
    const RenderJob job(scene_.rig(), scene_.mesh(), view_, scene_.cameras());
    sources_.clear();
    for (const CameraIndex camera : job.cameras())
      sources_.push_back({camera, &scene_.rig().cameras[camera], scene_.image(camera, pixels_)});
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
  ByteBuffer answer_;
  Accumulator sum_;
  Image picture_;
};

}  // namespace

void add_nodes(const MethodOptions& options, std::vector<MethodKind>& kinds) {
  const auto add = [&](Pixels pixels, int quality, int threads) {
    Setting setting{"simd", pixels, quality > 0 ? "jpeg" : "raw", quality};
    setting.threads = threads;
    setting.is_default = pixels == Pixels::kI420 && (quality == 0 || quality == 90);
    kinds.push_back({setting, [=](const Scene& scene, const View& view) {
                       return std::make_unique<NodeMethod>(scene, view, pixels, quality, threads);
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
}

}  // namespace lf::bench
