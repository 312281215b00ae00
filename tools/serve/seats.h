// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

namespace lf::serve {

// Decides who may watch, and who is next. A seat is a view: who has two eyes takes two. Each address has at most so
// many, and those that have not connected yet have a quarter of all together: where it is used up the address with most
// of it gives, and who has not connected after kPatience gives first. Where there is no seat there is a queue, each
// place with a ticket that is shown again and again. Plain arithmetic without clock or locks; times are
// g_get_monotonic_time(), microseconds.
class Seats {
 public:
  static constexpr int64_t kPatience = 2000000;   // microseconds until one that does not connect holds no seat
  static constexpr int64_t kForgotten = 3000000;  // microseconds until a ticket that is not shown is forgotten
  static constexpr size_t kMostWaiting = 64;

  Seats(int seats, int of_address);

  struct Answer {
    enum Verdict { kSeat, kAddress, kFull } verdict = kFull;
    std::vector<std::string> leave;  // kSeat: the sessions whose seats it gets, to be ended at once
    std::string ticket;              // kFull: "" where the queue is full, too
    size_t place = 0;                // kFull: 1 is next; 0: none
  };
  // Whether `views` of `address` get seats now, or their place in the queue. `ticket`: as it was answered before, or
  // ""; `new_ticket`: one that nobody can guess, given out where it is needed.
  Answer ask(const std::string& address, int views, const std::string& ticket, const std::string& new_ticket,
             int64_t now);
  // Takes the seats. Call after ask() has answered kSeat, and when those who had to leave have. `session`: the viewer's
  // name.
  void take(const std::string& session, const std::string& address, int views, int64_t now);
  void connected(const std::string& session);
  void leave(const std::string& session);

  int taken() const {
    return sum(held_, [](const Seat&) { return true; });
  }
  int of_address() const { return of_address_; }
  size_t waiting() const { return queue_.size(); }

 private:
  struct Seat {
    std::string address;
    int views;
    int64_t since;
    bool connected;
  };
  struct Ticket {
    std::string name, address;
    int64_t shown;
  };
  using Held = std::map<std::string, Seat>;  // by the session's name

  template <typename Counts>
  static int sum(const Held& held, const Counts& counts) {
    int views = 0;
    for (const auto& [session, seat] : held) views += counts(seat) ? seat.views : 0;
    return views;
  }
  Held::const_iterator greediest(const Held& held, const std::string& address, int views) const;
  bool make_room(const std::string& address, int views, int ahead, int64_t now, Answer& answer) const;
  void queue_up(const std::string& address, const std::string& new_ticket, int64_t now, Answer& answer);

  const int seats_, of_address_, unconnected_;
  Held held_;
  std::deque<Ticket> queue_;
};

}  // namespace lf::serve
