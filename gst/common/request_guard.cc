// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/request_guard.h"

#include <iterator>
#include <numeric>
#include <utility>

#include "base/schedule.h"
#include "view/view.h"
#include "wire/request_codec.h"

namespace lf {

void RequestGuard::install(GObjectClass* klass, guint first_id, bool views) {
  constexpr auto kFlags = GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);
  constexpr RequestLimits kDefault;
  const auto install = [&](Property property, GParamSpec* spec) {
    g_object_class_install_property(klass, first_id + property, spec);
  };
  install(kMaxPixels,
          g_param_spec_uint64(kNames[kMaxPixels], "Maximum pixels",
                              "Pixels of a view at most, width times height, and four times as many of all views "
                              "of a set together: requests for more are refused",
                              1, uint64_t{kMaxImageSize} * kMaxImageSize, kDefault.pixels, kFlags));
  install(kMaxAperture, g_param_spec_double(
                            kNames[kMaxAperture], "Maximum aperture",
                            "Synthetic aperture of a view at most, metres: requests for a wider one are refused (0: as "
                            "wide as the array, where that is known)",
                            0, Blending::kMaxAperture, kDefault.aperture, kFlags));
  install(kMaxTrials, g_param_spec_uint(kNames[kMaxTrials], "Maximum trials",
                                        "Trial surfaces of one request at most: requests for more are refused", 0,
                                        lf::kMaxTrials, kDefault.trials, kFlags));
  install(kMaxRate, g_param_spec_uint(kNames[kMaxRate], "Maximum requests per second",
                                      "Requests of one view a second at most, where they come in real time: others are "
                                      "refused (0: any number)",
                                      0, G_MAXUINT, kDefault.requests_per_second, kFlags));
  if (!views) return;
  install(kMaxViews, g_param_spec_uint(kNames[kMaxViews], "Maximum views",
                                       "Views that are served at a time at most: requests of more are refused, until "
                                       "another one has not asked for two seconds",
                                       1, 65536, kDefault.views, kFlags));
}

bool RequestGuard::set(guint id, const GValue* value) {
  const std::lock_guard lock(mutex_);
  switch (id - first_id_) {
    case kMaxPixels: limits_.pixels = g_value_get_uint64(value); return true;
    case kMaxAperture: limits_.aperture = g_value_get_double(value); return true;
    case kMaxTrials: limits_.trials = g_value_get_uint(value); return true;
    case kMaxRate: limits_.requests_per_second = g_value_get_uint(value); return true;
    case kMaxViews: limits_.views = g_value_get_uint(value); return true;
    default: return false;
  }
}

bool RequestGuard::get(guint id, GValue* value) const {
  const std::lock_guard lock(mutex_);
  switch (id - first_id_) {
    case kMaxPixels: g_value_set_uint64(value, limits_.pixels); return true;
    case kMaxAperture: g_value_set_double(value, limits_.aperture); return true;
    case kMaxTrials: g_value_set_uint(value, limits_.trials); return true;
    case kMaxRate: g_value_set_uint(value, limits_.requests_per_second); return true;
    case kMaxViews: g_value_set_uint(value, limits_.views); return true;
    default: return false;
  }
}

bool RequestGuard::admits(GstElement* element, std::span<const uint8_t> request, double extent, bool paced,
                          uint32_t requester) {
  const std::optional<wire::RequestPeek> peek = wire::peek_request(request);
  if (!peek) return true;  // refused where it is decoded
  const RequestCost cost = wire::peek_request_cost(request);
  std::unique_lock lock(mutex_);
  RequestLimits limits = limits_;
  if (!paced) limits.requests_per_second = 0;
  const uint64_t now = now_ns();
  const RequestGate::Refusal refusal =
      gate_.check(uint64_t{requester} << 32 | peek->head.view_id, cost, limits, extent, now);
  if (refusal == RequestGate::kNone) return true;
  if (const std::optional<uint64_t> refused = refuse(refusal, now, std::move(lock)))
    GST_ELEMENT_WARNING(element, RESOURCE, SETTINGS,
                        ("View %u %s: its request is refused (%" G_GUINT64_FORMAT " were so far).", peek->head.view_id,
                         refusal_text(refusal, cost, limits, extent).c_str(), *refused),
                        (nullptr));
  return false;
}

std::optional<uint64_t> RequestGuard::refuse(RequestGate::Refusal refusal, uint64_t now,
                                             [[maybe_unused]] std::unique_lock<std::mutex> lock) {
  refused_[refusal]++;
  if (!told_.may_leave(now)) return std::nullopt;
  return std::accumulate(std::begin(refused_), std::end(refused_), uint64_t{0});
}

void RequestGuard::forget(uint32_t requester) {
  const std::lock_guard lock(mutex_);
  gate_.forget_if([requester](uint64_t view) { return view >> 32 == requester; });
}

bool RequestGuard::admits_answer(GstElement* element, int width, int height) {
  std::unique_lock lock(mutex_);
  const RequestLimits limits = limits_;
  const uint64_t pixels = static_cast<uint64_t>(width) * static_cast<uint64_t>(height);
  if (pixels <= limits.pixels) return true;
  if (const std::optional<uint64_t> refused = refuse(RequestGate::kPixels, now_ns(), std::move(lock)))
    GST_ELEMENT_WARNING(element, RESOURCE, SETTINGS,
                        ("An answer of %dx%d pixels is more than max-pixels (%" G_GUINT64_FORMAT
                         "): it is refused (%" G_GUINT64_FORMAT " were so far).",
                         width, height, limits.pixels, *refused),
                        (nullptr));
  return false;
}

void RequestGuard::clear() {
  const std::lock_guard lock(mutex_);
  gate_.clear();
  std::fill(std::begin(refused_), std::end(refused_), 0);
}

uint64_t RequestGuard::refused() const {
  const std::lock_guard lock(mutex_);
  return std::accumulate(std::begin(refused_), std::end(refused_), uint64_t{0});
}

void RequestGuard::add_stats(GstStructure* stats) const {
  const std::lock_guard lock(mutex_);
  constexpr const char* kNames[] = {"refused-pixels", "refused-aperture", "refused-trials",
                                    "refused-rate",   "refused-views",    "refused-lens"};
  static_assert(std::size(kNames) == RequestGate::kNumRefusals);
  uint64_t all = 0;
  for (size_t i = 0; i < std::size(kNames); i++) {
    gst_structure_set(stats, kNames[i], G_TYPE_UINT64, refused_[i], nullptr);
    all += refused_[i];
  }
  gst_structure_set(stats, "refused", G_TYPE_UINT64, all, nullptr);
}

}  // namespace lf
