// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/frame_sources.h"

#include <algorithm>

#include "image/card_image.h"

namespace lf {

void FrameSources::add(CameraIndex camera, std::optional<CameraFrame> frame) {
  sources_.push_back({camera, &rig_.cameras[camera], {}});
  frames_.push_back(frame ? std::move(*frame) : CameraFrame{});
}

void FrameSources::decode_one(size_t i, PixelFamily family, const Replace& replace) {
  while (CameraPicture* picture = frames_[i].picture.get()) {
    if (const ImageView* on_card = group_ == 0 ? nullptr : picture->view_on_card(family, group_)) {
      sources_[i].image = *on_card;
      return;
    }
    views_[i] = picture->view(family, picture->is_compressed() ? region_(sources_[i].camera) : Rect{});
    if (views_[i]) {
      sources_[i].image = *views_[i];
      return;
    }
    frames_[i] = replace(sources_[i].camera, frames_[i]).value_or(CameraFrame{});
  }
}

void FrameSources::decode(PixelFamily family, const Replace& replace, const ParallelFor& parallel) {
  views_.resize(sources_.size());
  std::vector<size_t> shared;  // among threads
  for (size_t i = 0; i < sources_.size(); i++) {
    if (frames_[i].picture && frames_[i].picture->takes_work(family))
      shared.push_back(i);
    else
      decode_one(i, family, replace);
  }
  parallel(shared.size(), [&](size_t k) { decode_one(shared[k], family, replace); });
}

size_t FrameSources::on_card() const {
  return static_cast<size_t>(std::ranges::count_if(sources_, [](const Source& source) {
    return source.image.on_card.image && !source.image.on_card.image->is_fetched();
  }));
}

PixelFamily FrameSources::family() const {
  for (const Source& source : sources_)
    if (source.image.family != PixelFamily::kNone) return source.image.family;
  return PixelFamily::kNone;
}

}  // namespace lf
