// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace lf::test {

// Narrows what RUN_ALL_TESTS() runs to the tests of the source files that the program's arguments name: each is a part
// of a path, such as "lib/focus/" or "accumulator_test.cc". Without arguments all tests stay. To be called once, after
// testing::InitGoogleTest(). Returns false, after a line on standard error, for an argument that no test's file
// matches, and for files beside a --gtest_filter of other tests.
bool select_files(int argc, char** argv);

}  // namespace lf::test
