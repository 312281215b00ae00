// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <lightfield/error.h>
#include <lightfield/image.h>
#include <lightfield/rig.h>

namespace lightfield {

// A request or a part of an answer: a string of bytes that any transport may carry, whole. The format is that of
// lib/wire/spec.md, which the GStreamer elements speak, too.
using Bytes = std::vector<uint8_t>;

// A time that no frame has: the newest frames are meant.
constexpr uint64_t kNewest = std::numeric_limits<uint64_t>::max();

// The fields of a request that a transport or a frame buffer needs.
struct RequestInfo {
  uint32_t view_id = 0;     // the number of the viewer whose request this is
  uint32_t sequence = 0;    // grows by one with each request of this viewer, and wraps
  uint64_t time = kNewest;  // when the frames that are asked for were captured, nanoseconds
};

// Throws Error if the bytes are not exactly one request. They may come from anywhere.
RequestInfo read_request(const Bytes& request);

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

// How a picture is asked for, beside its view.
struct RequestOptions {
  Focus focus = Focus::kPlane;
  // With kAuto: where surfaces may be, metres from the array. Where either is 0 the range follows what is found in the
  // scene.
  double nearest = 0, farthest = 0;
  // With kAuto: whether cameras that are brighter or darker than the others are made as bright, by what they see of the
  // surface. Without a value: only where the rig says nothing of its cameras' colours.
  std::optional<bool> match_brightness = {};
  // How answers' pixels travel: 1 to 100: JPEG of this quality; 0: 16 bits a value, by which the picture is, to the
  // bit, that of a Renderer with all cameras, and large.
  int quality = 90;
  // When the frames that are asked for were captured, nanoseconds of a clock that all nodes share; kNewest: whichever
  // are newest.
  uint64_t time = kNewest;
  // Indices of cameras that are known to have no picture, in any order: their neighbours close the gap.
  std::vector<uint32_t> out_of_service = {};
  Colour background = {};  // is shown where no camera sees anything
};

// One viewer of nodes elsewhere: makes requests, and pictures from the answers.
//
//   Compositor compositor(rig, 1);
//   Bytes request = compositor.request(view, options);     // to every node
//   for (const Bytes& part : what_came) compositor.add(part);
//   Image picture = compositor.finish();                   // when all have answered, or time is up
//
// It keeps the focal surface that it has found from picture to picture. Compositors may be moved; one call at a time
// for each.
class Compositor {
 public:
  // `view_id`: different for each viewer of the same nodes.
  Compositor(Rig rig, uint32_t view_id);
  ~Compositor();
  Compositor(Compositor&&) noexcept;
  Compositor& operator=(Compositor&&) noexcept;

  // Begins the next picture. The request in bytes; it holds all that nodes have to know. A picture that was begun and
  // not finished is given up. Throws Error for a view that is none, and for options out of range.
  Bytes request(const View& view, const RequestOptions& options = {});

  // Whether a part could be used, and if not, why: it may come from anywhere, damaged, twice or too late.
  struct Added {
    bool added = false;
    std::string why_not = {};
    explicit operator bool() const { return added; }
  };
  // Adds a part of an answer to the picture that was begun. The bytes may go when the call is over.
  Added add(const Bytes& part);

  // Whether the nodes of all cameras in service have answered.
  bool is_complete() const;

  // The picture of what has been added, of the answers' format (RGB where no camera had a picture). What never came
  // leaves its weight to the other cameras of a pixel. Throws Error if no picture was begun.
  Image finish();

  // Cameras that the latest picture had to do without, though it needed them.
  unsigned missing() const;

  // Forgets the focal surface, as when the scene has become another one. Other options of focus forget it, too.
  void reset_focus();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lightfield
