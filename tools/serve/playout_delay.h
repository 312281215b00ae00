// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf::serve {

// RTP header extension by which receivers that know it show every picture as soon as it is decoded, and keep none back
// to make the gaps between pictures even. docs/measurements.md says what that saves.
inline constexpr char kPlayoutDelayUri[] = "http://www.webrtc.org/experiments/rtp-hdrext/playout-delay";

// Puts the extension into all packets of the payloader, under the number that the offer has for it, 1..14.
void add_playout_delay(GstElement* payloader, guint id);

}  // namespace lf::serve
