// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "base/text.h"

inline std::string text_of_error(const std::function<void()>& action) {
  try {
    action();
  } catch (const lf::Error& e) {
    return e.what();
  }
  return "no lf::Error was thrown";
}

// Expects an lf::Error with a text that contains `part`. gmock's ThrowsMessage compiles several times as slowly.
#define EXPECT_ERROR(statement, part) \
  EXPECT_PRED_FORMAT2(::testing::IsSubstring, std::string(part), text_of_error([&] { (void)(statement); }))
