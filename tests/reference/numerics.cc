// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/numerics.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "reference/renderer.h"

namespace lf::reference {
namespace {

// Keeps NaN as the largest of all errors.
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
      for (int k = 0; k < pixel.corners; k++)  // cameras that were left out altogether
        if (std::none_of(answer.own_weights.begin(), answer.own_weights.end(),
                         [&](const Answer::OwnWeights& own) { return own.camera == pixel.camera[k]; }))
          raise(m.weight, pixel.weight[k]);
      raise(m.partition, std::abs(sum - (sum > 0.5)));  // whatever the reference says
      raise(m.weight, std::abs(answer.valid[p] - pixel.coverage));
      raise(m.weight, std::abs(answer.lost[p] - pixel.lost));
      if (pixel.coverage > subject.least_valid && answer.valid[p] > subject.least_valid)
        for (int c = 0; c < answer.channels; c++)
          raise(m.colour, std::abs(answer.colour[answer.channels * p + c] - pixel.colour[c]));
      m.owned += sum > 0.5;
    }
}

}  // namespace

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
