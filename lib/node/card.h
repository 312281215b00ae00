// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <mutex>
#include <string>

#include "render/gl/sum_drawer.h"

namespace lf {

// What renders the sums of a node.
enum class RendererChoice { kCpu, kGl };

// The graphics card of a node that is to use one: opened when there is something to draw, as that takes tens to
// hundreds of milliseconds; and left alone for good once it can't be opened or is lost. Thread-safe.
class Card {
 public:
  // The card's renderer; null if the CPU has to draw. `news` tells the user once why there is no card (any more).
  gl::SumDrawer* open(std::string& news);
  // The name of what draws, or "": nothing does (yet).
  std::string device() const;

 private:
  mutable std::mutex mutex_;
  std::unique_ptr<gl::SumDrawer> drawer_;
  bool tried_ = false, told_ = false;
};

}  // namespace lf
