// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <lightfield/image.h>
#include <lightfield/request.h>
#include <lightfield/rig.h>

namespace lightfield {

struct NodeOptions {
  Resampling resampling = Resampling::kSharpened;  // how cameras' images are sampled
  unsigned threads = 0;  // how many work on an answer at most; 0: as many as there are processors
};

// The cameras of one machine: answers the requests of any number of viewers with the sum of what its cameras contribute
// to their views. Every node knows the whole rig and has images of its own cameras alone.
//
// Thread-safe: calls from several threads wait for each other; each of them works with several threads.
class Node {
 public:
  // `cameras`: indices of the node's cameras, in any order, none twice; the order is that of frames below. Throws Error
  // for one that the rig does not have, and for none at all.
  Node(Rig rig, std::vector<uint32_t> cameras, const NodeOptions& options = {});
  ~Node();
  Node(Node&&) noexcept;
  Node& operator=(Node&&) noexcept;

  const std::vector<uint32_t>& cameras() const;

  // Indices of the node's cameras whose frames are looked at for this request, ascending; frames of others need not be
  // decoded. Throws Error as answer() does.
  std::vector<uint32_t> cameras_for(const Bytes& request) const;

  // The answer: one part or a few, to be carried to the viewer's Compositor, in any order. `frames`: one for each of
  // cameras(), in that order, all of one format and each of its camera's size; empty where there is none, which the
  // answer says. They are only read, and only during the call. The same request and frames give the same bytes. Throws
  // Error for bytes that are no request, for a request that was made for another rig, and for frames that do not fit.
  std::vector<Bytes> answer(const Bytes& request, const std::vector<ImageView>& frames) const;
  std::vector<Bytes> answer(const Bytes& request, const std::vector<Image>& frames) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lightfield
