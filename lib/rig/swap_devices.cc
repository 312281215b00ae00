// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/swap_devices.h"

#include <array>
#include <nlohmann/json.hpp>
#include <string>

#include "base/error.h"

namespace lf {
namespace {

constexpr std::array kOfThePlace = {"id", "name", "position", "orientation"};

nlohmann::json& camera_of(nlohmann::json& rig, uint32_t id) {
  for (nlohmann::json& camera : rig["cameras"])
    if (camera["id"] == id) return camera;
  throw Error("there is no camera " + std::to_string(id));
}

}  // namespace

void swap_devices(nlohmann::json& rig, uint32_t a, uint32_t b) {
  nlohmann::json &first = camera_of(rig, a), &second = camera_of(rig, b);
  if (a == b) return;
  std::swap(first, second);
  for (const char* key : kOfThePlace) std::swap(first[key], second[key]);
}

}  // namespace lf
