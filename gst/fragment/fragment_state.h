// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "base/worker_pool.h"
#include "common/custom_events.h"
#include "common/gl_share.h"
#include "common/properties.h"
#include "common/request_guard.h"
#include "fragment/client.h"
#include "fragment/lffragment.h"
#include "node/answer_encoder.h"
#include "node/renderer_selector.h"
#include "wire/fragment_codec.h"

namespace lf {

// The properties of lffragment, except for `limits`, which is part of its RequestGuard.
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

struct _LfFragment {
  GstElement parent;
  struct State {
    // Any thread.
    lf::RequestGuard guard;
    lf::Node node;
    lf::RendererSelector gpu;
    std::shared_ptr<lf::WorkerPool> workers = lf::WorkerPool::shared();
    std::mutex seeking;  // held while seeking the cameras
    lf::SeekFilter seek_filter;

    // Guarded by the object lock.
    lf::FragmentSettings settings;
    std::set<lf::Client*> clients;
    lf::CameraFrames::Mode mode = lf::CameraFrames::Mode::kStopped;
    gint64 trimmed_at = 0;  // monotonic time, microseconds
    guint next_camera_pad = 0, next_pair = 0;
    uint32_t next_requester = 0;
    lf::WeakGlContext frames_context;
  } * state;
};

lf::FragmentSettings lf_fragment_settings(LfFragment* self);
// Frees answer memory that has not been used for a while. Camera frames trigger the call, because requests may have
// stopped.
void lf_fragment_trim_memory(LfFragment* self);
