// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

// Custom upstream event from a compositor's request pad, before and behind a seek that flushes: who makes requests
// waits in between. A funnel passes the seek to one viewer after the other, and each flush drops what is on its way
// from all of them; so none begins again before the last one has flushed. Field "held" (boolean); the sequence number
// is that of the seek.
#define LF_HOLD_EVENT "lightfield-hold"

namespace lf {

// A new event, owned by the caller.
GstEvent* hold_event(bool held, guint32 seqnum);
// False if the event is another one.
bool parse_hold(GstEvent* event, bool* held);

}  // namespace lf
