// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/card.h"

namespace lf {

gl::SumDrawer* Card::open(std::string& news) {
  const std::lock_guard lock(mutex_);
  if (!tried_) {
    tried_ = true;
    std::string why;
    drawer_ = gl::SumDrawer::create(gl::Context::Drivers::kAny, why);
    if (!drawer_) news = "no OpenGL ES 3.1 to render with, the CPU does: " + why;
  }
  if (!drawer_) return nullptr;
  if (!drawer_->is_lost()) return drawer_.get();
  if (!told_) news = drawer_->device() + " is lost to this process, the CPU renders from now on";
  told_ = true;
  return nullptr;
}

std::string Card::device() const {
  const std::lock_guard lock(mutex_);
  return drawer_ && !drawer_->is_lost() ? drawer_->device() : "";
}

}  // namespace lf
