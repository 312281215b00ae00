// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "serve/adaptation.h"
#include "serve/light_field.h"
#include "serve/limits.h"
#include "serve/process.h"
#include "serve/viewer.h"

namespace lf::serve {

// All viewers, each under a name that can't be guessed. On the main thread alone.
class Sessions {
 public:
  // The answer's SDP, or "" and why there is none.
  using OnAnswer = std::function<void(const std::string& sdp, const std::string& problem)>;

  Sessions(LightField& field, const Limits& limits);
  ~Sessions();

  size_t size() const { return viewers_.size(); }
  const Seats& seats() const { return seats_; }
  // Whether `wish` of this address gets its seats now; `ticket` as Seats has it.
  Seats::Answer ask(const std::string& address, const Wish& wish, const std::string& ticket);
  // After ask() has answered kSeat: returns the session's name; `on_answer` is called once, later. Throws Error.
  std::string open(const std::string& address, Offer offer, const Wish& wish, Route route, OnAnswer on_answer);
  // Closes a session; false if there is none of this name. Not to be called inside of a viewer's callback.
  bool close(const std::string& name, const std::string& why);

  void close_all(const std::string& why);
  // The light field has another rig.
  void take_rig();

  // What is known of the cameras, from whichever viewer watches them.
  const MonitorReport& monitor() const { return monitor_; }
  const Shedding& shedding() const { return shedding_; }
  uint64_t opened() const { return opened_; }
  // Totals over all viewers, those gone included.
  Viewer::Figures figures() const;

 private:
  // At this number of closed viewers whose pipelines still run, new viewers get no seat.
  static constexpr size_t kMostDepartures = 32;

  struct Session {
    std::unique_ptr<Viewer> viewer;
    uint32_t view;
    OnAnswer on_answer;  // null once it was called
  };
  double max_aperture() const;
  void close_soon(const std::string& name, const std::string& why);
  void tick();
  void watch_cameras();
  void watch_nodes();
  void shed();

  LightField& field_;
  Limits limits_;
  Seats seats_;
  Departures departures_;  // of closed viewers
  std::map<std::string, Session> viewers_;
  Viewer::Figures gone_;
  std::string watching_;  // the viewer whose requests the cameras are watched by
  MonitorReport monitor_;
  std::vector<size_t> silent_nodes_;  // silent nodes that the log has named
  ProcessorLoad load_;
  Shedding shedding_;
  double busy_ = 0;
  uint32_t next_view_ = 1;
  uint64_t opened_ = 0;
  guint timer_ = 0;
  unsigned ticks_ = 0;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace lf::serve
