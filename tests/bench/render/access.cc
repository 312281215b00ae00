// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/access.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <tuple>

#include "bench/render/measure.h"
#include "bench/render/output.h"
#include "bench/render/scene.h"
#include "composite/assembly.h"
#include "node/answer_task.h"
#include "node/camera_access.h"
#include "reference/exact_quality.h"
#include "wire/answer_parser.h"
#include "wire/command_codec.h"
#include "wire/request_codec.h"

namespace lf::bench {
namespace {

struct Kind {
  const char* name;
  Access access;
};
constexpr Kind kKinds[] = {{"self", Access::kSelf}, {"warp", Access::kWarp}, {"pixels", Access::kPixels}};

// One view by way of one kind of camera, step by step; every step takes what the one before it sent.
class Round {
 public:
  Round(const Scene& scene, const Kind& kind, int quality)
      : scene_(scene), kind_(kind), rig_(std::make_shared<const Rig>(scene.rig())) {
    request_.view = scene.views().front();
    request_.quality = static_cast<uint8_t>(quality);
    request_.rig_hash = rig_->hash();
    manner_.codec = quality > 0 ? CodecChoice::kJpeg : CodecChoice::kRaw;
    assembly_.set_rig(rig_);
  }

  void ask() {
    asked_ = wire::encode_request(request_);
    if (const CameraAccess* told = CameraAccess::of(kind_.access))
      command_ = wire::encode_any_request(told->command(*rig_, scene_.mesh(), request_));
  }

  void answer() {
    const auto request = wire::decode_any_request(command_.empty() ? asked_ : command_).value();
    const std::unique_ptr<AnswerTask> task = make_task(*rig_, mesh_, request, scene_.cameras());
    sources_.clear();
    for (const CameraIndex camera : task->cameras())
      sources_.push_back({camera, &rig_->cameras[camera], scene_.image(camera, Pixels::kI420)});
    wire::AnswerHeader header;
    std::tie(header.view_width, header.view_height) = wire::view_size(request);
    header.family = PixelFamily::kI420;
    header.rig_hash = request_.rig_hash;
    header.cameras = CameraRanges(scene_.cameras());
    answer_ = task->render(header, sources_, manner_, std::move(answer_)).bytes;
  }

  void compose() {
    assembly_.begin(wire::decode_request(asked_).value());
    assembly_.add(wire::parse_answer(answer_).value());
    assembly_.finish(PixelFamily::kI420, false);
    resolve_into(assembly_.picture(), picture_);
  }

  size_t asked_bytes() const { return asked_.size() + command_.size(); }
  size_t answer_bytes() const { return answer_.size(); }
  const Image& picture() const { return picture_; }

 private:
  const Scene& scene_;
  const Kind kind_;
  const std::shared_ptr<const Rig> rig_;
  ViewRequest request_;
  AnswerTask::Options manner_;
  std::vector<uint8_t> asked_, command_;
  std::vector<Source> sources_;
  ByteBuffer answer_;
  MeshCache mesh_;
  Assembly assembly_;
  Image picture_;
};

// Processor time of this thread, of the shortest of some calls; nanoseconds.
template <typename F>
double shortest(int repeats, F call) {
  const auto now = [] { return 1e9 * seconds(CLOCK_THREAD_CPUTIME_ID); };
  constexpr double kEnough = 2e9 / 3;  // of three steps
  double best = INFINITY, all = 0;
  for (int i = 0; repeats > 0 ? i < repeats : i < 3 || all < kEnough; i++) {
    const double begin = now();
    call();
    const double taken = now() - begin;
    best = std::min(best, taken);
    all += taken;
  }
  return best;
}

}  // namespace

void print_access(const std::vector<std::pair<int, int>>& sizes, int cameras, int repeats) {
  std::printf("%-18s %-10s %8s | %10s %10s | %12s | %12s %12s %12s | %6s %7s\n", "cameras", "view", "codec", "to them",
              "from them", "asking, us", "cameras", "compositor", "together", "max", "PSNR");
  std::printf("%-18s %-10s %8s | %10s %10s | %12s | %38s | %6s %7s\n", "", "", "", "bytes", "bytes", "",
              "ns per pixel of the view", "error", "dB");
  for (const auto& [width, height] : sizes) {
    SceneOptions options;
    options.array = {cameras, width, height};
    const Scene scene(options);
    for (const int quality : {0, 90})
      for (const Kind& kind : kKinds) {
        Round round(scene, kind, quality);
        const double ask = shortest(repeats, [&] { round.ask(); });
        const double answer = shortest(repeats, [&] { round.answer(); });
        const double compose = shortest(repeats, [&] { round.compose(); });
        const double pixels = static_cast<double>(width) * height;
        const ExactQuality error = compare(round.picture(), scene.exact(PixelFamily::kI420));
        const std::string size = std::to_string(width) + "x" + std::to_string(height);
        std::printf("%-18s %-10s %8s | %10zu %10zu | %12.1f | %12.2f %12.2f %12.2f | %6.2f %7.1f\n", kind.name,
                    size.c_str(), quality > 0 ? "jpeg 90" : "raw", round.asked_bytes(), round.answer_bytes(), ask / 1e3,
                    answer / pixels, compose / pixels, (answer + compose) / pixels, error.max_error, error.psnr_db);
        std::fflush(stdout);
      }
  }
}

}  // namespace lf::bench
