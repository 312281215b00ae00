// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/text.h"
#include "support/mentions.h"

inline std::string text_of_error(const std::function<void()>& action) {
  try {
    action();
  } catch (const lf::Error& e) {
    return e.what();
  }
  return "no lf::Error was thrown";
}

// A row of a table: an invalid text and the facts that its error mentions.
struct InvalidText {
  std::string text;
  std::vector<std::string> facts;
};

// Expects an lf::Error with a text that mentions these facts. gmock's ThrowsMessage compiles several times as slowly.
#define EXPECT_ERROR(statement, ...) EXPECT_MENTIONS(text_of_error([&] { (void)(statement); }), __VA_ARGS__)
