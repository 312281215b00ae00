// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/gain_matcher.h"

#include <algorithm>
#include <cmath>

#include "image/correction.h"
#include "node/image_memory.h"

namespace lf {

GainMatcher::View& GainMatcher::view_of(uint32_t view_id) {
  const auto found = views_.find(view_id);
  if (found == views_.end() && views_.size() >= kMostViews)
    views_.erase(std::ranges::min_element(views_, {}, [](const auto& v) { return v.second.used; }));
  View& view = views_[view_id];
  if (found == views_.end()) view.gains = latest_;
  view.used = ++uses_;
  return view;
}

const CameraGains& GainMatcher::gains_for(uint32_t view_id, const GainRequest& request) {
  View& view = view_of(view_id);
  if (request.mean.empty() || view.seen.empty() || request.mean_of != view.sequence) return view.gains;
  view.gains.take(WideLuma::ratios(view.seen, request.mean));
  view.seen.clear();
  latest_ = view.gains;
  return view.gains;
}

void GainMatcher::keep(uint32_t view_id, uint32_t sequence, std::vector<WideLuma::Camera> seen) {
  View& view = view_of(view_id);
  view.sequence = sequence;
  view.seen = std::move(seen);
}

std::vector<Source> GainMatcher::match(std::span<const Source> sources, const CameraGains& gains,
                                       const std::function<Rect(CameraIndex)>& region, std::vector<ByteBuffer>& memory,
                                       const ParallelFor& parallel) {
  std::vector<Source> matched(sources.begin(), sources.end());
  make_room(memory, sources.size());
  parallel(sources.size(), [&](size_t i) {
    const float gain = gains.of(sources[i].camera);
    if (std::abs(gain - 1) < kLeastGain || sources[i].image.family == PixelFamily::kNone) return;
    if (sources[i].image.on_card.image) {
      matched[i].image.on_card.gain = gain;
      return;
    }
    const Rect rect = region(sources[i].camera);
    if (!rect.empty()) matched[i].image = divide_by_gain(sources[i].image, rect, gain, memory[i]);
  });
  return matched;
}

void GainMatcher::clear() {
  views_.clear();
  latest_ = {};
}

}  // namespace lf
