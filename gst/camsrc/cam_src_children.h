// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include <gst/gst.h>

#include "camsrc/camera_chain.h"
#include "camsrc/camera_lifecycle.h"
#include "camsrc/camera_stream.h"
#include "camsrc/lfcamsrc.h"

namespace lf {

// The functions below change the states of the children of lfcamsrc, because GstBin would make the pipeline wait
// forever. A child that is a bin with a decoder, such as decodebin, reaches PAUSED asynchronously. A live GstBin
// without preroll forwards the message ASYNC_START of such a child, but not its ASYNC_DONE. No element needs to wait
// for these children, because a sink prerolls with the first frame. Therefore the functions lock the state of these
// children, change it themselves, and drop the asynchronous messages.

// Handler for GstBinClass::element_added: locks the state of a new child if the child is a bin.
void lock_decoder(GstBin* bin, GstElement* child);

// Changes the state of the bin and of its locked children. `chain_up` is the function change_state of the parent class.
// A network source can take long to stop, so a locked child that does not stop within two seconds is removed from the
// bin and continues to stop in the background.
GstStateChangeReturn change_camera_state(GstBin* bin, GstStateChange transition,
                                         GstStateChangeReturn (*chain_up)(GstElement*, GstStateChange));

// Sets all children, or only decoders, to `state`. Returns FAILURE if a child fails, and NO_PREROLL if no child fails
// and at least one child returns NO_PREROLL.
GstStateChangeReturn set_child_states(GstBin* bin, GstState state, bool only_decoders);

// Call from GstBinClass::handle_message. Returns true if it consumed the message, a state message of a locked child.
bool take_decoder_message(GstBin* bin, GstMessage* message);

}  // namespace lf

// The child elements of lfcamsrc while its camera is open, and the settings that they were created with. Children are
// not reused: they change from READY to PAUSED at most once, and are replaced by new children when a failed camera is
// opened again.
struct CamSrcSession {
  lf::CamSrcSettings settings;
  std::shared_ptr<const lf::Rig> rig;  // kept for the next camera with this rig
  lf::Controls controls;
  lf::CameraChain chain;
  std::shared_ptr<lf::CameraStream> stream;
  std::string wanted;  // requested size and rate of a device, as text
  bool used = false;   // the children have been in PAUSED, so their dynamic pads exist
};

struct _LfCamSrc {
  GstBin parent;
  GstPad* src;
  lf::CamSrcSettings* settings;  // guarded by the object lock
  lf::CameraLifecycle* service;
  std::shared_ptr<lf::LoadShedder>* shedder;
  lf::RecordingTap* tap;
  // Hold the state lock of the element to change the following members. Changes of `run`, `name` and `camera` also need
  // the object lock.
  CamSrcSession* run;
  std::atomic<bool> live;  // the camera is live; false while unknown; read by any thread
  GstClockTime end;        // running time of the end of the previous stream
  GstClockTime round;      // duration of one loop of the film, nanoseconds; 0: unknown
  // The number of frames that the earlier streams of this camera have delivered, which count towards num_buffers.
  gint64 frames;
  guint camera;
  std::string* name;
  gint expendable;   // atomic; 1: a loss of the camera is not an error
  guint serial;      // atomic; incremented when the camera is opened, so that steps scheduled earlier are skipped
  GstClockID timer;  // next scheduled step; guarded by the object lock
  // The number of frames that had arrived at the time `active`, including dropped frames, to detect a camera that
  // silently stops.
  guint64 activity;
  guint64 active;  // time when `activity` last changed, lf::now_ns()
};

// An error of a camera: domain and code of a GError, its text, and details for developers.
struct CamSrcFailure {
  GQuark domain = 0;
  gint code = 0;
  std::string text, debug;
};

// Opens the camera: closes it if it is open, and creates its child elements for the current settings, in state NULL. On
// every failure, sets `failure`, and there are no children. The result is false only if the rig cannot be loaded or
// lacks the camera; this is an error even for a camera that may be lost.
bool lf_cam_src_open(LfCamSrc* self, std::unique_ptr<CamSrcFailure>* failure);
// Stops the streaming threads of the children. Call this before the children change to the state READY or are removed
// from the bin.
void lf_cam_src_stop_flow(LfCamSrc* self);
void lf_cam_src_close(LfCamSrc* self);
// Sets the elements behind the decoder (CameraChain::tail) to PAUSED. Call this before the decoders start. The decoders
// are linked only when they start, so GstBin does not know that decoders are upstream of these elements. It could start
// a decoder first, and the first frame would reach an element that is not running.
void lf_cam_src_start_tail(const lf::CameraChain& chain);

// Returns true if the pipeline survives a failure of this camera. The failure is then reported as a lost camera instead
// of an error, and the camera may be opened again later. Defined in lfcamsrc.cc, like the functions below.
bool lf_cam_src_may_be_lost(LfCamSrc* self);
// Reports a failure of the camera: posts the message LF_CAMERA_LOST if lf_cam_src_may_be_lost(), and otherwise an
// error. Thread-safe.
void lf_cam_src_fail(LfCamSrc* self, const CamSrcFailure& failure);
// Shuts a failed camera down, or does nothing if it must not be lost (see lf_cam_src_may_be_lost()). Sends
// LF_CAMERA_LOST downstream. If the camera will be opened again, also closes it and schedules the next attempt. This
// happens in another thread, because the streaming thread that detects the failure cannot stop itself. `serial` is
// LfCamSrc::serial at the time when the camera was opened; the call has no effect if the camera has been opened again
// since then.
void lf_cam_src_shut_down(LfCamSrc* self, guint serial);
void lf_cam_src_post_found(LfCamSrc* self);
void lf_cam_src_warn_overload(LfCamSrc* self, GstClockTimeDiff late);
void lf_cam_src_warn_truncated(LfCamSrc* self, GstClockTime lasted, GstClockTime missing);
