// SPDX-License-Identifier: LGPL-2.1-or-later
#include "api/values.h"

#include <cmath>
#include <filesystem>

#include <lightfield/error.h>
#include <lightfield/image.h>
#include <lightfield/rig.h>
#include <lightfield/version.h>
#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "image/image.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "rig/rig_json.h"
#include "view/navigator.h"
#include "view/view.h"

namespace lf::api {
namespace {

Vec3 to_vec(const lightfield::Vec3& v) { return {v.x, v.y, v.z}; }
Quat to_quat(const lightfield::Quaternion& q) { return {q.w, q.x, q.y, q.z}; }

}  // namespace

Pose to_pose(const lightfield::Pose& pose) { return {to_vec(pose.position), to_quat(pose.orientation)}; }

Lens to_lens(const lightfield::Lens& lens) {
  const auto& [fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, fisheye] = lens;
  if (fisheye) {
    if (k5 != 0 || k6 != 0) throw Error("k5 and k6: must be 0 for a fisheye lens");
    if (p1 == 0 && p2 == 0 && s1 == 0 && s2 == 0) return {LensModel::kOpenCvFisheye, {fx, fy, cx, cy, k1, k2, k3, k4}};
    return {LensModel::kThinPrismFisheye, {fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, s1, s2}};
  }
  if (s1 != 0 || s2 != 0) throw Error("s1 and s2: must be 0, except for a fisheye lens");
  if (k3 != 0 || k4 != 0 || k5 != 0 || k6 != 0)
    return {LensModel::kFullOpenCv, {fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6}};
  if (k1 == 0 && k2 == 0 && p1 == 0 && p2 == 0) return {LensModel::kPinhole, {fx, fy, cx, cy}};
  return {LensModel::kOpenCv, {fx, fy, cx, cy, k1, k2, p1, p2}};
}

View to_view(const lightfield::View& view) {
  View out;
  validate_size("width", view.width);
  validate_size("height", view.height);
  out.width = view.width;
  out.height = view.height;
  if (!view.lens && !(view.fov_y > 0 && view.fov_y < 180)) throw Error("fov_y: must be above 0 and below 180 degrees");
  if (!(view.focus_distance > 0) || !std::isfinite(view.focus_distance))
    throw Error("focus_distance: must be above 0 metres");
  if (!std::isfinite(view.aperture) || view.aperture < 0) throw Error("aperture: must not be below 0 metres");
  out.lens = view.lens ? to_lens(*view.lens) : Lens::from_fov_y(view.fov_y, view.width, view.height);
  out.pose = to_pose(view.world_from_view);
  if (is_finite(out.pose.orientation)) out.focus.plane = focal_plane_at(out.pose, view.focus_distance);
  out.blending = make_blending(view.aperture, 0);
  validate(out);
  return out;
}

DepthEstimator::Settings to_settings(lightfield::Focus focus, double nearest, double farthest) {
  if (focus != lightfield::Focus::kPlane && focus != lightfield::Focus::kAuto)
    throw Error("focus: unknown value; use kPlane or kAuto");
  const bool far_enough = nearest == 0 || farthest == 0 || farthest > nearest;
  if (!(nearest >= 0) || !(farthest >= 0) || !std::isfinite(nearest) || !far_enough)
    throw Error("nearest, farthest: must be 0 or distances in metres, nearest below farthest");
  return {focus == lightfield::Focus::kAuto ? FocusMode::kAuto : FocusMode::kPlane, nearest, farthest};
}

lightfield::Pose from_pose(const Pose& pose) {
  const auto& [p, q] = pose;
  return {{p.x, p.y, p.z}, {q.w, q.x, q.y, q.z}};
}

lightfield::Lens from_lens(const Lens& lens) {
  const Distortion<double>& from = lens.distortion();
  return {.fx = lens.fx(),
          .fy = lens.fy(),
          .cx = lens.cx(),
          .cy = lens.cy(),
          .k1 = from.k[0],
          .k2 = from.k[1],
          .p1 = from.p1,
          .p2 = from.p2,
          .k3 = from.k[2],
          .k4 = from.fisheye ? from.k[3] : from.d[0],
          .k5 = from.d[1],
          .k6 = from.d[2],
          .s1 = from.s1,
          .s2 = from.s2,
          .fisheye = from.fisheye};
}

lightfield::Image from_image(Image image) {
  return {static_cast<lightfield::PixelFormat>(image.family()), image.width(), image.height(), std::move(image.data())};
}

ImageView to_image(const lightfield::ImageView& image, const Camera& camera, CameraIndex index) {
  ImageView out;
  if (image.format == lightfield::PixelFormat::kNone) return out;
  const auto fail = [&](const std::string& what) {
    throw Error("the image of camera " + std::to_string(index) + " (id " + std::to_string(camera.id) + ") has " + what);
  };
  if (image.format != lightfield::PixelFormat::kRgb && image.format != lightfield::PixelFormat::kI420)
    fail("an unknown format");
  if (image.width != camera.width || image.height != camera.height)
    fail(size_text(image.width, image.height) + " pixels, the rig says " + size_text(camera.width, camera.height));
  const bool rgb = image.format == lightfield::PixelFormat::kRgb;
  out.family = static_cast<PixelFamily>(image.format);
  out.width = image.width;
  out.height = image.height;
  for (int c = 0; c < (rgb ? 1 : 3); c++) {
    const ptrdiff_t row = rgb ? ptrdiff_t{3} * image.width : c == 0 ? image.width : chroma_size(image.width);
    if (!image.plane[c]) fail("no plane " + std::to_string(c));
    if (image.stride[c] < row)
      fail("a stride of " + std::to_string(image.stride[c]) + " bytes, but its rows need " + std::to_string(row));
    out.plane[c] = image.plane[c];
    out.stride[c] = image.stride[c];
  }
  return out;
}

PixelFamily check_output(const lightfield::MutableImageView& out, int width, int height) {
  const bool rgb = out.format == lightfield::PixelFormat::kRgb;
  if (!rgb && out.format != lightfield::PixelFormat::kI420) throw Error("out: the format must be kRgb or kI420");
  if (out.width != width || out.height != height)
    throw Error("out: has " + size_text(out.width, out.height) + " pixels, the view has " + size_text(width, height));
  for (int c = 0; c < (rgb ? 1 : 3); c++) {
    const ptrdiff_t row = rgb ? ptrdiff_t{3} * width : c == 0 ? width : chroma_size(width);
    if (!out.plane[c]) throw Error("out: has no plane " + std::to_string(c));
    if (out.stride[c] < row)
      throw Error("out: has a stride of " + std::to_string(out.stride[c]) + " bytes, but its rows need " +
                  std::to_string(row));
  }
  return static_cast<PixelFamily>(out.format);
}

PixelFamily family_of(std::span<const lightfield::ImageView> images) {
  PixelFamily family = PixelFamily::kNone;
  for (const lightfield::ImageView& image : images) {
    const auto other = static_cast<PixelFamily>(image.format);
    if (family == PixelFamily::kNone) family = other;
    if (other != PixelFamily::kNone && other != family)
      throw Error("images: some are RGB and some are I420; all must have the same format");
  }
  return family;
}

void check_count(size_t images, size_t count) {
  if (images != count)
    throw Error("images: expected one for each of " + std::to_string(count) + " cameras, got " +
                std::to_string(images));
}

}  // namespace lf::api

namespace lightfield {
namespace {

std::shared_ptr<const Rig::Data> data_of(lf::Rig rig, std::string original = {}) {
  const uint64_t hash = rig.hash();
  return std::make_shared<const Rig::Data>(
      Rig::Data{std::make_shared<const lf::Rig>(std::move(rig)), hash, std::move(original)});
}

lf::Camera to_camera(const Camera& camera) {
  lf::Camera out;
  out.id = camera.id;
  out.name = camera.name;
  out.width = camera.width;
  out.height = camera.height;
  out.lens = lf::api::to_lens(camera.lens);
  out.pose = lf::api::to_pose(camera.world_from_camera);
  out.image = camera.image;
  out.source = camera.source;
  if (camera.colour) {
    const Vec3& black = camera.colour->black;
    out.colour = lf::ColourModel{
        {black.x, black.y, black.z}, camera.colour->gamma, camera.colour->matrix, camera.colour->vignetting};
  }
  return out;
}

lf::Rig to_rig(const std::vector<Camera>& cameras, const Topology& topology) {
  lf::Rig rig;
  for (size_t i = 0; i < cameras.size(); i++) {
    try {
      rig.cameras.push_back(to_camera(cameras[i]));
    } catch (const Error& error) {
      throw Error("cameras[" + std::to_string(i) + "].lens: " + error.what());
    }
  }
  using Type = lf::Topology::Type;
  switch (topology.type) {
    case Topology::Type::kGrid: rig.topology.type = Type::kGrid; break;
    case Topology::Type::kTriangles: rig.topology.type = Type::kTriangles; break;
    default: rig.topology.type = Type::kDelaunay;
  }
  rig.topology.rows = topology.rows;
  rig.topology.columns = topology.columns;
  rig.topology.triangles = topology.triangles;
  return rig;
}

std::shared_ptr<const Rig::Data> parse(const std::string& text, const std::string& name, const std::string& directory) {
  return data_of(lf::parse_rig(text, name, directory), text);
}

std::string json_of(const Rig::Data& data, const lf::Rig& rig) {
  if (data.original.empty()) return lf::rig_to_json(rig);
  const nlohmann::json original = lf::parse_json(data.original, "rig");
  return lf::rig_to_json(rig, &original);
}

// Writes the rig as text and parses it, so that rigs made from values pass the same checks as rig files.
std::shared_ptr<const Rig::Data> checked(const lf::Rig& rig) {
  return data_of(lf::parse_rig(lf::rig_to_json(rig), "rig"));
}

}  // namespace

static_assert(static_cast<int>(PixelFormat::kRgb) == static_cast<int>(lf::PixelFamily::kRgb));
static_assert(static_cast<int>(PixelFormat::kI420) == static_cast<int>(lf::PixelFamily::kI420));

const char* version() { return LF_VERSION; }

Image make_image(PixelFormat format, int width, int height) {
  if (format != PixelFormat::kRgb && format != PixelFormat::kI420) throw Error("format: must be kRgb or kI420");
  lf::validate_size("width", width);
  lf::validate_size("height", height);
  lf::Image image(static_cast<lf::PixelFamily>(format), width, height);
  if (format == PixelFormat::kI420) std::fill(image.plane(1), image.data().data() + image.data().size(), uint8_t{128});
  return {format, width, height, std::move(image.data())};
}

MutableImageView::MutableImageView(Image& image) : format(image.format), width(image.width), height(image.height) {
  const ImageView view(image);
  for (int c = 0; c < 3; c++) {
    plane[c] = const_cast<uint8_t*>(view.plane[c]);
    stride[c] = view.stride[c];
  }
}

ImageView::ImageView(const Image& image) : format(image.format), width(image.width), height(image.height) {
  if (format == PixelFormat::kNone) return;
  const auto family = static_cast<lf::PixelFamily>(format);
  const bool known = format == PixelFormat::kRgb || format == PixelFormat::kI420;
  if (!known || width < 1 || height < 1 || width > lf::kMaxImageSize || height > lf::kMaxImageSize ||
      image.pixels.size() != lf::packed_size(family, width, height))
    throw Error("image: " + std::to_string(image.pixels.size()) + " bytes do not match an image of " +
                lf::size_text(width, height) + " pixels in its format");
  plane[0] = image.pixels.data();
  stride[0] = format == PixelFormat::kRgb ? ptrdiff_t{3} * width : width;
  if (format == PixelFormat::kRgb) return;
  const size_t luma = static_cast<size_t>(width) * height;
  plane[1] = plane[0] + luma;
  plane[2] = plane[1] + (image.pixels.size() - luma) / 2;
  stride[1] = stride[2] = lf::chroma_size(width);
}

View home_view(const Rig& rig, int width, int height) {
  lf::validate_size("width", width);
  lf::validate_size("height", height);
  const lf::Viewpoint home = lf::default_viewpoint(*rig.data().rig);
  View view;
  view.width = width;
  view.height = height;
  view.world_from_view = lf::api::from_pose(home.pose);
  view.fov_y = home.fov_y_deg;
  view.focus_distance = home.focus_distance;
  return view;
}

Pose look_at(const Vec3& eye, const Vec3& target) {
  const lf::Vec3 from(eye.x, eye.y, eye.z), to(target.x, target.y, target.z), down(0, 1, 0);
  const double away = glm::length(to - from);
  if (!(away > 0) || !std::isfinite(away)) throw Error("look_at: eye and target must differ");
  if (!(glm::length(glm::cross(to - from, down)) > 1e-9 * away))
    throw Error("look_at: the line of sight is vertical; choose a target that is not straight above or below the eye");
  return lf::api::from_pose(lf::look_at(from, to, down));
}

Rig::Rig(const std::vector<Camera>& cameras, const Topology& topology) : data_(checked(to_rig(cameras, topology))) {}

size_t Rig::size() const { return data_->rig->cameras.size(); }
uint64_t Rig::hash() const { return data_->hash; }

Camera Rig::camera(size_t index) const {
  if (index >= size())
    throw Error("camera " + std::to_string(index) + " is not one of the " + std::to_string(size()) + " cameras");
  const lf::Camera& camera = data_->rig->cameras[index];
  std::optional<CameraColour> colour;
  if (const auto& of = camera.colour)
    colour = CameraColour{{of->black.x, of->black.y, of->black.z}, of->gamma, of->matrix, of->vignetting};
  return {camera.id,
          camera.name,
          camera.width,
          camera.height,
          lf::api::from_lens(camera.lens),
          lf::api::from_pose(camera.pose),
          camera.image,
          camera.source,
          colour};
}

std::string Rig::json() const { return json_of(*data_, *data_->rig); }

Rig load_rig(const std::string& path) {
  return Rig(parse(lf::read_text_file(path), path, std::filesystem::path(path).parent_path().string()));
}

Rig parse_rig(const std::string& json, const std::string& name) { return Rig(parse(json, name, "")); }

void save_rig(const Rig& rig, const std::string& path) {
  lf::Rig moved = *rig.data().rig;
  lf::rebase_paths(moved, std::filesystem::path(path).parent_path().string());
  lf::write_text_file(json_of(rig.data(), moved), path);
}

}  // namespace lightfield
