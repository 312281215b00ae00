// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/worker_pool.h"
#include "geometry/lens.h"
#include "geometry/pose.h"
#include "image/image.h"

namespace lf {

// How many cameras make a pixel, and with which weights; see render/camera_weights.h.
struct Blending {
  enum class Kind {
    kMesh = 0,      // the corners of the triangle of cameras that the line of sight passes, as in the paper
    kAperture = 1,  // all cameras within a synthetic aperture around the line of sight
    kAngle = 2,     // the cameras that see what is in focus most nearly as the view does, as sharply, and at all
  };
  static constexpr double kMaxAperture = 1e6;  // metres
  static constexpr int kMaxNearest = 32;

  Kind kind = Kind::kMesh;
  double aperture = 0;  // kAperture: diameter, metres
  int nearest = 0;      // kAngle: how many cameras, 1..kMaxNearest

  bool is_mesh() const { return kind == Kind::kMesh; }
  bool operator==(const Blending&) const = default;
};

// One virtual camera: what to render.
struct View {
  int width = 0, height = 0;  // pixels, 1..kMaxImageSize
  Lens lens;
  Pose pose;  // world_from_view; position = the eye E
  FocalSurface focus;
  Blending blending;
  bool operator==(const View&) const = default;
};

// Throws Error ("width: ...", "orientation: ...", "focal_plane: ...", "focal_map: ...", "blending: ...") if a
// number is not finite, a size out of range, a quaternion or a plane normal not of unit length (kUnitTolerance).
void validate(const View& view);
// Throws Error ("NAME: ...") for pixels a side that no view has.
void validate_size(const char* name, int pixels);

// The view of an eye that stands `metres` to the right of the given view's (less than 0: to the left), as one of two
// eyes does: axes are parallel, the lens is the same, and the focal surface stays where it is in the world.
View seen_beside(const View& view, double metres);

// The plane facing the view at `distance` metres along its optical axis.
Plane focal_plane_at(const Pose& view_pose, double distance);

// The blending that a person chooses: by an aperture if there is one, else by angle if there is a number of cameras,
// else by the mesh.
Blending blending_of(double aperture, int nearest);

// Throws Error ("blending: ...") for an aperture that is not positive or a number out of range, and for either beside a
// kind that does not have it.
void validate(const Blending& blending);

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

// A display behind a sheet of upright or slanted cylinder lenses (or slits), which show another stripe of what is
// behind them to each side: stripes of many views, one beside the other behind each lens, are a light field without
// glasses. Each pixel has a red, a green and a blue stripe, from left to right, each a third of its width.
// (C. van Berkel, Image preparation for 3D-LCD, 1999: the view of a subpixel from its place under a slanted lens.)
struct LensDisplay {
  double lens_width = 0;  // pixels along a row of the display; more than 0
  double slant = 0;       // degrees that lenses lean to the right from upright, less than 90 either way
  double centre = 0;      // lens widths that the middle of a lens is to the right of the display's middle
  bool reversed = false;  // the lenses show stripes the other way round, as where what is shown is turned about

  // The place in its lens of what is `x`, `y` (pixels, to the right and down) from the display's middle: from 0, at the
  // left border, to 1.
  double place(double x, double y) const;
};
// Throws Error ("lenses: ...") for a width that is not positive and finite, or a slant or centre out of range.
void validate(const LensDisplay& display);

// Views side by side in one picture, as many in a row and as many rows as given: from left to right, the rows from
// below, as in SetLayout::kQuilt (a row of views is one of one row).
struct Quilt {
  ImageView picture;  // of PixelFamily::kRgb, `columns` x `rows` pictures of one size
  int columns = 1, rows = 1;
  int count() const { return columns * rows; }
};

// Fills `width` x `height` pixels of RGB, 3 bytes each, rows `stride` bytes apart: each view is spread over the whole
// display (bilinear in 8 bits, within 2 of 255), and each subpixel is of the view that is seen there. What leaves a
// lens from its left part goes to the right, so that view 0, of the left-most eye, is seen at the right border of a
// lens. Rows are shared out by `parallel`.
void interleave(const LensDisplay& display, const Quilt& quilt, int width, int height, ptrdiff_t stride, uint8_t* out,
                const ParallelFor& parallel = serial_for);

}  // namespace lf
