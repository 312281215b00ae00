// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "view/view.h"

namespace lf {

// How the pictures of a set of views, which are of one moment from eyes in a row, make one picture.
enum class SetLayout : uint8_t {
  kMono = 0,       // one view
  kStereo = 1,     // two views, the left one on the left
  kCrossEyed = 2,  // two views, the left one on the right
  kTopBottom = 3,  // two views, the left one on top
  kRow = 4,        // from left to right
  kQuilt = 5,      // in rows from left to right, the left-most view at the bottom left, as displays with lenses take it
};

// Which view of a set one view is, and where its picture goes.
struct PlaceInSet {
  static constexpr int kMostViews = 128;

  SetLayout layout = SetLayout::kMono;
  int columns = 1, rows = 1;  // of pictures
  int index = 0;              // of the view; 0 has the left-most eye
  bool operator==(const PlaceInSet&) const = default;

  int count() const { return columns * rows; }
  // The view that is asked for first, one next to the middle: the set's focal surface is found from it.
  bool leads() const { return index == leader(); }
  int leader() const { return (count() - 1) / 2; }
  // How many of the set are asked for before it.
  int turn() const { return leads() ? 0 : index < leader() ? index + 1 : index; }
  // Where the picture goes, counted from the top left.
  int column() const;
  int row() const;
};

// Throws Error ("set: ...") for a layout that there is not or that does not have so many columns and rows, more than
// kMostViews, an index that is none of them; and, of more than one view, for pictures of odd width or height, which
// could not be put beside each other with their chroma, or that are together larger than a picture may be.
void validate(const PlaceInSet& place, int width, int height);

// A set of views around one. All eyes look the same way.
struct ViewSet {
  SetLayout layout = SetLayout::kMono;
  int columns = 8, rows = 6;    // of a quilt; a row has one row
  double eye_distance = 0.063;  // metres from eye to eye
  // In place of eye_distance: the angle, in degrees, between the outermost eyes as seen from the middle of the focal
  // plane; 0: none. Where that plane is not in front of the view, eye_distance counts.
  double cone = 0;
  // Pictures are shifted so that what is in the middle of the focal plane is in the same place of all of them (exactly
  // all that is in the plane, where it faces the view and the lens does not distort); else lines of sight are parallel.
  bool converged = true;

  PlaceInSet place(int index) const;
  // The view whose picture shows a place that is given from the top left of all, in widths and heights of one picture.
  std::optional<PlaceInSet> place_at(const Vec2& at) const;
  // The places in the order in which they are asked for: the one that leads, then all others from the left.
  std::vector<PlaceInSet> places() const;
  // The view of one place: exactly `middle` for the only one.
  View view(const View& middle, const PlaceInSet& place) const;
};

}  // namespace lf
