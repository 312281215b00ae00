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
  // The rig and the cameras as one request sees them. Never changes.
  struct Array {
    std::shared_ptr<const Rig> rig;
    std::shared_ptr<const CameraColours> colours;  // the colours of the rig's cameras
    uint64_t rig_hash = 0;
    double extent = 0;  // see array_extent()
    std::map<CameraIndex, Frames> cameras;
  };

  // Sets the rig; inputs keep the id of their camera. Returns what a user should know: cameras that the rig does not
  // have, or has in another size than their pictures are of (these count as missing); "" where all is well.
  std::string set_rig(std::shared_ptr<const Rig> rig);
  // The rig's camera of this id; null if there is none.
  std::shared_ptr<const Camera> camera(uint32_t id) const;

  // Adds an input. Until it is known which camera it is and what its pixels are, requests of files wait.
  void add(Frames frames);
  // False if another input has this camera already.
  bool set_camera(const Frames& frames, uint32_t id);
  void set_family(const Frames& frames, PixelFamily family);
  // The input's stream has ended: what is not known of it will never be.
  void give_up(const Frames& frames);
  void remove(const Frames& frames);

  std::shared_ptr<const Array> array() const;
  // As array(), once all inputs are known. Doesn't wait while `cancelled` or not running.
  std::shared_ptr<const Array> wait_for_all(const std::atomic<bool>& cancelled);
  void set_running(bool running);
  // Wakes all that wait, for inputs or for a frame, to look again at whether they are cancelled.
  void wake();

  // The pixel family of all answers, chosen for the first one and kNone before: RGB if an input has it then, else I420.
  // As requests of files wait until all inputs are known, it is not a matter of who comes first. Frames of the other
  // family are converted.
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
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool running_ = false;
  std::map<Frames, Input> inputs_;
  std::shared_ptr<const Array> array_ = std::make_shared<Array>();  // made of inputs_ and the rig
};

// "3, 7 and 2 more".
std::string list_of_ids(const std::vector<uint32_t>& ids);

}  // namespace lf
