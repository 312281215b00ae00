// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "camsrc/cam_src_settings.h"
#include "camsrc/camera_chain.h"
#include "camsrc/camera_service.h"
#include "camsrc/camera_stream.h"
#include "camsrc/lfcamsrc.h"

// What the files of lfcamsrc share: lfcamsrc.cc (the element), cam_src_open.cc (its children) and cam_src_retry.cc
// (what becomes of a camera that fails).

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
// Puts into `stats` what the camera's controls are, which asks its device: not for every frame.
void lf_cam_src_add_controls(LfCamSrc* self, GstStructure* stats);
// Ends what flows between the children, as far as it has to end before they change state.
void lf_cam_src_stop_flow(LfCamSrc* self);
// Stops and removes the children.
void lf_cam_src_close(LfCamSrc* self);
// Starts the elements that decoders are linked with by and by: GstBin would start what is not linked yet in any order,
// and a decoder's first frame would find closed doors.
void lf_cam_src_start_tail(const lf::CameraChain& chain);

void lf_cam_src_post(LfCamSrc* self, GstMessageType type, const CamSrcFailure& failure, const char* more = "");

// Whether an error is a loss.
bool lf_cam_src_may_be_lost(LfCamSrc* self);
// Posts an error, or that the camera is lost. Any thread.
void lf_cam_src_fail(LfCamSrc* self, const CamSrcFailure& failure);
// As lf_cam_src_fail(), where the children have refused to start: they are removed, too.
void lf_cam_src_fail_to_start(LfCamSrc* self);
// For a stream's listener: closes the camera that has failed, after a while, and opens it again.
void lf_cam_src_take_out(LfCamSrc* self, guint serial);
void lf_cam_src_tell_found(LfCamSrc* self);
void lf_cam_src_tell_overload(LfCamSrc* self, GstClockTimeDiff late);
void lf_cam_src_tell_cut_off(LfCamSrc* self, GstClockTime lasted, GstClockTime missing);
// Tells downstream that no frame comes, by the event LF_CAMERA_LOST.
void lf_cam_src_push_lost(LfCamSrc* self);
// Plans the next attempt, if there is one to be.
void lf_cam_src_schedule_retry(LfCamSrc* self);
// Has a live camera of a node watched for frames that fail to come.
void lf_cam_src_watch(LfCamSrc* self);
// Cancels the attempts and looks that are planned.
void lf_cam_src_cancel_plans(LfCamSrc* self);
// A lost camera is not waited for any more: its stream ends. With the state lock.
void lf_cam_src_end_lost(LfCamSrc* self);
// Nanoseconds between frames, by the rate in the source pad's caps.
GstClockTime lf_cam_src_period(LfCamSrc* self);
