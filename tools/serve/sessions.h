// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "light_field.h"
#include "limits.h"
#include "viewer.h"

namespace lf::serve {

// All viewers, each under a name that can't be guessed. On the main thread alone.
class Sessions {
 public:
  // The answer's SDP, or "" and why there is none.
  using OnAnswer = std::function<void(const std::string& sdp, const std::string& problem)>;

  // `address`: the only one to be reached at, or "".
  Sessions(LightField& field, const Limits& limits, std::string address);
  ~Sessions();

  // Whether there is no place for this one. Two eyes are two views.
  bool full(const Wish& wish) const { return views_ + wish.views() > limits_.viewers; }
  size_t size() const { return viewers_.size(); }
  // Returns the session's name; `on_answer` is called once, later. Throws Error.
  std::string open(Offer offer, const Wish& wish, OnAnswer on_answer);
  // False if there is none. Not inside of a viewer's callback.
  bool close(const std::string& name, const std::string& why);

  void close_all(const std::string& why);

  // What is known of the cameras, from whichever viewer watches them.
  const MonitorReport& monitor() const { return monitor_; }
  uint64_t opened() const { return opened_; }
  // Over all viewers, those gone included.
  Viewer::Figures figures() const;

 private:
  struct Session {
    std::unique_ptr<Viewer> viewer;
    uint32_t view;
    int views;
    OnAnswer on_answer;  // until it was called
  };
  void close_soon(const std::string& name, const std::string& why);
  void tick();
  void watch_cameras();

  LightField& field_;
  Limits limits_;
  std::string address_;
  std::map<std::string, Session> viewers_;
  Viewer::Figures gone_;
  std::string watching_;  // the viewer whose requests the cameras are watched by
  MonitorReport monitor_;
  uint32_t next_view_ = 1;
  int views_ = 0;  // now
  uint64_t opened_ = 0;
  guint timer_ = 0;
  unsigned ticks_ = 0;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace lf::serve
