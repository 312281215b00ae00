// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/pixel_answer.h"

#include "base/schedule.h"
#include "render/sum_planes.h"
#include "wire/fragment_codec.h"
#include "wire/strips.h"

namespace lf {
namespace {

constexpr uint8_t kChromaOffset = 128;

// R, G, B in this order without padding between pixels.
void pack_rgb(const ImageView& image, FragmentPlanes& planes, ByteBuffer& memory) {
  const Rect& rect = planes.rect;
  const RgbLayout& layout = image.layout;
  const uint8_t* row = image.plane[0] + rect.y0 * image.stride[0] + rect.x0 * layout.pixel_stride;
  planes.plane[0] = row;
  planes.stride[0] = image.stride[0];
  if (layout == RgbLayout{}) return;
  planes.stride[0] = 3 * static_cast<ptrdiff_t>(rect.width());
  memory.resize(static_cast<size_t>(planes.stride[0]) * rect.height());
  planes.plane[0] = memory.data();
  uint8_t* to = memory.data();
  for (int y = 0; y < rect.height(); y++, row += image.stride[0]) {
    const uint8_t* from = row;
    for (int x = 0; x < rect.width(); x++, from += layout.pixel_stride, to += 3) {
      to[0] = from[layout.r];
      to[1] = from[layout.g];
      to[2] = from[layout.b];
    }
  }
}

// Chroma without its offset.
void pack_i420(const ImageView& image, FragmentPlanes& planes, ByteBuffer& memory) {
  const Rect& rect = planes.rect;
  planes.plane[0] = image.plane[0] + rect.y0 * image.stride[0] + rect.x0;
  planes.stride[0] = image.stride[0];
  const int width = chroma_size(rect.width()), height = chroma_size(rect.height());
  const size_t area = static_cast<size_t>(width) * height;
  memory.resize(2 * area);
  for (int c = 1; c < 3; c++) {
    uint8_t* to = memory.data() + (c - 1) * area;
    planes.plane[c] = to;
    planes.stride[c] = width;
    const uint8_t* row = image.plane[c] + rect.y0 / 2 * image.stride[c] + rect.x0 / 2;
    for (int y = 0; y < height; y++, row += image.stride[c], to += width)
      for (int x = 0; x < width; x++) to[x] = static_cast<uint8_t>(row[x] - kChromaOffset);
  }
}

wire::AnswerFragment cut(const PixelSource& from, const Rect& rect, ByteBuffer& memory) {
  const ImageView& image = from.source.image;
  wire::AnswerFragment fragment{from.source.camera, {.family = image.family, .rect = rect}};
  image.family == PixelFamily::kRgb ? pack_rgb(image, fragment.planes, memory)
                                    : pack_i420(image, fragment.planes, memory);
  return fragment;
}

}  // namespace

RenderedAnswer pixel_answer(const wire::AnswerHeader& header, std::span<const PixelSource> sources, int quality,
                            int strip_pixels, ByteBuffer memory, const ParallelFor& parallel) {
  const uint64_t begin = now_ns();
  std::vector<std::pair<const PixelSource*, Rect>> pieces;
  for (const PixelSource& source : sources) {
    check_image(*source.source.rig_camera, source.source.image);
    const int rows = quality > 0 ? wire::strip_rows(source.rect.width(), strip_pixels) : source.rect.height();
    for (const Rect& rect : wire::cut_rows(source.rect, rows)) pieces.emplace_back(&source, rect);
  }
  std::vector<ByteBuffer> packed(pieces.size());
  std::vector<wire::AnswerFragment> fragments(pieces.size());
  parallel(pieces.size(), [&](size_t i) { fragments[i] = cut(*pieces[i].first, pieces[i].second, packed[i]); });
  const uint64_t cut_out = now_ns();
  RenderedAnswer answer;
  answer.bytes = wire::encode_fragments(header, fragments, quality, std::move(memory), parallel);
  answer.fragments = fragments.size();
  answer.render_ns = cut_out - begin;
  answer.encode_ns = now_ns() - cut_out;
  return answer;
}

}  // namespace lf
