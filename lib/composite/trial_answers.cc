// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/trial_answers.h"

#include <optional>
#include <utility>

namespace lf {

std::string add_moments(std::span<const uint8_t> unit, const wire::MomentsHeader& header, const ViewRequest& request,
                        ViewFocus::Answers& answers) {
  if (request.rig_hash != 0 && header.rig_hash != request.rig_hash) return "of another rig";
  wire::MomentsShape asked;
  if (const FocalMap* map = request.view.focus.map.get()) {
    if (!header.gains)
      asked = {map->columns, map->rows, request.trials.size()};
    else if (request.gains.ask)
      asked = {FocalMap::nodes(map->columns, 2), FocalMap::nodes(map->rows, 2), 1};
  }
  std::string reason;
  std::optional<wire::MomentsUnit> came = wire::decode_moments(unit, asked, &reason);
  if (!came) return reason;
  if (came->gains) {
    answers.gains.add(*came->gains);
    if (answers.brightness.columns == 0)
      answers.brightness = std::move(came->sums()[0]);
    else
      came->add_to({&answers.brightness, 1});
  } else if (answers.moments.empty()) {
    answers.moments = came->sums();
  } else {
    came->add_to(answers.moments);
  }
  return {};
}

}  // namespace lf
