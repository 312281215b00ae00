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
#include "common/properties.h"

namespace lf {

struct CamSrcSettings {
  std::string rig;
  guint camera = 0;
  int fps_n = 0, fps_d = 1;
  bool is_live = false;
  bool loop = false;
  gint64 num_frames = -1;
  bool decode = true;
  guint64 latency = 200 * GST_MSECOND;
  bool retry = false;
  bool trusted = false;
  bool operator==(const CamSrcSettings&) const = default;

  static PropertyTable<CamSrcSettings>& properties();
};

// Changes the states of the children of lfcamsrc, instead of GstBin. The reason is that a bin with a decoder reaches
// PAUSED asynchronously. A live GstBin without preroll forwards the ASYNC_START of such a child but not its ASYNC_DONE,
// so the pipeline would wait forever. Nothing needs to wait for these children, because a sink prerolls with the first
// frame. Therefore their state is locked and changed here, and their async messages are dropped.

// Handler for GstBinClass::element_added: locks the state of a new child if the child is a bin.
void lock_decoder(GstBin* bin, GstElement* child);

// Changes the state of the bin and of its locked children. `chain_up` is change_state of the parent class. A locked
// child that does not stop within two seconds is removed from the bin and stops in the background.
GstStateChangeReturn change_camera_state(GstBin* bin, GstStateChange transition,
                                         GstStateChangeReturn (*chain_up)(GstElement*, GstStateChange));

// Sets new children of a bin in PAUSED or PLAYING to PAUSED, downstream elements first. See change_camera_state() for
// the next step.
GstStateChangeReturn pause_new_children(GstBin* bin);
GstStateChangeReturn play_new_children(GstBin* bin);

// Call from GstBinClass::handle_message. Returns true if it consumed the message, a state message of a locked child.
bool take_decoder_message(GstBin* bin, GstMessage* message);

}  // namespace lf

// The child elements of lfcamsrc while one camera is open, and the settings that they were created for. They change
// from READY to PAUSED at most once; a camera that fails gets new children.
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
  // Take the state lock before changing the following members. `run`, `name` and `camera` also need the object lock.
  CamSrcSession* run;
  std::atomic<bool> live;  // the camera is live, as far as known yet; read by any thread
  GstClockTime end;        // running time of the end of the previous stream
  GstClockTime round;      // duration of one loop of the film, nanoseconds; 0: unknown
  gint64 frames;
  guint camera;
  std::string* name;
  gint expendable;   // atomic; 1: a loss of the camera is not an error
  guint serial;      // atomic; incremented when the camera is opened, so that steps scheduled earlier are skipped
  GstClockID timer;  // next scheduled step; guarded by the object lock
  guint64 activity;
  guint64 active;  // time when `activity` last changed, lf::now_ns()
};

struct CamSrcFailure {
  GQuark domain = 0;
  gint code = 0;
  std::string text, debug;
};

// Creates the children for the current settings, in state NULL. Every failure sets `failure`. Returns false only if the
// rig cannot be loaded or lacks the camera.
bool lf_cam_src_open(LfCamSrc* self, std::unique_ptr<CamSrcFailure>* failure);
// Stops the data flow between the children. The bin calls this before its children go to the state READY or are
// removed.
void lf_cam_src_stop_flow(LfCamSrc* self);
void lf_cam_src_close(LfCamSrc* self);
// Starts the last elements of the chain. Call it before the decoders start: GstBin starts elements that are not linked
// yet in any order, so the first frame of a decoder could reach an element that is not running.
void lf_cam_src_start_tail(const lf::CameraChain& chain);

// Returns true if an error of this camera counts as a loss of the camera, which the pipeline survives, instead of an
// error. Defined in lfcamsrc.cc, like the next two functions.
bool lf_cam_src_may_be_lost(LfCamSrc* self);
// Reports a failure. Posts an error, or the messages about a lost camera if the pipeline survives the loss.
// Thread-safe.
void lf_cam_src_fail(LfCamSrc* self, const CamSrcFailure& failure);
// For stream listeners: closes the failed camera asynchronously and schedules a retry.
void lf_cam_src_shut_down(LfCamSrc* self, guint serial);
void lf_cam_src_post_found(LfCamSrc* self);
void lf_cam_src_warn_overload(LfCamSrc* self, GstClockTimeDiff late);
void lf_cam_src_warn_truncated(LfCamSrc* self, GstClockTime lasted, GstClockTime missing);
