// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_maker.h"

#include <algorithm>
#include <utility>

#include "base/schedule.h"
#include "image/correction.h"

namespace lf {

AnswerMaker::Units AnswerMaker::make(const AnswerTask& task, const wire::AnswerHeader& header,
                                     std::span<const Source> images, const Options& options, ByteBuffer memory) {
  const uint64_t begun = now_ns();
  Units units;
  std::vector<Source> sources(images.begin(), images.end());
  if (task.gains()) match_gains(task, header, options, sources, units);
  units.moments = task.moments(header, sources, options, options.parallel);
  units.before_ns = now_ns() - begun;
  resample(task, options, sources);
  units.answer = task.render(header, sources, options, std::move(memory), options.parallel);
  return units;
}

void AnswerMaker::match_gains(const AnswerTask& task, const wire::AnswerHeader& header, const Options& options,
                              std::vector<Source>& images, Units& units) {
  const CameraGains& gains = gains_.gains_for(header.view_id, *task.gains());
  AnswerTask::Brightness brightness = task.brightness(header, images, gains, options.parallel);
  if (task.gains()->use) {
    images = gains_.match(
        images, gains, [&task](CameraIndex camera) { return task.drawn(camera); }, options.parallel);
    units.gains = &gains;
  }
  if (!brightness.bytes.empty()) gains_.keep(header.view_id, header.sequence, std::move(brightness.seen));
  units.brightness = std::move(brightness.bytes);
}

// The same images, to be sampled as the options say: what the task needs of them sharpened.
void AnswerMaker::resample(const AnswerTask& task, const Options& options, std::vector<Source>& images) {
  for (Source& source : images) source.resampling = options.resampling;
  if (options.resampling != Resampling::kSharpened) return;
  sharpened_.resize(std::max(sharpened_.size(), images.size()));
  options.parallel(images.size(), [&](size_t i) {
    Source& source = images[i];
    if (source.image.family == PixelFamily::kNone || !task.shows_detail(source.camera)) return;
    source.image = sharpen(source.image, task.answer_region(source.camera), sharpened_[i]);
  });
}

}  // namespace lf
