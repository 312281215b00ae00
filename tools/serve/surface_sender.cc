// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/surface_sender.h"

#include <algorithm>

#include "compositor/view_meta.h"
#include "wire/surface_codec.h"

namespace lf::serve {
namespace {

bool same_camera(const View& a, const View& b) {
  return a.pose == b.pose && a.lens == b.lens && a.width == b.width && a.height == b.height;
}

}  // namespace

std::vector<uint8_t> SurfaceSender::message(const GstStructure* picture, uint32_t timestamp, size_t video_bytes) {
  credit_ = std::min<double>(kMaxBytes, credit_ + kShare * static_cast<double>(video_bytes));
  std::optional<View> view = view_of_picture(picture);
  if (!view) return {};
  const bool rests = sent_ && same_camera(*view, *sent_);
  unchanged_ = rests && view->focus == sent_->focus ? unchanged_ + 1 : 0;
  if (rests && (unchanged_ % kRepeat != 0 || credit_ < static_cast<double>(awaited_))) return {};
  auto surface = wire::picture_surface(*view, timestamp);
  if (!surface) return {};
  int halvings = 0;
  const auto coarser = [&] { return wire::halve(*surface) && ++halvings > 0; };
  while (!rests && halvings < halvings_ && coarser()) {
  }
  std::vector<uint8_t> bytes;
  for (;;) {
    bytes = wire::encode_surface(*surface);
    awaited_ = std::min(bytes.size() + kPacketBytes, kMaxBytes);
    if (static_cast<double>(bytes.size() + kPacketBytes) <= credit_) break;
    const bool waits = rests && bytes.size() + kPacketBytes <= kMaxBytes;
    if (waits || !coarser()) return {};
  }
  // A finer grid has up to four times as many bytes.
  if (!rests) halvings_ = 4.0 * static_cast<double>(awaited_) < credit_ ? std::max(halvings - 1, 0) : halvings;
  credit_ -= static_cast<double>(awaited_);
  sent_ = std::move(view);
  unchanged_ = 0;
  return bytes;
}

}  // namespace lf::serve
