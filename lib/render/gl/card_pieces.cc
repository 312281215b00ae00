// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/card_pieces.h"

#include "image/card_image.h"
#include "image/correction.h"
#include "render/gl/computed.h"

namespace lf::gl {

CardPieces::~CardPieces() {
  if (nearest_) glDeleteSamplers(1, &nearest_);
}

bool CardPieces::begin(size_t bytes, Programs& programs, std::string& why) {
  if (bytes / sizeof(uint32_t) > Computed::most_words()) {
    why = "the images are too large for its shaders";
    return false;
  }
  program_ = programs.use({.output = SumProgram::Output::kImage}, why);
  if (!program_) return false;
  if (!nearest_) {
    // Whoever made a texture may have left it to be read through mipmaps that it does not have.
    glGenSamplers(1, &nearest_);
    glSamplerParameteri(nearest_, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glSamplerParameteri(nearest_, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  }
  bytes_.reserve(bytes);
  glBindSampler(kCardImage, nearest_);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kResultBinding, bytes_.name());
  glMemoryBarrier(GL_PIXEL_BUFFER_BARRIER_BIT);  // the texture before has been made of them
  return true;
}

void CardPieces::copy(const ImageView& image, const Plane& plane) {
  const Rect& part = plane.part;
  if (part.empty()) return;
  const CardPixels& from = image.on_card;
  const CardImage::Texture texture = from.image->plane(plane.index);
  const bool rgb = image.family == PixelFamily::kRgb;
  const int columns = rgb ? part.width() : (part.width() + kWord - 1) / kWord, rows = part.height();
  glActiveTexture(GL_TEXTURE0 + kCardImage);
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

void CardPieces::end() {
  glMemoryBarrier(GL_PIXEL_BUFFER_BARRIER_BIT);
  glActiveTexture(GL_TEXTURE0 + kCardImage);
  glBindTexture(GL_TEXTURE_2D, 0);
  glBindSampler(kCardImage, 0);
}

}  // namespace lf::gl
