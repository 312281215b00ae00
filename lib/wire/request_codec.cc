// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/request_codec.h"

#include <algorithm>
#include <tuple>

#include "base/text.h"
#include "wire/unit.h"

namespace lf::wire {

void check_request_head(const RequestHeader& head) {
  constexpr uint8_t kMaxQuality = 100;
  if (head.quality > kMaxQuality)
    throw Error("quality: must be 0 to " + std::to_string(kMaxQuality) + ", is " + std::to_string(head.quality));
}

namespace {

template <typename Io, typename Head, typename Size>
void head_fields(Io& io, Head& head, Size& width, Size& height) {
  field<uint32_t>(io, head.view_id);
  field<uint32_t>(io, head.sequence);
  field<uint64_t>(io, head.target_time);
  field<uint64_t>(io, head.rig_hash);
  field<uint16_t>(io, width);
  field<uint16_t>(io, height);
  field<uint8_t>(io, head.quality);
}

}  // namespace

void put_request_head(Writer& out, uint8_t type, const RequestHeader& head, int width, int height, size_t size,
                      uint16_t more_flags) {
  const int flags =
      (head.absolute_time ? kAbsoluteTime : 0) | (head.probe ? kProbe : 0) | (head.warmup ? kWarmup : 0) | more_flags;
  put_unit_header(out, UnitKind::kRequest, type, static_cast<uint16_t>(flags), size);
  head_fields(out, head, width, height);
}

std::pair<int, int> get_request_head(Reader& in, uint16_t flags, RequestHeader& head) {
  head.absolute_time = flags & kAbsoluteTime;
  head.probe = flags & kProbe;
  head.warmup = flags & kWarmup;
  std::pair<int, int> size;
  head_fields(in, head, size.first, size.second);
  return size;
}

Reader read_request_head(std::span<const uint8_t> bytes, uint8_t type, RequestHeader& head, int& width, int& height,
                         uint16_t* more_flags) {
  constexpr uint16_t kOfAll = kAbsoluteTime | kProbe | kWarmup;
  const uint16_t known = static_cast<uint16_t>(kOfAll | (more_flags ? *more_flags : 0));
  const UnitHeader unit = read_unit_header(bytes, UnitKind::kRequest, type, known);
  check_unit_size(bytes, unit);
  if (more_flags) *more_flags &= unit.flags;
  Reader in(bytes.subspan(kUnitHeaderBytes));
  std::tie(width, height) = get_request_head(in, unit.flags, head);
  check_remaining(in, "view");
  return in;
}

void check_remaining(const Reader& in, const char* field) {
  if (!in.ok()) throw Error(std::string(field) + ": the request ends before this field ends");
}

void put_vec(Writer& out, const Vec3& v) {
  for (int i = 0; i < 3; i++) out.put(v[i]);
}

Vec3 get_vec(Reader& in) {
  Vec3 v;
  for (int i = 0; i < 3; i++) v[i] = in.get<double>();
  return v;
}

void put_lens(Writer& out, const Lens& lens) {
  for (int i = 0; i < lens.num_params(); i++) out.put(lens.params()[static_cast<size_t>(i)]);
}

Lens read_lens(Reader& in, uint8_t model_code) {
  const std::optional<LensModel> model = lens_model_from_code(model_code);
  if (!model) throw Error("lens model: " + std::to_string(model_code) + " is unknown");
  std::array<double, Lens::kMaxParams> params{};
  for (int i = 0; i < lens_model_num_params(*model); i++) params[static_cast<size_t>(i)] = in.get<double>();
  check_remaining(in, "lens params");
  return {*model, params};
}

namespace {

constexpr uint8_t kFocalPlane = 0, kFocalMap = 1, kMeasuredMap = 2;  // kinds of focal surfaces
constexpr uint8_t kUseGains = 1, kAskMean = 2, kMeanFollows = 4, kOnPlane = 8;
constexpr int kBlendingShift = 4;  // position of the blending kind in the same byte
constexpr size_t kPoseBytes = 7 * 8, kPlaneBytes = 4 * 8, kInFrontBytes = 3 * 8;

constexpr size_t kSetBytes = 4;

size_t mean_nodes(const FocalMap& map) {
  return static_cast<size_t>(FocalMap::nodes(map.columns, 2)) * static_cast<size_t>(FocalMap::nodes(map.rows, 2));
}

void check_gains(const ViewRequest& request) {
  const GainRequest& gains = request.gains;
  if (!gains.ask && gains.mean.empty()) return;
  if (!request.view.focus.map) throw Error("gains: require a focal map");
  if (!gains.mean.empty() && gains.mean.size() != mean_nodes(*request.view.focus.map))
    throw Error("gains: a mean of " + std::to_string(gains.mean.size()) + " nodes does not fit the map");
}

void check(const ViewRequest& request) {
  check_request_head(request);
  validate(request.view);
  validate(request.place, request.view.width, request.view.height);
  if (request.hypotheses.size() > kMaxHypotheses)
    throw Error("depth hypotheses: at most " + std::to_string(kMaxHypotheses) + ", not " +
                std::to_string(request.hypotheses.size()));
  for (size_t i = 0; i + 1 < request.hypotheses.size(); i++)
    if (request.hypotheses[i].kind == DepthHypothesis::Kind::kMeasured)
      throw Error("depth hypotheses: kind 5 must be the last");
  if (!request.hypotheses.empty() && !request.view.focus.map) throw Error("depth hypotheses: require a focal map");
  if (request.on_plane && !request.view.focus.map) throw Error("depth hypotheses: on a plane, require a focal map");
  check_gains(request);
  const CameraSet& out = request.out_of_service;
  for (size_t i = 0; i < out.size(); i++) {
    const auto place = [i] { return "out_of_service[" + std::to_string(i) + "]: "; };
    if (out[i] >= kMaxCameras)
      throw Error(place() + "camera " + std::to_string(out[i]) + " is beyond " + std::to_string(kMaxCameras - 1));
    if (i > 0 && out[i] <= out[i - 1]) throw Error(place() + "cameras must ascend");
  }
}

void put_plane(Writer& out, const Plane& plane) {
  put_vec(out, plane.normal);
  out.put(plane.d);
}

Plane get_plane(Reader& in) {
  Plane plane;
  plane.normal = get_vec(in);
  plane.d = in.get<double>();
  return plane;
}

size_t blending_bytes(Blending::Kind kind) {
  switch (kind) {
    case Blending::Kind::kAperture: return 8;
    case Blending::Kind::kAngle: return 1;
    case Blending::Kind::kMesh: break;
  }
  return 0;
}

void put_blending(Writer& out, const Blending& blending) {
  if (blending.kind == Blending::Kind::kAperture) out.put(blending.aperture);
  if (blending.kind == Blending::Kind::kAngle) out.put(static_cast<uint8_t>(blending.nearest));
}

void read_blending(Reader& in, Blending& blending) {
  if (blending.kind == Blending::Kind::kAperture) blending.aperture = in.get<double>();
  if (blending.kind == Blending::Kind::kAngle) blending.nearest = in.get<uint8_t>();
  check_remaining(in, "blending");
}

void put_place(Writer& out, const ViewSetPosition& place) {
  out.put(static_cast<uint8_t>(place.layout));
  out.put(static_cast<uint8_t>(place.columns));
  out.put(static_cast<uint8_t>(place.rows));
  out.put(static_cast<uint8_t>(place.index));
}

void read_place(Reader& in, ViewSetPosition& place) {
  place.layout = static_cast<ViewSetLayout>(in.get<uint8_t>());
  place.columns = in.get<uint8_t>();
  place.rows = in.get<uint8_t>();
  place.index = in.get<uint8_t>();
  check_remaining(in, "set");
  if (place == ViewSetPosition()) throw Error("set: must have at least two views");
}

void put_map(Writer& out, const FocalMap& map, std::span<const uint8_t> deflated,
             std::span<const DepthHypothesis> hypotheses) {
  put_plane(out, map.from);
  out.put(map.farthest);
  out.put(map.nearest);
  out.put(static_cast<uint8_t>(map.step));
  out.put(static_cast<uint8_t>(hypotheses.size()));
  for (const DepthHypothesis& hypothesis : hypotheses) {
    out.put(static_cast<uint8_t>(hypothesis.kind));
    out.put(static_cast<uint16_t>(hypothesis.value));
  }
  out.put(static_cast<uint32_t>(deflated.size()));
  out.put_bytes(deflated);
}

void read_map(Reader& in, bool measured, ViewRequest& request) {
  View& view = request.view;
  auto map = std::make_shared<FocalMap>();
  map->from = get_plane(in);
  map->farthest = in.get<double>();
  map->nearest = in.get<double>();
  map->step = in.get<uint8_t>();
  map->measured = measured;
  request.hypotheses.resize(in.get<uint8_t>());
  for (DepthHypothesis& hypothesis : request.hypotheses) {
    const uint8_t kind = in.get<uint8_t>();
    if (kind > static_cast<uint8_t>(DepthHypothesis::Kind::kFocused))
      throw Error("depth hypotheses: kind " + std::to_string(kind) + " is unknown");
    hypothesis.kind = static_cast<DepthHypothesis::Kind>(kind);
    hypothesis.value = static_cast<int16_t>(in.get<uint16_t>());
  }
  const std::span<const uint8_t> deflated = in.get_bytes(in.get<uint32_t>());
  check_remaining(in, "focal_map");
  if (map->step == 0) throw Error("focal_map: its step must not be 0");
  validate_size("width", view.width);
  validate_size("height", view.height);
  map->columns = FocalMap::nodes(view.width, map->step);
  map->rows = FocalMap::nodes(view.height, map->step);
  const size_t nodes = static_cast<size_t>(map->columns) * static_cast<size_t>(map->rows);
  if (nodes > FocalMap::kMaxNodes) throw Error("focal_map: " + std::to_string(nodes) + " nodes are too many");
  map->levels = inflate_exactly(deflated, nodes);
  view.focus.map = std::move(map);
}

void put_mean(Writer& out, const GainRequest& gains, const std::vector<uint8_t>& deflated) {
  out.put(gains.mean_of);
  out.put(static_cast<uint32_t>(deflated.size()));
  out.put_bytes(deflated);
}

void read_mean(Reader& in, const FocalMap& map, GainRequest& gains) {
  gains.mean_of = in.get<uint32_t>();
  const std::span<const uint8_t> deflated = in.get_bytes(in.get<uint32_t>());
  check_remaining(in, "gains");
  gains.mean = inflate_exactly(deflated, mean_nodes(map));
}

ViewRequest read_request(std::span<const uint8_t> bytes) {
  ViewRequest request;
  View& view = request.view;
  uint16_t of_set = kInSet;
  Reader in = read_request_head(bytes, kViewRequestType, request, view.width, view.height, &of_set);
  const auto need = [&](const char* field) { check_remaining(in, field); };
  const uint8_t model_code = in.get<uint8_t>();
  const uint8_t surface = in.get<uint8_t>();
  const uint8_t options = in.get<uint8_t>();
  const uint8_t gains = options & ((1 << kBlendingShift) - 1), blending = options >> kBlendingShift;
  view.pose.position = get_vec(in);
  view.pose.orientation.w = in.get<double>();
  view.pose.orientation.x = in.get<double>();
  view.pose.orientation.y = in.get<double>();
  view.pose.orientation.z = in.get<double>();
  need("view");

  view.lens = read_lens(in, model_code);

  if (surface > kMeasuredMap) throw Error("focal surface: kind " + std::to_string(surface) + " is not supported");
  if (gains > kUseGains && surface == kFocalPlane) throw Error("gains: require a focal map");
  request.on_plane = gains & kOnPlane;
  request.gains.use = gains & kUseGains;
  request.gains.ask = gains & kAskMean;
  if (blending > static_cast<uint8_t>(Blending::Kind::kAngle))
    throw Error("blending: kind " + std::to_string(blending) + " is not supported");
  view.blending.kind = static_cast<Blending::Kind>(blending);
  view.blending.extrapolates = !request.probe;  // a probe compares only the pixels inside the mesh
  view.focus.plane = get_plane(in);
  need("focal_plane");

  const uint32_t count = in.get<uint32_t>();
  need("out_of_service");
  const size_t cameras = size_t{count} * 2, blended = cameras + blending_bytes(view.blending.kind),
               wanted = blended + (of_set ? kSetBytes : 0);
  if (in.left() >= cameras && in.left() < wanted)
    throw Error(std::string(in.left() < blended ? "blending" : "set") + ": the request ends before this field ends");
  if (surface != kFocalPlane ? in.left() < wanted : in.left() != wanted)
    throw Error("out_of_service: " + std::to_string(count) + " cameras do not fill the " + std::to_string(in.left()) +
                " bytes left");
  request.out_of_service.reserve(count);
  for (uint32_t i = 0; i < count; i++) request.out_of_service.push_back(in.get<uint16_t>());
  if (surface != kFocalPlane) read_map(in, surface == kMeasuredMap, request);
  if (gains & kMeanFollows) read_mean(in, *view.focus.map, request.gains);
  read_blending(in, view.blending);
  if (of_set) read_place(in, request.place);
  if (in.left() != 0) throw Error("focal_map: " + std::to_string(in.left()) + " bytes too many");
  check(request);
  return request;
}

}  // namespace

std::vector<uint8_t> encode_request(const ViewRequest& request) {
  check(request);
  const View& view = request.view;
  const int num_params = view.lens.num_params();
  size_t size = kRequestHeadBytes + 3 + 8 * (3 + 4 + num_params + 4) + 4 + 2 * request.out_of_service.size();
  const FocalMap* const map = view.focus.map.get();
  std::vector<uint8_t> deflated, mean;
  const GainRequest& gains = request.gains;
  const auto packed = request.quality > 0 ? deflate_all : store_all;
  if (!gains.mean.empty()) {
    mean = packed(gains.mean);
    size += 4 + 4 + mean.size();
  }
  if (map) {
    deflated = packed(map->levels);
    size += 6 * 8 + 2 + 3 * request.hypotheses.size() + 4 + deflated.size();
  }
  const bool of_set = request.place != ViewSetPosition();
  size += blending_bytes(view.blending.kind) + (of_set ? kSetBytes : 0);

  Writer out(size);
  put_request_head(out, kViewRequestType, request, view.width, view.height, size, of_set ? kInSet : 0);
  out.put(static_cast<uint8_t>(view.lens.model()));
  out.put(!map ? kFocalPlane : map->measured ? kMeasuredMap : kFocalMap);
  out.put(static_cast<uint8_t>((gains.use ? kUseGains : 0) | (gains.ask ? kAskMean : 0) |
                               (gains.mean.empty() ? 0 : kMeanFollows) | (request.on_plane ? kOnPlane : 0) |
                               static_cast<int>(view.blending.kind) << kBlendingShift));
  put_vec(out, view.pose.position);
  out.put(view.pose.orientation.w);
  out.put(view.pose.orientation.x);
  out.put(view.pose.orientation.y);
  out.put(view.pose.orientation.z);
  put_lens(out, view.lens);
  put_plane(out, view.focus.plane);
  out.put(static_cast<uint32_t>(request.out_of_service.size()));
  for (const CameraIndex camera : request.out_of_service) out.put(static_cast<uint16_t>(camera));
  if (map) put_map(out, *map, deflated, request.hypotheses);
  if (!gains.mean.empty()) put_mean(out, gains, mean);
  put_blending(out, view.blending);
  if (of_set) put_place(out, request.place);
  return out.take();
}

std::optional<RequestPeek> peek_request(std::span<const uint8_t> bytes) {
  const std::optional<UnitHeader> unit = peek_unit(bytes);
  if (!unit || unit->kind != UnitKind::kRequest || unit->version != kVersion || bytes.size() < kRequestHeadBytes)
    return std::nullopt;
  RequestPeek peek{.type = unit->type};
  Reader in(bytes.subspan(kUnitHeaderBytes, kRequestHeadBytes - kUnitHeaderBytes));
  get_request_head(in, unit->flags, peek.head);
  return peek;
}

RequestCost peek_request_cost(std::span<const uint8_t> bytes) {
  RequestCost cost;
  const std::optional<UnitHeader> unit = peek_unit(bytes);
  if (!unit || unit->kind != UnitKind::kRequest || unit->version != kVersion) return cost;
  Reader in(bytes.first(std::min(bytes.size(), unit->size)).subspan(kUnitHeaderBytes));
  RequestHeader head;
  std::tie(cost.width, cost.height) = get_request_head(in, unit->flags, head);
  const bool is_view = unit->type == kViewRequestType;
  if (!is_view && unit->type != kWarpCommandType) return cost;
  const uint8_t model = in.get<uint8_t>(), surface = in.get<uint8_t>(), blending = in.get<uint8_t>() >> kBlendingShift;
  in.get_bytes(is_view ? kPoseBytes : kInFrontBytes);
  try {
    const Lens lens = read_lens(in, model);
    if (cost.width > 0 && cost.height > 0) cost.lens_steps = lens.mean_iterations(cost.width, cost.height);
  } catch (const Error&) {
    return cost;
  }
  if (!is_view) return cost;
  cost.by_angle = blending == static_cast<uint8_t>(Blending::Kind::kAngle);
  in.get_bytes(kPlaneBytes);
  in.get_bytes(2 * size_t{in.get<uint32_t>()});
  if (surface != kFocalPlane) {
    in.get_bytes(kPlaneBytes + 8 + 8 + 1);
    cost.hypotheses = in.get<uint8_t>();
  }
  const bool of_set = unit->flags & kInSet, wide = blending == static_cast<uint8_t>(Blending::Kind::kAperture);
  const size_t behind = (wide ? sizeof(double) : 0) + (of_set ? kSetBytes : 0);
  if (in.left() < behind) return cost;
  in.get_bytes(in.left() - behind);
  if (wide) cost.aperture = in.get<double>();
  if (of_set) {
    in.get<uint8_t>();
    cost.columns = in.get<uint8_t>();
    cost.rows = in.get<uint8_t>();
  }
  return cost;
}

std::optional<ViewRequest> decode_request(std::span<const uint8_t> bytes, std::string* reason) {
  return catch_reason(reason, [&] { return read_request(bytes); });
}

}  // namespace lf::wire
