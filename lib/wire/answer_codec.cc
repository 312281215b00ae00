// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/answer_codec.h"

#include <algorithm>

#include "base/error.h"
#include "wire/limits.h"

namespace lf::wire {
namespace {

constexpr uint16_t kLastOfNode = 1;  // flag of the unit
constexpr size_t kAnswerHeaderBytes = 60, kFragmentBytes = 20;

constexpr uint8_t kRaw = 0, kJpeg = 1;             // codecs
constexpr uint16_t kWeighted = 1, kLostPlane = 2;  // flags of a fragment
constexpr uint16_t kSumOnWire = 0xffff;            // camera

// What both ways ask of the fields in front of the fragment table.
void check_header(const Answer& answer, size_t fragments) {
  const auto size = [](const char* name, int value) {
    if (value < 1 || value > kMaxViewSize)
      throw Error(std::string(name) + ": must be 1 to " + std::to_string(kMaxViewSize) + " pixels, is " +
                  std::to_string(value));
  };
  size("view_width", answer.view_width);
  size("view_height", answer.view_height);
  if (answer.family > PixelFamily::kI420)
    throw Error("family: " + std::to_string(static_cast<int>(answer.family)) + " is unknown");
  if (fragments > kMaxFragments)
    throw Error("fragments: at most " + std::to_string(kMaxFragments) + ", not " + std::to_string(fragments));
  if (answer.family == PixelFamily::kNone && fragments > 0)
    throw Error("family: none, but there are " + std::to_string(fragments) + " fragments");
}

// What both ways ask of a fragment's place.
void check_fragment(const Answer& answer, CameraIndex camera, const Rect& rect) {
  if (camera != Fragment::kSum && camera >= kMaxCameras)
    throw Error("camera: " + std::to_string(camera) + " is beyond " + std::to_string(kMaxCameras - 1));
  if (rect.empty()) throw Error("rectangle: is empty");
  if (rect.x0 < 0 || rect.y0 < 0 || rect.x1 > answer.view_width || rect.y1 > answer.view_height)
    throw Error("rectangle: is not inside the view");
  if (answer.family == PixelFamily::kI420 && (rect.x0 % 2 != 0 || rect.y0 % 2 != 0))
    throw Error("rectangle: x and y must be even in YCbCr");
}

size_t area(const Rect& rect) { return static_cast<size_t>(rect.width()) * rect.height(); }

// "fragments[3].rectangle: ..."
template <typename F>
auto in_fragment(size_t index, F f) {
  try {
    return f();
  } catch (const Error& error) {
    throw Error("fragments[" + std::to_string(index) + "]." + error.what());
  }
}

struct Head {
  Answer answer;
  UnitHeader unit;
  uint32_t fragments;
};

Head read_head(std::span<const uint8_t> bytes) {
  std::string reason;
  const std::optional<UnitHeader> unit =
      check_unit_header(bytes, UnitKind::kAnswer, kFragmentsType, kLastOfNode, reason);
  if (!unit) throw Error(reason);
  Head head{.unit = *unit};
  Reader in(bytes.first(std::min(bytes.size(), unit->size)).subspan(kUnitHeaderBytes));
  Answer& answer = head.answer;
  answer.last_of_node = unit->flags & kLastOfNode;
  answer.view_id = in.get<uint32_t>();
  answer.sequence = in.get<uint32_t>();
  answer.target_time = in.get<uint64_t>();
  answer.actual_time = in.get<uint64_t>();
  answer.rig_hash = in.get<uint64_t>();
  answer.node = in.get<uint32_t>();
  answer.view_width = in.get<uint16_t>();
  answer.view_height = in.get<uint16_t>();
  answer.family = static_cast<PixelFamily>(in.get<uint8_t>());
  const uint32_t reserved = (uint32_t{in.get<uint8_t>()} << 16) | in.get<uint16_t>();
  head.fragments = in.get<uint32_t>();
  if (!in.ok())
    throw Error("header: needs " + std::to_string(kAnswerHeaderBytes) + " bytes, there are " +
                std::to_string(std::min(bytes.size(), unit->size)));
  if (reserved != 0) throw Error("reserved: must be 0, is " + std::to_string(reserved));
  check_header(answer, head.fragments);
  if (head.fragments > (unit->size - kAnswerHeaderBytes) / kFragmentBytes)
    throw Error("fragments: a table of " + std::to_string(head.fragments) + " is longer than the answer");
  return head;
}

// One entry of the table; its planes are taken from the front of `payloads`.
Fragment read_fragment(const Answer& answer, Reader& table, Reader& payloads) {
  Fragment fragment;
  const uint16_t camera = table.get<uint16_t>();
  const uint16_t plane = table.get<uint16_t>();
  const uint16_t x = table.get<uint16_t>(), y = table.get<uint16_t>();
  const uint16_t w = table.get<uint16_t>(), h = table.get<uint16_t>();
  const uint8_t codec = table.get<uint8_t>(), quality = table.get<uint8_t>();
  const uint16_t flags = table.get<uint16_t>();
  const uint32_t length = table.get<uint32_t>();

  fragment.camera = camera == kSumOnWire ? Fragment::kSum : camera;
  fragment.family = answer.family;
  fragment.rect = {x, y, x + w, y + h};
  check_fragment(answer, fragment.camera, fragment.rect);
  if (plane != 0) throw Error("plane: " + std::to_string(plane) + " is not supported");
  if (codec != kRaw)
    throw Error("codec: " + std::to_string(codec) + (codec == kJpeg ? " (JPEG)" : "") + " is not supported");
  if (quality != 0) throw Error("quality: must be 0 for raw pixels, is " + std::to_string(quality));
  if (flags & ~(kWeighted | kLostPlane)) throw Error("flags: unknown bits");
  if (!(flags & kWeighted)) throw Error("flags: fragments without weight are not supported");

  const size_t pixels = packed_size(answer.family, w, h), lost = flags & kLostPlane ? area(fragment.rect) : 0;
  if (length != pixels + lost)
    throw Error("length: must be " + std::to_string(pixels + lost) + " bytes, is " + std::to_string(length));
  if (length > payloads.left())
    throw Error("length: " + std::to_string(length) + " bytes, but " + std::to_string(payloads.left()) + " are left");
  const std::span<const uint8_t> pixel_bytes = payloads.get_bytes(pixels), lost_bytes = payloads.get_bytes(lost);
  fragment.pixels.assign(pixel_bytes.begin(), pixel_bytes.end());
  fragment.lost.assign(lost_bytes.begin(), lost_bytes.end());
  return fragment;
}

Answer read_answer(std::span<const uint8_t> bytes) {
  Head head = read_head(bytes);
  std::string reason;
  if (!check_unit_size(bytes, head.unit, reason)) throw Error(reason);
  Answer& answer = head.answer;
  const size_t table_bytes = head.fragments * kFragmentBytes;
  Reader table(bytes.subspan(kAnswerHeaderBytes, table_bytes));
  Reader payloads(bytes.subspan(kAnswerHeaderBytes + table_bytes));
  answer.fragments.reserve(head.fragments);  // their entries are there
  for (uint32_t i = 0; i < head.fragments; i++)
    answer.fragments.push_back(in_fragment(i, [&] { return read_fragment(answer, table, payloads); }));
  if (payloads.left() > 0)
    throw Error("length: " + std::to_string(payloads.left()) + " bytes after the last fragment's payload");
  return std::move(answer);
}

}  // namespace

std::vector<uint8_t> encode_answer(const Answer& answer) {
  check_header(answer, answer.fragments.size());
  size_t size = kAnswerHeaderBytes + answer.fragments.size() * kFragmentBytes;
  for (size_t i = 0; i < answer.fragments.size(); i++) {
    const Fragment& f = answer.fragments[i];
    in_fragment(i, [&] {
      check_fragment(answer, f.camera, f.rect);
      if (f.family != answer.family) throw Error("family: differs from the answer's");
      if (f.pixels.size() != packed_size(f.family, f.rect.width(), f.rect.height()))
        throw Error("pixels: do not fill the rectangle");
      if (!f.lost.empty() && f.lost.size() != area(f.rect)) throw Error("lost: does not fill the rectangle");
    });
    size += f.bytes();
    if (size > kMaxAnswerBytes)
      throw Error("fragments: more than the " + std::to_string(kMaxAnswerBytes) + " bytes an answer may have");
  }

  Writer out(size);
  put_unit_header(out, UnitKind::kAnswer, kFragmentsType, answer.last_of_node ? kLastOfNode : uint16_t{0}, size);
  out.put(answer.view_id);
  out.put(answer.sequence);
  out.put(answer.target_time);
  out.put(answer.actual_time);
  out.put(answer.rig_hash);
  out.put(answer.node);
  out.put(static_cast<uint16_t>(answer.view_width));
  out.put(static_cast<uint16_t>(answer.view_height));
  out.put(static_cast<uint8_t>(answer.family));
  out.put(uint8_t{0});
  out.put(uint16_t{0});
  out.put(static_cast<uint32_t>(answer.fragments.size()));
  for (const Fragment& f : answer.fragments) {
    out.put(f.camera == Fragment::kSum ? kSumOnWire : static_cast<uint16_t>(f.camera));
    out.put(uint16_t{0});  // plane
    out.put(static_cast<uint16_t>(f.rect.x0));
    out.put(static_cast<uint16_t>(f.rect.y0));
    out.put(static_cast<uint16_t>(f.rect.width()));
    out.put(static_cast<uint16_t>(f.rect.height()));
    out.put(kRaw);
    out.put(uint8_t{0});  // quality
    out.put(static_cast<uint16_t>(f.lost.empty() ? kWeighted : kWeighted | kLostPlane));
    out.put(static_cast<uint32_t>(f.bytes()));
  }
  for (const Fragment& f : answer.fragments) {
    out.put_bytes(f.pixels);
    out.put_bytes(f.lost);
  }
  return out.take();
}

std::optional<Answer> decode_answer(std::span<const uint8_t> bytes, std::string* reason) {
  try {
    return read_answer(bytes);
  } catch (const Error& error) {
    if (reason) *reason = error.what();
    return std::nullopt;
  }
}

std::optional<Answer> decode_answer_header(std::span<const uint8_t> bytes, std::string* reason) {
  try {
    return read_head(bytes).answer;
  } catch (const Error& error) {
    if (reason) *reason = error.what();
    return std::nullopt;
  }
}

}  // namespace lf::wire
