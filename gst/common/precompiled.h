// SPDX-License-Identifier: LGPL-2.1-or-later
// Headers of other projects that most elements include: see lib/base/precompiled.h.
#ifndef LF_COMMON_PRECOMPILED_H
#define LF_COMMON_PRECOMPILED_H

#include <condition_variable>

#include <gst/base/base.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include "base/precompiled.h"

#endif
