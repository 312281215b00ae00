// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/camera_inputs.h"

#include <algorithm>

#include "view/request_limits.h"

namespace lf {

std::string list_of_ids(const std::vector<uint32_t>& ids) {
  constexpr size_t kNamed = 8;
  std::string list;
  for (size_t i = 0; i < std::min(ids.size(), kNamed); i++) list += (i ? ", " : "") + std::to_string(ids[i]);
  if (ids.size() > kNamed) list += " and " + std::to_string(ids.size() - kNamed) + " more";
  return list;
}

// Requests that are being answered keep the array they began with.
void CameraInputs::rearrange() {
  auto array = std::make_shared<Array>(*array_);
  array->cameras.clear();
  for (const auto& [frames, input] : inputs_)
    if (const auto index = input.id ? array->rig->index_of_id(*input.id) : std::nullopt)
      array->cameras.emplace(*index, frames);
  array_ = std::move(array);
  changed_.notify_all();
}

std::string CameraInputs::set_rig(std::shared_ptr<const Rig> rig) {
  std::lock_guard lock(mutex_);
  auto array = std::make_shared<Array>();
  array->rig_hash = rig->hash();
  array->extent = array_extent(*rig);
  array->colours = std::make_shared<const CameraColours>(*rig);
  array->rig = std::move(rig);
  array_ = std::move(array);
  rearrange();
  std::vector<uint32_t> unknown, other_size;
  for (const auto& [frames, input] : inputs_) {
    if (!input.id) continue;
    const auto index = array_->rig->index_of_id(*input.id);
    const std::optional<CameraFrame> frame = frames->newest();
    if (!index)
      unknown.push_back(*input.id);
    else if (frame && !frame->fits(array_->rig->cameras[*index]))
      other_size.push_back(*input.id);
  }
  std::ranges::sort(unknown);
  std::ranges::sort(other_size);
  std::string text;
  if (!unknown.empty()) text = "it has no camera " + list_of_ids(unknown);
  if (!other_size.empty())
    text += (text.empty() ? "" : "; ") + ("it has another image size for camera " + list_of_ids(other_size));
  return text;
}

std::shared_ptr<const Camera> CameraInputs::camera(uint32_t id) const {
  const std::shared_ptr<const Array> array = this->array();
  const auto index = array->rig ? array->rig->index_of_id(id) : std::nullopt;
  return index ? std::shared_ptr<const Camera>(array->rig, &array->rig->cameras[*index]) : nullptr;
}

void CameraInputs::add(Frames frames) {
  std::lock_guard lock(mutex_);
  inputs_.try_emplace(std::move(frames));
}

bool CameraInputs::set_camera(const Frames& frames, uint32_t id) {
  std::lock_guard lock(mutex_);
  for (const auto& [other, input] : inputs_)
    if (input.id == id && other != frames) return false;
  inputs_[frames].id = id;
  rearrange();
  return true;
}

void CameraInputs::set_family(const Frames& frames, PixelFamily family) {
  std::lock_guard lock(mutex_);
  if (const auto input = inputs_.find(frames); input != inputs_.end()) input->second.family = family;
  changed_.notify_all();
}

void CameraInputs::give_up(const Frames& frames) {
  std::lock_guard lock(mutex_);
  if (const auto input = inputs_.find(frames); input != inputs_.end()) input->second.given_up = true;
  changed_.notify_all();
}

void CameraInputs::remove(const Frames& frames) {
  std::lock_guard lock(mutex_);
  if (inputs_.erase(frames) > 0) rearrange();
}

std::shared_ptr<const CameraInputs::Array> CameraInputs::array() const {
  std::lock_guard lock(mutex_);
  return array_;
}

std::shared_ptr<const CameraInputs::Array> CameraInputs::wait_for_all(const std::atomic<bool>& cancelled) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] {
    return !running_ || cancelled ||
           std::ranges::all_of(inputs_, [](const auto& entry) { return entry.second.is_known(); });
  });
  return array_;
}

void CameraInputs::set_running(bool running) {
  std::lock_guard lock(mutex_);
  running_ = running;
  changed_.notify_all();
}

void CameraInputs::wake() {
  std::lock_guard lock(mutex_);
  changed_.notify_all();
  for (const auto& [frames, input] : inputs_) frames->wake();
}

PixelFamily CameraInputs::choose_family() {
  std::lock_guard lock(mutex_);
  if (family_ != PixelFamily::kNone) return family_;
  PixelFamily chosen = PixelFamily::kNone;
  for (const auto& [frames, input] : inputs_)
    if (input.family != PixelFamily::kNone && chosen != PixelFamily::kRgb) chosen = input.family;
  return family_ = chosen;
}

}  // namespace lf
