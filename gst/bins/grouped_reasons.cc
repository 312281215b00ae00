// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/grouped_reasons.h"

#include <map>
#include <string_view>

namespace lf {
namespace {

constexpr std::string_view kColon = ": ";

struct Reason {
  std::string_view place, why;
};

Reason parse(std::string_view text) {
  const size_t colon = text.rfind(kColon);
  if (colon == text.npos) return {"", text};
  return {text.substr(0, colon), text.substr(colon + kColon.size())};
}

}  // namespace

std::string grouped_reasons(std::span<const std::string> reasons, const std::string& separator) {
  std::map<std::string_view, size_t> cameras;
  for (const std::string& reason : reasons) cameras[parse(reason).why]++;
  std::string text;
  for (const std::string& reason : reasons) {
    const auto [place, why] = parse(reason);
    const size_t count = cameras[why];
    if (count == 0) continue;  // told with the first of them
    if (!text.empty()) text += separator;
    if (count <= kAlone) {
      text += reason;
      continue;
    }
    text += std::to_string(count) + " cameras: " + std::string(why);
    if (!place.empty()) text += " (" + std::string(place) + " and others)";
    cameras[why] = 0;
  }
  return text;
}

}  // namespace lf
