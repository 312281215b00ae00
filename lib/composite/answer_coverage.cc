// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/answer_coverage.h"

#include <algorithm>
#include <cstring>

#include "wire/unit.h"

namespace lf {
namespace {

constexpr int kBits = 64;

// Calls fn(word, mask) for each word of the pixels x0 to x1 - 1, until it returns true.
template <typename F>
bool any_word(int x0, int x1, const F& fn) {
  for (int word = x0 / kBits; word * kBits < x1; word++) {
    const int from = std::max(x0 - word * kBits, 0), to = std::min(x1 - word * kBits, kBits);
    const uint64_t below = to == kBits ? ~uint64_t{0} : (uint64_t{1} << to) - 1;
    if (fn(static_cast<size_t>(word), below & (~uint64_t{0} << from))) return true;
  }
  return false;
}

}  // namespace

bool DisjointRects::meets(const Rect& rect) const {
  if (rect.empty()) return false;
  if (rects_.size() <= kFew)
    return std::ranges::any_of(rects_, [&rect](const Rect& other) { return !intersect(other, rect).empty(); });
  for (int y = rect.y0; y < std::min(rect.y1, static_cast<int>(rows_.size())); y++) {
    const std::vector<uint64_t>& row = rows_[static_cast<size_t>(y)];
    const int end = std::min(rect.x1, static_cast<int>(row.size()) * kBits);
    if (any_word(rect.x0, end, [&row](size_t word, uint64_t mask) { return (row[word] & mask) != 0; })) return true;
  }
  return false;
}

void DisjointRects::mark(const Rect& rect) {
  if (rect.empty()) return;
  if (rows_.size() < static_cast<size_t>(rect.y1)) rows_.resize(static_cast<size_t>(rect.y1));
  for (int y = rect.y0; y < rect.y1; y++) {
    std::vector<uint64_t>& row = rows_[static_cast<size_t>(y)];
    const size_t words = static_cast<size_t>((rect.x1 + kBits - 1) / kBits);
    if (row.size() < words) row.resize(words);
    any_word(rect.x0, rect.x1, [&row](size_t word, uint64_t mask) { return row[word] |= mask, false; });
  }
}

bool DisjointRects::add(const Rect& rect) {
  if (meets(rect)) return false;
  rects_.push_back(rect);
  if (rects_.size() == kFew + 1)
    std::ranges::for_each(rects_, [this](const Rect& one) { mark(one); });
  else if (rects_.size() > kFew)
    mark(rect);
  return true;
}

template <typename F>
void Coverage::for_each_rect(CameraIndex camera, const F& f) const {
  if (const auto own = cameras_.find(camera); own != cameras_.end()) std::ranges::for_each(own->second.rects(), f);
  for (const auto& [cameras, rects] : sums_)
    if (cameras.contains(camera)) std::ranges::for_each(rects.rects(), f);
}

bool Coverage::add(CameraIndex camera, const Rect& rect) {
  for (const auto& [cameras, rects] : sums_)
    if (cameras.contains(camera) && rects.meets(rect)) return false;
  return cameras_[camera].add(rect);
}

Coverage::Sums::Sums(Coverage& coverage, const CameraRanges& cameras) : coverage_(coverage), cameras_(cameras) {
  const auto own = coverage.sums_.find(cameras);
  own_ = own == coverage.sums_.end() ? nullptr : &own->second;
  for (const auto& [camera, rects] : coverage.cameras_)
    if (cameras.contains(camera)) others_.push_back(&rects);
  if (!coverage.summed_.intersects(cameras)) return;
  for (const auto& [others, rects] : coverage.sums_)
    if (&rects != own_ && others.intersects(cameras)) others_.push_back(&rects);
}

bool Coverage::Sums::add(const Rect& rect) {
  if (std::ranges::any_of(others_, [&rect](const DisjointRects* rects) { return rects->meets(rect); })) return false;
  if (!own_) {
    if (coverage_.sums_.size() >= wire::kMaxSources) return false;
    own_ = &coverage_.sums_[cameras_];
    coverage_.summed_.add(cameras_);
  }
  return own_->add(rect);
}

bool Coverage::has(CameraIndex camera) const { return cameras_.contains(camera) || summed_.contains(camera); }

void Coverage::subtract(CameraIndex camera, const Rect& rect, std::span<float> weights) const {
  for_each_rect(camera, [&](const Rect& other) {
    const Rect both = intersect(other, rect);
    for (int y = both.y0; y < both.y1; y++)
      std::fill_n(&weights[static_cast<size_t>(y - rect.y0) * rect.width() + (both.x0 - rect.x0)],
                  std::max(both.width(), 0), 0.0f);
  });
}

namespace {

constexpr uint8_t kChromaOffset = 128;

size_t area(const Rect& rect) { return rect.empty() ? 0 : static_cast<size_t>(rect.width()) * rect.height(); }

ImageView packed_image(PixelFamily family, int width, int height, const uint8_t* memory) {
  const FragmentPlanes planes = packed_planes(family, {0, 0, width, height}, memory, nullptr);
  ImageView image{.family = family, .width = width, .height = height};
  for (int c = 0; c < 3; c++) {
    image.plane[c] = planes.plane[c];
    image.stride[c] = planes.stride[c];
  }
  return image;
}

void copy(const FragmentPlanes& piece, const ImageView& image, uint8_t* memory) {
  const Rect& rect = piece.rect;
  const bool rgb = image.family == PixelFamily::kRgb;
  uint8_t* to = memory + (image.plane[0] - memory) + rect.y0 * image.stride[0] + (rgb ? 3 : 1) * rect.x0;
  const size_t bytes = static_cast<size_t>(rgb ? 3 : 1) * rect.width();
  for (int y = 0; y < rect.height(); y++)
    std::memcpy(to + y * image.stride[0], piece.plane[0] + y * piece.stride[0], bytes);
  for (int c = 1; c < 3 && !rgb; c++) {
    to = memory + (image.plane[c] - memory) + rect.y0 / 2 * image.stride[c] + rect.x0 / 2;
    for (int y = 0; y < chroma_size(rect.height()); y++)
      for (int x = 0; x < chroma_size(rect.width()); x++)
        to[y * image.stride[c] + x] = static_cast<uint8_t>(piece.plane[c][y * piece.stride[c] + x] + kChromaOffset);
  }
}

}  // namespace

bool CameraPixels::add(CameraIndex camera, const Camera& rig_camera, const FragmentPlanes& piece) {
  const int width = rig_camera.width, height = rig_camera.height;
  if (piece.rect.empty() || intersect(piece.rect, {0, 0, width, height}) != piece.rect) return false;
  Pixels& pixels = cameras_[camera];
  if (!pixels.memory) {
    pixels.memory = take_buffer(packed_size(piece.family, width, height));
    pixels.image = packed_image(piece.family, width, height, pixels.memory.get());
  }
  if (piece.family != pixels.image.family) return false;
  if (std::ranges::any_of(pixels.pieces, [&](const Rect& r) { return !intersect(r, piece.rect).empty(); }))
    return false;
  copy(piece, pixels.image, pixels.memory.get());
  pixels.pieces.push_back(piece.rect);
  return true;
}

std::vector<CameraIndex> CameraPixels::cameras() const {
  std::vector<CameraIndex> cameras;
  for (const auto& [camera, pixels] : cameras_) cameras.push_back(camera);
  return cameras;
}

bool CameraPixels::has(CameraIndex camera, const Rect& region) const {
  const auto found = cameras_.find(camera);
  if (found == cameras_.end()) return false;
  size_t there = 0;
  for (const Rect& piece : found->second.pieces) there += area(intersect(piece, region));
  return there == area(region);
}

}  // namespace lf
