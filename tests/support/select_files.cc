// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/select_files.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

namespace lf::test {
namespace {

// Returns a filter for the selected tests of a suite: the whole suite if all tests are selected.
std::string filter_of(const testing::TestSuite& suite, const std::vector<std::string>& parts,
                      std::vector<bool>& matched) {
  const std::string name = suite.name();
  std::string some;
  bool all = true;
  for (int i = 0; i < suite.total_test_count(); i++) {
    const testing::TestInfo& test = *suite.GetTestInfo(i);
    const std::string file = test.file();
    bool selected = false;
    for (size_t p = 0; p < parts.size(); p++) {
      if (file.find(parts[p]) == std::string::npos) continue;
      selected = matched[p] = true;
    }
    if (selected) some += name + "." + test.name() + ":";
    all = all && selected;
  }
  return all ? name + ".*:" : some;
}

}  // namespace

bool select_files(int argc, char** argv) {
  const std::vector<std::string> parts(argv + 1, argv + argc);
  if (parts.empty()) return true;
  if (GTEST_FLAG_GET(filter) != "*") {
    std::fprintf(stderr, "%s: files or --gtest_filter, not both\n", argv[0]);
    return false;
  }
  std::vector<bool> matched(parts.size());
  std::string filter;
  const testing::UnitTest& tests = *testing::UnitTest::GetInstance();
  for (int i = 0; i < tests.total_test_suite_count(); i++) filter += filter_of(*tests.GetTestSuite(i), parts, matched);
  const auto missing = std::find(matched.begin(), matched.end(), false);
  if (missing != matched.end()) {
    std::fprintf(stderr, "%s: no test is in %s\n", argv[0], parts[missing - matched.begin()].c_str());
    return false;
  }
  GTEST_FLAG_SET(filter, filter);
  return true;
}

}  // namespace lf::test
