// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/gst_test.h"
#include "rig/rig.h"
#include "rig/rig_json.h"
#include "view/view_request.h"

namespace lf::test {

// interval between the requests of a view, nanoseconds
inline constexpr uint64_t kFrame = 100 * GST_MSECOND;

// A 2x2 array of small cameras, its rig file, and requests for a central view; all cameras contribute.
class ArrayFixture {
 public:
  static constexpr int kWidth = 32, kHeight = 24;

  ArrayFixture();

  const Rig& rig() const { return rig_; }
  const std::string& rig_path() const { return file_.path(); }
  // Returns a request for the centre view; `time` is a running time in nanoseconds.
  ViewRequest request(uint32_t sequence, uint64_t time, uint32_t view_id = 0) const;
  // Returns a uniform grey RGB or I420 frame with PTS `time`.
  static GstBuffer* frame(const char* format, uint8_t value, uint64_t time);
  static std::string caps(const char* format);

 private:
  Rig rig_;
  TempFile file_;
};

// Returns a focal surface of uniform depth for a view.
std::shared_ptr<const FocalMap> flat_surface(const View& view);

class ModifiedRig {
 public:
  template <typename Change>
  ModifiedRig(Rig rig, Change change) : rig_((change(rig), rig)), file_(rig_to_json(rig_), ".json") {}
  const std::string& path() const { return file_.path(); }
  const Rig& rig() const { return rig_; }
  uint64_t hash() const { return rig_.hash(); }

 private:
  Rig rig_;
  TempFile file_;
};

}  // namespace lf::test
