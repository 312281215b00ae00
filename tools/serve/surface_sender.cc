// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/surface_sender.h"

#include <algorithm>
#include <utility>

#include "compositor/view_meta.h"

namespace lf::serve {
namespace {

bool same_camera(const View& a, const View& b) {
  return a.pose == b.pose && a.lens == b.lens && a.width == b.width && a.height == b.height;
}

}  // namespace

std::vector<SurfaceSender::Message> SurfaceSender::messages(const GstStructure* picture, uint32_t timestamp,
                                                            size_t video_bytes) {
  std::vector<PictureView> views = views_of_picture(picture);
  std::vector<Message> messages;
  if (views.size() > eyes_.size()) return messages;
  for (size_t i = 0; i < views.size(); i++) {
    const double share = kShare * static_cast<double>(video_bytes) / static_cast<double>(views.size());
    eyes_[i].credit = std::min<double>(kMaxBytes, eyes_[i].credit + share);
    Message bytes = message(eyes_[i], static_cast<int>(i), std::move(views[i].view), timestamp);
    if (!bytes.empty()) messages.push_back(std::move(bytes));
  }
  return messages;
}

SurfaceSender::Message SurfaceSender::message(Eye& eye, int index, View view, uint32_t timestamp) {
  const bool rests = eye.sent && same_camera(view, *eye.sent);
  eye.unchanged = rests && view.focus == eye.sent->focus ? eye.unchanged + 1 : 0;
  if (rests && (eye.unchanged % kRepeat != 0 || eye.credit < static_cast<double>(eye.awaited))) return {};
  auto surface = wire::picture_surface(view, timestamp);
  if (!surface) return {};
  surface->view = index;
  int halvings = 0;
  const auto coarser = [&] { return wire::halve(*surface) && ++halvings > 0; };
  while (!rests && halvings < eye.halvings && coarser()) {
  }
  Message bytes;
  for (;;) {
    bytes = wire::encode_surface(*surface);
    eye.awaited = std::min(bytes.size() + kPacketBytes, kMaxBytes);
    if (static_cast<double>(bytes.size() + kPacketBytes) <= eye.credit) break;
    const bool waits = rests && bytes.size() + kPacketBytes <= kMaxBytes;
    if (waits || !coarser()) return {};
  }
  // A finer grid has up to four times as many bytes.
  if (!rests) eye.halvings = 4.0 * static_cast<double>(eye.awaited) < eye.credit ? std::max(halvings - 1, 0) : halvings;
  eye.credit -= static_cast<double>(eye.awaited);
  eye.sent = std::move(view);
  eye.unchanged = 0;
  return bytes;
}

}  // namespace lf::serve
