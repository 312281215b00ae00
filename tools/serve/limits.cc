// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/limits.h"

#include <algorithm>
#include <iterator>

namespace lf::serve {

void TokenBucket::fill(int64_t now) {
  if (filled_) tokens_ = std::min(burst_, tokens_ + static_cast<double>(now - filled_) * 1e-6 * per_second_);
  filled_ = now;
}

bool TokenBucket::take(int64_t now, double count) {
  fill(now);
  if (tokens_ < count) return false;
  tokens_ -= count;
  return true;
}

void TokenBucket::set_rate(double per_second, double burst, int64_t now) {
  fill(now);
  per_second_ = per_second;
  burst_ = burst;
  tokens_ = std::min(tokens_, burst);
}

bool TokenBucket::full(int64_t now) {
  fill(now);
  return tokens_ >= burst_;
}

TokenBucket& AddressLimit::bucket(const std::string& address, int64_t now) {
  auto found = entries_.find(address);
  if (found != entries_.end()) {
    order_.splice(order_.end(), order_, found->second.place);
    return found->second.bucket;
  }
  // A full bucket equals a new bucket and can be forgotten.
  while (!order_.empty() && (entries_.size() >= kMaxAddresses || entries_.at(order_.front()).bucket.full(now))) {
    entries_.erase(order_.front());
    order_.pop_front();
  }
  order_.push_back(address);
  return entries_.emplace(address, Entry{TokenBucket(per_second_, burst_), std::prev(order_.end())})
      .first->second.bucket;
}

namespace {

template <typename SeatMap, typename May>
auto oldest(const SeatMap& held, const May& may) {
  auto found = held.end();
  for (auto i = held.begin(); i != held.end(); ++i)
    if (may(i->second) && (found == held.end() || i->second.since < found->second.since)) found = i;
  return found;
}

}  // namespace

// At least two seats for unconnected viewers, because a stereo viewer needs two.
AdmissionControl::AdmissionControl(int seats, int of_address)
    : admission_(seats), of_address_(of_address), unconnected_(std::max(2, seats / 4)) {}

// Selects a viewer that loses its seats: the oldest unconnected one of the address with the most unconnected views.
// Returns end() if that address would have no more of them than `address` with `views` additional views.
AdmissionControl::SeatMap::const_iterator AdmissionControl::largest_user(const SeatMap& held,
                                                                         const std::string& address, int views) const {
  std::map<std::string, int> unconnected;
  for (const auto& [session, seat] : held)
    if (!seat.connected) unconnected[seat.address] += seat.views;
  const int own = unconnected[address] + views;
  const auto most = std::ranges::max_element(unconnected, {}, [](const auto& entry) { return entry.second; });
  if (most->second <= own) return held.end();
  return oldest(held, [&](const Seat& seat) { return !seat.connected && seat.address == most->first; });
}

// Works on a copy, so that no viewer is closed unless there is enough room in the end.
bool AdmissionControl::make_room(const std::string& address, int views, int ahead, int64_t now, Answer& answer) const {
  SeatMap held = held_;
  const auto end = [&](SeatMap::const_iterator seat) {
    if (seat == held.end()) return false;
    answer.leave.push_back(seat->first);
    held.erase(seat);
    return true;
  };
  const auto late = [now](const Seat& seat) { return !seat.connected && now - seat.since > kConnectTimeout; };
  const auto own = [&](const Seat& seat) { return seat.address == address; };
  while (sum(held, own) + views > of_address_)
    if (!end(oldest(held, [&](const Seat& seat) { return own(seat) && late(seat); }))) {
      answer.verdict = Answer::kAddress;
      return false;
    }
  const auto unconnected = [](const Seat& seat) { return !seat.connected; };
  while (sum(held, unconnected) + views > unconnected_)
    if (!end(oldest(held, late)) && !end(largest_user(held, address, views))) return false;
  while (sum(held, [](const Seat&) { return true; }) + ahead + views > admission_)
    if (!end(oldest(held, late))) return false;
  return true;
}

void AdmissionControl::enqueue(const std::string& address, const std::string& new_ticket, int64_t now, Answer& answer) {
  if (std::ranges::count(queue_, address, &QueueEntry::address) >= of_address_) {
    answer.verdict = Answer::kAddress;
  } else if (queue_.size() < kMaxQueued) {
    queue_.push_back({new_ticket, address, now});
    answer.ticket = new_ticket;
    answer.place = queue_.size();
  }
}

AdmissionControl::Answer AdmissionControl::ask(const std::string& address, int views, const std::string& ticket,
                                               const std::string& new_ticket, int64_t now) {
  std::erase_if(queue_, [now](const QueueEntry& waiting) { return now - waiting.shown > kTicketTimeout; });
  const auto shown = ticket.empty() ? queue_.end() : std::ranges::find(queue_, ticket, &QueueEntry::name);
  Answer answer;
  if (make_room(address, views, static_cast<int>(shown - queue_.begin()), now, answer)) {
    answer.verdict = Answer::kAdmitted;
    if (shown != queue_.end()) queue_.erase(shown);
    return answer;
  }
  answer.leave.clear();
  if (answer.verdict == Answer::kAddress) return answer;
  if (shown == queue_.end()) {
    enqueue(address, new_ticket, now, answer);
  } else {
    shown->shown = now;
    answer.ticket = ticket;
    answer.place = static_cast<size_t>(shown - queue_.begin()) + 1;
  }
  return answer;
}

void AdmissionControl::take(const std::string& session, const std::string& address, int views, int64_t now) {
  held_[session] = {address, views, now, false};
}

void AdmissionControl::connected(const std::string& session) {
  if (const auto found = held_.find(session); found != held_.end()) found->second.connected = true;
}

void AdmissionControl::leave(const std::string& session) { held_.erase(session); }

}  // namespace lf::serve
