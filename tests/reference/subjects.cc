// SPDX-License-Identifier: LGPL-2.1-or-later
// The renderers that are set beside the reference: a new one is a line in subjects().
#include <algorithm>
#include <memory>

#include "base/error.h"
#include "composite/accumulator.h"
#include "reference/float_still.h"
#include "reference/subject_parts.h"
#include "render/gl/sum_drawer.h"
#include "support/camera_part.h"

namespace lf::reference {

Image as_i420(const Image& rgb) {
  Image image(PixelFamily::kI420, rgb.width(), rgb.height());
  std::fill(image.data().begin(), image.data().end(), uint8_t{128});
  for (int y = 0; y < rgb.height(); y++)
    for (int x = 0; x < rgb.width(); x++) image.plane(0)[static_cast<size_t>(y) * rgb.width() + x] = rgb.pixel(x, y)[0];
  return image;
}

namespace {

// In float, and nothing rounded.
Answer in_float(const Rig& rig, const Mesh& mesh, const View& view, const std::vector<Image>& images) {
  const Plans plans(rig, mesh, view);
  FloatStill still = render_float_still(rig, plans.plan, plans.owners, PixelFamily::kRgb,
                                        [&](CameraIndex i) -> const Image& { return images[i]; });
  Answer answer;
  for (const CameraIndex i : plans.plan.contributors()) {
    const Rect rect = plans.plan.camera_rect(i);
    Answer::OwnWeights own{i, std::vector<double>(still.valid.size())};
    place(pixel_weights(plans.plan, plans.owners, i, rect).data(), rect, view.width, 1, own.weight);
    answer.own_weights.push_back(std::move(own));
  }
  answer.colour = std::move(still.colour);
  answer.valid = std::move(still.valid);
  answer.lost = std::move(still.lost);
  return answer;
}

// The sums of nodes of one camera in 8 bits, added up by the compositor. Weights are those that white images show.
Answer in_fragments(Coordinates coordinates, PixelFamily family, const Rig& rig, const Mesh& mesh, const View& view,
                    const std::vector<Image>& images) {
  const Plans plans(rig, mesh, view);
  const size_t pixels = static_cast<size_t>(view.width) * view.height;
  const bool i420 = family == PixelFamily::kI420;
  Answer answer;
  answer.channels = i420 ? 1 : 3;
  answer.valid.resize(pixels);
  answer.lost.resize(pixels);
  Accumulator sum;
  sum.reset(family, view.width, view.height);
  const auto render = [&](CameraIndex i, const Image& rgb) {
    const Image image = i420 ? as_i420(rgb) : rgb;
    return test::camera_part(plans.plan, plans.owners.runs(), {i, &rig.cameras[i], image.view()}, coordinates);
  };
  for (const CameraIndex i : plans.plan.contributors()) {
    if (const auto fragment = render(i, images[i])) sum.add(*fragment);
    const auto white = render(i, white_image(rig.cameras[i].width, rig.cameras[i].height));
    if (!white) continue;
    std::vector<uint8_t> weight(white->pixels.begin(), white->pixels.end());
    if (!i420)
      for (size_t p = 0; 3 * p < white->pixels.size(); p++) weight[p] = white->pixels[3 * p];
    Answer::OwnWeights own{i, std::vector<double>(pixels)};
    place(weight.data(), white->rect, view.width, 1 / 255.0, own.weight);
    place(weight.data(), white->rect, view.width, 1 / 255.0, answer.valid);
    if (!white->lost.empty()) {
      place(white->lost.data(), white->rect, view.width, 1 / 255.0, own.weight);
      place(white->lost.data(), white->rect, view.width, 1 / 255.0, answer.lost);
    }
    answer.own_weights.push_back(std::move(own));
  }
  const Image picture = sum.resolve();
  answer.colour.assign(picture.data().begin(),
                       picture.data().begin() + static_cast<ptrdiff_t>(answer.channels * pixels));
  return answer;
}

// Three samples rounded to 8 bits add up to an integer less than 1.5 from their exact sum, and a lost weight below half
// a level is forgotten.
Subject of_fragments(std::string name, Coordinates coordinates, PixelFamily family) {
  constexpr double kHalf = 0.5 / 255 + 1e-6;
  return {std::move(name),
          3 * kHalf,
          3 * kHalf,
          1.75,
          0.999,
          [=](const Rig& rig, const Mesh& mesh, const View& view, const std::vector<Image>& images) {
            return in_fragments(coordinates, family, rig, mesh, view, images);
          }};
}

// The machine's card, or what computes in place of one; Error without either.
gl::SumDrawer* any_card() {
  static std::string why;
  static const std::unique_ptr<gl::SumDrawer> card = gl::SumDrawer::create(gl::Context::Drivers::kAny, why);
  if (!card) throw Error("no OpenGL ES 3.1: " + why);
  return card.get();
}

}  // namespace

std::vector<Subject> subjects() {
  std::vector<Subject> all{{"float", 1e-6, 1e-6, 2e-3, 0.01, in_float}};
  for (const Coordinates coordinates : {Coordinates::kGrid, Coordinates::kExact}) {
    const std::string grid = coordinates == Coordinates::kGrid ? " grid" : " exact";
    for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
      const std::string name = "simd " + std::string(family == PixelFamily::kRgb ? "RGB" : "I420") + grid;
      all.push_back(of_fragments(name, coordinates, family));
      all.push_back(of_sums(name + " sum", family, coordinates));
    }
  }
  all.push_back(of_sums("gl RGB sum", PixelFamily::kRgb, Coordinates::kExact, any_card()));
  all.push_back(of_sums("gl I420 sum", PixelFamily::kI420, Coordinates::kExact, any_card()));
  return all;
}

}  // namespace lf::reference
