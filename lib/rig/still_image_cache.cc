// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/still_image_cache.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "base/text.h"
#include "image/colour_correction.h"
#include "image/image_file.h"

namespace lf {

bool has_images(const Rig& rig) {
  return std::none_of(rig.cameras.begin(), rig.cameras.end(), [](const Camera& c) { return c.image.empty(); });
}

namespace {

std::string orientation_notice_of(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return "";
  std::vector<uint8_t> header(64 << 10);
  std::ifstream file(path, std::ios::binary);
  file.read(reinterpret_cast<char*>(header.data()), static_cast<std::streamsize>(header.size()));
  header.resize(static_cast<size_t>(file.gcount()));
  return orientation_notice(exif_orientation(header));
}

}  // namespace

std::string orientation_notice(const Rig& rig) {
  std::string first;
  size_t more = 0;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    if (rig.cameras[i].image.empty()) continue;
    const std::string path = rig.resolve(rig.cameras[i].image);
    const std::string notice = orientation_notice_of(path);
    if (notice.empty()) continue;
    if (first.empty())
      first = "cameras[" + std::to_string(i) + "].image: " + path + ": " + notice;
    else
      more++;
  }
  return more == 0 ? first : first + "; " + std::to_string(more) + " more";
}

const Image& StillImageCache::get(CameraIndex camera) {
  if (const auto found = place_.find(camera); found != place_.end()) {
    cache_.splice(cache_.begin(), cache_, found->second);
    return cache_.front().image;
  }
  const Camera& rig_camera = rig_.cameras[camera];
  const std::string name = rig_camera.label() + ": ";
  if (rig_camera.image.empty())
    throw Error(name + "the rig has no image of this camera; lf-rig snapshot takes one still of each camera");
  const std::string path = rig_.resolve(rig_camera.image);
  Image image;
  try {
    image = load_image_of_size(path, {rig_camera.width, rig_camera.height});
  } catch (const Error& e) {
    const std::string notice = orientation_notice_of(path);
    throw Error(name + e.what() + (notice.empty() ? "" : "; " + notice));
  }
  if (family_ == PixelFamily::kI420) image = to_i420(image);
  if (rig_camera.colour) image = corrected(image, *rig_camera.colour, rig_camera.principal_point());

  used_ += image.data().size();
  cache_.push_front({camera, std::move(image)});
  place_[camera] = cache_.begin();
  while (used_ > room_ && cache_.size() > 1) {
    used_ -= cache_.back().image.data().size();
    place_.erase(cache_.back().camera);
    cache_.pop_back();
  }
  return cache_.front().image;
}

}  // namespace lf
