// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <functional>
#include <ostream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

// Matches a text with a line that contains all facts, in any order. A place in the line states one fact only, and a
// number is a whole one: "4" is not in "14" or "40".
class Mentions {
 public:
  using is_gtest_matcher = void;

  explicit Mentions(std::vector<std::string> facts) : facts_(std::move(facts)) {
    std::ranges::stable_sort(facts_, std::greater(), &std::string::size);
  }

  bool MatchAndExplain(const std::string& text, std::ostream* /*explanation*/) const {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);)
      if (states_all(line)) return true;
    return false;
  }
  void DescribeTo(std::ostream* out) const { *out << "has a line that mentions " << testing::PrintToString(facts_); }
  void DescribeNegationTo(std::ostream* out) const {
    *out << "has no line that mentions " << testing::PrintToString(facts_);
  }

  // For EXPECT_PRED_FORMAT1.
  testing::AssertionResult operator()(const char* expression, const std::string& text) const {
    if (MatchAndExplain(text, nullptr)) return testing::AssertionSuccess();
    return testing::AssertionFailure() << expression << " does not mention " << testing::PrintToString(facts_) << ": "
                                       << text;
  }

 private:
  bool states_all(std::string line) const {
    return std::ranges::all_of(facts_, [&](const std::string& fact) {
      const size_t at = place_of(fact, line);
      if (at != line.npos) line.replace(at, fact.size(), " ");
      return at != line.npos;
    });
  }
  static size_t place_of(const std::string& fact, const std::string& line) {
    const auto is_digit = [&](size_t at) { return line[at] >= '0' && line[at] <= '9'; };
    const auto splits_number = [&](size_t at) {
      return at > 0 && at < line.size() && is_digit(at - 1) && is_digit(at);
    };
    size_t at = line.find(fact);
    while (at != line.npos && (splits_number(at) || splits_number(at + fact.size()))) at = line.find(fact, at + 1);
    return at;
  }

  std::vector<std::string> facts_;
};

template <typename... Facts>
Mentions mentions(const Facts&... facts) {
  return Mentions(std::vector<std::string>{facts...});
}

#define EXPECT_MENTIONS(text, ...) EXPECT_PRED_FORMAT1(mentions(__VA_ARGS__), text)
