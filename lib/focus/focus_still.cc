// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/focus_still.h"

#include <map>
#include <numeric>

#include "focus/trial_renderer.h"
#include "focus/view_focus.h"

namespace lf {

View focus_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                 const FocusControl::Settings& settings, int rounds) {
  std::vector<CameraIndex> all(rig.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  const FocusArray array(rig, mesh);
  std::map<CameraIndex, Image> kept;  // an image given is only good until the next one
  ViewFocus focus(settings);
  const auto next_request = [&] {
    ViewRequest request;
    request.view = view;
    request.view.focus.map = nullptr;
    focus.apply(request);
    return request;
  };
  for (int round = 0; round <= rounds; round++) {
    const ViewRequest request = next_request();
    ViewFocus::Answers answers;
    std::vector<Moments>& sums = answers.moments;
    sums.resize(request.trials.size());
    if (!sums.empty()) {
      std::vector<std::vector<uint8_t>> levels;
      for (const Trial& trial : request.trials) levels.push_back(trial_levels(request.view, trial));
      for (Moments& sum : sums) sum.reset(request.view.focus.map->columns, request.view.focus.map->rows);
      const RenderJob job(rig, mesh, trial_view(request.view), all);
      std::vector<Source> sources;
      for (const CameraIndex camera : job.cameras()) {
        if (!kept.contains(camera)) kept[camera] = images(camera);
        sources.push_back({camera, &rig.cameras[camera], kept[camera].view()});
      }
      add_moments(job, sources, levels, sums);
    }
    focus.take(request, answers, array);
  }
  return shown_view(next_request());
}

}  // namespace lf
