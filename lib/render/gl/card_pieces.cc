// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/card_pieces.h"

#include "image/card_image.h"
#include "image/correction.h"

namespace lf::gl {

CardPieces::~CardPieces() {
  if (target_) glDeleteFramebuffers(1, &target_);
  if (no_vertices_) glDeleteVertexArrays(1, &no_vertices_);
  if (nearest_) glDeleteSamplers(1, &nearest_);
}

bool CardPieces::begin(GLuint texture, Programs& programs, std::string& why) {
  program_ = programs.use({.output = SumProgram::Output::kImage}, why);
  if (!program_) return false;
  if (!target_) {
    glGenFramebuffers(1, &target_);
    glGenVertexArrays(1, &no_vertices_);  // OpenGL's core profile draws without none
    // Whoever made a texture may have left it to be read through mipmaps that it does not have.
    glGenSamplers(1, &nearest_);
    glSamplerParameteri(nearest_, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glSamplerParameteri(nearest_, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  }
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, target_);
  glFramebufferTexture2D(GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture, 0);
  if (glCheckFramebufferStatus(GL_DRAW_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    end();
    why = "the card can't draw images";
    return false;
  }
  glBindVertexArray(no_vertices_);
  glBindSampler(kCardImage, nearest_);
  glDisable(GL_BLEND);
  glDisable(GL_DITHER);
  glDisable(GL_DEPTH_TEST);
  return true;
}

void CardPieces::draw(const ImageView& image, const Plane& plane) {
  const Rect& part = plane.part;
  if (part.empty()) return;
  const CardPixels& from = image.on_card;
  const CardImage::Texture texture = from.image->plane(plane.index);
  const bool rgb = image.family == PixelFamily::kRgb;
  glActiveTexture(GL_TEXTURE0 + kCardImage);
  glBindTexture(GL_TEXTURE_2D, texture.name);
  glUniform2i(program_->origin, plane.x, plane.y);
  glUniform2i(program_->size, plane.width, plane.height);
  glUniform4i(program_->channels, rgb ? -1 : texture.channel, from.gain == 1 ? 0 : gain_factor(from.gain),
              plane.index == 0 ? 0 : 128, from.sharpened);
  glViewport(plane.x + part.x0, plane.y + part.y0, part.width(), part.height());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

void CardPieces::end() {
  glActiveTexture(GL_TEXTURE0 + kCardImage);
  glBindTexture(GL_TEXTURE_2D, 0);
  glBindSampler(kCardImage, 0);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
  glBindVertexArray(0);
}

}  // namespace lf::gl
