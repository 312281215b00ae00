// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_maker.h"

#include <utility>

#include "base/schedule.h"
#include "image/correction.h"

namespace lf {
namespace {

// The same images, what the task needs of them in the colours that they are to have.
void correct(const AnswerTask& task, const AnswerMaker::Options& options, std::vector<ByteBuffer>& memory,
             std::vector<Source>& images) {
  if (!options.colours || !options.colours->any()) return;
  make_room(memory, images.size());
  // Cameras that are asked how bright they are are looked at where they are not drawn, too.
  const bool compares = task.gains() && task.gains()->ask;
  options.parallel(images.size(), [&](size_t i) {
    Source& source = images[i];
    if (source.image.family == PixelFamily::kNone) return;
    const ColourCorrection* const correction = options.colours->of(source.camera, source.image.family);
    if (!correction) return;
    const Rect rect = compares ? task.region(source.camera) : task.drawn(source.camera);
    if (!rect.empty()) source.image = correction->apply(source.image, rect, memory[i]);
  });
}

// The same images, to be sampled as the options say: what the task needs of them sharpened.
void resample(const AnswerTask& task, const AnswerMaker::Options& options, std::vector<ByteBuffer>& memory,
              std::vector<Source>& images) {
  for (Source& source : images) source.resampling = options.resampling;
  if (options.resampling != Resampling::kSharpened) return;
  make_room(memory, images.size());
  options.parallel(images.size(), [&](size_t i) {
    Source& source = images[i];
    if (source.image.family == PixelFamily::kNone || !task.shows_detail(source.camera)) return;
    source.image = sharpen(source.image, task.answer_region(source.camera), memory[i]);
  });
}

}  // namespace

AnswerMaker::Units AnswerMaker::make(const AnswerTask& task, const wire::AnswerHeader& header,
                                     std::span<const Source> images, const Options& options, ImageMemory& scratch,
                                     ByteBuffer memory) {
  const uint64_t begun = now_ns();
  Units units;
  std::vector<Source> sources(images.begin(), images.end());
  correct(task, options, scratch.corrected, sources);
  if (task.gains()) match_gains(task, header, options, scratch.matched, sources, units);
  units.tried = task.moments(header, sources, options, options.parallel);
  units.before_ns = now_ns() - begun;
  resample(task, options, scratch.sharpened, sources);
  units.answer = task.render(header, sources, options, std::move(memory), options.parallel);
  return units;
}

void AnswerMaker::match_gains(const AnswerTask& task, const wire::AnswerHeader& header, const Options& options,
                              std::vector<ByteBuffer>& memory, std::vector<Source>& images, Units& units) {
  const CameraGains& gains = gains_.gains_for(header.view_id, *task.gains());
  AnswerTask::Brightness brightness = task.brightness(header, images, gains, options.parallel);
  if (task.gains()->use) {
    images = gains_.match(
        images, gains, [&task](CameraIndex camera) { return task.drawn(camera); }, memory, options.parallel);
    units.gains = &gains;
  }
  if (!brightness.bytes.empty()) gains_.keep(header.view_id, header.sequence, std::move(brightness.seen));
  units.brightness = std::move(brightness.bytes);
}

}  // namespace lf
