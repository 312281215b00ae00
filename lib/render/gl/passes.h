// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "render/gl/image_atlas.h"
#include "render/gl/pass_numbers.h"

namespace lf::gl {

// What a pass needs before it has the context.
struct Pass {
  ImageAtlas atlas;
  PassNumbers numbers;
};

// The memory of as many passes as are being made at once.
class Passes {
 public:
  // One that nobody else has, for as long as this lives. Without a context.
  class Lease {
   public:
    explicit Lease(Passes& from) : from_(from), pass_(from.take()) {}
    ~Lease() { from_.give_back(std::move(pass_)); }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    Pass* operator->() const { return pass_.get(); }

   private:
    Passes& from_;
    std::unique_ptr<Pass> pass_;
  };

 private:
  std::unique_ptr<Pass> take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return std::make_unique<Pass>();
    auto pass = std::move(free_.back());
    free_.pop_back();
    return pass;
  }
  void give_back(std::unique_ptr<Pass> pass) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(pass));
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<Pass>> free_;
};

}  // namespace lf::gl
