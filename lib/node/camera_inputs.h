// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "node/camera_frames.h"
#include "rig/camera_colours.h"
#include "rig/rig.h"

namespace lf {

// The rig of a node and which of its cameras the node has. Thread-safe: cameras come and go, and the rig is replaced,
// while requests are answered.
class CameraInputs {
 public:
  using Frames = std::shared_ptr<CameraFrames>;
  // As one request sees them.
  struct Array {
    std::shared_ptr<const Rig> rig;
    std::shared_ptr<const CameraColours> colours;  // of its cameras
    uint64_t rig_hash = 0;
    double extent = 0;  // see array_extent()
    std::map<CameraIndex, Frames> cameras;
  };

  // Inputs keep the id of their camera. The rest is for the user: which of them the rig does not have, or in another
  // size than their pictures have (these count as missing); "" where all is well.
  std::string set_rig(std::shared_ptr<const Rig> rig);
  // The rig's camera of this id, null without.
  std::shared_ptr<const Camera> camera(uint32_t id) const;

  // Until it is known of an input which camera it is and what its pixels are, requests of files wait.
  void add(Frames frames);
  // False if another input has this camera already.
  bool set_camera(const Frames& frames, uint32_t id);
  void set_family(const Frames& frames, PixelFamily family);
  // Its stream ended: what is not known will never be.
  void give_up(const Frames& frames);
  void remove(const Frames& frames);

  std::shared_ptr<const Array> array() const;
  // The same once all inputs are known. Doesn't wait while `cancelled` or not running.
  std::shared_ptr<const Array> wait_for_all(const std::atomic<bool>& cancelled);
  void set_running(bool running);
  // Whoever waits, here or for a frame, looks again at whether that is cancelled.
  void wake();

  // Of all answers; chosen for the first one, kNone before: RGB if an input has it then, else I420. As requests of
  // files wait until all inputs are known, it is not a matter of who comes first. Frames of the other family are
  // converted.
  PixelFamily family() const { return family_; }
  PixelFamily choose_family();
  void forget_family() { family_ = PixelFamily::kNone; }

 private:
  struct Input {
    std::optional<uint32_t> id;
    PixelFamily family = PixelFamily::kNone;
    bool given_up = false;
    bool is_known() const { return given_up || (id && family != PixelFamily::kNone); }
  };
  void rearrange();  // locked

  std::atomic<PixelFamily> family_ = PixelFamily::kNone;
  mutable std::mutex mutex_;  // of what follows
  std::condition_variable changed_;
  bool running_ = false;
  std::map<Frames, Input> inputs_;
  std::shared_ptr<const Array> array_ = std::make_shared<Array>();  // made of inputs_ and the rig
};

// "3, 7 and 2 more".
std::string list_of_ids(const std::vector<uint32_t>& ids);

}  // namespace lf
