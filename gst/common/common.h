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

// What the elements share. The elements hold no mathematics: that is in lib/.

// Caps are constant for the life of a stream. Requests carry the rate of their viewer (0/1: variable), so that a
// compositor can name the frame rate of its output.
#define LF_REQUEST_MEDIA_TYPE "application/x-lightfield-request"
#define LF_ANSWER_MEDIA_TYPE "application/x-lightfield-answer"
#define LF_RIG_MEDIA_TYPE "application/x-lightfield-rig"
// `parsed`: each buffer is one unit. Bytes of which that is not so (files, TCP) go through lfparse first.
#define LF_REQUEST_CAPS LF_REQUEST_MEDIA_TYPE ", parsed = (boolean) true"
#define LF_ANSWER_CAPS LF_ANSWER_MEDIA_TYPE ", parsed = (boolean) true"
#define LF_RGB_FORMATS "RGB, BGR, RGBx, BGRx, xRGB, xBGR, RGBA, BGRA, ARGB, ABGR"

// Video that lffragment takes from cameras as it is.
#define LF_CAMERA_FORMATS LF_RGB_FORMATS ", I420, NV12, GRAY8"

// Raw video in the computer's memory, and in a graphics card's: GStreamer copies that to where it is mapped.
#define LF_GL_MEMORY "memory:GLMemory"
#define LF_VIDEO_CAPS(formats) \
  GST_VIDEO_CAPS_MAKE(formats) "; " GST_VIDEO_CAPS_MAKE_WITH_FEATURES(LF_GL_MEMORY, formats)

// What shaders read of a card's memory: other textures are those of single decoders and cameras, which glcolorconvert
// turns into such.
#define LF_CARD_VIDEO_CAPS(formats) \
  GST_VIDEO_CAPS_MAKE_WITH_FEATURES(LF_GL_MEMORY, formats) ", texture-target = (string) 2D"

// The view that an event, a query or a message is of (uint): its field of this name.
#define LF_VIEW_ID_FIELD "lightfield-view-id"

// Sticky custom downstream event with which lfcamsrc names the camera of a stream: field "camera" (uint: index in the
// rig), "rig-hash" (uint64), "paced" (boolean: frames are ready before their time, so that none need be late).
#define LF_CAMERA_EVENT "lightfield-camera"

// Custom downstream event of lfcamsrc: no frame comes after those before it until a new segment, because the camera
// failed. The element messages of lfcamsrc, too, each with the fields "camera" (uint: id), "name" (string); the first
// one has "reason" (string).
#define LF_CAMERA_LOST "lightfield-camera-lost"
#define LF_CAMERA_FOUND "lightfield-camera-found"

// Element message of lfcameranode: no camera works any more, until one is found again. "cameras" (uint: how many there
// are), "reason" (string).
#define LF_NO_CAMERA "lightfield-no-camera"

// Element message of lfcameranode: no more frames are recorded. "folder", "reason" (strings).
#define LF_RECORDING_STOPPED "lightfield-recording-stopped"

// GstReferenceTimestampMeta reference of a frame's true capture time (stamp + the camera's time offset), and of the
// capture time of a picture: clock time for live sources, stream time for others.
#define LF_CAPTURE_TIME_CAPS "timestamp/x-lightfield-capture"

namespace lf {

// Whether the event is a seek in reverse, which can't be taken: to be refused before anything is flushed for it.
bool is_reverse_seek(GstEvent* event);

// LF_REQUEST_CAPS or LF_ANSWER_CAPS as caps, owned by the caller.
GstCaps* unit_caps(const gchar* media_type);
// Caps that leave `parsed` away are taken, too: who makes them has no reason to think of it.
void accept_unit_caps(GstPad* sink);

// By how many nanoseconds buffers on this sink pad may be late; nothing where they do not come in real time.
std::optional<GstClockTime> live_latency(GstPad* sink);

// The rig in `path`; elements that name the same unchanged file share one copy. Thread-safe. Throws Error.
std::shared_ptr<const Rig> shared_rig(const std::string& path);

// Whether the element runs: a rig that is named before is read by its start, one that is named then by reload_rig().
bool is_running(GstElement* element);
// The rig in `path`, as shared_rig(). Null if it can't be read: then a warning says so, and nothing is to change.
std::shared_ptr<const Rig> reload_rig(GstElement* element, const gchar* path);

// The pixel family of a raw video format, kNone if it is neither in the RGB family nor I420, NV12 or GRAY8.
PixelFamily family_of(const GstVideoInfo& info);
// At which bytes of a pixel R, G and B are in a format of the RGB family.
RgbLayout rgb_layout(const GstVideoInfo& info);
// Sets what I420 means inside the system: full-range BT.601, centred chroma.
void set_system_colorimetry(GstVideoInfo& info);
// Whether it is YCbCr with the head and foot room of video, in place of what I420 means inside the system.
bool has_video_levels(const GstVideoInfo& info);

}  // namespace lf
