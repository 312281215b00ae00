// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <gst/gst.h>
#include <gst/video/video.h>

#include "common/guard.h"
#include "image/image.h"
#include "rig/rig.h"

// Caps are constant for the life of a stream. Requests carry the frame rate of the viewer (0/1: variable), from which
// the compositor sets the rate of its output.
#define LF_REQUEST_MEDIA_TYPE "application/x-lightfield-request"
#define LF_ANSWER_MEDIA_TYPE "application/x-lightfield-answer"
#define LF_RIG_MEDIA_TYPE "application/x-lightfield-rig"
// `parsed`: each buffer is one unit. Byte streams (files, TCP) need lfparse first.
#define LF_REQUEST_CAPS LF_REQUEST_MEDIA_TYPE ", parsed = (boolean) true"
#define LF_ANSWER_CAPS LF_ANSWER_MEDIA_TYPE ", parsed = (boolean) true"
#define LF_RGB_FORMATS "RGB, BGR, RGBx, BGRx, xRGB, xBGR, RGBA, BGRA, ARGB, ABGR"

// Video that lffragment accepts from cameras unconverted.
#define LF_CAMERA_FORMATS LF_RGB_FORMATS ", I420, NV12, GRAY8"

// Raw video in system memory or GPU memory. GStreamer downloads GPU memory when it is mapped.
#define LF_GL_MEMORY "memory:GLMemory"
#define LF_VIDEO_CAPS(formats) \
  GST_VIDEO_CAPS_MAKE(formats) "; " GST_VIDEO_CAPS_MAKE_WITH_FEATURES(LF_GL_MEMORY, formats)

// GPU video that the shaders accept. glcolorconvert converts other texture targets, which some decoders and cameras
// use.
#define LF_CARD_VIDEO_CAPS(formats) \
  GST_VIDEO_CAPS_MAKE_WITH_FEATURES(LF_GL_MEMORY, formats) ", texture-target = (string) 2D"

// Field (uint) with the view id of an event, query or message.
#define LF_VIEW_ID_FIELD "lightfield-view-id"

// Sticky custom downstream event of lfcamsrc that identifies the camera of a stream: "camera" (uint: index in the rig),
// "rig-hash" (uint64), "paced" (boolean: frames are ready before their time, so none need be late).
#define LF_CAMERA_EVENT "lightfield-camera"

// Custom downstream event of lfcamsrc: the camera has failed, and no frame follows until a new segment. Also the names
// of lfcamsrc's element messages, with the fields "camera" (uint: id), "name" (string); the first also has "reason"
// (string).
#define LF_CAMERA_LOST "lightfield-camera-lost"
#define LF_CAMERA_FOUND "lightfield-camera-found"

// Element message of lfcameranode: no camera works until the next LF_CAMERA_FOUND. Fields: "cameras" (uint: number of
// cameras), "reason" (string).
#define LF_NO_CAMERA "lightfield-all-cameras-lost"

// Element message of lfcameranode: the recording has ended. Fields: "folder", "reason" (strings).
#define LF_RECORDING_STOPPED "lightfield-recording-stopped"

// Reference caps of a GstReferenceTimestampMeta with the capture time of a frame (timestamp plus time offset) or
// picture: clock time for live sources, stream time otherwise.
#define LF_CAPTURE_TIME_CAPS "timestamp/x-lightfield-capture"

namespace lf {

// True for a seek with negative rate, which is unsupported. Refuse such seeks before flushing.
bool is_reverse_seek(GstEvent* event);

// Returns LF_REQUEST_CAPS or LF_ANSWER_CAPS; the caller owns the caps.
GstCaps* unit_caps(const gchar* media_type);
// Makes the pad accept caps without the field `parsed`, which other elements may omit.
void accept_unit_caps(GstPad* sink);

// Returns the latency of buffers on this sink pad, nanoseconds; nothing if upstream is not live.
std::optional<GstClockTime> live_latency(GstPad* sink);

// Returns the rig in `path`. Elements with the same unchanged file share one copy. Thread-safe. Throws Error.
std::shared_ptr<const Rig> shared_rig(const std::string& path);

// True in PAUSED or PLAYING. A rig set before is loaded at start; a rig set while running is loaded by reload_rig().
bool is_running(GstElement* element);
// Calls shared_rig(), but posts a warning and returns null if the rig cannot be loaded. The caller then keeps its
// current rig.
std::shared_ptr<const Rig> reload_rig(GstElement* element, const gchar* path);

// Returns the pixel family of a raw video format. kNone if the format is neither RGB nor I420, NV12 or GRAY8.
PixelFamily family_of(const GstVideoInfo& info);
RgbLayout rgb_layout(const GstVideoInfo& info);
// Sets the colorimetry that I420 has inside the system: full-range BT.601, centred chroma.
void set_system_colorimetry(GstVideoInfo& info);
// True for YCbCr with limited (video) range, unlike I420 inside the system.
bool has_limited_range(const GstVideoInfo& info);

}  // namespace lf
