// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/request_codec.h"

#include "base/error.h"
#include "wire/limits.h"
#include "wire/unit.h"

namespace lf::wire {
namespace {

constexpr uint16_t kAbsoluteTime = 1;  // flag
constexpr uint8_t kFocalPlane = 0;     // kind of focal surface
constexpr uint8_t kMaxQuality = 100;

void check(const ViewRequest& request) {
  if (request.quality > kMaxQuality)
    throw Error("quality: must be 0 to " + std::to_string(kMaxQuality) + ", is " + std::to_string(request.quality));
  validate(request.view);
  const CameraSet& out = request.out_of_service;
  for (size_t i = 0; i < out.size(); i++) {
    const auto place = [i] { return "out_of_service[" + std::to_string(i) + "]: "; };
    if (out[i] >= kMaxCameras)
      throw Error(place() + "camera " + std::to_string(out[i]) + " is beyond " + std::to_string(kMaxCameras - 1));
    if (i > 0 && out[i] <= out[i - 1]) throw Error(place() + "cameras must ascend");
  }
}

ViewRequest read_request(std::span<const uint8_t> bytes) {
  std::string reason;
  const std::optional<UnitHeader> header =
      check_unit_header(bytes, UnitKind::kRequest, kViewRequestType, kAbsoluteTime, reason);
  if (!header || !check_unit_size(bytes, *header, reason)) throw Error(reason);

  Reader in(bytes.subspan(kUnitHeaderBytes));
  const auto need = [&](const char* field) {
    if (!in.ok()) throw Error(std::string(field) + ": the request ends before it does");
  };
  ViewRequest request;
  request.absolute_time = header->flags & kAbsoluteTime;
  request.view_id = in.get<uint32_t>();
  request.sequence = in.get<uint32_t>();
  request.target_time = in.get<uint64_t>();
  request.rig_hash = in.get<uint64_t>();
  View& view = request.view;
  view.width = in.get<uint16_t>();
  view.height = in.get<uint16_t>();
  request.quality = in.get<uint8_t>();
  const uint8_t model_code = in.get<uint8_t>();
  const uint8_t surface = in.get<uint8_t>();
  const uint8_t reserved = in.get<uint8_t>();
  for (int i = 0; i < 3; i++) view.pose.position[i] = in.get<double>();
  view.pose.orientation.w = in.get<double>();
  view.pose.orientation.x = in.get<double>();
  view.pose.orientation.y = in.get<double>();
  view.pose.orientation.z = in.get<double>();
  need("view");

  const std::optional<LensModel> model = lens_model_from_code(model_code);
  if (!model) throw Error("lens model: " + std::to_string(model_code) + " is unknown");
  std::array<double, Lens::kMaxParams> params{};
  for (int i = 0; i < lens_model_num_params(*model); i++) params[i] = in.get<double>();
  need("lens params");
  view.lens = Lens(*model, params);

  if (surface != kFocalPlane) throw Error("focal surface: kind " + std::to_string(surface) + " is not supported");
  if (reserved != 0) throw Error("reserved: must be 0, is " + std::to_string(reserved));
  Plane& plane = view.focus.plane;
  for (int i = 0; i < 3; i++) plane.normal[i] = in.get<double>();
  plane.d = in.get<double>();
  need("focal_plane");

  const uint32_t count = in.get<uint32_t>();
  need("out_of_service");
  if (in.left() != size_t{count} * 2)
    throw Error("out_of_service: " + std::to_string(count) + " cameras do not fill the " + std::to_string(in.left()) +
                " bytes left");
  request.out_of_service.reserve(count);
  for (uint32_t i = 0; i < count; i++) request.out_of_service.push_back(in.get<uint16_t>());
  check(request);
  return request;
}

}  // namespace

std::vector<uint8_t> encode_request(const ViewRequest& request) {
  check(request);
  const View& view = request.view;
  const int num_params = view.lens.num_params();
  const size_t size = kUnitHeaderBytes + 32 + 8 * (3 + 4 + num_params + 4) + 4 + 2 * request.out_of_service.size();

  Writer out(size);
  put_unit_header(out, UnitKind::kRequest, kViewRequestType, request.absolute_time ? kAbsoluteTime : uint16_t{0}, size);
  out.put(request.view_id);
  out.put(request.sequence);
  out.put(request.target_time);
  out.put(request.rig_hash);
  out.put(static_cast<uint16_t>(view.width));
  out.put(static_cast<uint16_t>(view.height));
  out.put(request.quality);
  out.put(static_cast<uint8_t>(view.lens.model()));
  out.put(kFocalPlane);
  out.put(uint8_t{0});
  for (int i = 0; i < 3; i++) out.put(view.pose.position[i]);
  out.put(view.pose.orientation.w);
  out.put(view.pose.orientation.x);
  out.put(view.pose.orientation.y);
  out.put(view.pose.orientation.z);
  for (int i = 0; i < num_params; i++) out.put(view.lens.params()[i]);
  for (int i = 0; i < 3; i++) out.put(view.focus.plane.normal[i]);
  out.put(view.focus.plane.d);
  out.put(static_cast<uint32_t>(request.out_of_service.size()));
  for (const CameraIndex camera : request.out_of_service) out.put(static_cast<uint16_t>(camera));
  return out.take();
}

std::optional<ViewRequest> decode_request(std::span<const uint8_t> bytes, std::string* reason) {
  try {
    return read_request(bytes);
  } catch (const Error& error) {
    if (reason) *reason = error.what();
    return std::nullopt;
  }
}

}  // namespace lf::wire
