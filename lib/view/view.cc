// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "base/text.h"
#include "rig/rig.h"

namespace lf {

void validate_size(const char* name, int pixels) {
  if (pixels < 1 || pixels > kMaxImageSize)
    throw Error(std::string(name) + ": must be 1 to " + std::to_string(kMaxImageSize) + " pixels, is " +
                std::to_string(pixels));
}

void validate(const View& view) {
  validate_size("width", view.width);
  validate_size("height", view.height);
  if (!is_finite(view.pose.position)) throw Error("position: must be finite numbers");
  if (!(std::abs(glm::length(view.pose.orientation) - 1) <= kUnitTolerance))
    throw Error("orientation: must be a quaternion of unit norm");
  validate(view.focus, view.width, view.height);
  validate(view.blending);
}

View offset_view(const View& view, double metres) {
  View beside = view;
  beside.pose.position += metres * view.pose.right();
  return beside;
}

Plane focal_plane_at(const Pose& view_pose, double distance) {
  const Vec3 axis = view_pose.forward();
  return plane_through(view_pose.position + distance * axis, -axis);
}

Blending make_blending(double aperture, int nearest) {
  if (aperture != 0) return {Blending::Kind::kAperture, aperture, 0};
  if (nearest != 0) return {Blending::Kind::kAngle, 0, nearest};
  return {};
}

void validate(const Blending& blending) {
  const bool wide = blending.kind == Blending::Kind::kAperture, by_angle = blending.kind == Blending::Kind::kAngle;
  if (wide ? !(blending.aperture > 0 && blending.aperture <= Blending::kMaxAperture) : blending.aperture != 0)
    throw Error(wide ? "blending: the aperture must be above 0, at most 1000000 m"
                     : "blending: this kind has no aperture");
  if (by_angle ? !(blending.nearest >= 1 && blending.nearest <= Blending::kMaxNearest) : blending.nearest != 0)
    throw Error(by_angle ? "blending: must use the nearest 1 to " + std::to_string(Blending::kMaxNearest) + " cameras"
                         : "blending: this kind has no number of cameras");
}

namespace {

// Returns the distance of the focal plane along the view's axis, in metres; 0 if the plane is not in front.
double focus_distance(const View& view) {
  const double distance =
      -view.focus.plane.signed_distance(view.pose.position) / glm::dot(view.focus.plane.normal, view.pose.forward());
  return distance > 0 && std::isfinite(distance) ? distance : 0;
}

bool has_shape(const ViewSetPosition& place) {
  const int c = place.columns, r = place.rows;
  switch (place.layout) {
    case ViewSetLayout::kMono: return c == 1 && r == 1;
    case ViewSetLayout::kStereo:
    case ViewSetLayout::kCrossEyed: return c == 2 && r == 1;
    case ViewSetLayout::kTopBottom: return c == 1 && r == 2;
    case ViewSetLayout::kRow: return c >= 1 && r == 1;
    case ViewSetLayout::kQuilt: return c >= 1 && r >= 1;
  }
  return false;
}

std::string by(int a, int b) { return std::to_string(a) + "x" + std::to_string(b); }

}  // namespace

int ViewSetPosition::column() const {
  return layout == ViewSetLayout::kCrossEyed   ? columns - 1 - index
         : layout == ViewSetLayout::kTopBottom ? 0
                                               : index % columns;
}

int ViewSetPosition::row() const {
  return layout == ViewSetLayout::kQuilt ? rows - 1 - index / columns : layout == ViewSetLayout::kTopBottom ? index : 0;
}

void validate(const ViewSetPosition& place, int width, int height) {
  if (!has_shape(place))
    throw Error("set: layout " + std::to_string(static_cast<int>(place.layout)) + " has no " +
                by(place.columns, place.rows) + " views");
  if (int64_t{place.columns} * place.rows > ViewSetPosition::kMaxViews)
    throw Error("set: " + by(place.columns, place.rows) + " views are more than " +
                std::to_string(ViewSetPosition::kMaxViews));
  if (place.index < 0 || place.index >= place.count())
    throw Error("set: view " + std::to_string(place.index) + " is out of range: number of views is " +
                std::to_string(place.count()));
  if (place.count() == 1) return;
  if (width % 2 != 0 || height % 2 != 0)
    throw Error("set: views must have an even width and height, not " + by(width, height));
  if (int64_t{width} * place.columns > kMaxImageSize || int64_t{height} * place.rows > kMaxImageSize)
    throw Error("set: " + by(place.columns, place.rows) + " views of " + by(width, height) +
                " pixels are more than the " + std::to_string(kMaxImageSize) + " a side that a picture may have");
}

ViewSetPosition ViewSet::place(int index) const {
  switch (layout) {
    case ViewSetLayout::kStereo:
    case ViewSetLayout::kCrossEyed: return {layout, 2, 1, index};
    case ViewSetLayout::kTopBottom: return {layout, 1, 2, index};
    case ViewSetLayout::kRow: return {layout, columns, 1, index};
    case ViewSetLayout::kQuilt: return {layout, columns, rows, index};
    case ViewSetLayout::kMono: break;
  }
  return {layout, 1, 1, index};
}

std::optional<ViewSetPosition> ViewSet::place_at(const Vec2& at) const {
  const ViewSetPosition first = place(0);
  if (!(at.x >= 0 && at.x <= first.columns && at.y >= 0 && at.y <= first.rows)) return std::nullopt;
  const int column = std::min(static_cast<int>(at.x), first.columns - 1);
  const int row = std::min(static_cast<int>(at.y), first.rows - 1);
  for (int i = 0; i < first.count(); i++)
    if (const ViewSetPosition p = place(i); p.column() == column && p.row() == row) return p;
  return std::nullopt;
}

std::vector<ViewSetPosition> ViewSet::places() const {
  const ViewSetPosition first = place(0);
  std::vector<ViewSetPosition> places = {place(first.reference_index())};
  for (int i = 0; i < first.count(); i++)
    if (i != first.reference_index()) places.push_back(place(i));
  return places;
}

View ViewSet::view(const View& middle, const ViewSetPosition& place) const {
  const int count = place.count();
  const double from_middle = place.index - (count - 1) / 2.0, distance = focus_distance(middle);
  if (from_middle == 0) return middle;
  const double apart =
      cone > 0 && distance > 0 ? 2 * distance * std::tan(cone * (std::numbers::pi / 360)) / (count - 1) : eye_distance;
  View view = offset_view(middle, from_middle * apart);
  if (converged && distance > 0) view.lens = view.lens.shifted({view.lens.fx() * from_middle * apart / distance, 0});
  return view;
}

namespace {

constexpr int kBand = 16;

double tangent(const LenticularDisplay& display) { return std::tan(display.slant * std::numbers::pi / 180); }

// The two samples of a view next to a position along one side of the display, and the weight of the second in 1/256.
struct Interpolation {
  int first, second;
  int part;
};
std::vector<Interpolation> stretch(int samples, int pixels) {
  std::vector<Interpolation> out;
  out.reserve(static_cast<size_t>(pixels));
  for (int i = 0; i < pixels; i++) {
    const double at = std::clamp((i + 0.5) * samples / pixels - 0.5, 0., samples - 1.);
    const int first = static_cast<int>(at);
    out.push_back({first, std::min(first + 1, samples - 1), static_cast<int>(std::lround((at - first) * 256))});
  }
  return out;
}

// Positions within lenses are in 1/2^32, so that integer overflow wraps from one lens to the next.
uint64_t in_lenses(double lenses) { return static_cast<uint64_t>(std::llround(std::ldexp(lenses, 32))); }

}  // namespace

double LenticularDisplay::place(double x, double y) const {
  const double lenses = (x + y * tangent(*this)) / lens_pitch - centre + 0.5;
  return lenses - std::floor(lenses);
}

void validate(const LenticularDisplay& display) {
  if (!(display.lens_pitch > 0) || !std::isfinite(display.lens_pitch)) throw Error("lenses: width must be positive");
  if (!(std::abs(display.slant) < 90)) throw Error("lenses: slant must be between -90 and 90 degrees");
  if (!std::isfinite(display.centre)) throw Error("lenses: centre must be finite");
}

void interleave_views(const LenticularDisplay& display, const Quilt& quilt, int width, int height, ptrdiff_t stride,
                      uint8_t* out, const ParallelFor& parallel) {
  validate(display);
  const ImageView& picture = quilt.picture;
  const int view_width = picture.width / quilt.columns, view_height = picture.height / quilt.rows;
  const std::vector<Interpolation> across = stretch(view_width, width), down = stretch(view_height, height);
  const RgbLayout& layout = picture.layout;
  const int channels[3] = {layout.r, layout.g, layout.b};
  const auto views = static_cast<uint64_t>(quilt.count());
  // The offsets of the top left sample of each view, in the order of the views across a lens.
  std::vector<const uint8_t*> corners;
  for (int k = 0; k < quilt.count(); k++) {
    const int view = display.reversed ? k : quilt.count() - 1 - k;
    const int column = view % quilt.columns, row = quilt.rows - 1 - view / quilt.columns;
    corners.push_back(picture.plane[0] + ptrdiff_t{row} * view_height * picture.stride[0] +
                      ptrdiff_t{column} * view_width * layout.pixel_stride);
  }
  const uint64_t step = in_lenses(1 / (3 * display.lens_pitch));
  const auto row = [&](int y) {
    const double from_middle = y - (height - 1) / 2.0;
    uint64_t place = in_lenses(display.place(-(width - 1) / 2.0 - 1. / 3, from_middle));
    const auto [upper, lower, below] = down[y];
    const ptrdiff_t upper_row = upper * picture.stride[0], lower_row = lower * picture.stride[0];
    uint8_t* to = out + y * stride;
    for (int x = 0; x < width; x++) {
      const ptrdiff_t left = ptrdiff_t{across[x].first} * layout.pixel_stride;
      const ptrdiff_t right = ptrdiff_t{across[x].second} * layout.pixel_stride;
      const int part = across[x].part;
      for (int c = 0; c < 3; c++, place += step) {
        const uint8_t* const view = corners[(place & 0xFFFFFFFFu) * views >> 32] + channels[c];
        const int top = view[upper_row + left] * (256 - part) + view[upper_row + right] * part;
        const int bottom = view[lower_row + left] * (256 - part) + view[lower_row + right] * part;
        *to++ = static_cast<uint8_t>((top * (256 - below) + bottom * below + (1 << 15)) >> 16);
      }
    }
  };
  parallel(static_cast<size_t>((height + kBand - 1) / kBand), [&](size_t band) {
    const int first = static_cast<int>(band) * kBand;
    for (int y = first; y < std::min(first + kBand, height); y++) row(y);
  });
}

}  // namespace lf
