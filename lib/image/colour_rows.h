// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "image/colour_correction.h"
#include "image/correction.h"

namespace lf {

// The loops of ColourCorrection: they correct the parts of the planes that are asked for.
void correct_i420(const ColourCorrection::Tables& tables, const PlaneCopy& y, const PlaneCopy& cb, const PlaneCopy& cr);
void correct_rgb(const ColourCorrection::Tables& tables, const PlaneCopy& plane, const RgbLayout& layout);

}  // namespace lf
