// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/fragment_codec.h"

#include <algorithm>
#include <cstring>
#include <numeric>

#include "jpeg/stack.h"
#include "wire/answer_layout.h"
#include "wire/answer_writer.h"
#include "wire/bytes.h"
#include "wire/limits.h"
#include "wire/payload.h"

namespace lf::wire {
namespace {

// Beginning a JPEG costs about 2 us each way, nearly half of what a fragment of 40x30 pixels costs alone: four of them
// in one picture take a third less time, eight 38 % less; two of 64x48 9 %, two of 96x72 6 % (bench-fragment-jpeg). A
// lost packet takes all members of an atlas along: at quality 90 four of 40x30 have 1.3 kB, a packet or two.
constexpr int kLargestAtlas = 4 * 48 * 32, kLargestMember = kLargestAtlas / 2;  // padded pixels

int padded_width(const CameraFragment& f) { return jpeg::padded(f.planes.rect.width(), jpeg::kPixelUnit); }
int padded_area(const CameraFragment& f) {
  return padded_width(f) * jpeg::padded(f.planes.rect.height(), jpeg::kPixelUnit);
}

// Indices of the fragments in an order in which those that share a picture are neighbours, and how many each shares.
// Only fragments as wide as one another do: an atlas has no empty corners.
struct Grouping {
  std::vector<size_t> order;
  std::vector<size_t> sizes;
};
Grouping group(std::span<const CameraFragment> fragments) {
  Grouping out;
  out.order.resize(fragments.size());
  std::iota(out.order.begin(), out.order.end(), size_t{0});
  const auto small_width = [&](size_t i) {
    return padded_area(fragments[i]) <= kLargestMember ? padded_width(fragments[i]) : 0;
  };
  std::ranges::stable_sort(out.order, {}, small_width);
  int shared_width = 0, total = 0;
  for (const size_t i : out.order) {
    const int width = small_width(i), area = padded_area(fragments[i]);
    const bool joins = width > 0 && width == shared_width && total + area <= kLargestAtlas;
    if (joins)
      out.sizes.back()++;
    else
      out.sizes.push_back(1);
    total = joins ? total + area : area;
    shared_width = width;
  }
  return out;
}

FragmentHeader header_of(const CameraFragment& f, Codec codec, int quality) {
  return {f.camera, f.planes.family, f.planes.rect, codec, static_cast<uint8_t>(quality), f.planes.lost != nullptr,
          f.plain};
}

// Fragments as planes, once they are known to fill their rectangles.
std::vector<CameraFragment> checked_planes(const AnswerHeader& header, std::span<const Fragment> fragments) {
  static_cast<void>(AnswerWriter(header, fragments.size()));  // its errors come first
  std::vector<CameraFragment> all;
  for (size_t i = 0; i < fragments.size(); i++) {
    const Fragment& f = fragments[i];
    all.push_back({f.camera, planes_of(f)});
    in_fragment(i, [&] {
      check_fragment(header, header_of(all.back(), Codec::kRaw, 0));
      if (f.pixels.size() != packed_size(f.family, f.rect.width(), f.rect.height()))
        throw Error("pixels: do not fill the rectangle");
      if (!f.lost.empty() && f.lost.size() != area(f.rect)) throw Error("lost: does not fill the rectangle");
    });
  }
  return all;
}

size_t raw_bytes(const CameraFragment& f) {
  const Rect& rect = f.planes.rect;
  return packed_size(f.planes.family, rect.width(), rect.height()) + (f.planes.lost ? area(rect) : 0);
}

void write_raw(AnswerWriter& writer, std::span<const CameraFragment> fragments) {
  size_t total = 0;
  for (const CameraFragment& f : fragments) total += raw_bytes(f);
  if (total > kMaxAnswerBytes)
    throw Error("fragments: more than the " + std::to_string(kMaxAnswerBytes) + " bytes an answer may have");
  writer.reserve_payloads(total);
  for (const CameraFragment& f : fragments) {
    const FragmentPlanes& p = f.planes;
    const int w = p.rect.width(), h = p.rect.height();
    uint8_t* to = writer.add(header_of(f, Codec::kRaw, 0)).data();
    if (p.family == PixelFamily::kRgb) {
      to = copy_rows(p.plane[0], p.stride[0], 3 * w, h, to);
    } else {
      to = copy_rows(p.plane[0], p.stride[0], w, h, to);
      for (int c = 1; c < 3; c++) to = copy_rows(p.plane[c], p.stride[c], chroma_size(w), chroma_size(h), to);
    }
    if (p.lost) copy_rows(p.lost, p.lost_stride, w, h, to);
  }
}

std::vector<FragmentPlanes> members_of(std::span<const CameraFragment> fragments, std::span<const size_t> indices) {
  std::vector<FragmentPlanes> members;
  for (const size_t i : indices) members.push_back(fragments[i].planes);
  return members;
}

// The fragments `indices`, which share one JPEG payload that `append` appends.
template <typename Append>
void write_group(AnswerWriter& writer, std::span<const CameraFragment> fragments, std::span<const size_t> indices,
                 int quality, Append append) {
  const Codec codec = indices.size() == 1 ? Codec::kJpeg : Codec::kJpegAtlas;
  writer.add(header_of(fragments[indices[0]], codec, quality), append);
  for (const size_t i : indices.subspan(1)) writer.add_member(header_of(fragments[i], codec, quality));
}

}  // namespace

void FragmentEncoder::encode_payload(std::span<const FragmentPlanes> members, int quality, ByteBuffer& out) {
  const bool lost = std::ranges::any_of(members, [](const FragmentPlanes& m) { return m.lost != nullptr; });
  const size_t begin = out.size();
  if (lost) out.resize(begin + sizeof(uint32_t));
  jpeg_.encode_pixels(members, quality, out);
  if (!lost) return;
  store(&out[begin], static_cast<uint32_t>(out.size() - begin - sizeof(uint32_t)));
  jpeg_.encode_lost(members, std::max(quality, kLeastLostQuality), out);
}

ByteBuffer FragmentEncoder::encode(const AnswerHeader& header, std::span<const Fragment> fragments, int quality,
                                   ByteBuffer memory) {
  return encode(header, checked_planes(header, fragments), quality, std::move(memory));
}

ByteBuffer FragmentEncoder::encode(const AnswerHeader& header, std::span<const CameraFragment> fragments, int quality,
                                   ByteBuffer memory) {
  if (quality < 0 || quality > 100) throw Error("quality: must be 0 to 100, is " + std::to_string(quality));
  AnswerWriter writer(header, fragments.size(), std::move(memory));
  for (size_t i = 0; i < fragments.size(); i++) in_fragment(i, [&] { check_fragment(header, header_of(fragments[i], Codec::kRaw, 0)); });
  if (quality == 0) {
    write_raw(writer, fragments);
    return writer.finish();
  }
  const Grouping groups = group(fragments);
  size_t first = 0;
  for (const size_t size : groups.sizes) {
    const std::span<const size_t> indices = std::span(groups.order).subspan(first, size);
    first += size;
    write_group(writer, fragments, indices, quality,
                [&](ByteBuffer& out) { encode_payload(members_of(fragments, indices), quality, out); });
  }
  return writer.finish();
}

ByteBuffer encode_fragments(const AnswerHeader& header, std::span<const CameraFragment> fragments, int quality,
                            ByteBuffer memory, const ParallelFor& parallel) {
  if (quality == 0 || fragments.size() < 2) {
    thread_local FragmentEncoder encoder;
    return encoder.encode(header, fragments, quality, std::move(memory));
  }
  AnswerWriter writer(header, fragments.size(), std::move(memory));
  for (size_t i = 0; i < fragments.size(); i++) in_fragment(i, [&] { check_fragment(header, header_of(fragments[i], Codec::kRaw, 0)); });
  const Grouping groups = group(fragments);
  std::vector<std::span<const size_t>> indices;
  for (size_t g = 0, first = 0; g < groups.sizes.size(); first += groups.sizes[g++])
    indices.push_back(std::span(groups.order).subspan(first, groups.sizes[g]));
  std::vector<ByteBuffer> payloads(indices.size());
  parallel(indices.size(), [&](size_t g) {
    thread_local FragmentEncoder encoder;
    encoder.encode_payload(members_of(fragments, indices[g]), quality, payloads[g]);
  });
  for (size_t g = 0; g < indices.size(); g++)
    write_group(writer, fragments, indices[g], quality, [&](ByteBuffer& out) { append(out, payloads[g]); });
  return writer.finish();
}

std::span<const FragmentPlanes> FragmentDecoder::decode(std::span<const FragmentView> group) {
  planes_.clear();
  if (group.empty() || group[0].codec == Codec::kRaw16) return {};
  if (group[0].codec == Codec::kRaw) {
    planes_.push_back(raw_planes(group[0], group[0].payload.data()));
    return planes_;
  }
  lost_.clear();
  for (const FragmentView& member : group) {
    planes_.push_back({.family = member.family, .rect = member.rect});
    if (member.has_lost) lost_.push_back(planes_.back());
  }
  const int quality = group[0].quality;
  const std::optional<Scans> scans = split_scans(group[0].payload, !lost_.empty());
  if (!scans || !jpeg_.decode_pixels(scans->pixels, quality, planes_)) return {};
  if (lost_.empty()) return planes_;
  if (!jpeg_.decode_lost(scans->lost, std::max(quality, kLeastLostQuality), lost_)) return {};
  for (size_t i = 0, next = 0; i < group.size(); i++) {
    if (!group[i].has_lost) continue;
    planes_[i].lost = lost_[next].lost;
    planes_[i].lost_stride = lost_[next++].lost_stride;
  }
  return planes_;
}

ConstSumPlanes FragmentDecoder::sums(const FragmentView& fragment, bool* copied) {
  const uint8_t* bytes = fragment.payload.data();
  const bool odd = reinterpret_cast<uintptr_t>(bytes) % alignof(int16_t) != 0;
  if (odd) {
    aligned_.resize(fragment.payload.size() / 2);
    std::memcpy(aligned_.data(), bytes, aligned_.size() * 2);
    bytes = reinterpret_cast<const uint8_t*>(aligned_.data());
  }
  if (copied) *copied = odd;
  return raw16_planes(fragment, bytes);
}

}  // namespace lf::wire
