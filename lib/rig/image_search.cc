// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/image_search.h"

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "base/error.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

// "11.jpg" does not end with the word "1.jpg", "cam 1.jpg" does.
bool ends_with_word(const std::string& text, const std::string& end) {
  if (end.size() >= text.size() || !text.ends_with(end)) return false;
  return !std::isalnum(static_cast<unsigned char>(text[text.size() - end.size() - 1]));
}

}  // namespace

ImageSearch::ImageSearch(const std::string& directory) : directory_(directory) {
  std::error_code error;
  for (fs::recursive_directory_iterator it(directory, error), end; !error && it != end; it.increment(error))
    if (it->is_regular_file()) files_.push_back(it->path().lexically_relative(directory).generic_string());
  if (error) throw Error(directory + ": can't be read: " + error.message());
  std::sort(files_.begin(), files_.end());
}

std::string ImageSearch::find(const std::string& name) const {
  const auto path = [&](const std::string& file) { return (fs::path(directory_) / file).string(); };
  const std::string wanted = fs::path(name).lexically_normal().generic_string();
  if (std::binary_search(files_.begin(), files_.end(), wanted)) return path(wanted);
  std::vector<std::string> found;
  for (const std::string& file : files_)
    if (ends_with_word(wanted, file) || ends_with_word(file, wanted)) found.push_back(file);
  if (found.empty()) throw Error(directory_ + ": no image file for \"" + name + "\"");
  if (found.size() > 1)
    throw Error(directory_ + ": more than one image file for \"" + name + "\": " + found[0] + ", " + found[1]);
  return path(found[0]);
}

}  // namespace lf
