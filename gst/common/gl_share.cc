// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/gl_share.h"

#include <mutex>
#include <utility>
#include <vector>

#include <gst/gl/gl.h>

namespace lf {
namespace {

class Groups {
 public:
  gl::ShareGroup of(GstGLContext* context) {
    const std::lock_guard lock(mutex_);
    gl::ShareGroup found = 0;
    bool is_known = false;
    std::erase_if(members_, [&](const Member& member) {
      const GlContextPtr other = member.context.get();
      if (!other) return true;
      is_known = is_known || other.get() == context;
      if (found == 0 && gst_gl_context_can_share(context, other.get())) found = member.group;
      return false;
    });
    if (is_known) return found;
    members_.push_back({WeakGlContext(context), found != 0 ? found : ++latest_});
    return members_.back().group;
  }

 private:
  struct Member {
    WeakGlContext context;
    gl::ShareGroup group;
  };

  std::mutex mutex_;
  std::vector<Member> members_;
  gl::ShareGroup latest_ = 0;
};

}  // namespace

gl::ShareGroup share_group(GstGLContext* context) {
  static Groups groups;
  return groups.of(context);
}

gl::Context::External share(GstGLContext* context, std::string& why) {
  why = "no context available";
  const GlContextPtr own_context{ObjectPtr<GstGLContext>(gst_gl_context_new(context->display))};
  GError* error = nullptr;
  if (!own_context || !gst_gl_context_create(own_context.get(), context, &error)) {
    if (error) why = error->message;
    g_clear_error(&error);
    return {};
  }
  using Job = std::function<void()>;
  // The group id is taken first, because `context` may be destroyed before the new context.
  share_group(context);
  const gl::ShareGroup group = share_group(own_context.get());
  why.clear();
  return {[own_context](const Job& job) {
            gst_gl_context_thread_add(
                own_context.get(), [](GstGLContext*, gpointer data) { (*static_cast<const Job*>(data))(); },
                const_cast<Job*>(&job));
            return true;
          },
          group};
}

static bool is_plane(GstMemory* memory, const GstVideoInfo& info, guint plane) {
  if (!gst_is_gl_memory(memory)) return false;
  auto* const texture = reinterpret_cast<GstGLMemory*>(memory);
  gint components[GST_VIDEO_MAX_COMPONENTS];
  gst_video_format_info_component(info.finfo, plane, components);
  const gint bytes = GST_VIDEO_INFO_COMP_PSTRIDE(&info, components[0]);
  GstGLFormat formats[2] = {};
  switch (bytes) {
    case 1: formats[0] = GST_GL_RED, formats[1] = GST_GL_R8; break;
    case 2: formats[0] = GST_GL_RG, formats[1] = GST_GL_RG8; break;
    case 3: formats[0] = GST_GL_RGB, formats[1] = GST_GL_RGB8; break;
    default: formats[0] = GST_GL_RGBA, formats[1] = GST_GL_RGBA8; break;
  }
  // Refuses three-byte textures, because OpenGL ES cannot read them back, so they could not be mapped.
  if (bytes == 3 && gst_gl_context_get_gl_api(texture->mem.context) == GST_GL_API_GLES2) return false;
  const GstGLFormat format = gst_gl_memory_get_texture_format(texture);
  return gst_gl_memory_get_texture_target(texture) == GST_GL_TEXTURE_TARGET_2D &&
         (format == formats[0] || format == formats[1]) &&
         gst_gl_memory_get_texture_width(texture) >= GST_VIDEO_INFO_COMP_WIDTH(&info, components[0]) &&
         gst_gl_memory_get_texture_height(texture) >= GST_VIDEO_INFO_COMP_HEIGHT(&info, components[0]);
}

bool has_planes_on_gpu(GstBuffer* picture, const GstVideoInfo& info) {
  const guint planes = GST_VIDEO_INFO_N_PLANES(&info);
  if (gst_buffer_n_memory(picture) != planes) return false;
  for (guint i = 0; i < planes; i++)
    if (!is_plane(gst_buffer_peek_memory(picture, i), info, i)) return false;
  return true;
}

gl::ShareGroup group_of_planes(GstBuffer* picture) {
  return share_group(reinterpret_cast<GstGLMemory*>(gst_buffer_peek_memory(picture, 0))->mem.context);
}

}  // namespace lf
