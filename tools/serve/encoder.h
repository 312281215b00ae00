// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

#include "offer.h"

namespace lf::serve {

// Whether an encoder for the codec is installed: of those for H.264 that are known here the one of the highest rank is
// used, hardware or not.
bool can_encode(VideoCodec codec);

// A part of a launch line from raw video to RTP for webrtcbin: an encoder "encoder" that keeps no picture back, and a
// payloader "payloader" whose timestamps are 90,000 times the running time in seconds.
std::string encoder_line(const Offer& offer, int bits_per_second);
// Sets the bit rate of an encoder, while it runs.
void set_bit_rate(GstElement* encoder, int bits_per_second);

}  // namespace lf::serve
