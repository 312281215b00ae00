// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view_set.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "base/error.h"
#include "rig/rig.h"

namespace lf {
namespace {

// Of the focal plane, along the view's axis, metres; 0 where it is not in front.
double focus_distance(const View& view) {
  const double distance =
      -view.focus.plane.signed_distance(view.pose.position) / glm::dot(view.focus.plane.normal, view.pose.forward());
  return distance > 0 && std::isfinite(distance) ? distance : 0;
}

bool has_shape(const PlaceInSet& place) {
  const int c = place.columns, r = place.rows;
  switch (place.layout) {
    case SetLayout::kMono: return c == 1 && r == 1;
    case SetLayout::kStereo:
    case SetLayout::kCrossEyed: return c == 2 && r == 1;
    case SetLayout::kTopBottom: return c == 1 && r == 2;
    case SetLayout::kRow: return c >= 1 && r == 1;
    case SetLayout::kQuilt: return c >= 1 && r >= 1;
  }
  return false;
}

std::string by(int a, int b) { return std::to_string(a) + "x" + std::to_string(b); }

}  // namespace

int PlaceInSet::column() const {
  return layout == SetLayout::kCrossEyed ? columns - 1 - index : layout == SetLayout::kTopBottom ? 0 : index % columns;
}

int PlaceInSet::row() const {
  return layout == SetLayout::kQuilt ? rows - 1 - index / columns : layout == SetLayout::kTopBottom ? index : 0;
}

void validate(const PlaceInSet& place, int width, int height) {
  if (!has_shape(place))
    throw Error("set: layout " + std::to_string(static_cast<int>(place.layout)) + " has no " +
                by(place.columns, place.rows) + " views");
  if (int64_t{place.columns} * place.rows > PlaceInSet::kMostViews)
    throw Error("set: " + by(place.columns, place.rows) + " views are more than " +
                std::to_string(PlaceInSet::kMostViews));
  if (place.index < 0 || place.index >= place.count())
    throw Error("set: view " + std::to_string(place.index) + " is none of its " + std::to_string(place.count()));
  if (place.count() == 1) return;
  if (width % 2 != 0 || height % 2 != 0)
    throw Error("set: views must have an even width and height, not " + by(width, height));
  if (int64_t{width} * place.columns > kMaxImageSize || int64_t{height} * place.rows > kMaxImageSize)
    throw Error("set: " + by(place.columns, place.rows) + " views of " + by(width, height) +
                " pixels are more than the " + std::to_string(kMaxImageSize) + " a side that a picture may have");
}

PlaceInSet ViewSet::place(int index) const {
  switch (layout) {
    case SetLayout::kStereo:
    case SetLayout::kCrossEyed: return {layout, 2, 1, index};
    case SetLayout::kTopBottom: return {layout, 1, 2, index};
    case SetLayout::kRow: return {layout, columns, 1, index};
    case SetLayout::kQuilt: return {layout, columns, rows, index};
    case SetLayout::kMono: break;
  }
  return {layout, 1, 1, index};
}

std::optional<PlaceInSet> ViewSet::place_at(const Vec2& at) const {
  const PlaceInSet first = place(0);
  if (!(at.x >= 0 && at.x <= first.columns && at.y >= 0 && at.y <= first.rows)) return std::nullopt;
  const int column = std::min(static_cast<int>(at.x), first.columns - 1);
  const int row = std::min(static_cast<int>(at.y), first.rows - 1);
  for (int i = 0; i < first.count(); i++)
    if (const PlaceInSet p = place(i); p.column() == column && p.row() == row) return p;
  return std::nullopt;
}

std::vector<PlaceInSet> ViewSet::places() const {
  const PlaceInSet first = place(0);
  std::vector<PlaceInSet> places = {place(first.leader())};
  for (int i = 0; i < first.count(); i++)
    if (i != first.leader()) places.push_back(place(i));
  return places;
}

View ViewSet::view(const View& middle, const PlaceInSet& place) const {
  const int count = place.count();
  const double from_middle = place.index - (count - 1) / 2.0, distance = focus_distance(middle);
  if (from_middle == 0) return middle;
  const double apart =
      cone > 0 && distance > 0 ? 2 * distance * std::tan(cone * (std::numbers::pi / 360)) / (count - 1) : eye_distance;
  View view = seen_beside(middle, from_middle * apart);
  if (converged && distance > 0) view.lens = view.lens.shifted({view.lens.fx() * from_middle * apart / distance, 0});
  return view;
}

}  // namespace lf
