// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/camera_trials_codec.h"

#include <algorithm>

#include "base/error.h"
#include "focus/trial_levels.h"
#include "wire/bytes.h"
#include "wire/deflate.h"
#include "wire/unit.h"

namespace lf::wire {
namespace {

constexpr size_t kHeaderBytes = kUnitHeaderBytes + 4 + 4 + 8 + 4 + 2 + 2 + 1 + 1 + 2;
constexpr size_t kCameraBytes = 2 + 4 * 2 + 4;

size_t area_of(const Rect& rect) { return static_cast<size_t>(rect.width()) * static_cast<size_t>(rect.height()); }

bool is_inside(const Rect& rect, const MomentsShape& shape) {
  return !rect.empty() && intersect(rect, {0, 0, shape.columns, shape.rows}) == rect;
}

// A few bytes inflate to a thousand times as many, and rectangles of cameras may overlap as they like: where they are
// those of a mesh they cover the map some four times.
size_t most_inflated(const MomentsShape& shape) {
  constexpr size_t kCovers = 16, kAlways = size_t{64} << 20;
  return std::max(kAlways,
                  kCovers * static_cast<size_t>(shape.columns) * static_cast<size_t>(shape.rows) * shape.trials);
}

// Up to the cameras; their number.
Reader read_header(std::span<const uint8_t> bytes, MomentsHeader& unit, MomentsShape& shape, size_t& cameras) {
  std::string reason;
  const std::optional<UnitHeader> header = check_unit_header(bytes, UnitKind::kAnswer, kCameraTrialsType, 0, reason);
  if (!header || !check_unit_size(bytes, *header, reason)) throw Error(reason);
  Reader in(bytes.subspan(kUnitHeaderBytes));
  unit.view_id = in.get<uint32_t>();
  unit.sequence = in.get<uint32_t>();
  unit.rig_hash = in.get<uint64_t>();
  unit.node = in.get<uint32_t>();
  shape.columns = in.get<uint16_t>();
  shape.rows = in.get<uint16_t>();
  shape.trials = in.get<uint8_t>();
  const uint8_t reserved = in.get<uint8_t>();
  cameras = in.get<uint16_t>();
  if (!in.ok()) throw Error("camera trials: the unit ends before its cameras");
  if (reserved != 0) throw Error("reserved: must be 0, is " + std::to_string(reserved));
  return in;
}

CameraTrialsUnit read_unit(std::span<const uint8_t> bytes, const MomentsShape& expected) {
  CameraTrialsUnit unit;
  MomentsShape shape;
  size_t cameras = 0;
  Reader in = read_header(bytes, unit, shape, cameras);
  size_t inflated = 0;
  if (shape != expected || shape.trials == 0)
    throw Error("camera trials: of other trials than those that were asked for");
  for (size_t i = 0; i < cameras; i++) {
    CameraTrials camera;
    camera.camera = in.get<uint16_t>();
    const int x = in.get<uint16_t>(), y = in.get<uint16_t>(), w = in.get<uint16_t>(), h = in.get<uint16_t>();
    camera.rect = {x, y, x + w, y + h};
    const std::span<const uint8_t> deflated = in.get_bytes(in.get<uint32_t>());
    if (!in.ok()) throw Error("camera trials: the unit ends before its cameras do");
    if (camera.camera >= kMaxCameras) throw Error("camera: " + std::to_string(camera.camera) + " is none of any rig");
    if (!unit.cameras.empty() && camera.camera <= unit.cameras.back().camera)
      throw Error("camera trials: cameras are not in order");
    if (!is_inside(camera.rect, shape)) throw Error("rectangle: is not inside the map");
    const size_t area = area_of(camera.rect);
    inflated += area * shape.trials;
    if (inflated > most_inflated(shape))
      throw Error("camera trials: cameras have more than " + std::to_string(most_inflated(shape)) + " bytes of luma");
    const std::vector<uint8_t> luma = inflate_exactly(deflated, area * shape.trials);
    for (size_t t = 0; t < shape.trials; t++) {
      const auto first = luma.begin() + static_cast<ptrdiff_t>(t * area);
      camera.luma.emplace_back(first, first + static_cast<ptrdiff_t>(area));
    }
    unit.cameras.push_back(std::move(camera));
  }
  if (in.left() != 0) throw Error("camera trials: " + std::to_string(in.left()) + " bytes too many");
  return unit;
}

}  // namespace

bool is_camera_trials(std::span<const uint8_t> bytes) {
  const std::optional<UnitHeader> header = peek_unit(bytes);
  return header && header->kind == UnitKind::kAnswer && header->type == kCameraTrialsType;
}

ByteBuffer encode_camera_trials(const MomentsHeader& header, const MomentsShape& shape,
                                std::span<const CameraTrials> cameras) {
  if (shape.trials < 1 || shape.trials > kMaxTrials)
    throw Error("trials: must be 1 to " + std::to_string(kMaxTrials) + ", not " + std::to_string(shape.trials));
  std::vector<std::vector<uint8_t>> deflated;
  size_t size = kHeaderBytes;
  for (const CameraTrials& camera : cameras) {
    const auto fits = [&](const std::vector<uint8_t>& luma) { return luma.size() == area_of(camera.rect); };
    if (camera.camera >= kMaxCameras || camera.luma.size() != shape.trials || !is_inside(camera.rect, shape) ||
        !std::ranges::all_of(camera.luma, fits))
      throw Error("camera trials: of another size");
    std::vector<uint8_t> luma;
    for (const std::vector<uint8_t>& trial : camera.luma) luma.insert(luma.end(), trial.begin(), trial.end());
    deflated.push_back(deflate_all(luma));
    size += kCameraBytes + deflated.back().size();
  }
  ByteBuffer bytes(size);
  PlacedWriter out(bytes.data());
  put_unit_header(out, UnitKind::kAnswer, kCameraTrialsType, 0, size);
  out.put(header.view_id);
  out.put(header.sequence);
  out.put(header.rig_hash);
  out.put(header.node);
  out.put(static_cast<uint16_t>(shape.columns));
  out.put(static_cast<uint16_t>(shape.rows));
  out.put(static_cast<uint8_t>(shape.trials));
  out.put(uint8_t{0});
  out.put(static_cast<uint16_t>(cameras.size()));
  for (size_t i = 0; i < cameras.size(); i++) {
    const Rect& rect = cameras[i].rect;
    out.put(static_cast<uint16_t>(cameras[i].camera));
    for (const int v : {rect.x0, rect.y0, rect.width(), rect.height()}) out.put(static_cast<uint16_t>(v));
    out.put(static_cast<uint32_t>(deflated[i].size()));
    out.put_bytes(deflated[i]);
  }
  return bytes;
}

std::optional<MomentsHeader> parse_camera_trials_header(std::span<const uint8_t> bytes, std::string* reason) {
  return or_reason(reason, [&] {
    MomentsHeader header;
    MomentsShape shape;
    size_t cameras = 0;
    read_header(bytes, header, shape, cameras);
    return header;
  });
}

std::optional<CameraTrialsUnit> decode_camera_trials(std::span<const uint8_t> bytes, const MomentsShape& expected,
                                                     std::string* reason) {
  return or_reason(reason, [&] { return read_unit(bytes, expected); });
}

}  // namespace lf::wire
