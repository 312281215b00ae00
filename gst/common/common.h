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

// The caps of requests and answers are constant for the life of a stream. Requests carry the frame rate of the viewer
// (0/1: variable), so that the compositor can set the rate of its output.
#define LF_REQUEST_MEDIA_TYPE "application/x-lightfield-request"
#define LF_ANSWER_MEDIA_TYPE "application/x-lightfield-answer"
#define LF_RIG_MEDIA_TYPE "application/x-lightfield-rig"
// The field `parsed` means that each buffer holds exactly one unit, which is a request or a part of an answer. Byte
// streams from files and TCP do not have this field. The element lfparse splits a byte stream into units.
#define LF_REQUEST_CAPS LF_REQUEST_MEDIA_TYPE ", parsed = (boolean) true"
#define LF_ANSWER_CAPS LF_ANSWER_MEDIA_TYPE ", parsed = (boolean) true"
#define LF_RGB_FORMATS "RGB, BGR, RGBx, BGRx, xRGB, xBGR, RGBA, BGRA, ARGB, ABGR"

// Raw video formats that lffragment accepts from cameras without conversion.
#define LF_CAMERA_FORMATS LF_RGB_FORMATS ", I420, NV12, GRAY8"

// Raw video in system memory or GPU memory. GStreamer downloads GPU memory when a buffer is mapped.
#define LF_GL_MEMORY "memory:GLMemory"
#define LF_VIDEO_CAPS(formats) \
  GST_VIDEO_CAPS_MAKE(formats) "; " GST_VIDEO_CAPS_MAKE_WITH_FEATURES(LF_GL_MEMORY, formats)

// Video in GPU memory that our shaders can read, which is texture target 2D. Some decoders and cameras use other
// texture targets, and need the element glcolorconvert.
#define LF_CARD_VIDEO_CAPS(formats) \
  GST_VIDEO_CAPS_MAKE_WITH_FEATURES(LF_GL_MEMORY, formats) ", texture-target = (string) 2D"

// Field (uint) with the view id of an event, query or message. Upstream events without this field apply to every view.
#define LF_VIEW_ID_FIELD "lightfield-view-id"

// Custom upstream event that moves the view of an lfviewrequest. Fields: any properties of the view, as numbers.
#define LF_VIEW_EVENT "lightfield-view-request"

// Event that informs lffragment about the camera of a stream. It is a sticky custom downstream event of lfcamsrc.
// Fields: "camera" (uint: index in the rig), "rig-hash" (uint64: checksum of the rig file), "paced" (boolean: frames
// are ready before their time, so none need be late).
#define LF_CAMERA_EVENT "lightfield-camera"

// LF_CAMERA_LOST is a custom downstream event of lfcamsrc. It means that the camera has failed, and that no frame
// follows until the next segment event. lffragment then does not wait for frames of this camera. LF_CAMERA_LOST and
// LF_CAMERA_FOUND are also element messages of lfcamsrc, with the fields "camera" (uint: id) and "name" (string). The
// message LF_CAMERA_LOST also has "reason" (string).
#define LF_CAMERA_LOST "lightfield-camera-lost"
#define LF_CAMERA_FOUND "lightfield-camera-found"

// Element message of lfcameranode: no camera works until the next LF_CAMERA_FOUND. Fields: "cameras" (uint: number of
// cameras), "reason" (string).
#define LF_NO_CAMERA "lightfield-all-cameras-lost"

// Element message of lfcameranode: the recording has ended. Fields: "folder", "reason" (strings).
#define LF_RECORDING_STOPPED "lightfield-recording-stopped"

// Reference caps of the GstReferenceTimestampMeta with the capture time of a frame or picture. The capture time is
// clock time for live sources and stream time otherwise. For frames it includes the time offset of the camera.
#define LF_CAPTURE_TIME_CAPS "timestamp/x-lightfield-capture"

namespace lf {

// Returns true for a seek with a negative rate. Reverse playback is not supported, so refuse these seeks before
// flushing.
bool is_reverse_seek(GstEvent* event);

// The caller owns the caps.
GstCaps* unit_caps(const gchar* media_type);
// Makes the sink pad accept caps that do not have the field `parsed`, because elements outside of this plugin may omit
// this field.
void accept_unit_caps(GstPad* sink);
// Returns the part of the caps that `filter` (null: no filter) allows, in the order of the filter. Takes `caps`.
GstCaps* filter_caps(GstCaps* caps, GstCaps* filter);

// Returns the meta with the capture time of a frame or picture (LF_CAPTURE_TIME_CAPS); null if there is none.
GstReferenceTimestampMeta* find_capture_time(GstBuffer* buffer);
void add_capture_time(GstBuffer* buffer, GstClockTime time, GstClockTime duration = GST_CLOCK_TIME_NONE);

// Sets the field to a GstValueArray with one value of this type for each item. `set` is a function such as
// g_value_set_uint, which stores an item in a GValue.
template <typename Items, typename Set>
void set_array(GstStructure* structure, const char* field, GType type, const Items& items, Set set) {
  GValue array = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  for (const auto& item : items) {
    GValue value = G_VALUE_INIT;
    g_value_init(&value, type);
    set(&value, item);
    gst_value_array_append_and_take_value(&array, &value);
  }
  gst_structure_take_value(structure, field, &array);
}

// Queries upstream of this sink pad for its latency. Returns the minimum latency in nanoseconds, or nothing if upstream
// is not live.
std::optional<GstClockTime> live_latency(GstPad* sink);

// Loads a rig file. All elements that load the same unchanged file share one copy in memory. Thread-safe. Throws Error
// if the file is unreadable or invalid.
std::shared_ptr<const Rig> shared_rig(const std::string& path);

// Returns true in PAUSED or PLAYING.
bool is_running(GstElement* element);
// Loads the new rig for a running element. If the file cannot be loaded, posts a warning and returns null, and the
// caller keeps its current rig.
std::shared_ptr<const Rig> reload_rig(GstElement* element, const gchar* path);

// Returns the pixel family of a raw video format, which is RGB or YCbCr. Returns kNone if lffragment does not accept
// the format.
PixelFamily family_of(const GstVideoInfo& info);
// Returns the order of the channels in a pixel of RGB video, for example that BGRx has blue in the first of four bytes.
RgbLayout rgb_layout(const GstVideoInfo& info);
// Sets the colorimetry that all I420 of the plugin has: full-range BT.601 with centred chroma.
void set_system_colorimetry(GstVideoInfo& info);
// Returns true for YCbCr with limited (video) range.
bool has_limited_range(const GstVideoInfo& info);

}  // namespace lf
