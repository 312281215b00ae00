// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "rig/camera_ranges.h"

namespace lf {

// Judges which cameras are out of order by the answers to one view's requests: a camera that is missing from so many
// pictures in a row is taken out of service, so that its neighbours close the gap, and put back when it has been in
// some again. Not thread-safe.
class CameraHealth {
 public:
  // Pictures in a row that a camera is seen in before it is put back: one that comes and goes stays out.
  static constexpr unsigned kBackAfter = 3;

  // A camera may be missing from `max_missed` pictures in a row; 0: from any number, and none is ever taken out.
  explicit CameraHealth(unsigned max_missed = 0) : max_missed_(max_missed) {}

  // Cameras 0 to count - 1 are expected: they are missing even if they never answer. Others are known once they answer.
  void expect(size_t count);
  // Tells the hash of the rig that cameras are of; 0: not known, which changes nothing. Cameras are known by their
  // index, which in another rig may be another camera's or nobody's: with another rig than before all that was known is
  // forgotten. True if out_of_service() is another now.
  bool use_rig(uint64_t hash);
  // Notes cameras whose answers were in time, but came after their picture was made: they count for the next one. Those
  // of another rig do not.
  void seen_late(uint64_t rig, const CameraRanges& seeing);
  // One more picture has been made; `seeing` are the cameras that answered in time with pictures of theirs. A picture
  // of none counts for nothing: then it is not the cameras that are out of order. True if out_of_service() is another
  // now.
  bool picture(CameraRanges seeing);

  const CameraSet& out_of_service() const { return out_; }

 private:
  struct Camera {
    bool known = false, out = false;
    unsigned missed = 0, seen = 0;  // pictures in a row that the camera is missing from, or in
  };
  unsigned max_missed_;
  uint64_t rig_ = 0;
  size_t expected_ = 0;
  CameraRanges seen_late_;
  std::vector<Camera> cameras_;
  CameraSet out_;
};

}  // namespace lf
