// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/request_guard.h"

#include <cmath>
#include <iterator>
#include <numeric>
#include <type_traits>
#include <utility>

#include "base/schedule.h"
#include "base/text.h"
#include "common/common.h"
#include "common/properties.h"
#include "view/view.h"
#include "wire/request_codec.h"

namespace lf {

namespace {

struct LimitRow {
  const char* name;
  double least, most;
  // must not contain colons and brackets, because docs/reference/elements.md is generated from the blurb
  const char *unit, *what;
};

template <typename Limits, typename Visit>
void for_each_limit(Limits& limits, const Visit& visit) {
  visit(LimitRow{"max-pixels", 1, double{kMaxImageSize} * kMaxImageSize, "pixels",
                 "width times height of a view; all views of a set, such as a stereo pair, may together have four "
                 "times as many"},
        limits.pixels);
  visit(LimitRow{"max-aperture", 0, Blending::kMaxAperture, "metres",
                 "diameter of the synthetic aperture; larger apertures use more cameras per pixel and cost more time; "
                 "0 = diameter of the array, if known"},
        limits.aperture);
  visit(
      LimitRow{
          "max-hypotheses", 0, kMaxHypotheses, "surfaces",
          "number of depth hypotheses in one request, which are the depths that the cameras test to find the focus"},
      limits.hypotheses);
  visit(LimitRow{"max-requests-per-second", 0, G_MAXUINT, "requests a second",
                 "rate of the live requests of one view; 0 = unlimited"},
        limits.requests_per_second);
  visit(LimitRow{"max-views", 1, 65536, "views",
                 "number of concurrent views; further views are refused until another view has been silent for two "
                 "seconds"},
        limits.views);
}

GType type_of(uint64_t) { return G_TYPE_UINT64; }
GType type_of(double) { return G_TYPE_DOUBLE; }
GType type_of(unsigned) { return G_TYPE_UINT; }

template <typename Field>
bool set_limit(const LimitRow& row, const GValue* value, Field& field) {
  GValue number = G_VALUE_INIT;
  g_value_init(&number, G_TYPE_DOUBLE);
  if (!g_value_transform(value, &number)) return false;
  const double given = g_value_get_double(&number);
  if (!(given >= row.least && given <= row.most)) return false;
  if (!std::is_same_v<Field, double> && given != std::floor(given)) return false;
  field = static_cast<Field>(given);
  return true;
}

std::string description() {
  std::string text =
      "Upper limits for the requests of other hosts and viewers, which protect this machine from overload. The value "
      "is a structure, for example limits,max-pixels=4000000. Missing fields have their default values. The `stats` "
      "property counts refused requests. The element refuses requests that exceed one of these limits";
  const char* separator = ": ";
  const RequestLimits limits;
  for_each_limit(limits, [&](const LimitRow& row, auto) {
    text += format_text("%s%s (%s, %.10g to %.10g: %s)", separator, row.name, row.unit, row.least, row.most, row.what);
    separator = ", ";
  });
  return text;
}

}  // namespace

GstStructure* limits_structure(const RequestLimits& limits) {
  GstStructure* structure = gst_structure_new_empty("limits");
  for_each_limit(limits, [structure](const LimitRow& row, auto field) {
    gst_structure_set(structure, row.name, type_of(field), field, nullptr);
  });
  return structure;
}

RequestLimits parse_limits(const GstStructure* structure, std::vector<std::string>& problems) {
  RequestLimits limits;
  for (int i = 0; structure && i < gst_structure_n_fields(structure); i++) {
    const std::string name = gst_structure_nth_field_name(structure, static_cast<guint>(i));
    const GValue* value = gst_structure_get_value(structure, name.c_str());
    std::string problem = name +
                          ": there is no such limit. The limits are max-pixels, max-aperture, max-hypotheses, "
                          "max-requests-per-second and max-views";
    for_each_limit(limits, [&](const LimitRow& row, auto& field) {
      if (name != row.name) return;
      problem.clear();
      if (set_limit(row, value, field)) return;
      g_autofree gchar* given = gst_value_serialize(value);
      problem = format_text("%s: must be a %snumber of %.10g to %.10g, not %s", row.name,
                            std::is_same_v<decltype(field), double&> ? "" : "whole ", row.least, row.most,
                            given ? given : G_VALUE_TYPE_NAME(value));
    });
    if (!problem.empty()) problems.push_back(problem);
  }
  return limits;
}

void RequestGuard::install(GObjectClass* klass) {
  static const std::string kDescription = description();
  g_object_class_install_property(
      klass, kLimits, g_param_spec_boxed("limits", "Limits", kDescription.c_str(), GST_TYPE_STRUCTURE, kWhilePlaying));
}

bool RequestGuard::set(GstElement* element, guint id, const GValue* value) {
  if (id != kLimits) return false;
  std::vector<std::string> problems;
  const RequestLimits limits = parse_limits(gst_value_get_structure(value), problems);
  std::unique_lock lock(mutex_);
  limits_ = limits;
  problems_ = std::move(problems);
  lock.unlock();
  if (is_running(element)) warn_of_problems(element);
  return true;
}

bool RequestGuard::get(guint id, GValue* value) const {
  if (id != kLimits) return false;
  const std::lock_guard lock(mutex_);
  g_value_take_boxed(value, limits_structure(limits_));
  return true;
}

void RequestGuard::warn_of_problems(GstElement* element) const {
  std::unique_lock lock(mutex_);
  const std::vector<std::string> problems = problems_;
  lock.unlock();
  for (const std::string& problem : problems)
    GST_ELEMENT_WARNING(element, RESOURCE, SETTINGS, ("limits: %s; this value is ignored", problem.c_str()), (nullptr));
}

bool RequestGuard::admits(GstElement* element, std::span<const uint8_t> request, double extent, bool paced,
                          uint32_t client) {
  const std::optional<wire::RequestPeek> peek = wire::peek_request(request);
  if (!peek) return true;
  const RequestCost cost = wire::peek_request_cost(request);
  std::unique_lock lock(mutex_);
  RequestLimits limits = limits_;
  if (!paced) limits.requests_per_second = 0;
  const uint64_t now = now_ns();
  const RequestLimiter::Refusal refusal =
      gate_.check(uint64_t{client} << 32 | peek->head.view_id, cost, limits, extent, now);
  if (refusal == RequestLimiter::kNone) return true;
  if (const std::optional<uint64_t> refused = refuse(refusal, now, std::move(lock)))
    GST_ELEMENT_WARNING(element, RESOURCE, SETTINGS,
                        ("View %u %s: its request is refused (%" G_GUINT64_FORMAT " refused so far).",
                         peek->head.view_id, refusal_text(refusal, cost, limits, extent).c_str(), *refused),
                        (nullptr));
  return false;
}

std::optional<uint64_t> RequestGuard::refuse(RequestLimiter::Refusal refusal, uint64_t now,
                                             [[maybe_unused]] std::unique_lock<std::mutex> lock) {
  refused_[refusal]++;
  if (!log_limit_.try_acquire(now)) return std::nullopt;
  return std::accumulate(std::begin(refused_), std::end(refused_), uint64_t{0});
}

void RequestGuard::forget(uint32_t client) {
  const std::lock_guard lock(mutex_);
  gate_.forget_if([client](uint64_t view) { return view >> 32 == client; });
}

bool RequestGuard::admits_answer(GstElement* element, int width, int height) {
  std::unique_lock lock(mutex_);
  const RequestLimits limits = limits_;
  const uint64_t pixels = static_cast<uint64_t>(width) * static_cast<uint64_t>(height);
  if (pixels <= limits.pixels) return true;
  if (const std::optional<uint64_t> refused = refuse(RequestLimiter::kPixels, now_ns(), std::move(lock)))
    GST_ELEMENT_WARNING(element, RESOURCE, SETTINGS,
                        ("An answer of %dx%d pixels exceeds the limit max-pixels (%" G_GUINT64_FORMAT
                         "), so it is refused (%" G_GUINT64_FORMAT " refused so far).",
                         width, height, limits.pixels, *refused),
                        (nullptr));
  return false;
}

void RequestGuard::start(GstElement* element) {
  std::unique_lock lock(mutex_);
  gate_.clear();
  std::fill(std::begin(refused_), std::end(refused_), 0);
  lock.unlock();
  warn_of_problems(element);
}

uint64_t RequestGuard::refused() const {
  const std::lock_guard lock(mutex_);
  return std::accumulate(std::begin(refused_), std::end(refused_), uint64_t{0});
}

void RequestGuard::add_stats(GstStructure* stats) const {
  const std::lock_guard lock(mutex_);
  constexpr const char* kNames[] = {"refused-pixels", "refused-aperture", "refused-hypotheses",
                                    "refused-rate",   "refused-views",    "refused-lens"};
  static_assert(std::size(kNames) == RequestLimiter::kNumRefusals);
  uint64_t all = 0;
  for (size_t i = 0; i < std::size(kNames); i++) {
    gst_structure_set(stats, kNames[i], G_TYPE_UINT64, refused_[i], nullptr);
    all += refused_[i];
  }
  gst_structure_set(stats, "refused", G_TYPE_UINT64, all, nullptr);
}

}  // namespace lf
