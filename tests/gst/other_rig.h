// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "gst/gst_test.h"
#include "rig/rig_json.h"

namespace lf::test {

// A rig file that is made of another rig.
class OtherRig {
 public:
  template <typename Change>
  OtherRig(Rig rig, Change change) : rig_((change(rig), rig)), file_(bytes(), ".json") {}
  const std::string& path() const { return file_.path(); }
  const Rig& rig() const { return rig_; }
  uint64_t hash() const { return rig_.hash(); }

 private:
  std::vector<uint8_t> bytes() const {
    const std::string text = rig_to_json(rig_);
    return {text.begin(), text.end()};
  }
  Rig rig_;
  TempFile file_;
};

}  // namespace lf::test
