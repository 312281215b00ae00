// SPDX-License-Identifier: LGPL-2.1-or-later
#include <lightfield/view.h>

#include "api/convert.h"
#include "view/navigator.h"

namespace lightfield {

View home_view(const Rig& rig, int width, int height) {
  lf::validate_size("width", width);
  lf::validate_size("height", height);
  const lf::Viewpoint home = lf::default_viewpoint(*rig.data().rig);
  View view;
  view.width = width;
  view.height = height;
  view.world_from_view = lf::api::from_pose(home.pose);
  view.fov_y = home.fov_y_deg;
  view.focus_distance = home.focus_distance;
  return view;
}

}  // namespace lightfield
