// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/sessions.h"

#include <malloc.h>

#include <algorithm>
#include <cstdio>
#include <random>

#include "serve/process.h"

namespace lf::serve {
namespace {

constexpr guint kTickMs = 250;
constexpr unsigned kTicksPerReport = 4;
constexpr std::chrono::seconds kLongestEnd{5};

std::string random_name() {
  std::random_device random;
  std::string name;
  for (int i = 0; i < 4; i++) {
    char hex[9];
    std::snprintf(hex, sizeof hex, "%08x", random());
    name += hex;
  }
  return name;
}

void add(Viewer::ViewerCounters& sum, const Viewer::ViewerCounters& counters) {
  sum.pictures += counters.pictures;
  sum.incomplete += counters.incomplete;
  sum.answer_bytes += counters.answer_bytes;
  sum.video_bytes += counters.video_bytes;
  sum.surface_bytes += counters.surface_bytes;
  sum.refused_messages += counters.refused_messages;
}

}  // namespace

Sessions::Sessions(LightField& field, const Limits& limits)
    : field_(field), limits_(limits), admission_(limits.viewers, limits.address_views) {
  timer_ = g_timeout_add(
      kTickMs,
      [](gpointer data) -> gboolean {
        static_cast<Sessions*>(data)->tick();
        return G_SOURCE_CONTINUE;
      },
      this);
}

Sessions::~Sessions() {
  g_source_remove(timer_);
  alive_.reset();
  close_all("the server ends");
  if (!teardowns_.wait(kLongestEnd))
    say("pipelines of closed viewers that do not stop: " + std::to_string(teardowns_.size()));
}

void Sessions::close_all(const std::string& why) {
  while (!viewers_.empty()) close(std::string(viewers_.begin()->first), why);
}

double Sessions::max_aperture() const {
  return limits_.max_aperture > 0 ? limits_.max_aperture : field_.array()->size();
}

// Results of the camera monitor for the old rig do not apply to the new rig.
void Sessions::update_rig() {
  monitor_ = {};
  for (const auto& [name, session] : viewers_) session.viewer->update_rig(max_aperture());
}

AdmissionControl::Answer Sessions::ask(const std::string& address, const ViewParams& view_params,
                                       const std::string& ticket) {
  if (teardowns_.size() >= kMaxTeardowns) return {};
  const AdmissionControl::Answer answer =
      admission_.ask(address, view_params.views(), ticket, random_name(), g_get_monotonic_time());
  for (const std::string& name : answer.leave) close(name, "it did not connect; its seat is given to another viewer");
  return answer;
}

std::string Sessions::open(const std::string& address, Offer offer, const ViewParams& view_params, const Route& route,
                           OnAnswer on_answer) {
  const ViewSettings settings{next_view_++, view_params, limits_};
  const std::string name = random_name(), codec = to_string(offer.codec);
  Viewer::Callbacks callbacks;
  callbacks.on_answer = [this, name](const std::string& sdp) {
    const auto found = viewers_.find(name);
    if (found == viewers_.end() || !found->second.on_answer) return;
    const OnAnswer on_answer = std::move(found->second.on_answer);
    found->second.on_answer = nullptr;
    on_answer(sdp, "");
  };
  callbacks.on_connected = [this, name] { admission_.connected(name); };
  callbacks.on_gone = [this, name](const std::string& why) { close_soon(name, why); };
  auto viewer =
      std::make_unique<Viewer>(field_, std::move(offer), settings, max_aperture(), route, std::move(callbacks));
  viewer->shed(load_shedding_);
  viewers_.emplace(name, Session{std::move(viewer), settings.id, std::move(on_answer)});
  admission_.take(name, address, view_params.views(), g_get_monotonic_time());
  opened_++;
  say("view " + std::to_string(settings.id) + " opens: " + (view_params.eye_distance > 0 ? "two of " : "") +
      std::to_string(view_params.width) + "x" + std::to_string(view_params.height) + ", " + codec +
      "; viewers: " + std::to_string(viewers_.size()));
  return name;
}

bool Sessions::close(const std::string& name, const std::string& why) {
  const auto found = viewers_.find(name);
  if (found == viewers_.end()) return false;
  Session session = std::move(found->second);
  viewers_.erase(found);
  admission_.leave(name);
  add(closed_counters_, session.viewer->counters());
  session.viewer->leave();
  teardowns_.add([viewer = std::shared_ptr<Viewer>(std::move(session.viewer))]() mutable {
    viewer.reset();
    malloc_trim(0);  // returns the memory of the viewer, which is megabytes in small blocks, to the system
  });
  say("view " + std::to_string(session.view) + " closes: " + why + "; viewers: " + std::to_string(viewers_.size()));
  if (session.on_answer) session.on_answer("", why);
  return true;
}

void Sessions::close_soon(const std::string& name, const std::string& why) {
  on_main_thread([this, alive = std::weak_ptr(alive_), name, why] {
    if (alive.lock()) close(name, why);
  });
}

void Sessions::tick() {
  const int64_t now = g_get_monotonic_time();
  const bool report = ++ticks_ % kTicksPerReport == 0;
  if (report) shed();
  if (report) watch_nodes();
  if (report) field_.update_camera_states();
  for (auto i = viewers_.begin(); i != viewers_.end();) {
    const auto& [name, session] = *i++;
    if (session.viewer->silence(now) > (session.viewer->connected() ? Limits::kSilence : Limits::kConnect))
      close(std::string(name), session.viewer->connected() ? "no packets from the browser" : "it does not connect");
    else if (report)
      session.viewer->tick(busy_);
  }
  if (report && limits_.monitor > 0) watch_cameras();
}

// The load is judged over all viewers, because they share the processors.
void Sessions::shed() {
  busy_ = load_.update();
  double kept = 0;
  int connected = 0;
  for (const auto& [name, session] : viewers_)
    if (session.viewer->connected()) {
      kept += session.viewer->kept();
      connected++;
    }
  if (!load_shedding_.update(busy_, connected > 0 ? kept / connected : 1)) return;
  for (const auto& [name, session] : viewers_) session.viewer->shed(load_shedding_);
}

// Runs the camera monitor in one viewer only. When this viewer leaves, its results stay until another viewer has
// checked all cameras.
void Sessions::watch_cameras() {
  const auto watching = viewers_.find(watching_);
  if (watching == viewers_.end()) {
    const auto next =
        std::ranges::find_if(viewers_, [](const auto& entry) { return entry.second.viewer->connected(); });
    if (next == viewers_.end()) return;
    watching_ = next->first;
    next->second.viewer->set_monitor_interval(limits_.monitor);
    return;
  }
  MonitorReport report = watching->second.viewer->monitor();
  if (report.turns >= std::min<uint64_t>(monitor_.turns, report.cameras.size())) monitor_ = std::move(report);
}

// Logs a silent host once, and again when it answers. Without viewers there are no requests, so silence means nothing.
void Sessions::watch_nodes() {
  const std::vector<size_t> silent = field_.silent_nodes();
  const auto tell = [this](const std::vector<size_t>& some, const std::vector<size_t>& others, const char* what) {
    for (const size_t node : some)
      if (!std::ranges::binary_search(others, node)) say("cameras: " + field_.node_name(node) + what);
  };
  tell(silent, silent_nodes_, " does not answer");
  if (!viewers_.empty()) tell(silent_nodes_, silent, " answers again");
  silent_nodes_ = silent;
}

Viewer::ViewerCounters Sessions::counters() const {
  Viewer::ViewerCounters sum = closed_counters_;
  for (const auto& [name, session] : viewers_) add(sum, session.viewer->counters());
  return sum;
}

}  // namespace lf::serve
