// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "base/json_value.h"
#include "command_line.h"
#include "rig/rig.h"
#include "scene/colour_faults.h"

// The colour faults that lf-scene gives its cameras.
struct FaultOptions {
  int seed = -1;
  std::string stuck;

  void add_to(cli::App& app) {
    cli::Option* faults =
        app.add_option("--faults", seed,
                       "Cameras with colours of their own: brightness +-8 %, white balance +-5 %, black level, gamma, "
                       "crosstalk, up to 30 % of vignetting, noise; colours.json has the truth")
            ->type_name("SEED")
            ->check(cli::Range(0, 1000000));
    app.add_option("--stuck", stuck, "Ids of cameras whose exposure is stuck, 1.6 times as bright")
        ->type_name("LIST")
        ->needs(faults);
  }
  // The faults, one for each camera; empty where none are asked for. Throws Error for ids that are none.
  std::vector<lf::ColourFault> faults(const lf::Rig& rig) const {
    if (seed < 0) return {};
    std::vector<lf::ColourFault> faults = lf::random_faults(rig.cameras.size(), static_cast<uint32_t>(seed));
    if (!stuck.empty())
      for (const lf::CameraIndex i : lf::parse_camera_list(rig, stuck)) faults[i].gain = lf::kStuckGain;
    return faults;
  }
};

// The picture that camera `i` gives: frame `n` of a film.
inline lf::Image filmed(lf::Image image, const std::vector<lf::ColourFault>& faults, const lf::Rig& rig, size_t i,
                        int n) {
  if (faults.empty()) return image;
  return lf::with_fault(image, faults[i], rig.cameras[i].principal_point(),
                        (uint64_t{i} << 32) + static_cast<uint64_t>(n));
}

inline void write_faults(const lf::Rig& rig, const std::vector<lf::ColourFault>& faults, const std::string& folder) {
  if (!faults.empty()) lf::write_text_file(lf::faults_to_json(rig, faults), folder + "/colours.json");
}
