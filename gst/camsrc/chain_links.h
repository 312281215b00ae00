// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

// What the elements of a camera's chain are linked by, those whose pads appear by and by among them.
namespace lf {

// Throws MissingElement.
GstElement* add(GstBin* bin, const char* factory, const char* name = nullptr);
// Adds a decoder of Motion JPEG. Throws MissingElement.
GstElement* add_jpeg_decoder(GstBin* bin);
// The pad without the reference: it stays as long as its element.
GstPad* borrow_pad(GstElement* element, const char* name);
// Appends `next` to the chain that ends in `tail`. The elements of a chain fit by construction, so nothing is checked.
GstElement* append(GstElement* tail, GstElement* next);

// The identities around what makes raw video, where JPEG, and pictures in a graphics card's memory, go past it: named
// so, because pads that appear later find nothing but the first of them.
inline constexpr const char* kBeforeConvert = "before-convert";
inline constexpr const char* kAfterConvert = "after-convert";
bool may_bypass(GstElement* head);
// Links the first identity with the last: the video stays as it is. Before data flows.
void bypass(GstElement* before);

// These handle signals of pads that appear: they link the first video with `head`, the sink of the chain. This one is a
// decoder's.
void on_decoded_pad(GstElement* decoder, GstPad* pad, gpointer head);
// This one is a Matroska demuxer's: MJPEG goes through jpegdec on the demuxer's own thread, or stays as it is; what
// else there is goes through decodebin, which brings queues and threads.
void on_matroska_pad(GstElement* demuxer, GstPad* pad, gpointer head);
// The turn that a film asks for (MP4's matrix), by the tags that have passed the pad.
GstVideoOrientationMethod turn_of(GstPad* pad);
inline bool is_turned(GstPad* pad) { return turn_of(pad) != GST_VIDEO_ORIENTATION_IDENTITY; }
// Whether there is sound in what the bin's elements read: the pictures may end before the whole does.
bool has_sound(GstBin* bin);
// Posts an error if there was no video.
void on_no_more_pads(GstElement* element, gpointer unused);

}  // namespace lf
