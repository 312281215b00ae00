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

// An encoded message: a request, or one part of an answer. Any transport can carry these messages if it delivers each
// message whole. The GStreamer elements use the same format (lib/wire/spec.md).
using Bytes = std::vector<uint8_t>;

// The capture time of a request for the newest frames.
constexpr uint64_t kNewest = std::numeric_limits<uint64_t>::max();

struct RequestInfo {
  uint32_t view_id = 0;
  uint32_t sequence = 0;    // increases by one with each request of the viewer; wraps around
  uint64_t time = kNewest;  // capture time of the requested frames, nanoseconds, or kNewest
};

// Reads the header of a request, for example to find the frames of the requested time. The bytes may be untrusted.
// Throws Error unless they are exactly one request.
RequestInfo read_request(const Bytes& request);

struct NodeOptions {
  Resampling resampling = Resampling::kSharpened;
  unsigned threads = 0;  // maximum number of threads per answer; 0: number of processors
  uint64_t reserved[4] = {};  // space for the options of later versions; must be 0
};

// Serves the cameras of one machine. A node answers the requests of any number of viewers: it warps its cameras' images
// into the requested view and returns their weighted sum, which is much smaller than the images. Every node knows the
// whole rig, but needs images of its cameras alone.
//
// Thread-safe. Concurrent calls are serialised, and each call uses several threads.
class Node {
 public:
  // Creates a node that serves the cameras with the indices `cameras`, without duplicates. The frames for answer() must
  // follow the same order. Throws Error if the list is empty or an index is not in the rig.
  Node(Rig rig, std::vector<uint32_t> cameras, const NodeOptions& options = {});
  ~Node();
  Node(Node&&) noexcept;
  Node& operator=(Node&&) noexcept;

  const std::vector<uint32_t>& cameras() const;

  // Returns the indices of the node's cameras that contribute to this request, in ascending order. Frames of other
  // cameras need not be decoded. Throws Error like answer().
  std::vector<uint32_t> cameras_for(const Bytes& request) const;

  // Answers a request with a list of messages, which must all be sent to the viewer's Compositor, in any order.
  //
  // `frames` has one frame for each of cameras(), in the same order. All frames must have the same format, and each
  // must have the size of its camera. Pass an empty frame for a camera that has no image; the answer then marks this
  // camera as missing.
  //
  // The frames are only read during the call. The same request and frames always give the same bytes. Throws Error if
  // the request is invalid or belongs to another rig, or if a frame does not fit.
  std::vector<Bytes> answer(const Bytes& request, const std::vector<ImageView>& frames) const;
  std::vector<Bytes> answer(const Bytes& request, const std::vector<Image>& frames) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

struct RequestOptions {
  Focus focus = Focus::kPlane;
  // Range of the surface distances from the array that Focus::kAuto searches, in metres. If either value is 0, the
  // range adapts to the scene.
  double nearest = 0, farthest = 0;
  // True if Focus::kAuto also measures and corrects brightness differences between the cameras. Without a value,
  // brightness is matched if the rig has no colour calibration.
  std::optional<bool> match_brightness = {};
  // Encoding of the pixels in the answers. 1 to 100 is a JPEG quality. 0 sends 16 bits per value, which is large, but
  // the picture is then bit-identical to the picture of a Renderer with all cameras.
  int quality = 90;
  // Capture time of the frames, in nanoseconds of a clock that all nodes share, or kNewest.
  uint64_t time = kNewest;
  // Indices of cameras that have no images, in any order. Their neighbours fill the gaps.
  std::vector<uint32_t> out_of_service = {};
  Colour background = {};  // colour of pixels that no camera sees
  uint64_t reserved[4] = {};  // space for the options of later versions; must be 0
};

// Shows the cameras of remote nodes to one viewer: makes the requests, and combines the nodes' answers into pictures.
//
//   Compositor compositor(rig, 1);
//   Bytes request = compositor.request(view, options);     // to every node
//   for (const Bytes& part : received_parts) compositor.add(part);
//   Image picture = compositor.finish();                   // after all answers, or after a timeout
//
// A compositor keeps its focal surface (the estimated depth of each pixel) from picture to picture. It may be moved.
// Call its methods from one thread at a time.
class Compositor {
 public:
  // Creates a compositor for one viewer. `view_id` must be unique among the viewers of the same nodes, because nodes
  // keep a separate state for each id.
  Compositor(Rig rig, uint32_t view_id);
  ~Compositor();
  Compositor(Compositor&&) noexcept;
  Compositor& operator=(Compositor&&) noexcept;

  // Begins the next picture and returns its request, which must be sent to every node. An unfinished picture is
  // discarded. Throws Error if the view is invalid or an option is out of range.
  Bytes request(const View& view, const RequestOptions& options = {});

  // The result of add(). If a part was not added, `problem` explains the reason to the user: for example, the part is
  // damaged, a duplicate, or late.
  struct AddResult {
    bool added = false;
    std::string problem = {};
    explicit operator bool() const { return added; }
  };
  // Adds a received part of an answer to the current picture. The part may come from an untrusted source, because every
  // field is checked. The bytes are not used after the call.
  AddResult add(const Bytes& part);

  // Returns whether the nodes of all cameras in service have answered, so that finish() need not wait any longer.
  bool is_complete() const;

  // Returns the picture from all parts added so far, in the format of the answers (RGB if no camera had an image). If
  // some cameras did not answer, the remaining cameras of each pixel take over their weight, so that the picture has no
  // holes. Throws Error if request() has not been called.
  Image finish();
  // Writes the picture to the memory of `out`, which must have the size of the view and the format of the answers (any
  // format if no camera had an image). If `out` does not fit, throws Error and keeps the parts for another call.
  void finish_into(const MutableImageView& out);

  // Number of cameras that the latest picture needed but did not get.
  unsigned missing() const;

  // Discards the focal surface (the estimated depth of each pixel), for example after the scene has changed. Changing
  // the focus options has the same effect.
  void reset_focus();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lightfield
