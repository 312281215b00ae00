// SPDX-License-Identifier: LGPL-2.1-or-later
#include "solver_log.h"

#include <glog/logging.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lf::test {
namespace {

TEST(SolverLog, KeepsWhatTheSolverSaysFromStderr) {
  catch_solver_messages();
  testing::internal::CaptureStderr();
  for (int i = 0; i < 3; i++) LOG(WARNING) << "Linear solver failure";
  LOG(ERROR) << "Residual is not finite";
  google::FlushLogFiles(google::GLOG_INFO);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_THAT(solver_messages(),
              testing::UnorderedElementsAre("Linear solver failure (3 times)", "Residual is not finite"));
}

}  // namespace
}  // namespace lf::test
