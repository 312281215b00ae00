// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

#include "common/access.h"
#include "common/properties.h"
#include "node/answer_form.h"
#include "node/card.h"
#include "wire/strips.h"

namespace lf {

// lffragment's properties, but for those of RequestGuard.
struct FragmentSettings {
  std::string rig;
  guint node = 0;
  CodecChoice codec = CodecChoice::kAuto;
  guint threads = 0;
  guint64 max_skew = 500 * GST_MSECOND;
  gint strip_pixels = wire::kStripPixels;
  bool post_messages = false;
  Access access = Access::kSelf;
  Resampling resampling = Resampling::kSharpened;
  guint64 max_delay = 500 * GST_MSECOND;
  RendererChoice renderer = RendererChoice::kCpu;

  static PropertyTable<FragmentSettings>& properties();
};

}  // namespace lf
