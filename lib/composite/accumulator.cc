// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/accumulator.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "base/text.h"
#include "composite/resolve.h"
#include "render/sum_planes.h"

namespace lf {
namespace {

size_t area(const Rect& rect) { return static_cast<size_t>(rect.width()) * rect.height(); }

template <typename To, typename From, typename Row>
void for_rows(To* to, ptrdiff_t to_stride, const From* from, ptrdiff_t from_stride, int width, int height, Row row) {
  for (int y = 0; y < height; y++, to += to_stride, from += from_stride) row(to, from, width);
}

template <typename T>
void copy_row(T* to, const T* from, int n) {
  std::memcpy(to, from, n * sizeof(T));
}

}  // namespace

void Accumulator::reset(PixelFamily family, int width, int height) {
  family_ = family;
  width_ = width;
  height_ = height;
  touched_ = {};
  borrowed_.reset();
  gpu_sums_.clear();
  if (fetched_) fetched_->reset(PixelFamily::kNone, 0, 0);
  own_set_ = own_missing_set_ = false;
  zeros_.resize(width);
  uncovered_.clear();
}

bool Accumulator::fits(PixelFamily family, const Rect& rect) const {
  if (family_ == PixelFamily::kNone || family != family_) return false;
  if (family_ == PixelFamily::kI420 && (rect.x0 % 2 != 0 || rect.y0 % 2 != 0)) return false;
  return !rect.empty() && rect.x0 >= 0 && rect.y0 >= 0 && rect.x1 <= width_ && rect.y1 <= height_;
}

SumPlanes Accumulator::own() {
  return packed_sums(family_, all(), sum_.data(), own_missing_set_ ? missing_.data() : nullptr);
}

ConstSumPlanes Accumulator::fetched() const {
  if (gpu_sums_.size() == 1 && gpu_sums_.front()->rect() == all()) return gpu_sums_.front()->fetch();
  if (!fetched_) fetched_ = std::make_unique<Accumulator>();
  if (fetched_->family() == PixelFamily::kNone) {
    fetched_->reset(family_, width_, height_);
    for (const std::shared_ptr<gl::GpuSum>& sum : gpu_sums_) fetched_->add(sum->fetch());
  }
  return fetched_->whole();
}

std::optional<ConstSumPlanes> Accumulator::kept() const {
  return gpu_sums_.empty() ? borrowed_ : std::optional(fetched());
}

ConstSumPlanes Accumulator::whole() const {
  if (const auto kept = this->kept()) return *kept;
  const uint16_t* const lost = own_missing_set_ ? missing_.data() : nullptr;
  if (own_set_) return packed_sums(family_, all(), sum_.data(), lost);
  ConstSumPlanes nothing{.family = family_, .rect = all()};
  for (const int16_t*& plane : nothing.plane) plane = zeros_.data();  // one row of zeros with stride 0
  return nothing;
}

void Accumulator::materialize() {
  if (own_set_) return;
  own_set_ = true;
  sum_.resize(packed_size(family_, width_, height_));
  const std::optional<ConstSumPlanes> kept = this->kept();
  if (!kept) {
    std::memset(sum_.data(), 0, sum_.size() * sizeof(sum_[0]));
    return;
  }
  const ConstSumPlanes from = *kept;
  // Keeps the GPU sums alive until the copy is done.
  const std::vector<std::shared_ptr<gl::GpuSum>> gpu_sums = std::move(gpu_sums_);
  gpu_sums_.clear();
  borrowed_.reset();
  if (from.lost) materialize_missing();
  const SumPlanes to = own();
  for (int c = 0; c < 3; c++)
    for_rows(to.plane[c], to.stride[c], from.plane[c], from.stride[c], plane_width(family_, to.rect, c),
             plane_height(family_, to.rect, c), copy_row<int16_t>);
  if (from.lost)
    for_rows(to.lost, to.missing_stride, from.lost, from.missing_stride, width_, height_, copy_row<uint16_t>);
}

void Accumulator::materialize_missing() {
  if (own_missing_set_) return;
  own_missing_set_ = true;
  missing_.resize(static_cast<size_t>(width_) * height_);
  std::memset(missing_.data(), 0, missing_.size() * sizeof(missing_[0]));
}

bool Accumulator::add(const FragmentPlanes& in) {
  if (!fits(in.family, in.rect)) return false;
  materialize();
  if (in.lost) materialize_missing();
  const SumPlanes to = part_of(own(), in.rect);
  const int w = in.rect.width(), h = in.rect.height();
  if (family_ == PixelFamily::kRgb) {
    for (int y = 0; y < h; y++)
      add_rgb_row(to.plane[0] + y * to.stride[0], to.plane[1] + y * to.stride[1], to.plane[2] + y * to.stride[2],
                  in.plane[0] + y * in.stride[0], w);
  } else {
    for_rows(to.plane[0], to.stride[0], in.plane[0], in.stride[0], w, h, add_row);
    for (int c = 1; c < 3; c++)
      for_rows(to.plane[c], to.stride[c], in.plane[c], in.stride[c], chroma_size(w), chroma_size(h), add_chroma_row);
  }
  if (in.lost) for_rows(to.lost, to.missing_stride, in.lost, in.missing_stride, w, h, add_missing_row);
  touched_ = unite(touched_, in.rect);
  return true;
}

bool Accumulator::add(const Fragment& fragment) {
  if (!fits(fragment.family, fragment.rect)) return false;
  if (fragment.pixels.size() != packed_size(family_, fragment.rect.width(), fragment.rect.height())) return false;
  if (!fragment.lost.empty() && fragment.lost.size() != area(fragment.rect)) return false;
  return add(planes_of(fragment));
}

bool Accumulator::add(const ConstSumPlanes& in) {
  if (!fits(in.family, in.rect)) return false;
  materialize();
  if (in.lost) materialize_missing();
  const SumPlanes to = part_of(own(), in.rect);
  const auto add_row = [](auto* sum, const auto* more, int n) { add_sum_row(sum, more, n); };
  for (int c = 0; c < 3; c++)
    for_rows(to.plane[c], to.stride[c], in.plane[c], in.stride[c], plane_width(family_, in.rect, c),
             plane_height(family_, in.rect, c), add_row);
  if (in.lost)
    for_rows(to.lost, to.missing_stride, in.lost, in.missing_stride, in.rect.width(), in.rect.height(), add_row);
  touched_ = unite(touched_, in.rect);
  return true;
}

bool Accumulator::add_borrowed(const ConstSumPlanes& sums) {
  if (!touched_.empty() || sums.rect != all()) return add(sums);
  if (!fits(sums.family, sums.rect)) return false;
  borrowed_ = sums;
  touched_ = sums.rect;
  return true;
}

bool Accumulator::add_borrowed(std::shared_ptr<gl::GpuSum> sum) {
  if (sum->view() != all() || !fits(sum->family(), sum->rect())) return false;
  const bool are_alone = touched_.empty() || !gpu_sums_.empty();
  if (!are_alone || (!gpu_sums_.empty() && gpu_sums_.front()->group() != sum->group())) return add(sum->fetch());
  touched_ = unite(touched_, sum->rect());
  gpu_sums_.push_back(std::move(sum));
  if (fetched_) fetched_->reset(PixelFamily::kNone, 0, 0);
  return true;
}

bool Accumulator::add_missing_weights(const Rect& rect, const std::vector<float>& weights) {
  // Missing weight has one value per pixel in both families, so the rectangle may start at an odd pixel.
  const Rect even{rect.x0 & ~1, rect.y0 & ~1, rect.x1, rect.y1};
  if (rect.empty() || !fits(family_, even) || weights.size() != area(rect)) return false;
  materialize();
  materialize_missing();
  const int w = rect.width();
  std::vector<uint16_t> row(w);
  for (int y = 0; y < rect.height(); y++) {
    const float* in = &weights[static_cast<size_t>(y) * w];
    // This order of comparisons turns NaN into 0.
    for (int x = 0; x < w; x++)
      row[x] = static_cast<uint16_t>((in[x] > 0 ? std::min(in[x], 1.f) : 0.f) * kMissingOne + 0.5f);
    add_sum_row(&missing_[static_cast<size_t>(rect.y0 + y) * width_ + rect.x0], row.data(), w);
  }
  touched_ = unite(touched_, rect);
  return true;
}

void Accumulator::set_uncovered(const FaceIdMap& whole_view) {
  if (whole_view.region() != all()) throw Error("the face-id map of uncovered pixels does not cover the picture");
  uncovered_.resize(static_cast<size_t>(width_) * height_);
  for (int y = 0; y < height_; y++) {
    const int32_t* owner = whole_view.row(0, y);
    uint8_t* out = &uncovered_[static_cast<size_t>(y) * width_];
    for (int x = 0; x < width_; x++) out[x] = owner[x] == FaceIdMap::kNone;
  }
}

void Accumulator::resolve(const Background& background, const RgbLayout& layout, uint8_t* const plane[3],
                          const ptrdiff_t stride[3], const Levels& levels) const {
  lf::resolve(whole(), uncovered_.empty() ? nullptr : uncovered_.data(), background, layout, plane, stride, levels);
}

gl::ShareGroup Accumulator::share_group() const {
  return !gpu_sums_.empty() && !own_missing_set_ && uncovered_.empty() ? gpu_sums_.front()->group() : 0;
}

bool Accumulator::is_gone() const {
  return std::ranges::any_of(gpu_sums_, [](const auto& sum) { return sum->is_gone(); });
}

std::shared_ptr<gl::GpuSum> Accumulator::resolve_on_gpu(const Background& background, const Levels& levels,
                                                        gl::GpuPicture to, std::string& why) const {
  if (share_group() == 0) {
    why = "it is not on a GPU";
    return nullptr;
  }
  std::shared_ptr<gl::GpuSum> sum = gpu_sums_.size() == 1 ? gpu_sums_.front() : gl::GpuSum::add(gpu_sums_, why);
  if (!sum) return nullptr;
  to.gain = levels.gain;
  to.offset = levels.offset;
  to.chroma_gain = levels.chroma_gain;
  to.least_weight = kMinWeight;
  const float r = background.r, g = background.g, b = background.b;
  const YCbCr ycbcr = ycbcr_of(r, g, b);
  const bool rgb = family_ == PixelFamily::kRgb;
  std::ranges::copy(rgb ? std::array{r, g, b} : std::array{ycbcr.y, ycbcr.cb, ycbcr.cr}, to.background);
  return sum->draw(to, why) ? sum : nullptr;
}

void Accumulator::conceal(const ImageView& before, uint8_t* const plane[3], const ptrdiff_t stride[3]) const {
  lf::conceal(whole(), before, plane, stride);
}

Image Accumulator::resolve(const Background& background) const {
  Image image(family_, width_, height_);
  if (family_ == PixelFamily::kNone) return image;
  const int count = family_ == PixelFamily::kRgb ? 1 : 3;
  uint8_t* plane[3] = {};
  ptrdiff_t stride[3] = {};
  for (int i = 0; i < count; i++) {
    plane[i] = image.plane(i);
    stride[i] = image.view().stride[i];
  }
  resolve(background, RgbLayout{}, plane, stride);
  return image;
}

std::vector<float> Accumulator::coverage() const {
  std::vector<float> coverage(static_cast<size_t>(width_) * height_, 1);
  if (const ConstSumPlanes sum = whole(); sum.lost)
    for (int y = 0; y < height_; y++)
      for (int x = 0; x < width_; x++) {
        const int lost = std::min<int>(sum.lost[y * sum.missing_stride + x], kMissingOne);
        coverage[static_cast<size_t>(y) * width_ + x] = static_cast<float>(kMissingOne - lost) / kMissingOne;
      }
  for (size_t i = 0; i < uncovered_.size(); i++)
    if (uncovered_[i]) coverage[i] = 0;
  return coverage;
}

std::optional<ConstSumPlanes> Accumulator::sums() const {
  if (touched_.empty()) return std::nullopt;
  Rect rect = touched_;
  if (family_ == PixelFamily::kI420) {  // missing weights may start at an odd pixel
    rect.x0 &= ~1;
    rect.y0 &= ~1;
  }
  return part_of(whole(), rect);
}

}  // namespace lf
