// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf {

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

// Stops a child and removes it from the bin. A decoder that does not stop in time is left to stop by itself.
void remove_child(GstBin* bin, GstElement* child);

// Takes a locked child's message about its state, in GstBinClass::handle_message: true if the message ends here,
// unreferenced.
bool take_decoder_message(GstBin* bin, GstMessage* message);

}  // namespace lf
