// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <vector>

#include "common/buffer_ptr.h"

namespace lf {

// What is to be known of a stream of coded pictures to keep them: from which one on they can be decoded, and in which
// order they are to be seen. Of one stream; without locks.
class CodedPictures {
 public:
  struct Picture {
    BufferPtr buffer;
    GstClockTime taken;  // running time, or time in the film
  };
  // So many may wait for a first frame to be sent, more than a decoder holds back; then it has failed.
  static constexpr size_t kMostWaiting = 300;
  // What a capture time may go back by without the clock having been set back: its sender has just told what it is.
  static constexpr GstClockTime kMostBack = GST_SECOND;

  // Whether a picture may be kept: nothing before the first key frame can.
  bool admits(GstBuffer* picture);
  // Those before are not kept, so that it begins with a key frame again.
  void begin_again();
  // Keeps a reference.
  void wait(GstBuffer* picture, GstClockTime taken);
  std::vector<Picture> take_waiting();
  // The capture time of a picture. One that is seen later than all before it was taken later, whatever its time says.
  GstClockTime in_order(GstClockTime taken, GstClockTime captured);

 private:
  bool has_key_ = false;
  std::vector<Picture> waiting_;
  GstClockTime newest_taken_ = 0, newest_captured_ = 0;  // of those passed on; 0: none was
};

}  // namespace lf
