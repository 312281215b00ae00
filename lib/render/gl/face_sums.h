// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "render/gl/face_cover.h"
#include "render/gl/objects.h"
#include "render/gl/sum_drawer.h"
#include "render/gl/view_textures.h"
#include "render/simd/band_data.h"

namespace lf::gl {

// Draws sums by fragment shaders, a few triangles for each face of the mesh: what is quickest where the CPU computes,
// whose drivers are slow with all that is looked up. All calls while the context is current.
class FaceSums {
 public:
  // Sums in float have more bits where the driver can blend them (GL_EXT_float_blend).
  explicit FaceSums(bool has_float_blend);
  ~FaceSums();
  FaceSums(const FaceSums&) = delete;
  FaceSums& operator=(const FaceSums&) = delete;

  // Has the card draw the sum of a view whose textures are there. False with the reason in `why`.
  bool begin(const DrawnView& view, const ViewTextures& textures, Programs& programs, Stopwatch& stopwatch,
             std::string& why);
  // Waits for it.
  void read(DrawnSum& out);

 private:
  void upload_owners(const simd::SumTask& task, const Rect& rect);
  void upload_block_owners(const Rect& rect);
  void attach(GLenum where, Texture& texture, GLenum format, int width, int height);
  bool begin(Texture& texture, GLenum format, const Texture& depths, int width, int height);
  bool draw(const SumProgram& what, const std::vector<CoverCorner>& triangles, int width, int height,
            std::string& why);
  bool draw_pixels(std::string& why);
  bool draw_chroma(std::string& why);

  // What is drawn now.
  struct Job {
    DrawnView view;
    const ViewTextures* textures = nullptr;
    Programs* programs = nullptr;
    FaceCover cover;
  } job_;
  const GLenum float_target_;
  GLuint frame_ = 0, corners_ = 0;
  Texture pixels_, lost_, chroma_sums_, chroma_;
  Texture owners_, block_owners_, tables_;  // depths of what is drawn, see sum_shader.h; numbers of faces
  std::vector<uint16_t> owner_memory_, block_memory_;
  std::vector<float> table_memory_;
};

}  // namespace lf::gl
