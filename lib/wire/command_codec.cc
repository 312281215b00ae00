// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/command_codec.h"

#include "base/text.h"
#include "wire/request_codec.h"
#include "wire/unit.h"

namespace lf::wire {
namespace {

constexpr uint16_t kNoCorner = 0xffff;
constexpr size_t kTriangleBytes = 6 + 8 + 3 * 24 + 24, kProjectionBytes = 2 + 72, kRegionBytes = 10;

void check_camera(CameraIndex camera, size_t place) {
  if (camera >= kMaxCameras)
    throw Error("cameras[" + std::to_string(place) + "]: camera " + std::to_string(camera) + " is beyond " +
                std::to_string(kMaxCameras - 1));
}

void check_reserved(uint32_t value) {
  if (value != 0) throw Error("reserved: must be 0, is " + std::to_string(value));
}

void check_size(size_t size) {
  if (size > kMaxRequestBytes)
    throw Error("length: the command has " + std::to_string(size) + " bytes, at most " +
                std::to_string(kMaxRequestBytes) + " may be sent");
}

void put_rect(Writer& out, const Rect& rect) {
  for (const int value : {rect.x0, rect.y0, rect.width(), rect.height()}) out.put(static_cast<uint16_t>(value));
}

Rect get_rect(Reader& in) {
  const int x = in.get<uint16_t>(), y = in.get<uint16_t>(), w = in.get<uint16_t>(), h = in.get<uint16_t>();
  return {x, y, x + w, y + h};
}

void check(const WarpCommand& command) {
  check_request_head(command);
  validate(command.warp);
  size_t rows = 0;  // the memory for finding pixel owners grows with the rows
  for (const FacePlan& face : command.warp.faces) rows += static_cast<size_t>(face.rect.height());
  if (rows > kMaxTriangleRows)
    throw Error("triangles: have " + std::to_string(rows) + " rows together, at most " +
                std::to_string(kMaxTriangleRows) + " are allowed");
  for (size_t i = 0; i < command.warp.cameras.size(); i++) check_camera(command.warp.cameras[i].camera, i);
}

void check(const PixelCommand& command) {
  check_request_head(command);
  validate_size("width", command.view_width);
  validate_size("height", command.view_height);
  for (size_t i = 0; i < command.regions.size(); i++) {
    const PixelCommand::Region& region = command.regions[i];
    check_camera(region.camera, i);
    const auto place = [i] { return "cameras[" + std::to_string(i) + "]: "; };
    if (i > 0 && region.camera <= command.regions[i - 1].camera) throw Error(place() + "cameras must ascend");
    const Rect& rect = region.rect;
    if (rect.empty()) throw Error(place() + "the rectangle is empty");
    if (rect.x0 < 0 || rect.y0 < 0 || rect.x1 > kMaxImageSize || rect.y1 > kMaxImageSize)
      throw Error(place() + "the rectangle is not inside any image");
    if (rect.x0 % 2 != 0 || rect.y0 % 2 != 0) throw Error(place() + "x and y must be even");
  }
}

FacePlan read_triangle(Reader& in, uint32_t number) {
  FacePlan face{.face = number};
  for (CameraIndex& camera : face.camera) {
    camera = in.get<uint16_t>();
    if (camera == kNoCorner) camera = MeshFace::kNone;
  }
  face.rect = get_rect(in);
  for (Vec3& edge : face.edge) edge = get_vec(in);
  face.facing = get_vec(in);
  return face;
}

WarpCommand read_warp_command(std::span<const uint8_t> bytes) {
  WarpCommand command;
  ViewWarp& warp = command.warp;
  Reader in = read_request_head(bytes, kWarpCommandType, command, warp.width, warp.height);
  const uint8_t model_code = in.get<uint8_t>();
  check_reserved(in.get<uint16_t>());
  warp.in_front = get_vec(in);
  check_remaining(in, "in_front");
  warp.lens = read_lens(in, model_code);
  const uint32_t triangles = in.get<uint32_t>(), cameras = in.get<uint32_t>();
  check_remaining(in, "cameras");
  if (in.left() != triangles * uint64_t{kTriangleBytes} + cameras * uint64_t{kProjectionBytes})
    throw Error("cameras: " + std::to_string(triangles) + " triangles and " + std::to_string(cameras) +
                " cameras do not fill the " + std::to_string(in.left()) + " bytes left");
  warp.faces.reserve(triangles);
  for (uint32_t i = 0; i < triangles; i++) warp.faces.push_back(read_triangle(in, i));
  warp.cameras.reserve(cameras);
  for (uint32_t i = 0; i < cameras; i++) {
    ViewWarp::Projection projection{.camera = in.get<uint16_t>()};
    for (int column = 0; column < 3; column++) projection.camera_from_ray[column] = get_vec(in);
    warp.cameras.push_back(projection);
  }
  check(command);
  return command;
}

PixelCommand read_pixel_command(std::span<const uint8_t> bytes) {
  PixelCommand command;
  Reader in = read_request_head(bytes, kPixelCommandType, command, command.view_width, command.view_height);
  check_reserved(in.get<uint8_t>());
  const uint16_t cameras = in.get<uint16_t>();
  check_remaining(in, "cameras");
  if (in.left() != cameras * kRegionBytes)
    throw Error("cameras: " + std::to_string(cameras) + " do not fill the " + std::to_string(in.left()) +
                " bytes left");
  command.regions.reserve(cameras);
  for (uint16_t i = 0; i < cameras; i++) {
    const CameraIndex camera = in.get<uint16_t>();
    command.regions.push_back({camera, get_rect(in)});
  }
  check(command);
  return command;
}

}  // namespace

std::vector<uint8_t> encode_command(const WarpCommand& command) {
  check(command);
  const ViewWarp& warp = command.warp;
  const size_t size = kRequestHeadBytes + 3 + 24 + 8 * static_cast<size_t>(warp.lens.num_params()) + 8 +
                      warp.faces.size() * kTriangleBytes + warp.cameras.size() * kProjectionBytes;
  check_size(size);
  Writer out(size);
  put_request_head(out, kWarpCommandType, command, warp.width, warp.height, size);
  out.put(static_cast<uint8_t>(warp.lens.model()));
  out.put(uint16_t{0});
  put_vec(out, warp.in_front);
  put_lens(out, warp.lens);
  out.put(static_cast<uint32_t>(warp.faces.size()));
  out.put(static_cast<uint32_t>(warp.cameras.size()));
  for (const FacePlan& face : warp.faces) {
    for (const CameraIndex camera : face.camera)
      out.put(camera == MeshFace::kNone ? kNoCorner : static_cast<uint16_t>(camera));
    put_rect(out, face.rect);
    for (const Vec3& edge : face.edge) put_vec(out, edge);
    put_vec(out, face.facing);
  }
  for (const ViewWarp::Projection& projection : warp.cameras) {
    out.put(static_cast<uint16_t>(projection.camera));
    for (int column = 0; column < 3; column++) put_vec(out, projection.camera_from_ray[column]);
  }
  return out.take();
}

std::vector<uint8_t> encode_command(const PixelCommand& command) {
  check(command);
  const size_t size = kRequestHeadBytes + 3 + command.regions.size() * kRegionBytes;
  Writer out(size);
  put_request_head(out, kPixelCommandType, command, command.view_width, command.view_height, size);
  out.put(uint8_t{0});
  out.put(static_cast<uint16_t>(command.regions.size()));
  for (const PixelCommand::Region& region : command.regions) {
    out.put(static_cast<uint16_t>(region.camera));
    put_rect(out, region.rect);
  }
  return out.take();
}

std::optional<WarpCommand> decode_warp_command(std::span<const uint8_t> bytes, std::string* reason) {
  return catch_reason(reason, [&] { return read_warp_command(bytes); });
}

std::optional<PixelCommand> decode_pixel_command(std::span<const uint8_t> bytes, std::string* reason) {
  return catch_reason(reason, [&] { return read_pixel_command(bytes); });
}

std::optional<Access> access_of_type(uint8_t type) {
  switch (type) {
    case kViewRequestType: return Access::kSelf;
    case kWarpCommandType: return Access::kWarp;
    case kPixelCommandType: return Access::kPixels;
    default: return std::nullopt;
  }
}

std::vector<uint8_t> encode_any_request(const AnyRequest& request) {
  if (const auto* view = std::get_if<ViewRequest>(&request)) return encode_request(*view);
  if (const auto* warp = std::get_if<WarpCommand>(&request)) return encode_command(*warp);
  return encode_command(std::get<PixelCommand>(request));
}

std::optional<AnyRequest> decode_any_request(std::span<const uint8_t> bytes, std::string* reason) {
  const std::optional<UnitHeader> unit = peek_unit(bytes);
  if (unit && unit->type == kWarpCommandType) return decode_warp_command(bytes, reason);
  if (unit && unit->type == kPixelCommandType) return decode_pixel_command(bytes, reason);
  return decode_request(bytes, reason);
}

}  // namespace lf::wire
