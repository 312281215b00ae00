// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace lf {

// The image files below a folder, to be found by the names that some other program knew them by.
class ImageSearch {
 public:
  // Throws Error if `directory` is not a folder.
  explicit ImageSearch(const std::string& directory);

  // The path of the file called `name` (which may have folders in it). Where there is none: of the one file whose name
  // ends `name`, or that `name` ends with, at a place where a word begins. Throws Error if there is no such file, or
  // more than one.
  std::string find(const std::string& name) const;

 private:
  std::string directory_;
  std::vector<std::string> files_;  // relative to directory_, sorted
};

}  // namespace lf
