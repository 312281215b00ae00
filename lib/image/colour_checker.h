// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "base/vec.h"

namespace lf {

// The classic chart of 24 patches in six columns and four rows (ColorChecker): squares on black, in the measures of
// OpenCV's mcc module, in which a patch has a side of 2.5. x to the right and y down as the chart is read, from the
// outer corner of its black border beside the first patch.
namespace checker {

inline constexpr int kColumns = 6, kRows = 4, kPatches = kColumns * kRows;
inline constexpr double kSide = 2.5, kGap = 0.25;
inline constexpr double kWidth = kColumns * (kSide + kGap) + kGap, kHeight = kRows * (kSide + kGap) + kGap;

// The middle of patch 0 to 23, row by row.
inline Vec2 middle(int patch) {
  return {kGap + kSide / 2 + patch % kColumns * (kSide + kGap), kGap + kSide / 2 + patch / kColumns * (kSide + kGap)};
}

// What the patches are like in sRGB under D65 (means of charts of before November 2014, as their maker has them).
inline constexpr int kSrgb[kPatches][3] = {
    {115, 82, 68},   {194, 150, 130}, {98, 122, 157},  {87, 108, 67},   {133, 128, 177}, {103, 189, 170},
    {214, 126, 44},  {80, 91, 166},   {193, 90, 99},   {94, 60, 108},   {157, 188, 64},  {224, 163, 46},
    {56, 61, 150},   {70, 148, 73},   {175, 54, 60},   {231, 199, 31},  {187, 86, 149},  {8, 133, 161},
    {243, 243, 242}, {200, 200, 200}, {160, 160, 160}, {122, 122, 121}, {85, 85, 85},    {52, 52, 52}};

}  // namespace checker
}  // namespace lf
