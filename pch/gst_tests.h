// SPDX-License-Identifier: LGPL-2.1-or-later
// What most tests with GStreamer include, compiled once for all of a program. Each file still includes what it uses.
#ifndef LF_PCH_GST_TESTS_H
#define LF_PCH_GST_TESTS_H

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gst/check/gstharness.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/vec.h"

#endif  // LF_PCH_GST_TESTS_H
