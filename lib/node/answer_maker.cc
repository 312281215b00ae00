// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_maker.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/schedule.h"
#include "image/card_image.h"
#include "image/correction.h"

namespace lf {
namespace {

using Works = std::span<const AnswerMaker::Work>;

bool has(const AnswerTask& task, CameraIndex camera) { return std::ranges::binary_search(task.cameras(), camera); }

// What all of the tasks need of a camera's image; `part`: what one does.
Rect united(Works works, CameraIndex camera, Rect (AnswerTask::*part)(CameraIndex) const) {
  Rect all;
  for (const auto& [task, header, has_images] : works)
    if (has(*task, camera)) all = unite(all, (task->*part)(camera));
  return all;
}

// The same images, what the tasks need of them in the colours that they are to have.
void correct(Works works, const AnswerMaker::Options& options, std::vector<ByteBuffer>& memory,
             std::vector<Source>& images) {
  if (!options.colours || !options.colours->any()) return;
  make_room(memory, images.size());
  // Cameras that are asked how bright they are are looked at where they are not drawn, too.
  const GainRequest* const gains = works.front().task->gains();
  const auto part = gains && gains->ask ? &AnswerTask::region : &AnswerTask::drawn;
  options.parallel(images.size(), [&](size_t i) {
    Source& source = images[i];
    if (source.image.family == PixelFamily::kNone) return;
    const ColourCorrection* const correction = options.colours->of(source.camera, source.image.family);
    if (!correction) return;
    const Rect rect = united(works, source.camera, part);
    if (rect.empty()) return;
    FetchedMemory nothing_made;
    const ImageView image = fetched(source.image, rect, nothing_made);
    source.image = image.family == PixelFamily::kNone ? image : correction->apply(image, rect, memory[i]);
  });
}

// The same images as the options say that they are to be sampled: sharpened where a task shows it.
std::vector<Source> resampled(Works works, const AnswerMaker::Options& options, std::vector<ByteBuffer>& memory,
                              const std::vector<Source>& images) {
  std::vector<Source> sampled = images;
  if (options.resampling != Resampling::kSharpened) return sampled;
  make_room(memory, images.size());
  options.parallel(images.size(), [&](size_t i) {
    Source& source = sampled[i];
    if (source.image.family == PixelFamily::kNone) return;
    Rect shown;
    for (const auto& [task, header, has_images] : works)
      if (has(*task, source.camera) && task->shows_detail(source.camera))
        shown = unite(shown, task->answer_region(source.camera));
    if (shown.empty()) return;
    if (source.image.on_card.image)
      source.image.on_card.sharpened = true;
    else
      source.image = sharpen(source.image, shown, memory[i]);
  });
  return sampled;
}

// Those of a task's cameras.
std::vector<Source> images_of(const AnswerMaker::Work& work, const std::vector<Source>& images) {
  std::vector<Source> own;
  if (work.has_images)
    std::ranges::copy_if(images, std::back_inserter(own),
                         [&work](const Source& source) { return has(*work.task, source.camera); });
  return own;
}

}  // namespace

std::vector<AnswerMaker::Units> AnswerMaker::make(Works works, std::span<const Source> images, const Options& options,
                                                  ImageMemory& scratch, const std::function<ByteBuffer()>& memory) {
  const uint64_t begun = now_ns();
  std::vector<Units> units(works.size());
  std::vector<Source> sources(images.begin(), images.end());
  correct(works, options, scratch.corrected, sources);
  if (works.front().task->gains()) match_gains(works, options, scratch.matched, sources, units);
  for (size_t i = 0; i < works.size(); i++)
    units[i].tried = works[i].task->moments(works[i].header, images_of(works[i], sources), options, options.parallel);
  for (Units& of_one : units) of_one.before_ns = (now_ns() - begun) / works.size();
  const std::vector<Source> sampled = resampled(works, options, scratch.sharpened, sources);
  std::vector<std::unique_ptr<PendingAnswer>> answers(works.size());
  options.parallel(works.size(), [&](size_t i) {
    const auto& [task, header, has_images] = works[i];
    std::vector<Source> own = images_of(works[i], sampled);
    for (size_t k = 0, all = 0; k < own.size(); k++) {
      while (sources[all].camera != own[k].camera) all++;
      if (!task->shows_detail(own[k].camera)) own[k] = sources[all];
    }
    answers[i] = task->begin(header, own, options);
  });
  std::vector<PendingAnswer*> all;
  for (const auto& answer : answers) all.push_back(answer.get());
  std::vector<RenderedAnswer> rendered = finish_answers(all, options.card.get(), memory, options.parallel);
  for (size_t i = 0; i < works.size(); i++) units[i].answer = std::move(rendered[i]);
  return units;
}

void AnswerMaker::match_gains(Works works, const Options& options, std::vector<ByteBuffer>& memory,
                              std::vector<Source>& images, std::vector<Units>& units) {
  const auto& [task, header, has_images] = works.front();
  const CameraGains& gains = gains_.gains_for(header.view_id, *task->gains());
  AnswerTask::Brightness brightness =
      task->brightness(header, images_of(works.front(), images), gains, options.parallel);
  if (task->gains()->use) {
    const auto part = [&works](CameraIndex camera) { return united(works, camera, &AnswerTask::drawn); };
    images = gains_.match(images, gains, part, memory, options.parallel);
    for (Units& of_one : units) of_one.gains = &gains;
  }
  if (!brightness.bytes.empty()) gains_.keep(header.view_id, header.sequence, std::move(brightness.seen));
  units.front().brightness = std::move(brightness.bytes);
}

}  // namespace lf
