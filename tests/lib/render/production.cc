// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lib/render/production.h"

#include <filesystem>

#include "composite/accumulator.h"
#include "composite/still.h"
#include "image/image.h"
#include "support/fragments.h"

namespace lf::test {

Rect whole(const View& view) { return {0, 0, view.width, view.height}; }

std::vector<Fragment> Production::fragments(const std::vector<Image>& images) const {
  std::vector<Fragment> out;
  for (const CameraIndex i : plan.contributors())
    if (auto fragment = camera_part(plan, owners.runs(), {i, &rig.cameras[i], images[i].view()}))
      out.push_back(std::move(*fragment));
  return out;
}

Image Production::picture_of_parts(const std::vector<Image>& images) const {
  Accumulator accumulator = empty_sum(images.front().family(), plan.view().width, plan.view().height);
  for (const Fragment& fragment : fragments(images)) accumulator.add(fragment);
  accumulator.set_uncovered(owners);
  return accumulator.resolve();
}

Image Production::picture(const std::vector<Image>& images) const {
  return render_still(rig, mesh, plan.view(), [&](CameraIndex i) -> const Image& { return images[i]; }).picture;
}

FloatStill Production::sums(const std::vector<Image>& images) const {
  return render_float_still(rig, plan, owners, images.front().family(),
                            [&](CameraIndex i) -> const Image& { return images[i]; });
}

std::vector<Production::OwnWeights> Production::own_weights() const {
  const int width = plan.view().width;
  std::vector<OwnWeights> own_weights;
  for (const CameraIndex i : plan.contributors()) {
    const Rect& rect = plan.camera_rect(i);
    const std::vector<float> part = pixel_weights(plan, owners, i, rect);
    OwnWeights own{i, std::vector<float>(static_cast<size_t>(width) * plan.view().height)};
    for (int y = rect.y0; y < rect.y1; y++)
      std::copy_n(&part[static_cast<size_t>(y - rect.y0) * rect.width()], rect.width(),
                  &own.weight[static_cast<size_t>(y) * width + rect.x0]);
    own_weights.push_back(std::move(own));
  }
  return own_weights;
}

std::vector<Image> i420_of(const std::vector<Image>& images) {
  std::vector<Image> out;
  for (const Image& image : images) out.push_back(to_i420(image));
  return out;
}

std::string data_folder(const std::string& name) {
  const auto folder = std::filesystem::path(LF_SOURCE_ROOT).parent_path() / "shared" / "data" / name;
  return std::filesystem::exists(folder / "rig.json") ? folder.string() : "";
}

std::vector<Image> load_images(const Rig& rig) {
  std::vector<Image> images;
  for (const Camera& camera : rig.cameras) images.push_back(load_image(rig.resolve(camera.image)));
  return images;
}

}  // namespace lf::test
