// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/frame_sources.h"

#include <algorithm>

namespace lf {

void FrameSources::add(CameraIndex camera, std::optional<CameraFrame> frame) {
  sources_.push_back({camera, &rig_.cameras[camera], {}});
  frames_.push_back(frame ? std::move(*frame) : CameraFrame{});
  const CameraFrame& held = frames_.back();
  mapped_.push_back(nullptr);
  if (held.jpeg) {
    pending_.push_back(sources_.size() - 1);
  } else if (held.buffer) {
    map(sources_.size() - 1);
  }
}

void FrameSources::map(size_t i) {
  mapped_[i] = std::make_unique<MappedFrame>(frames_[i]);
  sources_[i].image = mapped_[i]->ok() ? mapped_[i]->view() : ImageView{};
}

void FrameSources::convert_one(size_t i, PixelFamily family) {
  const CameraFrame converted = in_family(frames_[i], family);
  mapped_[i].reset();
  frames_[i] = converted;
  map(i);
}

bool FrameSources::decode_one(size_t i, PixelFamily family) {
  JpegFrame& frame = *frames_[i].jpeg;
  const Camera& camera = *sources_[i].rig_camera;
  Rect region{0, 0, camera.width, camera.height};
  if (family != PixelFamily::kRgb) region = region_(sources_[i].camera);
  if (!frame.ensure(region)) return false;
  sources_[i].image = frame.view();
  if (family != PixelFamily::kRgb) return true;
  // Cameras of both families on one node: rare, and never cheap.
  const ImageView from = frame.view();
  Image packed(PixelFamily::kI420, from.width, from.height);
  for (int c = 0; c < 3; c++) {
    const int w = c ? chroma_size(from.width) : from.width, h = c ? chroma_size(from.height) : from.height;
    for (int y = 0; y < h; y++)
      std::copy_n(from.plane[c] + y * from.stride[c], w, packed.plane(c) + static_cast<ptrdiff_t>(y) * w);
  }
  converted_[i] = to_rgb(packed);
  sources_[i].image = converted_[i].view();
  return true;
}

void FrameSources::decode(PixelFamily family, const Replace& replace, const ParallelFor& parallel) {
  if (family == PixelFamily::kRgb) converted_.resize(sources_.size());
  for (size_t i = 0; i < sources_.size(); i++)
    if (mapped_[i] && mapped_[i]->ok() && sources_[i].image.family != family) pending_.push_back(i);
  parallel(pending_.size(), [&](size_t k) {
    const size_t i = pending_[k];
    if (!frames_[i].jpeg) return convert_one(i, family);
    while (!decode_one(i, family)) {
      std::optional<CameraFrame> before = replace(sources_[i].camera, frames_[i]);
      if (!before) return;
      frames_[i] = std::move(*before);
    }
  });
}

PixelFamily FrameSources::family() const {
  for (const Source& source : sources_)
    if (source.image.family != PixelFamily::kNone) return source.image.family;
  return PixelFamily::kNone;
}

}  // namespace lf
