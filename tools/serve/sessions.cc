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

// A proxy finds the replica by the beginning of the name.
std::string random_name(const std::string& replica) {
  std::random_device random;
  std::string name = replica.empty() ? "" : replica + "-";
  for (int i = 0; i < 4; i++) {
    char hex[9];
    std::snprintf(hex, sizeof hex, "%08x", random());
    name += hex;
  }
  return name;
}

}  // namespace

Sessions::Sessions(LightField& field, const Limits& limits)
    : field_(field),
      limits_(limits),
      seats_(limits.viewers, limits.address_views),
      watching_seats_(limits.watchers, limits.address_views) {
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
  for (const auto& [key, flight] : flights_) flight->update_rig();
  for (const auto& [name, session] : viewers_) {
    if (session.viewer) session.viewer->update_rig(max_aperture());
    if (session.watcher) session.watcher->notify_of_rig();
  }
}

AdmissionControl::Answer Sessions::ask(const std::string& address, const ViewParams& view_params,
                                       const std::string& ticket) {
  if (teardowns_.size() >= kMaxTeardowns) return {};
  const AdmissionControl::Answer answer =
      seats_for(view_params)
          .ask(address, view_params.views(), ticket, random_name(limits_.replica), g_get_monotonic_time());
  for (const std::string& name : answer.leave) close(name, "it did not connect; its seat is given to another viewer");
  return answer;
}

// A new watcher must not join a flight that has already failed.
std::shared_ptr<Flight> Sessions::flight(const FlightKey& key, const ViewParams& view_params) {
  end_failed_flights();
  std::shared_ptr<Flight>& flight = flights_[key];
  if (flight) return flight;
  try {
    flight = std::make_shared<Flight>(field_, key.second, ViewSettings{next_view_++, view_params, limits_});
  } catch (const Error&) {
    flights_.erase(key);
    throw;
  }
  flight->shed(load_shedding_);
  return flight;
}

// Ends a flight without watchers.
void Sessions::end_flight(const FlightKey& key) {
  const auto found = flights_.find(key);
  const auto watches = [&key](const auto& entry) { return entry.second.watcher && entry.second.flight == key; };
  if (found == flights_.end() || std::ranges::any_of(viewers_, watches)) return;
  closed_counters_ += found->second->counters();
  teardowns_.add([flight = std::move(found->second)]() mutable { flight.reset(); });
  flights_.erase(found);
}

std::string Sessions::open(const std::string& address, Offer offer, const ViewParams& view_params, const Route& route,
                           OnAnswer on_answer) {
  const std::string name = random_name(limits_.replica), codec = to_string(offer.codec);
  BrowserStream::Callbacks callbacks;
  callbacks.on_answer = [this, name](const std::string& sdp) {
    const auto found = viewers_.find(name);
    if (found == viewers_.end() || !found->second.on_answer) return;
    const OnAnswer on_answer = std::move(found->second.on_answer);
    found->second.on_answer = nullptr;
    on_answer(sdp, "");
  };
  AdmissionControl& seats = seats_for(view_params);
  callbacks.on_connected = [&seats, name] { seats.connected(name); };
  callbacks.on_gone = [this, name](const std::string& why) { close_soon(name, why); };
  Session session{.view = next_view_++, .on_answer = std::move(on_answer)};
  if (view_params.is_shared()) {
    session.flight = {view_params.path, offer.codec};
    std::shared_ptr<Flight> flight = this->flight(session.flight, view_params);
    try {
      auto watcher = std::make_unique<Watcher>(field_, std::move(offer), flight, route, std::move(callbacks));
      session.watcher = watcher.get();
      session.stream = std::move(watcher);
    } catch (const Error&) {
      end_flight(session.flight);
      throw;
    }
  } else {
    auto viewer = std::make_unique<Viewer>(field_, std::move(offer), ViewSettings{session.view, view_params, limits_},
                                           max_aperture(), route, std::move(callbacks));
    viewer->shed(load_shedding_);
    session.viewer = viewer.get();
    session.stream = std::move(viewer);
  }
  const bool is_shared = session.watcher;
  const uint32_t view = session.view;
  viewers_.emplace(name, std::move(session));
  seats.take(name, address, view_params.views(), g_get_monotonic_time());
  opened_++;
  say("view " + std::to_string(view) + " opens: " + (view_params.eye_distance > 0 ? "two of " : "") +
      std::to_string(view_params.width) + "x" + std::to_string(view_params.height) + ", " + codec +
      (is_shared ? ", shared" : "") + "; viewers: " + std::to_string(viewers_.size()));
  return name;
}

bool Sessions::close(const std::string& name, const std::string& why) {
  const auto found = viewers_.find(name);
  if (found == viewers_.end()) return false;
  Session session = std::move(found->second);
  viewers_.erase(found);
  (session.watcher ? watching_seats_ : seats_).leave(name);
  closed_counters_ += session.stream->counters();
  session.stream->leave();
  if (session.watcher) end_flight(session.flight);
  teardowns_.add([stream = std::shared_ptr<BrowserStream>(std::move(session.stream))]() mutable {
    stream.reset();
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
  if (report) tick_flights();
  for (auto i = viewers_.begin(); i != viewers_.end();) {
    const auto& [name, session] = *i++;
    const bool is_connected = session.stream->connected();
    if (session.stream->silence(now) > (is_connected ? Limits::kSilence : Limits::kConnect))
      close(std::string(name), is_connected ? "no packets from the browser" : "it does not connect");
    else if (report)
      session.stream->tick(busy_);
  }
  if (report && limits_.monitor > 0) watch_cameras();
}

// Closes the sessions of all watchers of failed flights. Closing the last session ends the flight.
void Sessions::end_failed_flights() {
  std::vector<std::pair<std::string, std::string>> failed;  // session, problem
  for (const auto& [name, session] : viewers_) {
    if (!session.watcher) continue;
    const std::string& problem = flights_.at(session.flight)->problem();
    if (!problem.empty()) failed.emplace_back(name, problem);
  }
  for (const auto& [name, problem] : failed) close(name, problem);
}

void Sessions::tick_flights() {
  end_failed_flights();
  for (const auto& [key, flight] : flights_) flight->tick();
}

// The load is judged over all viewers, because they share the processors.
void Sessions::shed() {
  busy_ = load_.update();
  double kept = 0;
  int connected = 0;
  for (const auto& [name, session] : viewers_)
    if (session.viewer && session.viewer->connected()) {
      kept += session.viewer->kept();
      connected++;
    }
  for (const auto& [key, flight] : flights_) {
    kept += flight->kept();
    connected++;
  }
  if (!load_shedding_.update(busy_, connected > 0 ? kept / connected : 1)) return;
  for (const auto& [key, flight] : flights_) flight->shed(load_shedding_);
  for (const auto& [name, session] : viewers_)
    if (session.viewer) session.viewer->shed(load_shedding_);
}

// Runs the camera monitor in one view only. When this view ends, its results stay until another view has checked all
// cameras.
void Sessions::watch_cameras() {
  std::vector<ViewerPipeline*> views;
  for (const auto& [name, session] : viewers_)
    if (session.viewer && session.viewer->connected()) views.push_back(&session.viewer->view_pipeline());
  for (const auto& [key, flight] : flights_) views.push_back(&flight->view_pipeline());
  if (views.empty()) return;
  const auto found = std::ranges::find(views, monitoring_view_, &ViewerPipeline::id);
  if (found == views.end()) {
    monitoring_view_ = views.front()->id();
    views.front()->set_monitor_interval(limits_.monitor);
    return;
  }
  MonitorReport report = (*found)->monitor();
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

size_t Sessions::watchers() const {
  return static_cast<size_t>(std::ranges::count_if(viewers_, [](const auto& entry) { return entry.second.watcher; }));
}

ViewerCounters Sessions::counters() const {
  ViewerCounters sum = closed_counters_;
  for (const auto& [key, flight] : flights_) sum += flight->counters();
  for (const auto& [name, session] : viewers_) sum += session.stream->counters();
  return sum;
}

}  // namespace lf::serve
