// SPDX-License-Identifier: LGPL-2.1-or-later
// What most files of gst/ include, compiled once for all of them. Each file still includes what it uses.
#ifndef LF_PCH_PLUGIN_H
#define LF_PCH_PLUGIN_H

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <gst/base/gstaggregator.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include "base/vec.h"

#endif  // LF_PCH_PLUGIN_H
