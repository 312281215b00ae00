// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/request_layout.h"

#include <tuple>

#include "base/error.h"

namespace lf::wire {
namespace {

constexpr uint8_t kMaxQuality = 100;

}  // namespace

void check_request_head(const RequestHeader& head) {
  if (head.quality > kMaxQuality)
    throw Error("quality: must be 0 to " + std::to_string(kMaxQuality) + ", is " + std::to_string(head.quality));
}

void put_request_head(Writer& out, uint8_t type, const RequestHeader& head, int width, int height, size_t size,
                      uint16_t more_flags) {
  const int flags = (head.absolute_time ? kAbsoluteTime : 0) | (head.probe ? kProbe : 0) |
                    (head.rehearsal ? kRehearsal : 0) | more_flags;
  put_unit_header(out, UnitKind::kRequest, type, static_cast<uint16_t>(flags), size);
  out.put(head.view_id);
  out.put(head.sequence);
  out.put(head.target_time);
  out.put(head.rig_hash);
  out.put(static_cast<uint16_t>(width));
  out.put(static_cast<uint16_t>(height));
  out.put(head.quality);
}

std::pair<int, int> get_request_head(Reader& in, uint16_t flags, RequestHeader& head) {
  head.absolute_time = flags & kAbsoluteTime;
  head.probe = flags & kProbe;
  head.rehearsal = flags & kRehearsal;
  head.view_id = in.get<uint32_t>();
  head.sequence = in.get<uint32_t>();
  head.target_time = in.get<uint64_t>();
  head.rig_hash = in.get<uint64_t>();
  const int width = in.get<uint16_t>(), height = in.get<uint16_t>();
  head.quality = in.get<uint8_t>();
  return {width, height};
}

Reader read_request_head(std::span<const uint8_t> bytes, uint8_t type, RequestHeader& head, int& width, int& height,
                         uint16_t* more_flags) {
  constexpr uint16_t kOfAll = kAbsoluteTime | kProbe | kRehearsal;
  const uint16_t known = static_cast<uint16_t>(kOfAll | (more_flags ? *more_flags : 0));
  std::string reason;
  const std::optional<UnitHeader> unit = check_unit_header(bytes, UnitKind::kRequest, type, known, reason);
  if (!unit || !check_unit_size(bytes, *unit, reason)) throw Error(reason);
  if (more_flags) *more_flags &= unit->flags;
  Reader in(bytes.subspan(kUnitHeaderBytes));
  std::tie(width, height) = get_request_head(in, unit->flags, head);
  need_more(in, "view");
  return in;
}

void need_more(const Reader& in, const char* field) {
  if (!in.ok()) throw Error(std::string(field) + ": the request ends before it does");
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
  need_more(in, "lens params");
  return {*model, params};
}

}  // namespace lf::wire
