// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/request_codec.h"

#include "base/error.h"
#include "wire/limits.h"
#include "wire/request_layout.h"

namespace lf::wire {
namespace {

constexpr uint8_t kFocalPlane = 0;  // kind of focal surface

void check(const ViewRequest& request) {
  check_request_head(request);
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
  ViewRequest request;
  View& view = request.view;
  Reader in = read_request_head(bytes, kViewRequestType, request, view.width, view.height);
  const auto need = [&](const char* field) { need_more(in, field); };
  const uint8_t model_code = in.get<uint8_t>();
  const uint8_t surface = in.get<uint8_t>();
  const uint8_t reserved = in.get<uint8_t>();
  view.pose.position = get_vec(in);
  view.pose.orientation.w = in.get<double>();
  view.pose.orientation.x = in.get<double>();
  view.pose.orientation.y = in.get<double>();
  view.pose.orientation.z = in.get<double>();
  need("view");

  view.lens = read_lens(in, model_code);

  if (surface != kFocalPlane) throw Error("focal surface: kind " + std::to_string(surface) + " is not supported");
  if (reserved != 0) throw Error("reserved: must be 0, is " + std::to_string(reserved));
  Plane& plane = view.focus.plane;
  plane.normal = get_vec(in);
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
  const size_t size = kRequestHeadBytes + 3 + 8 * (3 + 4 + num_params + 4) + 4 + 2 * request.out_of_service.size();

  Writer out(size);
  put_request_head(out, kViewRequestType, request, view.width, view.height, size);
  out.put(static_cast<uint8_t>(view.lens.model()));
  out.put(kFocalPlane);
  out.put(uint8_t{0});
  put_vec(out, view.pose.position);
  out.put(view.pose.orientation.w);
  out.put(view.pose.orientation.x);
  out.put(view.pose.orientation.y);
  out.put(view.pose.orientation.z);
  put_lens(out, view.lens);
  put_vec(out, view.focus.plane.normal);
  out.put(view.focus.plane.d);
  out.put(static_cast<uint32_t>(request.out_of_service.size()));
  for (const CameraIndex camera : request.out_of_service) out.put(static_cast<uint16_t>(camera));
  return out.take();
}

std::optional<ViewRequest> decode_request(std::span<const uint8_t> bytes, std::string* reason) {
  return or_reason(reason, [&] { return read_request(bytes); });
}

}  // namespace lf::wire
