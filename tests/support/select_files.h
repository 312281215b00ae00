// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace lf::test {

// Restricts RUN_ALL_TESTS() to tests from source files that match an argument, a part of a path such as "lib/focus/" or
// "accumulator_test.cc". Without arguments all tests run. Call once, after testing::InitGoogleTest(). Returns false and
// prints a line on stderr for an argument without a match, and for files that conflict with --gtest_filter.
bool select_files(int argc, char** argv);

}  // namespace lf::test
