// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/numerics.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "base/text.h"
#include "composite/accumulator.h"
#include "reference/float_renderer.h"
#include "reference/renderer.h"
#include "render/gl/gles_renderer.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"
#include "support/fragments.h"

namespace lf::reference {
namespace {

struct Plans {
  Plans(const Rig& rig, const Mesh& mesh, const View& view)
      : plan(rig, mesh, view), owners(plan, {0, 0, view.width, view.height}) {}
  ViewPlan plan;
  FaceIdMap owners;
};

template <class T>
void place(const T* values, const Rect& rect, int width, double scale, std::vector<double>& plane) {
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) plane[static_cast<size_t>(y) * width + x] += *values++ * scale;
}

struct Sum {
  Sum(const Plans& plans, std::span<const Source> sources, PixelFamily family, Coordinates coordinates,
      gl::GlesRenderer* gpu) {
    const View& view = plans.plan.view();
    const Rect all{0, 0, view.width, view.height};
    samples.resize(packed_size(family, view.width, view.height));
    lost.resize(static_cast<size_t>(view.width) * view.height);
    const SumRenderer renderer(plans.plan, plans.owners.runs(), sources, family, coordinates, gpu);
    if (gpu && !renderer.rect().empty() && !renderer.drawing().drawn)
      throw Error("not drawn: " + renderer.drawing().why_not);
    const bool any_missing =
        renderer.render_rows(0, view.height, packed_sums(family, all, samples.data(), lost.data()));
    planes =
        packed_sums<const int16_t, const uint16_t>(family, all, samples.data(), any_missing ? lost.data() : nullptr);
  }
  std::vector<int16_t> samples;
  std::vector<uint16_t> lost;
  ConstSumPlanes planes;
};

Answer in_sums(PixelFamily family, Coordinates coordinates, gl::GlesRenderer* gpu, const Rig& rig, const Mesh& mesh,
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
    const Sum sum(plans, {&alone, 1}, family, coordinates, gpu);
    Answer::OwnWeights own{i, std::vector<double>(pixels)};
    place(sum.planes.plane[0], all, view.width, 1 / kWhite, own.weight);
    place(sum.planes.plane[0], all, view.width, 1 / kWhite, answer.valid);
    if (sum.planes.lost) {
      place(sum.planes.lost, all, view.width, 1.0 / kMissingOne, own.weight);
      place(sum.planes.lost, all, view.width, 1.0 / kMissingOne, answer.lost);
    }
    answer.own_weights.push_back(std::move(own));
  }
  const Sum sum(plans, sources, family, coordinates, gpu);
  Accumulator accumulator;
  accumulator.reset(family, view.width, view.height);
  accumulator.add_borrowed(sum.planes);
  const Image picture = accumulator.resolve();
  answer.colour.assign(picture.data().begin(),
                       picture.data().begin() + static_cast<ptrdiff_t>(answer.channels * pixels));
  return answer;
}

// SumRenderer's 16-bit sums of all cameras, resolved by the compositor; on the GPU if `gpu` is given. A weight has 15
// bits, its sample seven fractional bits: two units of 1/32640 per camera. The colour bound for smooth images: 0.5 for
// rounding to 8 bits once, the rest for three such weights and positions within kGridError.
Subject of_sums(std::string name, PixelFamily family, Coordinates coordinates, gl::GlesRenderer* gpu = nullptr) {
  return {std::move(name),
          1e-4,
          2e-4,
          0.6,
          0.999,
          [=](const Rig& rig, const Mesh& mesh, const View& view, const std::vector<Image>& images) {
            return in_sums(family, coordinates, gpu, rig, mesh, view, images);
          }};
}

// In float, without rounding.
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

// 8-bit sums of single-camera nodes, added up by the compositor. Weights are measured with white images.
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

// Three samples rounded to 8 bits add up to an integer less than 1.5 from their exact sum; a missing weight below half
// a level is dropped.
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

// Returns the machine's GPU or a software renderer. Throws Error if there is neither.
gl::GlesRenderer* any_gpu() {
  static std::string why;
  static const std::unique_ptr<gl::GlesRenderer> gpu = gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  if (!gpu) throw Error("no OpenGL ES 3.1: " + why);
  return gpu.get();
}

// Counts NaN as an infinite error.
void raise(double& largest, double error) {
  if (std::isnan(error)) error = std::numeric_limits<double>::infinity();
  largest = std::max(largest, error);
}

void compare(const Picture& expected, const Subject& subject, const Answer& answer, Measured& m) {
  for (int y = 0; y < expected.height; y++)
    for (int x = 0; x < expected.width; x++) {
      const Pixel& pixel = expected.at(x, y);
      const size_t p = static_cast<size_t>(y) * expected.width + x;
      double sum = 0;
      for (const Answer::OwnWeights& own : answer.own_weights) {
        raise(m.weight, std::abs(own.weight[p] - expected.weight_of(x, y, own.camera)));
        sum += own.weight[p];
      }
      for (int k = 0; k < pixel.corners; k++)  // cameras that the renderer omitted
        if (std::none_of(answer.own_weights.begin(), answer.own_weights.end(),
                         [&](const Answer::OwnWeights& own) { return own.camera == pixel.camera[k]; }))
          raise(m.weight, pixel.weight[k]);
      raise(m.partition, std::abs(sum - (sum > 0.5)));  // independent of the reference
      raise(m.weight, std::abs(answer.valid[p] - pixel.coverage));
      raise(m.weight, std::abs(answer.lost[p] - pixel.lost));
      if (pixel.coverage > subject.least_valid && answer.valid[p] > subject.least_valid)
        for (int c = 0; c < answer.channels; c++)
          raise(m.colour, std::abs(answer.colour[answer.channels * p + c] - pixel.colour[c]));
      m.owned += sum > 0.5;
    }
}

}  // namespace

Image as_i420(const Image& rgb) {
  Image image(PixelFamily::kI420, rgb.width(), rgb.height());
  std::fill(image.data().begin(), image.data().end(), uint8_t{128});
  for (int y = 0; y < rgb.height(); y++)
    for (int x = 0; x < rgb.width(); x++) image.plane(0)[static_cast<size_t>(y) * rgb.width() + x] = rgb.pixel(x, y)[0];
  return image;
}

// Add new renderers here.
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
  all.push_back(of_sums("gl RGB sum", PixelFamily::kRgb, Coordinates::kExact, any_gpu()));
  all.push_back(of_sums("gl I420 sum", PixelFamily::kI420, Coordinates::kExact, any_gpu()));
  return all;
}

bool is_within(const Measured& measured, const Subject& bounds) {
  return measured.weight <= bounds.weight_bound && measured.partition <= bounds.partition_bound &&
         measured.colour <= bounds.colour_bound;
}

std::vector<Measured> measure(const HardCase& hard, const std::vector<Subject>& subjects) {
  std::vector<Measured> measured(subjects.size());
  double pixels = 0;
  for (int trial = 0; trial < hard.trials; trial++) {
    Random random(static_cast<uint64_t>(trial));
    const auto [rig, view] = hard.make(random);
    validate(view);
    const std::vector<Image> images = images_of(rig, random, smooth_image);
    const Mesh mesh = build_mesh(rig);
    const Picture expected = render(rig, mesh, view, images);
    for (size_t i = 0; i < subjects.size(); i++)
      compare(expected, subjects[i], subjects[i].render(rig, mesh, view, images), measured[i]);
    pixels += static_cast<double>(expected.pixels.size());
  }
  for (Measured& m : measured) m.owned /= pixels;
  return measured;
}

void print_heading(const std::vector<Subject>& subjects) {
  std::printf("Largest errors of weights (0..1) and of colours (0..255) against 80-bit reals.\n%-38s", "renderer");
  for (const Subject& subject : subjects) std::printf(" | %-19s", subject.name.c_str());
  std::printf("\n%-38s", "colours where more of the weight than");
  for (const Subject& subject : subjects) std::printf(" | %10g is valid", subject.least_valid);
  std::printf("\n%-38s", "case");
  for (size_t i = 0; i < subjects.size(); i++) std::printf(" | %9s %9s", "weight", "colour");
  std::printf(" | owned\n%-38s", "bound");
  for (const Subject& subject : subjects) std::printf(" | %9.2g %9.2g", subject.weight_bound, subject.colour_bound);
  std::printf(" |\n");
}

void print_row(const HardCase& hard, const std::vector<Measured>& measured) {
  std::printf("%-38s", hard.name);
  for (const Measured& m : measured) std::printf(" | %9.2g %9.2g", m.weight, m.colour);
  std::printf(" | %5.3f\n", measured.empty() ? 0 : measured.front().owned);
}

}  // namespace lf::reference
