// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>

#include <gst/gst.h>

namespace lf {

// Takes each seek once, though it comes several times: through the compositor's request pad and, by way of the nodes,
// through its answer pads; and from every compositor behind a tee. Thread-safe.
class SeekOnce {
 public:
  // Whether the seek with this number is another one than the latest.
  bool is_new(guint32 seqnum) { return seqnum_.exchange(seqnum) != seqnum; }
  void clear() { seqnum_ = GST_SEQNUM_INVALID; }

 private:
  std::atomic<guint32> seqnum_ = GST_SEQNUM_INVALID;
};

}  // namespace lf
