// SPDX-License-Identifier: LGPL-2.1-or-later
#include <lightfield/compositor.h>

#include "api/convert.h"
#include "api/view_composer.h"
#include "wire/request_codec.h"

namespace lightfield {

struct [[gnu::visibility("hidden")]] Compositor::State {
  State(const Rig& rig, uint32_t view_id) : composer(rig.data().rig, rig.data().hash, view_id) {}
  lf::api::ViewComposer composer;
};

Compositor::Compositor(Rig rig, uint32_t view_id) : state_(std::make_unique<State>(rig, view_id)) {}
Compositor::~Compositor() = default;
Compositor::Compositor(Compositor&&) noexcept = default;
Compositor& Compositor::operator=(Compositor&&) noexcept = default;

Bytes Compositor::request(const View& view, const RequestOptions& options) {
  return lf::wire::encode_request(state_->composer.begin(view, options));
}

Compositor::Added Compositor::add(const Bytes& part) { return state_->composer.add(part); }

bool Compositor::is_complete() const { return state_->composer.is_complete(); }

Image Compositor::finish() { return state_->composer.finish(); }

unsigned Compositor::missing() const { return state_->composer.missing(); }
void Compositor::reset_focus() { state_->composer.reset_focus(); }

}  // namespace lightfield
