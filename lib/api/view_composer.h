// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <span>

#include <lightfield/compositor.h>

#include "composite/assembly.h"
#include "focus/focus_array.h"
#include "focus/view_focus.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf::api {

// One viewer: its requests, one at a time, and the pictures that come of the answers. Not thread-safe.
class ViewComposer {
 public:
  using Added = lightfield::Compositor::Added;

  ViewComposer(std::shared_ptr<const Rig> rig, uint64_t rig_hash, uint32_t view_id);

  // Begins the next picture and returns the request that nodes are to answer. Throws Error for a view or an option that
  // is none.
  const ViewRequest& begin(const lightfield::View& view, const lightfield::RequestOptions& options);
  // Adds a unit of an answer. `owner`: what keeps the bytes where they are; with it they may be used there until
  // finish().
  Added add(std::span<const uint8_t> unit, std::shared_ptr<const void> owner = nullptr);
  bool is_complete() const;
  // Throws Error without a picture that was begun.
  lightfield::Image finish();

  unsigned missing() const { return missing_; }
  void reset_focus();

 private:
  std::string add_moments(std::span<const uint8_t> unit);
  std::string add_answer(std::span<const uint8_t> unit, std::shared_ptr<const void> owner);

  const std::shared_ptr<const Rig> rig_;
  const uint64_t rig_hash_;
  const uint32_t view_id_;
  uint32_t sequence_ = 0;
  std::optional<ViewRequest> current_;
  Background background_;
  Assembly assembly_;
  // Nodes whose answers are there, by their cameras; and units of moments that are, by a hash of their bytes.
  std::set<CameraRanges> answered_;
  std::set<size_t> tried_;
  ViewFocus::Answers answers_;
  ViewFocus focus_;
  std::optional<FocusArray> array_;  // made when a surface is first looked for
  unsigned missing_ = 0;
};

}  // namespace lf::api
