// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "serve/adaptation.h"
#include "serve/flight.h"
#include "serve/light_field.h"
#include "serve/limits.h"
#include "serve/process.h"
#include "serve/viewer.h"

namespace lf::serve {

// Creates, finds and closes the viewers of lf-serve. Each viewer has a session with an unguessable name, because the
// name is sufficient to close the session. Main thread only.
class Sessions {
 public:
  // Receives the SDP answer, or an empty text and the reason for the failure.
  using OnAnswer = std::function<void(const std::string& sdp, const std::string& problem)>;

  Sessions(LightField& field, const Limits& limits);
  ~Sessions();

  size_t size() const { return viewers_.size(); }
  size_t flights() const { return flights_.size(); }
  size_t watchers() const;
  // Viewers of shared flights do not take the seats of other viewers.
  const AdmissionControl& seats(const ViewParams& view_params) const {
    return view_params.is_shared() ? watching_seats_ : seats_;
  }
  AdmissionControl::Answer ask(const std::string& address, const ViewParams& view_params, const std::string& ticket);
  // Opens a viewer after ask() has returned kAdmitted, and returns the name of its session. `on_answer` is called once,
  // later. Throws Error.
  std::string open(const std::string& address, Offer offer, const ViewParams& view_params, const Route& route,
                   OnAnswer on_answer);
  bool has(const std::string& name) const { return viewers_.contains(name); }
  // Closes a session. Returns false if no session has this name. Must not be called inside a callback of a viewer.
  bool close(const std::string& name, const std::string& why);

  void close_all(const std::string& why);
  void update_rig();

  const MonitorReport& monitor() const { return monitor_; }
  const LoadShedding& load_shedding() const { return load_shedding_; }
  uint64_t opened() const { return opened_; }
  // Includes viewers that have left.
  ViewerCounters counters() const;

 private:
  // Maximum number of closed viewers with pipelines that have not stopped yet. If it is reached, new viewers get no
  // seat.
  static constexpr size_t kMaxTeardowns = 32;

  using FlightKey = std::pair<std::string, VideoCodec>;  // camera path
  struct Session {
    std::unique_ptr<BrowserStream> stream;
    Viewer* viewer;    // null if the stream is a watcher; borrowed from `stream`
    Watcher* watcher;  // null if the stream is a viewer; borrowed from `stream`
    FlightKey flight;  // of a watcher
    uint32_t view;
    OnAnswer on_answer;  // null after the call
  };
  AdmissionControl& seats_for(const ViewParams& view_params) {
    return view_params.is_shared() ? watching_seats_ : seats_;
  }
  std::shared_ptr<Flight> flight(const FlightKey& key, const ViewParams& view_params);
  void end_flight(const FlightKey& key);
  double max_aperture() const;
  void close_soon(const std::string& name, const std::string& why);
  void tick();
  void end_failed_flights();
  void tick_flights();
  void watch_cameras();
  void watch_nodes();
  void shed();

  LightField& field_;
  Limits limits_;
  AdmissionControl seats_, watching_seats_;
  Teardowns teardowns_;
  std::map<std::string, Session> viewers_;
  std::map<FlightKey, std::shared_ptr<Flight>> flights_;
  ViewerCounters closed_counters_;
  uint32_t monitoring_view_ = 0;  // the view that runs the camera monitor
  MonitorReport monitor_;
  std::vector<size_t> silent_nodes_;
  ProcessorLoad load_;
  LoadShedding load_shedding_;
  double busy_ = 0;
  uint32_t next_view_ = 1;
  uint64_t opened_ = 0;
  guint timer_ = 0;
  unsigned ticks_ = 0;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace lf::serve
