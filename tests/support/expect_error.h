// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

// Expects an lf::Error whose text contains `part`.
#define EXPECT_ERROR(statement, part)                                            \
  EXPECT_THAT([&] { (void)(statement); }, ::testing::ThrowsMessage<::lf::Error>( \
                                              ::testing::HasSubstr(part)))
