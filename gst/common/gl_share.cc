// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/gl_share.h"

#include <list>
#include <mutex>
#include <utility>

#include <gst/gl/gl.h>

namespace lf {
namespace {

// Takes the reference, of which there may be none.
GlContextPtr owned(gpointer context) {
  return {static_cast<GstGLContext*>(context), [](GstGLContext* of) {
            if (of) gst_object_unref(of);
          }};
}

// All contexts that were asked about and are still there: GStreamer tells of two whether they share, and no more.
class Groups {
 public:
  gl::ShareGroup of(GstGLContext* context) {
    const std::lock_guard lock(mutex_);
    gl::ShareGroup found = 0;
    bool is_known = false;
    for (auto member = members_.begin(); member != members_.end();) {
      const GlContextPtr other = owned(g_weak_ref_get(&member->context));
      if (!other) {
        member = members_.erase(member);
        continue;
      }
      is_known = is_known || other.get() == context;
      if (found == 0 && gst_gl_context_can_share(context, other.get())) found = member->group;
      ++member;
    }
    if (is_known) return found;
    members_.emplace_back(context, found != 0 ? found : ++latest_);
    return members_.back().group;
  }

 private:
  struct Member {
    Member(GstGLContext* of, gl::ShareGroup group) : group(group) { g_weak_ref_init(&context, of); }
    ~Member() { g_weak_ref_clear(&context); }
    Member(const Member&) = delete;
    Member& operator=(const Member&) = delete;
    GWeakRef context;
    const gl::ShareGroup group;
  };

  std::mutex mutex_;
  std::list<Member> members_;
  gl::ShareGroup latest_ = 0;
};

}  // namespace

WeakGlContext::WeakGlContext(GstGLContext* context)
    : ref_(new GWeakRef, [](GWeakRef* ref) {
        g_weak_ref_clear(ref);
        delete ref;
      }) {
  g_weak_ref_init(ref_.get(), context);
}

GlContextPtr WeakGlContext::get() const { return ref_ ? owned(g_weak_ref_get(ref_.get())) : nullptr; }

gl::ShareGroup share_group(GstGLContext* context) {
  static Groups groups;
  return groups.of(context);
}

gl::Context::Foreign share(GstGLContext* context, std::string& why) {
  why = "no context can be had";
  const GlContextPtr ours = owned(gst_gl_context_new(context->display));
  GError* error = nullptr;
  if (!ours || !gst_gl_context_create(ours.get(), context, &error)) {
    if (error) why = error->message;
    g_clear_error(&error);
    return {};
  }
  using Job = std::function<void()>;
  // The number is that of the other one, which may go first.
  share_group(context);
  const gl::ShareGroup group = share_group(ours.get());
  why.clear();
  return {[ours](const Job& job) {
            gst_gl_context_thread_add(
                ours.get(), [](GstGLContext*, gpointer data) { (*static_cast<const Job*>(data))(); },
                const_cast<Job*>(&job));
            return true;
          },
          group};
}

}  // namespace lf
