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
#include "fragment/lffragment.h"
#include "fragment/requester.h"
#include "node/answer_encoder.h"
#include "node/card.h"
#include "wire/fragment_codec.h"

namespace lf {

// lffragment's properties, but for the limits of its RequestGuard.
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
    lf::Card card;
    std::shared_ptr<lf::WorkerPool> workers = lf::WorkerPool::shared();
    std::mutex seeking;   // held while cameras are sought
    lf::SeekOnce sought;  // the latest seek that the cameras followed

    // Under the object lock.
    lf::FragmentSettings settings;
    std::set<lf::Requester*> requesters;
    lf::CameraFrames::Mode mode = lf::CameraFrames::Mode::kStopped;  // mode of all cameras
    gint64 trimmed_at = 0;                                           // monotonic time, microseconds
    guint next_camera_pad = 0, next_pair = 0;  // numbers of the next camera pad and of the next pair of pads
    uint32_t next_requester = 0;
    lf::WeakGlContext frames_context;  // of the latest frame that may stay on a card
  } * state;
};

// A copy of the properties, as they are now.
lf::FragmentSettings lf_fragment_settings(LfFragment* self);
// Frames come where no requests do any more: memory of answers is given back.
void lf_fragment_trim_memory(LfFragment* self);
