// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <list>
#include <span>
#include <vector>

#include "image/card_image.h"
#include "render/simd/band_data.h"
#include "render/sum_renderer.h"

namespace lf {

// The images of a task's slots in this process's memory: what a view needs of those that are on a card comes from there
// when it is asked for. Not thread-safe.
class FetchedImages {
 public:
  // Both must outlive this; `sources`: what the task was made of.
  FetchedImages(const simd::SumTask& task, std::span<const Source> sources) : task_(task), sources_(sources) {}

  // Of one of the task's slots; valid as long as this lives. kNone: it has none, or none can be had.
  const ImageView& of(const simd::Slot& slot) {
    if (!slot.image.on_card.image) return slot.image;
    const auto index = static_cast<size_t>(&slot - task_.slots.data());
    if (images_.empty()) images_.resize(task_.slots.size());
    if (images_[index]) return *images_[index];
    for (const Source& source : sources_)
      if (source.camera == slot.camera)
        images_[index] = &fetched_.emplace_back(source.image, needed_pixels(*task_.plan, slot.camera, *source.rig_camera))
                              .image;
    return *images_[index];
  }

 private:
  struct Fetched {
    Fetched(const ImageView& from, const Rect& part) : image(fetched(from, part, memory)) {}
    FetchedMemory memory;
    ImageView image;
  };
  const simd::SumTask& task_;
  const std::span<const Source> sources_;
  std::list<Fetched> fetched_;
  std::vector<const ImageView*> images_;  // by slot; null: not asked for yet
};

}  // namespace lf
