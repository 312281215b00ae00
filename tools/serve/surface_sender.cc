// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/surface_sender.h"

#include <algorithm>
#include <utility>

#include "compositor/view_meta.h"

namespace lf::serve {
namespace {

// Sorted by the quality of redrawn pictures, best first. Even a tolerance of 8 levels costs less quality than half the
// resolution.
constexpr struct {
  int halvings, tolerance;
} kCoarseness[] = {{0, 2}, {0, 4}, {0, 8}, {1, 2}, {1, 4}, {1, 8}, {2, 4}, {3, 4}};
constexpr double kGrowth = 1.6;  // ratio of the bytes of neighbouring entries

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
  const bool is_due = !rests || view.focus != eye.sent->focus || timestamp - eye.sent_timestamp >= kRepeat;
  if (!is_due || (rests && eye.credit < static_cast<double>(eye.awaited))) return {};
  auto surface = wire::picture_surface(view, timestamp);
  if (!surface) return {};
  surface->view = index;
  wire::smooth(*surface);
  int halvings = 0;
  size_t coarseness = rests ? 0 : eye.coarseness;
  Message bytes;
  for (;; coarseness++) {
    if (coarseness == std::size(kCoarseness)) return {};
    while (halvings < kCoarseness[coarseness].halvings && wire::halve(*surface)) halvings++;
    surface->tolerance = kCoarseness[coarseness].tolerance;
    bytes = wire::encode_surface(*surface);
    eye.awaited = std::min(bytes.size() + kPacketBytes, kMaxBytes);
    if (static_cast<double>(bytes.size() + kPacketBytes) <= eye.credit) break;
    if (rests && bytes.size() + kPacketBytes <= kMaxBytes) return {};  // waits for enough bits
  }
  if (!rests)
    eye.coarseness =
        coarseness && kGrowth * static_cast<double>(eye.awaited) < eye.credit ? coarseness - 1 : coarseness;
  eye.credit -= static_cast<double>(eye.awaited);
  eye.sent = std::move(view);
  eye.sent_timestamp = timestamp;
  return bytes;
}

}  // namespace lf::serve
