// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/image_atlas.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "image/image.h"
#include "image/image_filters.h"
#include "render/gl/objects.h"

namespace lf::gl {

TextureStager::~TextureStager() {
  if (nearest_) glDeleteSamplers(1, &nearest_);
}

void TextureStager::begin(size_t bytes, Programs& programs) {
  if (bytes / sizeof(uint32_t) > ComputeBuffer::most_words())
    throw Error("the images are too large for a shader storage buffer");
  program_ = &programs.use({.output = SumProgram::Output::kImage});
  if (!nearest_) {
    // The creator of a texture may have set a mipmap filter without providing mipmaps.
    glGenSamplers(1, &nearest_);
    glSamplerParameteri(nearest_, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glSamplerParameteri(nearest_, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  }
  bytes_.reserve(bytes);
  glBindSampler(kGpuImage, nearest_);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kResultBinding, bytes_.name());
  glMemoryBarrier(GL_PIXEL_BUFFER_BARRIER_BIT);  // wait for the previous upload from this buffer
}

void TextureStager::copy(const ImageView& image, const Plane& plane) {
  const Rect& part = plane.part;
  if (part.empty()) return;
  const GpuPixels& from = image.on_gpu;
  const GpuImage::Texture texture = from.image->plane(plane.index);
  const bool rgb = image.family == PixelFamily::kRgb;
  const int columns = rgb ? part.width() : (part.width() + kWord - 1) / kWord, rows = part.height();
  glActiveTexture(GL_TEXTURE0 + kGpuImage);
  glBindTexture(GL_TEXTURE_2D, texture.name);
  glUniform2i(program_->origin, part.x0, part.y0);
  glUniform2i(program_->size, plane.width, plane.height);
  glUniform2i(program_->extent, columns, rows);
  glUniform4ui(program_->parts, static_cast<GLuint>(plane.first), static_cast<GLuint>(plane.row), 0, 0);
  glUniform4i(program_->channels, rgb ? -1 : texture.channel, from.gain == 1 ? 0 : gain_factor(from.gain),
              plane.index == 0 ? 0 : 128, from.sharpened);
  const auto groups = [](int words) { return static_cast<GLuint>((words + kGroup - 1) / kGroup); };
  glDispatchCompute(groups(columns), groups(rows), 1);
}

void TextureStager::end() {
  glMemoryBarrier(GL_PIXEL_BUFFER_BARRIER_BIT);
  glActiveTexture(GL_TEXTURE0 + kGpuImage);
  glBindTexture(GL_TEXTURE_2D, 0);
  glBindSampler(kGpuImage, 0);
}

namespace {

int even(int size) { return (size + 1) & ~1; }

int up_to(int multiple, int size) { return (size + multiple - 1) / multiple * multiple; }

}  // namespace

void ImageAtlas::find_pieces(std::span<const GlesView> views, const NeededPixels& needed) {
  const PixelFamily family = views.front().task->family;
  pieces_.clear();
  uses_.clear();
  bytes_ = 1;
  has_chroma_ = needed.colours && family == PixelFamily::kI420;
  has_uploads_ = has_gpu_ = false;
  std::map<std::tuple<const uint8_t*, const uint8_t*, ptrdiff_t, GpuPixels>, size_t> known;
  for (size_t v = 0; v < views.size(); v++)
    for (const Source& source : views[v].sources) {
      const int32_t slot = views[v].task->slot_of_camera[source.camera];
      if (slot < 0 || source.image.family == PixelFamily::kNone) continue;
      const ImageView& image = source.image;
      const auto [at, is_new] =
          known.try_emplace({image.plane[0], image.plane[1], image.stride[0], image.on_gpu}, pieces_.size());
      if (is_new) pieces_.push_back({&image, {}, {}});
      (image.on_gpu.image ? has_gpu_ : has_uploads_) = true;
      Piece& piece = pieces_[at->second];
      piece.part = unite(piece.part, needed.part(views[v], source));
      uses_.push_back({v, static_cast<size_t>(slot), at->second});
      // TextureStager writes whole words.
      if (family == PixelFamily::kRgb) bytes_ = std::max(bytes_, image.on_gpu.image ? 4 : image.layout.pixel_stride);
    }
}

int ImageAtlas::place_pieces() {
  // TextureStager also writes chroma in whole words, and chroma has half the width.
  const int columns = has_gpu_ ? 2 * TextureStager::kWord : 2;
  double area = 0;
  int widest = columns;
  std::vector<Piece*> highest_first;
  for (Piece& piece : pieces_) {
    area += static_cast<double>(up_to(columns, piece.part.width())) * even(piece.part.height());
    widest = std::max(widest, up_to(columns, piece.part.width()));
    highest_first.push_back(&piece);
  }
  std::ranges::sort(highest_first, std::ranges::greater(), [](const Piece* piece) { return piece->part.height(); });
  width_ = std::max(widest, up_to(columns, static_cast<int>(std::sqrt(1.1 * area))));
  int x = 0, y = 0, shelf = 0;
  for (Piece* const piece : highest_first) {
    const int width = up_to(columns, piece->part.width()), height = even(piece->part.height());
    if (x + width > width_) {
      x = 0;
      y += shelf;
      shelf = 0;
    }
    shelf = std::max(shelf, height);
    piece->at = {x - piece->part.x0, y - piece->part.y0};
    x += width;
  }
  return y + shelf;
}

bool ImageAtlas::lay_out(std::span<const GlesView> views, const NeededPixels& needed, int max_size) {
  find_pieces(views, needed);
  height_ = std::max(place_pieces(), 2);
  offsets_.resize(views.size());
  for (size_t v = 0; v < views.size(); v++) offsets_[v].assign(views[v].task->slots.size(), {});
  for (const auto& [view, slot, piece] : uses_) offsets_[view][slot] = pieces_[piece].at;
  return std::max(width_, all_rows()) <= max_size && size() <= kMaxBytes;
}

void ImageAtlas::copy(const Piece& piece, uint8_t* to) const {
  const auto& [image, part, at] = piece;
  const auto bytes = static_cast<size_t>(bytes_), row = static_cast<size_t>(width_) * bytes;
  const size_t count = static_cast<size_t>(part.width()) * bytes;
  uint8_t* out = to + static_cast<size_t>(at.y + part.y0) * row + static_cast<size_t>(at.x + part.x0) * bytes;
  const RgbLayout& layout = image->layout;
  const int offsets[3] = {layout.r, layout.g, layout.b};
  for (int y = part.y0; y < part.y1; y++, out += row) {
    const uint8_t* from = image->plane[0] + y * image->stride[0];
    if (image->family == PixelFamily::kI420 || layout.pixel_stride == bytes_) {
      std::copy_n(from + ptrdiff_t{part.x0} * bytes_, count, out);
      continue;
    }
    uint8_t* pixel = out;  // the image has fewer bytes per pixel than the texture
    for (int x = part.x0; x < part.x1; x++, pixel += bytes)
      for (const int c : offsets) pixel[c] = from[x * layout.pixel_stride + c];
  }
  if (!has_chroma_) return;
  const Rect half{part.x0 / 2, part.y0 / 2, chroma_size(part.x1), chroma_size(part.y1)};
  for (const int plane : {1, 2}) {
    const Offset origin = chroma_offset(plane);
    out = to + static_cast<size_t>(origin.y + at.y / 2 + half.y0) * row +
          static_cast<size_t>(origin.x + at.x / 2 + half.x0);
    for (int y = half.y0; y < half.y1; y++, out += row)
      std::copy_n(image->plane[plane] + y * image->stride[plane] + half.x0, half.width(), out);
  }
}

void ImageAtlas::copy_on_gpu(const Piece& piece, TextureStager& pieces) const {
  const auto& [image, part, at] = piece;
  // samples per word; words per row
  const int samples = bytes_ == 1 ? TextureStager::kWord : 1, row = width_ / samples;
  const auto word_at = [&](int x, int y) { return static_cast<size_t>(y) * row + static_cast<size_t>(x / samples); };
  pieces.copy(*image, {0, image->width, image->height, part, word_at(at.x + part.x0, at.y + part.y0), row});
  if (!has_chroma_) return;
  const Rect half{part.x0 / 2, part.y0 / 2, chroma_size(part.x1), chroma_size(part.y1)};
  for (const int plane : {1, 2}) {
    const Offset origin = chroma_offset(plane);
    pieces.copy(*image, {plane, chroma_size(image->width), chroma_size(image->height), half,
                         word_at(origin.x + at.x / 2 + half.x0, origin.y + at.y / 2 + half.y0), row});
  }
}

void ImageAtlas::fill(const ParallelFor& parallel) {
  if (!has_uploads_) return;
  parallel(pieces_.size(), [&](size_t i) {
    if (!pieces_[i].image->on_gpu.image) copy(pieces_[i], texture_.room());
  });
}

void ImageAtlas::send(TextureStager& pieces, Programs& programs) {
  const GLenum internal_format = bytes_ == 1   ? GL_R8
                                 : bytes_ == 3 ? GL_RGB8
                                               : GL_RGBA8,
               format = bytes_ == 1   ? GL_RED
                        : bytes_ == 3 ? GL_RGB
                                      : GL_RGBA;
  const auto send_from = [&](GLuint buffer) {
    texture_.send(kImages, internal_format, format, width_, all_rows(), false, buffer);
  };
  if (!has_gpu_) return send_from(0);
  std::set<const GpuImage*> waited_for;
  for (const Piece& piece : pieces_) {
    const GpuImage* const image = piece.image->on_gpu.image;
    if (image && waited_for.insert(image).second) image->wait();
  }
  pieces.begin(size(), programs);
  if (has_uploads_) texture_.copy_to(pieces.name(), size());
  for (const Piece& piece : pieces_)
    if (piece.image->on_gpu.image) copy_on_gpu(piece, pieces);
  pieces.end();
  send_from(pieces.name());
}

}  // namespace lf::gl
