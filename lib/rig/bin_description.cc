// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/bin_description.h"

#include <string_view>

#include "rig/rig.h"

namespace lf {

bool is_bin_description(const std::string& source) {
  if (is_uri(source)) return false;
  if (source.find(" ! ") != std::string::npos) return true;
  constexpr std::string_view kWord = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";
  const size_t begin = source.find_first_not_of(' ');
  if (begin == std::string::npos) return false;
  const size_t space = source.find_first_not_of(kWord, begin);
  if (space == begin || space == std::string::npos || source[space] != ' ') return false;
  const size_t property = source.find_first_not_of(' ', space);
  if (property == std::string::npos) return false;
  size_t equals = source.find_first_not_of(kWord, property);
  if (equals == property || equals == std::string::npos) return false;
  equals = source.find_first_not_of(' ', equals);
  return equals != std::string::npos && source[equals] == '=';
}

}  // namespace lf
