// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "cameras/identify_server.h"
#include "cameras/light_watch.h"
#include "cameras/mosaic.h"

namespace lf::cameras {

// The mosaic of cameras that record, on a page of this machine: with the places of each picture that a moved light came
// to, and what the person before the cameras is told. It is served by the thread that makes it, in serve().
class RecordingPage {
 public:
  // `rig` and `watch` outlive this; `watch` is null where no light is moved. Throws Error where the port is taken; 0: any.
  RecordingPage(const Rig& rig, const LightWatch* watch, int port);

  // A frame, in the thread that brings it. Any threads.
  void see(const CameraFrame& frame);
  void say(const std::string& line) { told_ = line; }  // what the page says from now on
  void serve();                                        // answers those who have asked meanwhile
  std::string url() const { return server_.url(); }

 private:
  std::string state() const;

  const Rig& rig_;
  const LightWatch* watch_;
  Mosaic mosaic_;
  std::string told_ = "Cameras are being opened.";
  IdentifyServer server_;
};

}  // namespace lf::cameras
