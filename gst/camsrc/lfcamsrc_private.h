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

// One use of the children, from READY through PAUSED at most once.
struct CamSrcRun {
  lf::CamSrcSettings settings;
  std::shared_ptr<const lf::Rig> rig;  // kept, so that the next camera finds it read already
  lf::Controls controls;               // that it is to have
  lf::CameraChain chain;
  std::shared_ptr<lf::CameraStream> stream;
  std::string wanted;  // of a device, in words
  bool used = false;   // has been in PAUSED: pads that come by and by have come
};

struct _LfCamSrc {
  GstBin parent;
  GstPad* src;
  lf::CamSrcSettings* settings;  // under the object lock
  lf::CameraService* service;
  std::shared_ptr<lf::CameraShedder>* shedder;
  // What follows changes under the state lock alone; `run`, `name` and `camera` under the object lock, too.
  CamSrcRun* run;          // null while there are no children
  std::atomic<bool> live;  // the camera is, as far as is known; read by any thread
  GstClockTime end;        // running time of the end of the stream before
  guint camera;            // id of the camera last opened
  std::string* name;
  gint expendable;   // its loss is no error; atomic
  guint serial;      // atomic; another one with each opening: what was planned before is void
  GstClockID timer;  // of the next attempt or look; under the object lock
  guint64 activity;  // frames seen by the watch
  guint64 active;    // when there was another one, lf::now_ns()
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
// The same where the children have refused to start; they go.
void lf_cam_src_fail_to_start(LfCamSrc* self);
// For a stream's listener: closes the camera that has failed, after a while, and opens it again.
void lf_cam_src_take_out(LfCamSrc* self, guint serial);
void lf_cam_src_tell_found(LfCamSrc* self);
void lf_cam_src_tell_overload(LfCamSrc* self, GstClockTimeDiff late);
// Downstream: no frame comes.
void lf_cam_src_push_lost(LfCamSrc* self);
// Plans the next attempt, if there is one to be.
void lf_cam_src_schedule_retry(LfCamSrc* self);
// Has a live camera of a node watched for frames that fail to come.
void lf_cam_src_watch(LfCamSrc* self);
// What is planned is not done any more.
void lf_cam_src_cancel_plans(LfCamSrc* self);
// A lost camera is not waited for any more: its stream ends. With the state lock.
void lf_cam_src_end_lost(LfCamSrc* self);
// Between frames as the caps have it, nanoseconds.
GstClockTime lf_cam_src_period(LfCamSrc* self);
