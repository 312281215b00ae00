// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "composite/assembly.h"
#include "node/request_renderer.h"
#include "render/sum_planes.h"
#include "rig/mesh.h"
#include "view/view_request.h"
#include "wire/answer_codec.h"
#include "wire/fragment_codec.h"

// Answers as vectors of uncompressed fragments, for tests that can afford a copy.
namespace lf::wire {

struct Answer : AnswerHeader {
  std::vector<Fragment> fragments;
  bool operator==(const Answer&) const = default;
};

inline void append_rows(std::vector<uint8_t>& out, const uint8_t* plane, ptrdiff_t stride, int width, int height) {
  for (int y = 0; y < height; y++, plane += stride) out.insert(out.end(), plane, plane + width);
}

inline Fragment to_fragment(const FragmentHeader& header, const FragmentPlanes& planes) {
  const int w = header.rect.width(), h = header.rect.height();
  Fragment out{header.family, header.rect, {}, {}};
  if (header.family == PixelFamily::kRgb) {
    append_rows(out.pixels, planes.plane[0], planes.stride[0], 3 * w, h);
  } else {
    append_rows(out.pixels, planes.plane[0], planes.stride[0], w, h);
    for (int c = 1; c < 3; c++)
      append_rows(out.pixels, planes.plane[c], planes.stride[c], chroma_size(w), chroma_size(h));
  }
  if (planes.lost) append_rows(out.lost, planes.lost, planes.missing_stride, w, h);
  return out;
}

inline ByteBuffer encode_fragments(const AnswerHeader& header, const std::vector<Fragment>& fragments, int quality) {
  std::vector<AnswerFragment> planes;
  for (const Fragment& fragment : fragments) planes.push_back({{}, planes_of(fragment)});
  return encode_fragments(header, planes, quality, {});
}

// Encodes raw. Throws Error with the invalid field if decode_answer() would reject the result.
inline std::vector<uint8_t> encode_answer(const Answer& answer) {
  const ByteBuffer bytes = encode_fragments(answer, answer.fragments, 0);
  return {bytes.begin(), bytes.end()};
}

// Returns nullopt unless `bytes` is exactly one valid, whole answer with valid payloads; `reason` (may be null) then
// receives the invalid field. 16-bit sums are rounded (halves up) and saturated to 8 bits.
inline std::optional<Answer> decode_answer(std::span<const uint8_t> bytes, std::string* reason = nullptr) {
  const std::optional<AnswerView> view = parse_answer(bytes, reason);
  if (!view) return std::nullopt;
  if (!view->part.whole()) {
    if (reason) *reason = "total: a part of an answer, not a whole one";
    return std::nullopt;
  }
  Answer answer{*view, {}};
  FragmentDecoder decoder;
  for (size_t i = 0; i < view->fragments.size(); i++) {
    const FragmentView& fragment = view->fragments[i];
    if (fragment.camera) {
      if (reason) *reason = "fragments[" + std::to_string(i) + "].camera: pixels of one, no part of a sum";
      return std::nullopt;
    }
    if (fragment.codec == Codec::kRaw16) {
      answer.fragments.push_back(rounded_fragment(decoder.sums(fragment)));
      continue;
    }
    const std::optional<FragmentPlanes> planes = decoder.decode(fragment);
    if (!planes) {
      if (reason) *reason = "fragments[" + std::to_string(i) + "].payload: damaged JPEG";
      return std::nullopt;
    }
    answer.fragments.push_back(to_fragment(fragment, *planes));
  }
  return answer;
}

}  // namespace lf::wire

namespace lf {

inline Assembly::Verdict add_answer(Assembly& assembly, const wire::Answer& answer) {
  const std::vector<uint8_t> bytes = wire::encode_answer(answer);
  return assembly.add(wire::parse_answer(bytes).value());
}

}  // namespace lf

namespace lf::test {

// Returns the answer's cameras that have frames, ascending.
inline CameraSet seeing(const wire::AnswerHeader& answer) {
  CameraRanges cameras = answer.cameras;
  cameras.remove(answer.blind);
  return cameras.cameras();
}

// Returns the sum of a node with these cameras, which all have the frame `image`.
inline ByteBuffer node_answer_bytes(const Rig& rig, const ViewRequest& request, const std::vector<CameraIndex>& cameras,
                                    const Image& image, CodecChoice codec = CodecChoice::kRaw) {
  ViewRequest of_sum;
  of_sum.view = request.view;
  const RequestPlan plan(rig, build_mesh(rig, request.out_of_service), of_sum, cameras);
  wire::AnswerHeader header;
  header.view_id = request.view_id;
  header.sequence = request.sequence;
  header.view_width = request.view.width;
  header.view_height = request.view.height;
  header.family = image.family();
  header.target_time = header.actual_time = request.target_time;
  header.rig_hash = rig.hash();
  header.cameras = CameraRanges(cameras);
  std::vector<Source> sources;
  for (const CameraIndex camera : plan.cameras()) sources.push_back({camera, &rig.cameras[camera], image.view()});
  ImageMemory scratch;
  return RequestRenderer().render({&plan, header}, sources, {.codec = codec}, scratch).bytes;
}

inline wire::Answer node_answer(const Rig& rig, const ViewRequest& request, const std::vector<CameraIndex>& cameras,
                                const Image& image) {
  return wire::decode_answer(node_answer_bytes(rig, request, cameras, image)).value();
}

}  // namespace lf::test
