// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <lightfield/image.h>
#include <lightfield/request.h>
#include <lightfield/view.h>

namespace lightfield {

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
