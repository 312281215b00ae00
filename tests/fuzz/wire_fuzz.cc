// SPDX-License-Identifier: LGPL-2.1-or-later
#include <string>

#include "base/text.h"
#include "focus/hypothesis_levels.h"
#include "fuzz/fuzz.h"
#include "fuzz/repair.h"
#include "render/ownership.h"
#include "scene/scene.h"
#include "wire/answer_codec.h"
#include "wire/command_codec.h"
#include "wire/consistency_codec.h"
#include "wire/fragment_codec.h"
#include "wire/request_codec.h"
#include "wire/surface_codec.h"
#include "wire/unit.h"

namespace {

using Bytes = std::span<const uint8_t>;

// Returns the sizes of units; negative: skipped bytes (adjacent ones merged).
std::vector<int64_t> cut(Bytes stream, size_t piece) {
  std::vector<int64_t> out;
  size_t begin = 0, end = std::min(piece, stream.size());
  while (begin < stream.size()) {
    const bool more = end < stream.size();
    const Bytes bytes = stream.subspan(begin, end - begin);
    const std::optional<lf::wire::UnitHeader> unit = lf::wire::peek_unit(bytes);
    if (more && (bytes.size() < lf::wire::kUnitHeaderBytes || (unit && unit->size > bytes.size()))) {
      end = std::min(end + piece, stream.size());
    } else if (unit && unit->size <= bytes.size()) {
      out.push_back(static_cast<int64_t>(unit->size));
      begin += unit->size;
    } else {
      const size_t count = lf::wire::distance_to_magic(bytes, more);
      lf::fuzz::require(count > 0 && count <= bytes.size());
      if (out.empty() || out.back() > 0) out.push_back(0);
      out.back() -= static_cast<int64_t>(count);
      begin += count;
    }
    end = std::max(end, begin);
  }
  return out;
}

}  // namespace

// Finds units in a byte stream that arrives in pieces, like lfparse: every byte belongs to a unit or is skipped,
// independent of the division into pieces.
LF_FUZZ_TARGET(framing)(const uint8_t* data, size_t size) {
  lf::fuzz::Input input(data, size);
  const size_t piece = 1 + input.number(1);
  const Bytes stream = input.take(size);
  const std::vector<int64_t> whole = cut(stream, stream.size() + 1);
  lf::fuzz::require(cut(stream, piece) == whole);
  size_t sum = 0;
  for (const int64_t part : whole) sum += static_cast<size_t>(std::abs(part));
  lf::fuzz::require(sum == stream.size());
  return 0;
}

// View requests and commands: accepted units can be re-encoded to an equal unit, and their view can be planned.
LF_FUZZ_TARGET(request)(const uint8_t* data, size_t size) {
  using namespace lf;
  std::string reason;
  const std::optional<wire::AnyRequest> request = wire::decode_any_request({data, size}, &reason);
  fuzz::require(request || !reason.empty());
  if (!request) return 0;
  std::vector<uint8_t> again;
  if (const auto* view = std::get_if<ViewRequest>(&*request)) {
    again = wire::encode_request(*view);
    for (const DepthHypothesis& hypothesis : view->hypotheses)
      if (view->view.width <= 256 && view->view.height <= 256) hypothesis_levels(view->view, hypothesis);
    if (view->view.width <= 64 && view->view.height <= 64) {
      static const Rig rig = scene_rig(2, 2, 64, 48);
      static const Mesh mesh = build_mesh(rig);
      FaceRuns(ViewPlan(rig, mesh, view->view), {0, 0, view->view.width, view->view.height});
    }
  }
  if (const auto* pixels = std::get_if<wire::PixelCommand>(&*request)) again = wire::encode_command(*pixels);
  if (const auto* warp = std::get_if<wire::WarpCommand>(&*request)) {
    again = wire::encode_command(*warp);
    try {
      if (warp->warp.width <= 64 && warp->warp.height <= 64)
        FaceRuns(ViewPlan(warp->warp, 1000), {0, 0, warp->warp.width, warp->warp.height});
    } catch (const Error&) {
    }
  }
  fuzz::require(wire::decode_any_request(again) == request);
  return 0;
}

namespace {

// Reads every sample, so that a sanitizer detects invalid memory.
uint64_t g_sum = 0;

void read_plane(const uint8_t* plane, ptrdiff_t stride, int width, int height) {
  for (int y = 0; y < height; y++) g_sum += plane[y * stride] + plane[y * stride + width - 1];
}

void read(const lf::FragmentPlanes& f) {
  const int w = f.rect.width(), h = f.rect.height();
  const bool rgb = f.family == lf::PixelFamily::kRgb;
  read_plane(f.plane[0], f.stride[0], rgb ? 3 * w : w, h);
  for (int c = 1; c < 3 && !rgb; c++) read_plane(f.plane[c], f.stride[c], lf::chroma_size(w), lf::chroma_size(h));
  if (f.lost) read_plane(f.lost, f.missing_stride, w, h);
}

}  // namespace

LF_FUZZ_ANSWERS(answer, 0)

// Parses and decodes answers including JPEG, like a compositor.
LF_FUZZ_TARGET(answer)(const uint8_t* data, size_t size) {
  static lf::wire::FragmentDecoder decoder;
  std::string reason;
  const std::optional<lf::wire::AnswerView> answer = lf::wire::parse_answer({data, size}, &reason);
  lf::fuzz::require(answer || !reason.empty());
  if (!answer) return 0;
  lf::fuzz::require(lf::wire::parse_answer_header({data, size}).has_value());
  for (const lf::wire::FragmentView& fragment : answer->fragments) {
    if (fragment.codec == lf::wire::Codec::kRaw16) {
      const lf::ConstSumPlanes sums = decoder.sums(fragment);
      const lf::Rect& rect = fragment.rect;
      for (int c = 0; c < 3; c++)
        g_sum += sums.plane[c][(lf::plane_height(sums.family, rect, c) - 1) * sums.stride[c] +
                               lf::plane_width(sums.family, rect, c) - 1];
    } else if (const std::optional<lf::FragmentPlanes> planes = decoder.decode(fragment)) {
      read(*planes);
    }
  }
  return 0;
}

// Photo-consistency sums: accepted units can be re-encoded to an equal unit, and added up.
LF_FUZZ_TARGET(moments)(const uint8_t* data, size_t size) {
  using namespace lf;
  std::string reason;
  wire::ConsistencyShape shape;
  if (!wire::parse_consistency_header({data, size}, &shape, &reason)) {
    fuzz::require(!reason.empty());
    return 0;
  }
  if (shape.columns > 64 || shape.rows > 64) shape = {64, 64, 4};  // a shape that a request may have
  std::optional<wire::ConsistencyUnit> unit = wire::decode_consistency({data, size}, shape, &reason);
  fuzz::require(unit || !reason.empty());
  if (!unit) return 0;
  std::vector<PhotoConsistency> sums = unit->sums();
  const ByteBuffer bytes = wire::encode_consistency(*unit, sums);
  const std::optional<wire::ConsistencyUnit> again = wire::decode_consistency(bytes, shape);
  fuzz::require(again && again->hypotheses.size() == sums.size());
  const std::vector<PhotoConsistency> same = again->sums();
  for (size_t t = 0; t < sums.size(); t++) {
    PhotoConsistency& moments = sums[t];
    for (size_t i = 0; i < moments.weight.size(); i++) {
      // Nodes without weight may have been omitted.
      fuzz::require(same[t].weight[i] == moments.weight[i]);
      if (moments.weight[i] > 0) fuzz::require(same[t].square[i] == moments.square[i]);
    }
    moments.add(same[t]);
    for (size_t i = 0; i < moments.weight.size(); i++) moments.deviation(i);
  }
  return 0;
}

// Surfaces of pictures: encoding changes the levels of decoded messages by the tolerance at most, also after the grid
// has been halved and smoothed.
LF_FUZZ_TARGET(surface)(const uint8_t* data, size_t size) {
  using namespace lf;
  std::string reason;
  auto surface = wire::decode_surface({data, size}, &reason);
  fuzz::require(surface || !reason.empty());
  if (!surface) return 0;
  do {
    fuzz::require(surface->levels.size() <= wire::PictureSurface::kMaxNodes);
    auto coded = wire::decode_surface(wire::encode_surface(*surface));
    fuzz::require(coded && coded->levels.size() == surface->levels.size());
    for (size_t i = 0; i < surface->levels.size(); i++)
      fuzz::require(std::abs(coded->levels[i] - surface->levels[i]) <= surface->tolerance);
    coded->levels = surface->levels;
    fuzz::require(coded == surface);
    wire::smooth(*surface);
  } while (wire::halve(*surface));
  return 0;
}
