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

// A request or one part of an answer, for any transport that delivers messages whole. The format is lib/wire/spec.md,
// as used by the GStreamer elements.
using Bytes = std::vector<uint8_t>;

// Capture time of a request for the newest frames.
constexpr uint64_t kNewest = std::numeric_limits<uint64_t>::max();

struct RequestInfo {
  uint32_t view_id = 0;
  uint32_t sequence = 0;    // increases by one with each request of the viewer; wraps around
  uint64_t time = kNewest;  // capture time of the frames, nanoseconds; kNewest: newest frames
};

// Throws Error unless the bytes are exactly one request. The bytes may be untrusted.
RequestInfo read_request(const Bytes& request);

struct NodeOptions {
  Resampling resampling = Resampling::kSharpened;
  unsigned threads = 0;  // maximum threads per answer; 0: number of processors
};

// The cameras of one machine. Answers the requests of any number of viewers with the weighted sum of its cameras'
// pixels. Every node knows the whole rig but only has the images of its cameras.
//
// Thread-safe: concurrent calls are serialised, and each call uses several threads.
class Node {
 public:
  // `cameras`: indices of the node's cameras, without duplicates, in the order of the frames below. Throws Error if the
  // list is empty or an index is not in the rig.
  Node(Rig rig, std::vector<uint32_t> cameras, const NodeOptions& options = {});
  ~Node();
  Node(Node&&) noexcept;
  Node& operator=(Node&&) noexcept;

  const std::vector<uint32_t>& cameras() const;

  // Returns the indices of the node's cameras that this request needs, ascending. Other cameras need no decoded frame.
  // Throws Error like answer().
  std::vector<uint32_t> cameras_for(const Bytes& request) const;

  // Returns the parts of an answer. Send them to the viewer's Compositor in any order.
  //
  // `frames`: one for each of cameras(), in that order, all of the same format and each of its camera's size. An empty
  // frame means that the camera has no image, and the answer reports that. Frames are only read, and only during the
  // call. The same request and frames give the same bytes. Throws Error if the request is invalid or was made for
  // another rig, or if a frame does not fit.
  std::vector<Bytes> answer(const Bytes& request, const std::vector<ImageView>& frames) const;
  std::vector<Bytes> answer(const Bytes& request, const std::vector<Image>& frames) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

struct RequestOptions {
  Focus focus = Focus::kPlane;
  // kAuto: range of surface distances from the array, in metres. If either value is 0, the range follows the scene.
  double nearest = 0, farthest = 0;
  // kAuto: true to correct brightness differences between the cameras, measured on the surface. Without a value: true
  // if the rig has no colour calibration.
  std::optional<bool> match_brightness = {};
  // Encoding of the pixels. 1 to 100: JPEG of this quality. 0: 16 bits per value, which is large; the picture is then
  // bit-identical to the picture of a Renderer with all cameras.
  int quality = 90;
  // Capture time of the frames, in nanoseconds of a clock that all nodes share; kNewest: newest frames.
  uint64_t time = kNewest;
  // Indices of cameras without images, in any order. Neighbouring cameras fill the gaps.
  std::vector<uint32_t> out_of_service = {};
  Colour background = {};  // colour of pixels that no camera sees
};

// Makes the requests of one viewer and combines the answers of remote nodes into pictures.
//
//   Compositor compositor(rig, 1);
//   Bytes request = compositor.request(view, options);     // to every node
//   for (const Bytes& part : received_parts) compositor.add(part);
//   Image picture = compositor.finish();                   // after all answers, or after a timeout
//
// Keeps its focal surface from picture to picture. Movable. One call at a time for each compositor.
class Compositor {
 public:
  // `view_id`: unique among the viewers of the same nodes.
  Compositor(Rig rig, uint32_t view_id);
  ~Compositor();
  Compositor(Compositor&&) noexcept;
  Compositor& operator=(Compositor&&) noexcept;

  // Begins the next picture and returns its request, which has everything that nodes need to know. Discards an
  // unfinished picture. Throws Error if the view is invalid or an option is out of range.
  Bytes request(const View& view, const RequestOptions& options = {});

  // Parts may come from an untrusted source, and may be damaged, duplicate or late.
  struct AddResult {
    bool added = false;
    std::string problem = {};
    explicit operator bool() const { return added; }
  };
  // Adds a part of an answer to the current picture. The bytes are not used after the call.
  AddResult add(const Bytes& part);

  // True if the nodes of all cameras in service have answered.
  bool is_complete() const;

  // Returns the picture from all parts added so far, in the format of the answers (RGB if no camera had an image). The
  // remaining cameras of a pixel take over the weight of missing cameras. Throws Error if no picture was begun.
  Image finish();

  // Number of cameras that the latest picture needed but did not get.
  unsigned missing() const;

  // Discards the focal surface, for example after a scene change. A change of the focus options does the same.
  void reset_focus();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lightfield
