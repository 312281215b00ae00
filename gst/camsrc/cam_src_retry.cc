// SPDX-License-Identifier: LGPL-2.1-or-later
//
// A camera that fails where that is no error: it is closed, and opened again after a while, on threads of their own, as
// neither may be done by the threads that streamed. Each of these steps has the element's state to itself; those that
// were planned before the element was stopped, or opened anew, are void.
#include <algorithm>
#include <atomic>
#include <utility>

#include "base/number_text.h"
#include "base/schedule.h"
#include "camsrc/camera_controls.h"
#include "camsrc/camera_states.h"
#include "camsrc/lfcamsrc_private.h"
#include "common/common.h"
#include "rig/location_text.h"

GST_DEBUG_CATEGORY_EXTERN(lf_cam_src_debug);
#undef GST_CAT_DEFAULT  // of another file that is compiled in one with this
#define GST_CAT_DEFAULT lf_cam_src_debug

using State = lf::CameraService::State;

static GstStructure* lf_cam_src_structure(LfCamSrc* self, const char* name) {
  GST_OBJECT_LOCK(self);
  GstStructure* structure =
      gst_structure_new(name, "camera", G_TYPE_UINT, self->camera, "name", G_TYPE_STRING, self->name->c_str(), nullptr);
  GST_OBJECT_UNLOCK(self);
  return structure;
}

static void lf_cam_src_post_structure(LfCamSrc* self, GstStructure* structure) {
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), structure));
}

static bool lf_cam_src_retries(LfCamSrc* self) {
  GST_OBJECT_LOCK(self);
  const bool retry = self->settings->retry;
  GST_OBJECT_UNLOCK(self);
  return retry && (self->live || !g_atomic_int_get(&self->expendable));
}

void lf_cam_src_set_expendable(LfCamSrc* self) { g_atomic_int_set(&self->expendable, TRUE); }

void lf_cam_src_add_controls(LfCamSrc* self, GstStructure* stats) {
  lf::ObjectLock lock(self);
  GstElement* device = self->run ? self->run->chain.device : nullptr;
  if (device) gst_object_ref(device);
  const lf::Controls wanted = self->run ? self->run->controls : lf::Controls{};
  lock.unlock();
  GstStructure* controls = device ? lf::read_controls(device, wanted) : gst_structure_new_empty("lightfield-controls");
  GstStructure* values =
      device ? lf::read_control_values(device, wanted) : gst_structure_new_empty("lightfield-controls");
  if (!device)
    for (const auto& [name, value] : wanted) gst_structure_set(controls, name.c_str(), G_TYPE_BOOLEAN, FALSE, nullptr);
  gst_structure_set(stats, "controls", GST_TYPE_STRUCTURE, controls, "control-values", GST_TYPE_STRUCTURE, values,
                    nullptr);
  gst_structure_free(controls);
  gst_structure_free(values);
  if (device) gst_object_unref(device);
}

GstStructure* lf_cam_src_stats(LfCamSrc* self, const char* name) {
  const lf::CameraService::Report report = self->service->report();
  lf::ObjectLock lock(self);
  const std::shared_ptr<lf::SenderClock> sender = self->run ? self->run->chain.sender : nullptr;
  const bool is_arrival = self->run && self->run->stream->stamps_arrivals();
  const guint64 damaged = self->run ? self->run->chain.damaged->load() : 0;
  lock.unlock();
  const char* capture_time = is_arrival ? "arrival" : "source";
  if (sender) capture_time = sender->is_known() ? "sender-reports" : "arrival";
  return gst_structure_new(name, "state", G_TYPE_STRING, lf::to_string(report.state), "reason", G_TYPE_STRING,
                           report.reason.c_str(), "losses", G_TYPE_UINT64, report.losses, "retries", G_TYPE_UINT64,
                           report.retries, "dropped", G_TYPE_UINT64, (*self->shedder)->dropped(), "damaged",
                           G_TYPE_UINT64, damaged, "capture-time", G_TYPE_STRING, capture_time, nullptr);
}

const lf::CameraService& lf_cam_src_service(LfCamSrc* self) { return *self->service; }

bool lf_cam_src_is_lost_for_good(LfCamSrc* self) {
  return self->service->state() == State::kLost && !lf_cam_src_retries(self);
}

bool lf_cam_src_may_be_lost(LfCamSrc* self) {
  GST_OBJECT_LOCK(self);
  const bool retry = self->settings->retry;
  GST_OBJECT_UNLOCK(self);
  return retry || g_atomic_int_get(&self->expendable);
}

void lf_cam_src_post(LfCamSrc* self, GstMessageType type, const CamSrcFailure& failure, const char* more) {
  const std::string text = lf::location_text(failure.text) + more, debug = lf::location_text(failure.debug);
  gst_element_message_full(GST_ELEMENT(self), type, failure.domain, failure.code, g_strdup(text.c_str()),
                           debug.empty() ? nullptr : g_strdup(debug.c_str()), __FILE__, GST_FUNCTION, __LINE__);
}

void lf_cam_src_fail(LfCamSrc* self, const CamSrcFailure& failure) {
  if (!lf_cam_src_may_be_lost(self)) return lf_cam_src_post(self, GST_MESSAGE_ERROR, failure);
  const std::string reason = lf::location_text(failure.text);
  if (!self->service->lose(reason, lf::now_ns())) {
    GST_INFO_OBJECT(self, "not back: %s", reason.c_str());
    return;
  }
  GstStructure* lost = lf_cam_src_structure(self, LF_CAMERA_LOST);
  gst_structure_set(lost, "reason", G_TYPE_STRING, reason.c_str(), nullptr);
  lf_cam_src_post_structure(self, lost);
  lf_cam_src_post(self, GST_MESSAGE_WARNING, failure,
                  lf_cam_src_retries(self) ? ": out of service until it is back" : ": out of service from now on");
}

void lf_cam_src_tell_found(LfCamSrc* self) {
  GST_INFO_OBJECT(self, "back again");
  lf_cam_src_post_structure(self, lf_cam_src_structure(self, LF_CAMERA_FOUND));
}

// Of all cameras of the process one for a while.
void lf_cam_src_tell_overload(LfCamSrc* self, GstClockTimeDiff late) {
  constexpr uint64_t kQuiet = 10'000'000'000;
  static std::atomic<uint64_t> told = 0;
  const uint64_t now = lf::now_ns(), before = told.exchange(now);
  if (before != 0 && now - before < kQuiet) return;
  lf::ObjectLock lock(self);
  const std::string place = self->run ? self->run->stream->place() : "";
  lock.unlock();
  GST_ELEMENT_WARNING(
      self, STREAM, DECODE,
      ("%s: this machine can't decode all frames, they come %d ms late: some are dropped before they are "
       "decoded, up to the next key frame that can be on time",
       place.c_str(), static_cast<int>(late / GST_MSECOND)),
      ("further ones, of other cameras, too, are counted in stats"));
}

void lf_cam_src_tell_cut_off(LfCamSrc* self, GstClockTime lasted, GstClockTime missing) {
  const auto seconds = [](GstClockTime time) {
    return lf::format_text("%.2f", static_cast<double>(time) / GST_SECOND);
  };
  lf::ObjectLock lock(self);
  const std::string place = self->run ? self->run->stream->place() : "";
  lock.unlock();
  GST_ELEMENT_WARNING(
      self, STREAM, DECODE,
      ("%s: is cut off: it ends after %s of %s s. %s, each time it loops", place.c_str(), seconds(lasted).c_str(),
       seconds(lasted + missing).c_str(),
       self->live ? "It gives nothing for the rest" : "For the rest its picture that is nearest in time stands"),
      (nullptr));
}

void lf_cam_src_push_lost(LfCamSrc* self) {
  gst_pad_push_event(self->src,
                     gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, gst_structure_new_empty(LF_CAMERA_LOST)));
}

// Whether nothing has been opened or stopped since `serial`.
static bool lf_cam_src_is_due(LfCamSrc* self, guint serial) {
  return static_cast<guint>(g_atomic_int_get(&self->serial)) == serial && GST_STATE(self) >= GST_STATE_PAUSED &&
         GST_STATE_TARGET(self) >= GST_STATE_PAUSED;
}

// Calls `step` with the state lock, on a thread of its own, if it is still due then.
static void lf_cam_src_call_step(LfCamSrc* self, guint serial, void (*step)(LfCamSrc*)) {
  struct Call {
    guint serial;
    void (*step)(LfCamSrc*);
  };
  gst_element_call_async(
      GST_ELEMENT(self),
      [](GstElement* element, gpointer data) {
        const auto* call = static_cast<Call*>(data);
        GST_STATE_LOCK(element);
        lf::guarded(element, 0, [=] {
          if (lf_cam_src_is_due(LF_CAM_SRC(element), call->serial)) call->step(LF_CAM_SRC(element));
          return 0;
        });
        GST_STATE_UNLOCK(element);
      },
      new Call{serial, step}, [](gpointer data) { delete static_cast<Call*>(data); });
}

// The same after `delay`, in place of what is planned.
static void lf_cam_src_call_later(LfCamSrc* self, GstClockTime delay, void (*step)(LfCamSrc*)) {
  struct Plan {
    GWeakRef element;
    guint serial;
    void (*step)(LfCamSrc*);
  };
  auto* plan = new Plan{{}, static_cast<guint>(g_atomic_int_get(&self->serial)), step};
  g_weak_ref_init(&plan->element, self);
  GstClock* clock = gst_system_clock_obtain();
  GstClockID timer = gst_clock_new_single_shot_id(clock, gst_clock_get_time(clock) + delay);
  gst_clock_id_wait_async(
      timer,
      [](GstClock*, GstClockTime, GstClockID, gpointer data) -> gboolean {
        auto* due = static_cast<Plan*>(data);
        if (gpointer element = g_weak_ref_get(&due->element)) {
          lf::guarded(element, 0, [=] { return lf_cam_src_call_step(LF_CAM_SRC(element), due->serial, due->step), 0; });
          gst_object_unref(element);
        }
        return TRUE;
      },
      plan,
      [](gpointer data) {
        g_weak_ref_clear(&static_cast<Plan*>(data)->element);
        delete static_cast<Plan*>(data);
      });
  gst_object_unref(clock);
  GST_OBJECT_LOCK(self);
  GstClockID before = std::exchange(self->timer, timer);
  GST_OBJECT_UNLOCK(self);
  if (!before) return;
  gst_clock_id_unschedule(before);
  gst_clock_id_unref(before);
}

static void lf_cam_src_close_lost(LfCamSrc* self) {
  lf_cam_src_close(self);
  lf_cam_src_push_lost(self);  // again: a frame may have been on its way
  lf_cam_src_schedule_retry(self);
}

// Downstream is told without the state lock, as a file's frames may be waiting there for requests; but after a change
// of state that is under way.
void lf_cam_src_take_out(LfCamSrc* self, guint serial) {
  if (!lf_cam_src_may_be_lost(self)) return;
  gst_element_call_async(
      GST_ELEMENT(self),
      [](GstElement* element, gpointer data) {
        LfCamSrc* cam_src = LF_CAM_SRC(element);
        GST_STATE_LOCK(element);
        const bool is_due = lf_cam_src_is_due(cam_src, GPOINTER_TO_UINT(data));
        GST_STATE_UNLOCK(element);
        if (!is_due) return;
        lf_cam_src_push_lost(cam_src);
        // Without another attempt the children stay as they are: frames on their way still arrive.
        lf::guarded(element, 0, [=] {
          if (lf_cam_src_retries(cam_src)) lf_cam_src_call_step(cam_src, GPOINTER_TO_UINT(data), lf_cam_src_close_lost);
          return 0;
        });
      },
      GUINT_TO_POINTER(serial), nullptr);
}

// Cables can be pulled so that nobody says a word.
static void lf_cam_src_look_for_frames(LfCamSrc* self) {
  if (!self->run || self->service->state() == State::kEnded) return;
  constexpr uint64_t kLongestGap = 5'000'000'000, kLongestStart = 20'000'000'000;
  const uint64_t now = lf::now_ns(), frames = self->run->stream->frames_seen();
  const uint64_t activity = frames + (*self->shedder)->dropped();
  const GstClockTime time = gst_element_get_current_running_time(GST_ELEMENT(self));
  const bool is_waiting = GST_CLOCK_TIME_IS_VALID(time) && time < self->run->stream->due();
  if (GST_STATE(self) != GST_STATE_PLAYING || activity != self->activity || is_waiting) {
    self->activity = activity;
    self->active = now;
  }
  const uint64_t longest = frames > 0 ? std::max<uint64_t>(kLongestGap, 5 * lf_cam_src_period(self)) : kLongestStart;
  if (now - self->active < longest) return lf_cam_src_call_later(self, GST_SECOND, lf_cam_src_look_for_frames);
  if (!self->run->stream->first_error()) return;  // that has been told
  lf_cam_src_fail(
      self,
      {GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_READ,
       self->run->stream->place() + ": no frame for " + std::to_string((now - self->active) / GST_SECOND) + " s", ""});
  lf_cam_src_take_out(self, static_cast<guint>(g_atomic_int_get(&self->serial)));
}

void lf_cam_src_watch(LfCamSrc* self) {
  // Alone, its downstream may stop it for as long as it likes.
  if (!self->live || !self->run || !g_atomic_int_get(&self->expendable)) return;
  self->active = lf::now_ns();
  lf_cam_src_call_later(self, GST_SECOND, lf_cam_src_look_for_frames);
}

static void lf_cam_src_try_again(LfCamSrc* self) {
  if (self->service->state() != State::kLost || self->run) return;
  self->service->retry();
  GST_INFO_OBJECT(self, "trying again");
  std::unique_ptr<CamSrcFailure> failure;
  lf_cam_src_open(self, &failure);
  if (failure) {
    lf_cam_src_fail(self, *failure);
    return lf_cam_src_schedule_retry(self);
  }
  GstBin* bin = GST_BIN(self);
  self->run->used = true;
  lf_cam_src_start_tail(self->run->chain);
  GstStateChangeReturn result = lf::pause_new_children(bin);
  if (result == GST_STATE_CHANGE_NO_PREROLL) {
    self->live = true;
    self->run->stream->set_live();
  }
  if (result != GST_STATE_CHANGE_FAILURE && GST_STATE_TARGET(self) == GST_STATE_PLAYING)
    result = lf::play_new_children(bin);
  if (result == GST_STATE_CHANGE_FAILURE) return lf_cam_src_fail_to_start(self);
  lf_cam_src_watch(self);
}

void lf_cam_src_fail_to_start(LfCamSrc* self) {
  if (self->run->stream->first_error())
    lf_cam_src_fail(
        self, {GST_CORE_ERROR, GST_CORE_ERROR_STATE_CHANGE, self->run->stream->place() + ": can't be started", ""});
  g_atomic_int_inc(&self->serial);  // its errors have been told
  lf_cam_src_close(self);
  if (GST_STATE(self) >= GST_STATE_PAUSED) lf_cam_src_push_lost(self);
  lf_cam_src_schedule_retry(self);
}

void lf_cam_src_schedule_retry(LfCamSrc* self) {
  if (lf_cam_src_retries(self)) lf_cam_src_call_later(self, self->service->wait(lf::now_ns()), lf_cam_src_try_again);
}

void lf_cam_src_cancel_plans(LfCamSrc* self) {
  g_atomic_int_inc(&self->serial);
  GST_OBJECT_LOCK(self);
  GstClockID before = std::exchange(self->timer, nullptr);
  GST_OBJECT_UNLOCK(self);
  if (!before) return;
  gst_clock_id_unschedule(before);
  gst_clock_id_unref(before);
}

// Not in this thread, which may be anyone's; and in no later run than this one.
void lf_cam_src_end_lost(LfCamSrc* self) {
  lf_cam_src_cancel_plans(self);
  lf_cam_src_call_step(self, static_cast<guint>(g_atomic_int_get(&self->serial)),
                       [](LfCamSrc* camera) { gst_pad_push_event(camera->src, gst_event_new_eos()); });
}
