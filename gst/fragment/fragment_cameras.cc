// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <optional>
#include <vector>

#include "common/common.h"
#include "fragment/lffragment_private.h"

std::vector<lf::PadPtr> lf_fragment_camera_pads(LfFragment* self) {
  std::vector<lf::PadPtr> pads;
  const lf::ObjectLock lock(self);
  for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next)
    if (LF_IS_FRAGMENT_PAD(item->data)) pads.emplace_back(GST_PAD(gst_object_ref(item->data)));
  return pads;
}

static lf::CameraInput& input_of(const lf::PadPtr& pad) { return *LF_FRAGMENT_PAD(pad.get())->input; }

// The mode is `mode` from now on, if it is `before` now or that is not given.
static void change_mode(LfFragment* self, std::optional<lf::CameraFrames::Mode> before, lf::CameraFrames::Mode mode) {
  const bool running = mode == lf::CameraFrames::Mode::kRunning;
  lf::CameraInputs& inputs = self->state->node.inputs();
  lf::ObjectLock lock(self);
  if (before && self->state->mode != *before) return;
  self->state->mode = mode;
  for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next) {
    if (!LF_IS_FRAGMENT_PAD(item->data)) continue;
    const auto& frames = LF_FRAGMENT_PAD(item->data)->input->frames();
    frames->set_mode(mode);
    if (running) inputs.add(frames);
  }
  lock.unlock();
  inputs.set_running(running);
}

void lf_fragment_set_mode(LfFragment* self, lf::CameraFrames::Mode mode) { change_mode(self, std::nullopt, mode); }

void lf_fragment_change_mode(LfFragment* self, lf::CameraFrames::Mode before, lf::CameraFrames::Mode mode) {
  change_mode(self, before, mode);
}

uint64_t lf_fragment_needed_delay(LfFragment* self, uint64_t now) {
  uint64_t needed = 0;
  for (const lf::PadPtr& pad : lf_fragment_camera_pads(self))
    needed = std::max(needed, input_of(pad).needed_delay(now));
  return needed;
}

// Where to seek a camera for frames of `time`: a little before it, because a decoder may stamp the first frame behind a
// seek with where it was sought, and before the last frame, because that stands for all times after it.
static gint64 seek_position(const lf::PadPtr& pad, uint64_t time) {
  const auto camera = input_of(pad).camera();
  const gint64 offset = camera ? static_cast<gint64>(camera->time_offset * GST_SECOND) : 0;
  const gint64 before = GST_SECOND + 2 * static_cast<gint64>(input_of(pad).frames()->period());
  gint64 position = static_cast<gint64>(time) - offset, duration = 0;
  if (gst_pad_peer_query_duration(pad.get(), GST_FORMAT_TIME, &duration) && duration > 0)
    position = MIN(position, duration);
  return MAX(position - before, 0);
}

void lf_fragment_seek_cameras(LfFragment* self, uint64_t time, guint32 seqnum) {
  const std::lock_guard seeking(self->state->seeking);
  if (!self->state->sought.is_new(seqnum)) return;
  std::vector<lf::PadPtr> pads = lf_fragment_camera_pads(self);
  std::erase_if(pads, [](const lf::PadPtr& pad) { return input_of(pad).is_live(); });
  lf_fragment_change_mode(self, lf::CameraFrames::Mode::kFinished, lf::CameraFrames::Mode::kRunning);
  for (const lf::PadPtr& pad : pads) {
    const gint64 position = seek_position(pad, time);
    GST_DEBUG_OBJECT(pad.get(), "seeking to %" GST_TIME_FORMAT, GST_TIME_ARGS(position));
    GstEvent* seek = gst_event_new_seek(1, GST_FORMAT_TIME, GstSeekFlags(GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE),
                                        GST_SEEK_TYPE_SET, position, GST_SEEK_TYPE_NONE, -1);
    gst_event_set_seqnum(seek, seqnum);
    if (!gst_pad_push_event(pad.get(), seek))
      GST_ELEMENT_WARNING(self, RESOURCE, SEEK,
                          ("Pad %s: its camera can't be sought; it shows what it has.", GST_PAD_NAME(pad.get())),
                          (nullptr));
  }
}

void lf_fragment_note_context(LfFragment* self, GstGLContext* context) {
  const lf::ObjectLock lock(self);
  lf::WeakGlContext& latest = self->state->frames_context;
  if (latest.get().get() != context) latest = context ? lf::WeakGlContext(context) : lf::WeakGlContext();
}
