// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "image/image.h"
#include "reference/generators.h"
#include "rig/mesh.h"

// Renderers beside the reference in the hard cases.
namespace lf::reference {

// What a renderer makes of a view, in numbers.
struct Answer {
  struct OwnWeights {
    CameraIndex camera;
    std::vector<double> weight;  // per pixel of the view, 0 outside its rectangle
  };
  std::vector<OwnWeights> own_weights;  // of all contributing cameras
  int channels = 3;                 // of `colour` that count: 3, or 1 where only luma is set beside the red of the rule
  std::vector<double> colour;       // `channels` per pixel, 0..255
  std::vector<double> valid, lost;  // per pixel
};

// One renderer with the bounds it states.
struct Subject {
  std::string name;
  double weight_bound;     // of any camera in any pixel
  double partition_bound;  // how far the weights of a pixel may be from a sum of 0 or 1
  double colour_bound;     // of 255, where at least `least_valid` of the weight is valid
  double least_valid;
  // `images`: kRgb.
  std::function<Answer(const Rig&, const Mesh&, const View&, const std::vector<Image>&)> render;
};
// Every renderer there is.
std::vector<Subject> subjects();

// Red as luma: then the luma of I420 images has a known rule, rounded nowhere.
Image as_i420(const Image& rgb);

struct Measured {
  double weight = 0, partition = 0, colour = 0;  // largest errors; infinity for a NaN
  double owned = 0;                              // fraction of pixels that some face owns
};
bool is_within(const Measured& measured, const Subject& bounds);
// One each of `subjects`, over all trials of the case.
std::vector<Measured> measure(const HardCase& hard, const std::vector<Subject>& subjects);

// The table of it on standard output: weight and colour errors of each subject, their bounds in the heading.
void print_heading(const std::vector<Subject>& subjects);
void print_row(const HardCase& hard, const std::vector<Measured>& measured);

}  // namespace lf::reference
