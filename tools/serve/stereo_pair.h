// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <array>
#include <deque>
#include <memory>
#include <mutex>

namespace lf::serve {

// Puts the pictures of a left and a right eye side by side: those of one stamp, which are of one moment, and no others.
// Where an eye has none for a stamp the other's is left out. Thread-safe.
class StereoPair {
 public:
  enum Side { kLeft, kRight };

  // Takes a sample of raw video, both sides of one even size and one format. Returns the picture that it completes, of
  // twice the width, or null.
  GstSample* add(Side side, GstSample* picture);

 private:
  struct Unref {
    void operator()(GstSample* sample) const { gst_sample_unref(sample); }
  };
  using SamplePtr = std::unique_ptr<GstSample, Unref>;
  static GstSample* join(GstSample* left, GstSample* right);

  std::mutex mutex_;
  std::array<std::deque<SamplePtr>, 2> waiting_;  // samples of each eye, by stamp
};

}  // namespace lf::serve
