// SPDX-License-Identifier: LGPL-2.1-or-later
// main() of tests without GStreamer.
#include <gtest/gtest.h>

#include "support/select_files.h"

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return lf::test::select_files(argc, argv) ? RUN_ALL_TESTS() : 2;
}
