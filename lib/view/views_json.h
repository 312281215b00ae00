// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "view/view.h"

namespace lf {

struct NamedView {
  std::string name;  // unique in its file; "view_00", "view_01", ... where the file has none
  double time = 0;   // seconds
  View view;
};

// views.json ("format": "lightfield-views", "version": 1): a camera path. Throws Error naming file and place; a file
// with no views is an error, and so is a time that decreases.
std::vector<NamedView> load_views(const std::string& path);
std::vector<NamedView> parse_views(const std::string& text, const std::string& name);
// Writes model + params and focal_plane, so that a loaded path is saved to the last bit.
void save_views(const std::vector<NamedView>& views, const std::string& path);
std::string views_to_json(const std::vector<NamedView>& views);

}  // namespace lf
