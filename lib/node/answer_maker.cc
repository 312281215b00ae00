// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_maker.h"

#include <algorithm>
#include <utility>

#include "base/schedule.h"
#include "image/correction.h"

namespace lf {
namespace {

constexpr int kStripRows = 16;  // corrected, then sharpened, while they are in the nearest cache; even

}  // namespace

AnswerMaker::Units AnswerMaker::make(const AnswerTask& task, const wire::AnswerHeader& header,
                                     std::span<const Source> images, const Options& options, ByteBuffer memory) {
  const uint64_t begun = now_ns();
  Units units;
  std::vector<Source> sources(images.begin(), images.end());
  std::vector<Source> shown;
  // Each pass over images that are too many for caches costs as much as reading them anew.
  const bool at_once =
      options.colours && options.colours->any() && !task.gains() && options.resampling == Resampling::kSharpened;
  if (at_once) {
    shown = correct_and_resample(task, options, sources);
  } else {
    correct(task, options, sources);
    if (task.gains()) match_gains(task, header, options, sources, units);
  }
  units.moments = task.moments(header, sources, options, options.parallel);
  units.before_ns = now_ns() - begun;
  if (!at_once) {
    resample(task, options, sources);
    shown = std::move(sources);
  }
  units.answer = task.render(header, shown, options, std::move(memory), options.parallel);
  return units;
}

// correct() and resample() in one pass: `images` become the corrected ones, where somebody looks at these; the result
// is what is rendered.
std::vector<Source> AnswerMaker::correct_and_resample(const AnswerTask& task, const Options& options,
                                                      std::vector<Source>& images) {
  corrected_.resize(std::max(corrected_.size(), images.size()));
  sharpened_.resize(std::max(sharpened_.size(), images.size()));
  std::vector<Source> shown = images;
  options.parallel(images.size(), [&](size_t i) {
    // Of cameras one after the other: stays in the cache.
    static thread_local ByteBuffer passing;
    Source &source = images[i], &sharp = shown[i];
    sharp.resampling = options.resampling;
    if (source.image.family == PixelFamily::kNone) return;
    const ColourCorrection* const correction = options.colours->of(source.camera, source.image.family);
    const Rect region = task.answer_region(source.camera);
    Rect drawn = task.drawn(source.camera);
    const bool sharpens = task.shows_detail(source.camera);
    if (!correction) {
      if (sharpens) sharp.image = sharpen(source.image, region, sharpened_[i]);
      return;
    }
    if (drawn.empty()) return;
    const bool is_looked_at = !sharpens || drawn != region;
    ByteBuffer& memory = is_looked_at ? corrected_[i] : passing;
    const ImageView raw = source.image;
    if (!sharpens) {
      source.image = sharp.image = correction->apply(raw, drawn, memory);
      return;
    }
    // Sharpened samples have neighbours.
    drawn = {std::max(0, drawn.x0 - 2), std::max(0, drawn.y0 - 2), std::min(raw.width, drawn.x1 + 2),
             std::min(raw.height, drawn.y1 + 2)};
    ImageView coloured = raw;
    int done = drawn.y0;
    for (int y = region.y0; y < region.y1; y += kStripRows) {
      const int end = std::min(y + kStripRows, region.y1);
      const int ahead = end == region.y1 ? drawn.y1 : std::min(end + 2, drawn.y1);
      if (ahead > done) coloured = correction->apply(raw, {drawn.x0, done, drawn.x1, ahead}, memory);
      done = ahead;
      sharp.image = sharpen(coloured, {region.x0, y, region.x1, end}, sharpened_[i]);
    }
    if (done < drawn.y1) coloured = correction->apply(raw, {drawn.x0, done, drawn.x1, drawn.y1}, memory);
    if (is_looked_at) source.image = coloured;
  });
  return shown;
}

// The same images, what the task needs of them in the colours that they are to have.
void AnswerMaker::correct(const AnswerTask& task, const Options& options, std::vector<Source>& images) {
  if (!options.colours || !options.colours->any()) return;
  corrected_.resize(std::max(corrected_.size(), images.size()));
  // Cameras that are asked how bright they are are looked at where they are not drawn, too.
  const bool compares = task.gains() && task.gains()->ask;
  options.parallel(images.size(), [&](size_t i) {
    Source& source = images[i];
    if (source.image.family == PixelFamily::kNone) return;
    const ColourCorrection* const correction = options.colours->of(source.camera, source.image.family);
    if (!correction) return;
    const Rect rect = compares ? task.region(source.camera) : task.drawn(source.camera);
    if (!rect.empty()) source.image = correction->apply(source.image, rect, corrected_[i]);
  });
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
