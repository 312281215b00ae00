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

// The rule for blending the colour of a pixel from the cameras: the cameras that contribute, and their weights. See
// render/camera_weights.h.
struct Blending {
  enum class Kind {
    kMesh = 0,      // the three corners of the camera triangle that the line of sight crosses
    kAperture = 1,  // all cameras within a circle around the line of sight, like the lens of a large camera
    kAngle = 2,     // the cameras that see the point in focus from the most similar directions, at a similar resolution
  };
  static constexpr double kMaxAperture = 1e6;  // metres
  static constexpr int kMaxNearest = 32;

  Kind kind = Kind::kMesh;
  double aperture = 0;  // kAperture only: diameter of the circle, metres
  int nearest = 0;      // kAngle only: number of cameras, 1 to kMaxNearest
  // kMesh only: true if pixels with lines of sight that pass beside the mesh are extrapolated from the nearest cameras
  // instead of staying empty. This field is not transmitted. It is false for probes and true for all other requests.
  bool extrapolates = true;
  // kMesh only, with `extrapolates`: true if pixels inside the mesh are extrapolated, too, where the cameras of their
  // face do not see the scene. The wire has no such field, so all requests have true.
  bool fills_gaps = true;

  bool is_mesh() const { return kind == Kind::kMesh; }
  bool operator==(const Blending&) const = default;
};

// Everything that defines a picture except its time: size, lens, pose, the surface in focus, and the blending.
struct View {
  int width = 0, height = 0;  // pixels, 1 to kMaxImageSize
  Lens lens;
  Pose pose;  // world_from_view; the position is the eye
  FocalSurface focus;
  Blending blending;
  bool operator==(const View&) const = default;
};

// Checks a view that comes from a user or from the network. Throws Error if a number is not finite or out of range, or
// if a quaternion or a plane normal is not of unit length (kUnitTolerance). The text starts with the member: "width:
// ...", "focal_plane: ...".
void validate(const View& view);
// Checks the width or height of a picture. Throws Error ("NAME: ...") unless `pixels` is within 1 to kMaxImageSize.
void validate_size(const char* name, int pixels);

// Returns the same view from an eye `metres` to the right (negative: to the left), as for one eye of a stereo pair. The
// axes are parallel, and the focal surface does not move.
View offset_view(const View& view, double metres);

Plane focal_plane_at(const Pose& view_pose, double distance);

// Returns the blending for settings of a user; 0 means "not set". Aperture blending takes precedence over blending by
// angle; with neither, the result is mesh blending.
Blending make_blending(double aperture, int nearest);

// Checks that the values belong to the kind of blending and are in range. Throws Error ("blending: ...") otherwise.
void validate(const Blending& blending);

// How the pictures of several views are combined into one picture, for 3D displays. The eyes of these views form a row,
// and all views show the same time.
enum class ViewSetLayout : uint8_t {
  kMono = 0,
  kStereo = 1,     // two views, left view on the left
  kCrossEyed = 2,  // two views, left view on the right
  kTopBottom = 3,  // two views, left view on top
  kRow = 4,        // views from left to right
  kQuilt = 5,      // a quilt: rows from bottom to top, each from left to right; the format of lenticular displays
};

// The position of one view in a set of views that are combined in one picture.
struct ViewSetPosition {
  static constexpr int kMaxViews = 128;

  ViewSetLayout layout = ViewSetLayout::kMono;
  int columns = 1, rows = 1;  // size of the combined picture, in views
  int index = 0;              // number of the view; 0 is the left-most eye
  bool operator==(const ViewSetPosition&) const = default;

  int count() const { return columns * rows; }
  // Returns true for the reference view, which is next to the middle of the set. This view is requested first and
  // determines the focal surface (the depths in focus) of the whole set.
  bool leads() const { return index == reference_index(); }
  int reference_index() const { return (count() - 1) / 2; }
  // Number of the view in the order of the requests: the reference view is 0, then the rest follows from left to right.
  int turn() const { return leads() ? 0 : index < reference_index() ? index + 1 : index; }
  // Column and row of the view in the combined picture, counted from the top left.
  int column() const;
  int row() const;
};

// Checks the position of a view in a set. Throws Error ("set: ...") if the layout is unknown or does not match columns
// and rows, if there are more than kMaxViews views, or if the index is out of range. Several views also need an even
// width and height, because their chroma samples could not be combined otherwise. The combined picture must not be
// larger than kMaxImageSize a side.
void validate(const ViewSetPosition& place, int width, int height);

// A row of views around a middle view, all with parallel axes.
struct ViewSet {
  ViewSetLayout layout = ViewSetLayout::kMono;
  int columns = 8, rows = 6;    // size of a quilt; kRow only uses columns
  double eye_distance = 0.063;  // metres between neighbouring eyes
  // Angle between the outermost eyes in degrees, seen from the middle of the focal plane. The angle replaces
  // eye_distance, unless it is 0 or the focal plane is not in front of the view.
  double cone = 0;
  // True: each picture is shifted so that the middle of the focal plane appears at the same place in all pictures. The
  // whole plane then coincides if it is perpendicular to the optical axis and the lens has no distortion. False: the
  // pictures are not shifted, so only infinity coincides.
  bool converged = true;

  ViewSetPosition place(int index) const;
  // Returns the view at a point of the combined picture. `at` is measured from the top left, in widths and heights of
  // one view.
  std::optional<ViewSetPosition> place_at(const Vec2& at) const;
  // Returns all positions in the order of their requests: the reference view first, then the rest from left to right.
  std::vector<ViewSetPosition> places() const;
  // Returns the view at a position, or `middle` itself if the set has only one view.
  View view(const View& middle, const ViewSetPosition& place) const;
};

// A lenticular display: a screen behind a sheet of upright or slanted cylindrical lenses (or slits). Each direction
// sees a different stripe of pixels behind each lens. If these stripes show different views, the display shows a light
// field without glasses. Each pixel consists of a red, a green and a blue stripe from left to right, each a third as
// wide as the pixel. The assignment of views follows C. van Berkel, Image preparation for 3D-LCD, 1999.
struct LenticularDisplay {
  double lens_pitch = 0;  // width of a lens along a row of the display, pixels; more than 0
  double slant = 0;       // inclination of the lenses to the right, degrees, between -90 and 90
  double centre = 0;      // distance of a lens centre to the right of the display centre, in lens widths
  // the lenses show the stripes in reverse order, for example because the display is turned around
  bool reversed = false;

  // Returns the position of a point within its lens, from 0 (left border) to 1. `x` and `y` are pixels right of and
  // below the centre of the display.
  double place(double x, double y) const;
};
// Checks the geometry of a display. Throws Error ("lenses: ...") if the lens width is not positive and finite, or if
// the slant or the centre is out of range.
void validate(const LenticularDisplay& display);

// Several views in one picture, from left to right in rows from the bottom up (ViewSetLayout::kQuilt).
struct Quilt {
  ImageView picture;  // PixelFamily::kRgb; all views have the same size
  int columns = 1, rows = 1;
  int count() const { return columns * rows; }
};

// Renders a quilt for a lenticular display. Writes `width` x `height` RGB pixels of 3 bytes; rows are `stride` bytes
// apart. Each view is scaled to the whole display (bilinear, accurate to 2 of 255), and each subpixel takes its value
// from the view that is visible there. The left part of a lens emits light to the right, so the view of the left-most
// eye is at the right border of each lens. `parallel` distributes the rows over threads.
void interleave_views(const LenticularDisplay& display, const Quilt& quilt, int width, int height, ptrdiff_t stride,
                      uint8_t* out, const ParallelFor& parallel = serial_for);

}  // namespace lf
