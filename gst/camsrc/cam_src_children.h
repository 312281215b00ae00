// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include <gst/gst.h>

#include "camsrc/camera_chain.h"
#include "camsrc/camera_service.h"
#include "camsrc/camera_stream.h"
#include "camsrc/lfcamsrc.h"
#include "common/properties.h"

namespace lf {

// lfcamsrc's properties.
struct CamSrcSettings {
  std::string rig;
  guint camera = 0;  // id
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

// The states of lfcamsrc's children, some of which are bins that decode: these come to PAUSED by and by (ASYNC). A
// GstBin that has come to PAUSED without preroll, as a live one does, tells its parent of the beginning of that and not
// of its end, and the pipeline waits for ever. Nobody needs to wait for them: a sink prerolls with the frame it gets.
// So the bin does not know: their state is locked and is changed here, and their messages about it end here.

// Locks the state of a child that decodes: the function for GstBinClass::element_added.
void lock_decoder(GstBin* bin, GstElement* child);

// Changes the states of the bin and of its locked children, in place of the parent class's change_state, which
// `chain_up` is. A locked child that does not stop within two seconds is taken out of the bin, and goes on stopping by
// itself.
GstStateChangeReturn change_camera_state(GstBin* bin, GstStateChange transition,
                                         GstStateChangeReturn (*chain_up)(GstElement*, GstStateChange));

// Starts children that have just been put into the bin, which is in PAUSED or PLAYING: to PAUSED; who takes starts
// first. As change_camera_state().
GstStateChangeReturn pause_new_children(GstBin* bin);
// Takes children that pause_new_children() has started from PAUSED to PLAYING.
GstStateChangeReturn play_new_children(GstBin* bin);

// Takes a locked child's message about its state, in GstBinClass::handle_message: true if the message ends here,
// unreferenced.
bool take_decoder_message(GstBin* bin, GstMessage* message);

}  // namespace lf

// The children of lfcamsrc, from one opening of the camera to the next: they go from READY through PAUSED at most once.
struct CamSrcRun {
  lf::CamSrcSettings settings;
  std::shared_ptr<const lf::Rig> rig;  // kept, so that the next camera finds it read already
  lf::Controls controls;               // controls that the device is to have
  lf::CameraChain chain;
  std::shared_ptr<lf::CameraStream> stream;
  std::string wanted;  // the size and rate that a device is asked for, in words
  bool used = false;   // the children have been in PAUSED: pads that come by and by have come
};

struct _LfCamSrc {
  GstBin parent;
  GstPad* src;
  lf::CamSrcSettings* settings;  // under the object lock
  lf::CameraService* service;
  std::shared_ptr<lf::CameraShedder>* shedder;
  lf::CameraKeeper* keeper;  // set before it starts
  // What follows changes under the state lock alone; `run`, `name` and `camera` under the object lock, too.
  CamSrcRun* run;          // null while there are no children
  std::atomic<bool> live;  // whether the camera is live, as far as is known; read by any thread
  GstClockTime end;        // running time of the end of the stream before
  GstClockTime round;      // how long a round of a film that loops has been found to be; 0: not known
  gint64 frames;           // frames of the streams before
  guint camera;            // id of the camera last opened
  std::string* name;
  gint expendable;   // atomic; 1: the camera's loss is no error
  guint serial;      // atomic; another number with each opening: what was planned for an earlier one is void
  GstClockID timer;  // when the next attempt or look is due; under the object lock
  guint64 activity;  // frames seen by the watch
  guint64 active;    // when `activity` last grew, lf::now_ns()
};

// Why a camera is of no use.
struct CamSrcFailure {
  GQuark domain = 0;
  gint code = 0;
  std::string text, debug;
};

// Children for the current settings, in state NULL; without them `failure` says why. False where no camera is at fault:
// the rig can't be read, or does not have it.
bool lf_cam_src_open(LfCamSrc* self, std::unique_ptr<CamSrcFailure>* failure);
// Ends what flows between the children, as far as it has to end before they change state.
void lf_cam_src_stop_flow(LfCamSrc* self);
// Stops and removes the children.
void lf_cam_src_close(LfCamSrc* self);
// Starts the elements that decoders are linked with by and by: GstBin would start what is not linked yet in any order,
// and a decoder's first frame would find closed doors.
void lf_cam_src_start_tail(const lf::CameraChain& chain);

// lfcamsrc.cc: what becomes of a camera that fails. Whether an error is a loss.
bool lf_cam_src_may_be_lost(LfCamSrc* self);
// Posts an error, or that the camera is lost. Any thread.
void lf_cam_src_fail(LfCamSrc* self, const CamSrcFailure& failure);
// For a stream's listener: closes the camera that has failed, after a while, and opens it again.
void lf_cam_src_take_out(LfCamSrc* self, guint serial);
void lf_cam_src_tell_found(LfCamSrc* self);
void lf_cam_src_tell_overload(LfCamSrc* self, GstClockTimeDiff late);
void lf_cam_src_tell_cut_off(LfCamSrc* self, GstClockTime lasted, GstClockTime missing);
