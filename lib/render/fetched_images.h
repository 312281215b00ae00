// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "image/card_image.h"
#include "render/camera_projection.h"
#include "render/simd/band_data.h"
#include "render/sum_renderer.h"

namespace lf {

// The images of a task's slots in this process's memory: what a view needs of those that are on a card comes from there
// when it is asked for. Thread-safe for different slots.
class FetchedImages {
 public:
  // Both must outlive this; `sources`: what the task was made of.
  FetchedImages(const simd::SumTask& task, std::span<const Source> sources)
      : task_(task), sources_(sources), fetched_(task.slots.size()) {}

  // Of one of the task's slots, which must stay as it is; valid as long as this lives. kNone: it has none, or none can
  // be had.
  const ImageView& of(const simd::Slot& slot) {
    if (!slot.image.on_card.image) return slot.image;
    std::unique_ptr<Fetched>& fetched = fetched_[static_cast<size_t>(&slot - task_.slots.data())];
    for (const Source& source : sources_)
      if (!fetched && source.camera == slot.camera)
        fetched = std::make_unique<Fetched>(slot.image, needed_pixels(*task_.plan, slot.camera, *source.rig_camera));
    return fetched->image;
  }

 private:
  struct Fetched {
    Fetched(const ImageView& from, const Rect& part) : image(fetched(from, part, memory)) {}
    FetchedMemory memory;
    ImageView image;
  };
  const simd::SumTask& task_;
  const std::span<const Source> sources_;
  std::vector<std::unique_ptr<Fetched>> fetched_;  // by slot; null: not asked for yet
};

}  // namespace lf
