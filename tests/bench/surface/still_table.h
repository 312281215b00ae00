// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "bench/surface/mean.h"
#include "bench/surface/measure.h"

namespace lf::focus {

// The figures of still views: a table on standard output, a row a view as it comes, and as JSON. What could not be
// measured is "-" there, null here, and not in the means.
class StillTable {
 public:
  // Prints what the columns mean, and their headings.
  StillTable(const Case& c, const Options& options);
  // `options`: with which it was measured.
  void add(const std::string& view, const Options& options, const StillResult& result);
  // A view of which the cameras see nothing.
  void add_unseen(const std::string& view);
  // Prints the means.
  void finish();
  nlohmann::ordered_json json() const;

 private:
  void add(const std::string& view, const std::vector<double>& figures);
  void print(const std::string& view, const std::vector<double>& figures) const;

  int name_width_;
  std::vector<Mean> means_, gain_by_round_;
  std::vector<double> mean_figures_;
  nlohmann::ordered_json views_ = nlohmann::ordered_json::array();
};

}  // namespace lf::focus
