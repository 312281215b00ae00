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

// Selection and weights of the cameras of a pixel; see render/camera_weights.h.
struct Blending {
  enum class Kind {
    kMesh = 0,      // corners of the camera triangle that the line of sight crosses, as in the paper
    kAperture = 1,  // all cameras within a synthetic aperture around the line of sight
    kAngle = 2,     // cameras that see the point in focus from the most similar direction and as sharply
  };
  static constexpr double kMaxAperture = 1e6;  // metres
  static constexpr int kMaxNearest = 32;

  Kind kind = Kind::kMesh;
  double aperture = 0;  // kAperture: diameter, metres
  int nearest = 0;      // kAngle: number of cameras, 1..kMaxNearest

  bool is_mesh() const { return kind == Kind::kMesh; }
  bool operator==(const Blending&) const = default;
};

struct View {
  int width = 0, height = 0;  // pixels, 1..kMaxImageSize
  Lens lens;
  Pose pose;  // world_from_view; position: the eye
  FocalSurface focus;
  Blending blending;
  bool operator==(const View&) const = default;
};

// Throws Error ("width: ...", "orientation: ...", "focal_plane: ...", "focal_map: ...", "blending: ...") if a number is
// not finite or out of range, or a quaternion or plane normal is not of unit length (kUnitTolerance).
void validate(const View& view);
// Throws Error ("NAME: ...") unless 1 <= pixels <= kMaxImageSize.
void validate_size(const char* name, int pixels);

// Returns the view moved by `metres` to the right (negative: left), as for one of two eyes. Axes are parallel, the lens
// is the same, and the focal surface stays in the world.
View offset_view(const View& view, double metres);

Plane focal_plane_at(const Pose& view_pose, double distance);

// Returns the blending for user settings: by aperture if set, else by angle if a number of cameras is set, else by the
// mesh.
Blending make_blending(double aperture, int nearest);

// Throws Error ("blending: ...") if a value is out of range, or does not belong to the kind.
void validate(const Blending& blending);

// Arrangement of a set of views in one picture. The views have the same time and their eyes are in a row.
enum class ViewSetLayout : uint8_t {
  kMono = 0,       // one view
  kStereo = 1,     // two views, left view on the left
  kCrossEyed = 2,  // two views, left view on the right
  kTopBottom = 3,  // two views, left view on top
  kRow = 4,        // views from left to right
  kQuilt = 5,      // rows from left to right, left-most view at the bottom left, as lenticular displays expect
};

struct ViewSetPosition {
  static constexpr int kMaxViews = 128;

  ViewSetLayout layout = ViewSetLayout::kMono;
  int columns = 1, rows = 1;  // size of the combined picture, in pictures
  int index = 0;              // index of the view; 0: left-most eye
  bool operator==(const ViewSetPosition&) const = default;

  int count() const { return columns * rows; }
  // True for the view that is requested first, next to the middle. It determines the focal surface of the set.
  bool leads() const { return index == reference_index(); }
  int reference_index() const { return (count() - 1) / 2; }
  int turn() const { return leads() ? 0 : index < reference_index() ? index + 1 : index; }
  // Position of the picture, counted from the top left.
  int column() const;
  int row() const;
};

// Throws Error ("set: ...") if the layout is unknown or has another shape, if there are more than kMaxViews, or if the
// index is out of range. For several views, also if the width or height is odd (chroma could not be combined), or if
// the combined picture is too large.
void validate(const ViewSetPosition& place, int width, int height);

// A set of views around a middle view, all in the same direction.
struct ViewSet {
  ViewSetLayout layout = ViewSetLayout::kMono;
  int columns = 8, rows = 6;    // size of a quilt; kRow only uses columns
  double eye_distance = 0.063;  // metres between neighbouring eyes
  // Angle in degrees between the outermost eyes, seen from the middle of the focal plane. Replaces eye_distance unless
  // it is 0 or the plane is not in front of the view.
  double cone = 0;
  // True: pictures are shifted so that the middle of the focal plane is at the same place in all pictures. This holds
  // for the whole plane if it faces the view and the lens has no distortion. False: lines of sight are parallel.
  bool converged = true;

  ViewSetPosition place(int index) const;
  // Returns the view at a position of the combined picture, which is given from the top left, in widths and heights of
  // one picture.
  std::optional<ViewSetPosition> place_at(const Vec2& at) const;
  // Returns all positions in the order of requests: the reference view, then the rest from the left.
  std::vector<ViewSetPosition> places() const;
  // Returns the view at a position; `middle` itself if there is only one view.
  View view(const View& middle, const ViewSetPosition& place) const;
};

// A display behind a sheet of upright or slanted cylindrical lenses (or slits). Each direction sees a different stripe
// behind each lens: stripes of many views side by side behind each lens show a light field without glasses. Each pixel
// has a red, a green and a blue stripe, from left to right, each a third of its width. (C. van Berkel, Image
// preparation for 3D-LCD, 1999: the view of a subpixel from its place under a slanted lens.)
struct LenticularDisplay {
  double lens_pitch = 0;  // pixels along a row of the display; more than 0
  double slant = 0;       // degrees to the right from upright, between -90 and 90
  double centre = 0;      // offset of a lens centre from the centre of the display to the right, in lens widths
  bool reversed = false;  // lenses show stripes in reverse order, as when the display is turned around

  // Returns the position within its lens of a point `x`, `y` (pixels right and down from the centre of the display): 0
  // at the left border to 1.
  double place(double x, double y) const;
};
// Throws Error ("lenses: ...") if the width is not positive and finite, or the slant or centre is out of range.
void validate(const LenticularDisplay& display);

// Views side by side in one picture: from left to right, rows from the bottom up, as in ViewSetLayout::kQuilt.
struct Quilt {
  ImageView picture;  // PixelFamily::kRgb, `columns` x `rows` pictures of one size
  int columns = 1, rows = 1;
  int count() const { return columns * rows; }
};

// Writes `width` x `height` RGB pixels of 3 bytes, rows `stride` bytes apart. Each view is scaled to the whole display
// (bilinear in 8 bits, within 2 of 255), and each subpixel shows the view that is visible there. The left part of a
// lens emits light to the right, so view 0, of the left-most eye, is at the right border of a lens. `parallel`
// distributes the rows.
void interleave_views(const LenticularDisplay& display, const Quilt& quilt, int width, int height, ptrdiff_t stride,
                      uint8_t* out, const ParallelFor& parallel = serial_for);

}  // namespace lf
