// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>

#include "base/error.h"
#include "composite/accumulator.h"
#include "reference/subject_parts.h"
#include "render/gl/sum_drawer.h"

namespace lf::reference {
namespace {

// A sum over the whole view, and its memory.
struct Sum {
  Sum(const Plans& plans, std::span<const Source> sources, PixelFamily family, Coordinates coordinates,
      gl::SumDrawer* card) {
    const View& view = plans.plan.view();
    const Rect all{0, 0, view.width, view.height};
    samples.resize(packed_size(family, view.width, view.height));
    lost.resize(static_cast<size_t>(view.width) * view.height);
    const SumRenderer renderer(plans.plan, plans.owners.runs(), sources, family, coordinates, card);
    if (card && !renderer.rect().empty() && !renderer.drawing().drawn)
      throw Error("not drawn: " + renderer.drawing().why_not);
    const bool any_lost = renderer.render_rows(0, view.height, packed_sums(family, all, samples.data(), lost.data()));
    planes = packed_sums<const int16_t, const uint16_t>(family, all, samples.data(), any_lost ? lost.data() : nullptr);
  }
  std::vector<int16_t> samples;
  std::vector<uint16_t> lost;
  ConstSumPlanes planes;
};

// Weights are those that white images show.
Answer in_sums(PixelFamily family, Coordinates coordinates, gl::SumDrawer* card, const Rig& rig, const Mesh& mesh,
               const View& view, const std::vector<Image>& images) {
  constexpr double kWhite = 255 << kSumFractionBits;
  const Plans plans(rig, mesh, view);
  const size_t pixels = static_cast<size_t>(view.width) * view.height;
  const Rect all{0, 0, view.width, view.height};
  const bool i420 = family == PixelFamily::kI420;
  Answer answer;
  answer.channels = i420 ? 1 : 3;
  answer.valid.resize(pixels);
  answer.lost.resize(pixels);
  std::vector<Image> seen;
  std::vector<Source> sources;
  seen.reserve(rig.cameras.size());
  for (const CameraIndex i : plans.plan.contributors()) {
    const Camera& camera = rig.cameras[i];
    seen.push_back(i420 ? as_i420(images[i]) : images[i]);
    sources.push_back({i, &camera, seen.back().view()});
    const Image rgb = white_image(camera.width, camera.height), white = i420 ? as_i420(rgb) : rgb;
    const Source alone{i, &camera, white.view()};
    const Sum sum(plans, {&alone, 1}, family, coordinates, card);
    Answer::OwnWeights own{i, std::vector<double>(pixels)};
    place(sum.planes.plane[0], all, view.width, 1 / kWhite, own.weight);
    place(sum.planes.plane[0], all, view.width, 1 / kWhite, answer.valid);
    if (sum.planes.lost) {
      place(sum.planes.lost, all, view.width, 1.0 / kLostOne, own.weight);
      place(sum.planes.lost, all, view.width, 1.0 / kLostOne, answer.lost);
    }
    answer.own_weights.push_back(std::move(own));
  }
  const Sum sum(plans, sources, family, coordinates, card);
  Accumulator accumulator;
  accumulator.reset(family, view.width, view.height);
  accumulator.add_kept(sum.planes);
  const Image picture = accumulator.resolve();
  answer.colour.assign(picture.data().begin(),
                       picture.data().begin() + static_cast<ptrdiff_t>(answer.channels * pixels));
  return answer;
}

}  // namespace

// A weight has 15 bits, its sample seven of fraction: two units of 1/32640 each camera. Colours of smooth images: 0.5
// of rounding to 8 bits once, the rest for three such weights and positions good to kGridError.
Subject of_sums(std::string name, PixelFamily family, Coordinates coordinates, gl::SumDrawer* card) {
  return {std::move(name),
          1e-4,
          2e-4,
          0.6,
          0.999,
          [=](const Rig& rig, const Mesh& mesh, const View& view, const std::vector<Image>& images) {
            return in_sums(family, coordinates, card, rig, mesh, view, images);
          }};
}

}  // namespace lf::reference
