// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "image/image.h"
#include "reference/generators.h"
#include "rig/mesh.h"

// Renderers compared with the reference in the hard cases.
namespace lf::reference {

struct Answer {
  struct OwnWeights {
    CameraIndex camera;
    std::vector<double> weight;  // per pixel of the view, 0 outside the camera's rectangle
  };
  std::vector<OwnWeights> own_weights;  // weights of all contributing cameras
  int channels = 3;                     // 3, or 1 if only luma is compared, with the red channel of the rule
  std::vector<double> colour;           // `channels` per pixel, 0..255
  std::vector<double> valid, lost;      // per pixel
};

struct Subject {
  std::string name;
  double weight_bound;     // for any camera in any pixel
  double partition_bound;  // maximum deviation of a pixel's sum of weights from 0 or 1
  double colour_bound;     // levels of 255, where at least `least_valid` of the weight is valid
  double least_valid;
  // `images`: kRgb.
  std::function<Answer(const Rig&, const Mesh&, const View&, const std::vector<Image>&)> render;
};
std::vector<Subject> subjects();

// Copies red to luma, which gives the luma of I420 images a known rule without rounding.
Image as_i420(const Image& rgb);

struct Measured {
  double weight = 0, partition = 0, colour = 0;  // largest errors; infinity for NaN
  double owned = 0;                              // fraction of pixels with an owner
};
bool is_within(const Measured& measured, const Subject& bounds);
// One result for each of `subjects`, over all trials of the case.
std::vector<Measured> measure(const HardCase& hard, const std::vector<Subject>& subjects);

void print_heading(const std::vector<Subject>& subjects);
void print_row(const HardCase& hard, const std::vector<Measured>& measured);

}  // namespace lf::reference
