// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/fragment_codec.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "wire/answer_codec.h"
#include "wire/unit.h"

namespace lf::wire {
namespace {

int divided_up(int a, int b) { return (a + b - 1) / b; }

}  // namespace

Rect Tiling::tile(size_t i) const {
  const int x = whole.x0 + static_cast<int>(i % columns) * width, y = whole.y0 + static_cast<int>(i / columns) * height;
  return {x, y, std::min(x + width, whole.x1), std::min(y + height, whole.y1)};
}

FragmentHeader tile_header(const FragmentHeader& fragment, const Rect& tile) {
  FragmentHeader out = fragment;
  out.rect = tile;
  return out;
}

std::optional<Tiling> tile_raw(const FragmentHeader& fragment, size_t max_bytes) {
  if (fragment.codec == Codec::kJpeg) return std::nullopt;
  const int unit = fragment.family == PixelFamily::kI420 ? 2 : 1;  // pixels per side that share chroma samples
  const auto units_that_fit = [&](int width) {
    const size_t bytes = raw_size(tile_header(fragment, {0, 0, width, unit}));
    return static_cast<int>(std::min<size_t>(max_bytes / bytes, kMaxViewSize / unit));
  };
  const auto in_columns = [&](int columns) {
    Tiling out{.whole = fragment.rect};
    out.width = divided_up(divided_up(out.whole.width(), columns), unit) * unit;
    out.height = units_that_fit(out.width) * unit;
    if (out.height == 0) return out;
    out.columns = divided_up(out.whole.width(), out.width);
    out.rows = divided_up(out.whole.height(), out.height);
    return out;
  };
  const int widest = units_that_fit(unit) * unit;
  if (widest == 0) return std::nullopt;
  // Full rows may leave half of each packet empty, which would double the number of packets. Narrower tiles fill
  // packets better.
  const int least = units_that_fit(fragment.rect.width()) > 0 ? 1 : divided_up(fragment.rect.width(), widest);
  std::vector<Tiling> choices;
  for (int columns = least; columns <= 2 * least + 6; columns++) {
    choices.push_back(in_columns(columns));
    if (choices.back().count() == 0) choices.pop_back();
  }
  const size_t fewest = std::ranges::min_element(choices, {}, &Tiling::count)->count();
  return *std::ranges::find_if(choices, [&](const Tiling& t) { return 9 * t.count() <= 10 * fewest; });
}

void copy_tile(const FragmentView& fragment, const Rect& tile, uint8_t* to) {
  const Rect& whole = fragment.rect;
  const uint8_t* from = fragment.payload.data();
  const auto plane = [&](int bytes, int side) {
    const ptrdiff_t stride = static_cast<ptrdiff_t>(divided_up(whole.width(), side)) * bytes;
    to = copy_rows(from + (tile.y0 - whole.y0) / side * stride + (tile.x0 - whole.x0) / side * bytes, stride,
                   static_cast<size_t>(divided_up(tile.width(), side)) * bytes, divided_up(tile.height(), side), to);
    from += stride * divided_up(whole.height(), side);
  };
  const bool rgb = fragment.family == PixelFamily::kRgb;
  const int sample = fragment.codec == Codec::kRaw16 ? 2 : 1;
  if (rgb && sample == 1) {
    plane(3, 1);
  } else {
    plane(sample, 1);
    for (int c = 1; c < 3; c++) plane(sample, rgb ? 1 : 2);
  }
  if (fragment.has_missing) plane(sample, 1);
}

namespace {

FragmentHeader header_of(const AnswerFragment& f, Codec codec, int quality) {
  return {f.camera, f.planes.family, f.planes.rect, codec, static_cast<uint8_t>(quality), f.planes.lost != nullptr};
}

size_t raw_bytes(const AnswerFragment& f) {
  const Rect& rect = f.planes.rect;
  return packed_size(f.planes.family, rect.width(), rect.height()) + (f.planes.lost ? area(rect) : 0);
}

void write_raw(AnswerWriter& writer, std::span<const AnswerFragment> fragments) {
  size_t total = 0;
  for (const AnswerFragment& f : fragments) total += raw_bytes(f);
  if (total > kMaxAnswerBytes)
    throw Error("fragments: more than the " + std::to_string(kMaxAnswerBytes) + " bytes an answer may have");
  writer.reserve_payloads(total);
  for (const AnswerFragment& f : fragments) {
    const FragmentPlanes& p = f.planes;
    const int w = p.rect.width(), h = p.rect.height();
    uint8_t* to = writer.add(header_of(f, Codec::kRaw, 0)).data();
    if (p.family == PixelFamily::kRgb) {
      to = copy_rows(p.plane[0], p.stride[0], 3 * w, h, to);
    } else {
      to = copy_rows(p.plane[0], p.stride[0], w, h, to);
      for (int c = 1; c < 3; c++) to = copy_rows(p.plane[c], p.stride[c], chroma_size(w), chroma_size(h), to);
    }
    if (p.lost) copy_rows(p.lost, p.missing_stride, w, h, to);
  }
}

}  // namespace

void append_jpeg(const FragmentPlanes& fragment, int quality, ByteBuffer& out) {
  thread_local jpeg::FragmentEncoder encoder;
  const size_t begin = out.size();
  if (fragment.lost) out.resize(begin + sizeof(uint32_t));
  encoder.encode_pixels(fragment, quality, out);
  if (!fragment.lost) return;
  store(&out[begin], static_cast<uint32_t>(out.size() - begin - sizeof(uint32_t)));
  encoder.encode_missing(fragment, std::max(quality, kMinMissingQuality), out);
}

ByteBuffer encode_fragments(const AnswerHeader& header, std::span<const AnswerFragment> fragments, int quality,
                            ByteBuffer memory, const ParallelFor& parallel) {
  if (quality < 0 || quality > 100) throw Error("quality: must be 0 to 100, is " + std::to_string(quality));
  AnswerWriter writer(header, fragments.size(), std::move(memory));
  for (size_t i = 0; i < fragments.size(); i++)
    in_fragment(i, [&] { check_fragment(header, header_of(fragments[i], Codec::kRaw, 0)); });
  if (quality == 0) {
    write_raw(writer, fragments);
    return writer.finish();
  }
  std::vector<ByteBuffer> payloads(fragments.size());
  parallel(fragments.size(), [&](size_t i) { append_jpeg(fragments[i].planes, quality, payloads[i]); });
  for (size_t i = 0; i < fragments.size(); i++)
    writer.add(header_of(fragments[i], Codec::kJpeg, quality), [&](ByteBuffer& out) { append(out, payloads[i]); });
  return writer.finish();
}

std::optional<FragmentPlanes> FragmentDecoder::decode(const FragmentView& fragment) {
  if (fragment.codec == Codec::kRaw16) return std::nullopt;
  if (fragment.codec == Codec::kRaw) return raw_planes(fragment, fragment.payload.data());
  FragmentPlanes planes{.family = fragment.family, .rect = fragment.rect};
  const std::optional<Scans> scans = split_scans(fragment.payload, fragment.has_missing);
  if (!scans || !jpeg_.decode_pixels(scans->pixels, fragment.quality, planes)) return std::nullopt;
  if (fragment.has_missing &&
      !jpeg_.decode_missing(scans->lost, std::max<int>(fragment.quality, kMinMissingQuality), planes))
    return std::nullopt;
  return planes;
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
