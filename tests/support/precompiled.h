// SPDX-License-Identifier: LGPL-2.1-or-later
// Headers of other projects that most tests include: see lib/base/precompiled.h.
#ifndef LF_SUPPORT_PRECOMPILED_H
#define LF_SUPPORT_PRECOMPILED_H

#include <condition_variable>
#include <fstream>
#include <random>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/precompiled.h"

#endif
