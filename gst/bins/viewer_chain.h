// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gst/gst.h>

#include "base/text.h"
#include "bins/rtp_link.h"
#include "common/gst_pointers.h"

namespace lf {

// One viewer inside of a bin: its lfviewrequest ("view"), its lfcompositor ("compositor"), and what is between them and
// the cameras:
//
//   view ! requests (tee) ! queue ! [cameras] ! queue ! compositor.sink_N    compositor ! queue ! pictures (tee) !
//   [out]
//          requests       ! queue ! compositor.request
//
// Whoever takes pictures more slowly than they come keeps nobody waiting: live, the oldest are dropped behind the
// compositor. In front of it they would wait as requests, and what comes of one request's trials would reach the view
// several slow pictures later.
//
// The elements are the bin's; the ending of their names tells the viewers of a bin apart ("view_0"). All functions are
// to be called by one thread at a time.
class ViewerChain {
 public:
  // Adds the elements to the bin and links them. Throws Error if GStreamer's own are not there.
  ViewerChain(GstBin* bin, guint view_id, const std::string& ending);
  ~ViewerChain();
  ViewerChain(const ViewerChain&) = delete;
  ViewerChain& operator=(const ViewerChain&) = delete;

  guint view_id() const { return view_id_; }
  GstElement* view() const { return view_; }              // borrowed
  GstElement* compositor() const { return compositor_; }  // borrowed
  // The pad where the pictures leave, with a reference; a picture that nobody takes is dropped.
  GstPad* pictures() const { return gst_element_get_static_pad(pictures_, "src_0"); }
  // The pad where requests leave for the cameras, with a reference.
  GstPad* requests() const { return gst_element_get_static_pad(to_cameras_, "src"); }
  // A new pad where the answers of one more node come in, with a reference. `drops`: the oldest answers are dropped
  // where they come too fast, else they wait. `from`: what users call the node, in warnings of lfcompositor.
  GstPad* add_answers(bool drops, const std::string& from = "");
  // Takes away all pads that add_answers() made. Call while nothing runs.
  void drop_answers();

  // So many requests that leave at once have room on their way, as the chain's own have that are of a set.
  void make_room(guint requests) { make_room_in(to_cameras_, requests), make_room_in(to_compositor_, requests); }
  // Live, late requests and pictures are dropped, so that nobody waits for anybody. Call while nothing runs.
  void set_live(bool live);
  // Takes the elements to the bin's state, those behind first; from then on they follow its state. Before this call
  // nothing runs, whatever the bin does.
  void follow_bin();

  // Takes the elements out of the bin, so that nothing they still say reaches it. They run on until close().
  void take_out();
  // Stops the elements, those behind first, which wakes those before; `leave_cameras` is called where the cameras have
  // their turn. Not to be called by a streaming thread of these elements.
  void close(const std::function<void()>& leave_cameras);

 private:
  static void make_room_in(GstElement* queue, guint requests);
  static void follow_set(GstElement* view, GParamSpec* changed, gpointer queue);
  GstElement* add(const char* factory, const char* name);
  std::vector<GstElement*> behind_cameras() const;
  std::vector<GstElement*> before_cameras() const;
  std::vector<GstElement*> all() const;  // those farthest downstream first

  GstBin* bin_;
  guint view_id_;
  std::string ending_;
  GstElement *view_, *requests_, *to_cameras_, *to_compositor_, *compositor_, *to_src_, *pictures_;  // with references
  std::vector<GstElement*> answers_;                                                                 // with references
  bool follows_ = false;  // the elements follow the bin's state
};

// View requests of viewers on other hosts, which come in at one port by RTP: each viewer of a bin then relays those of
// its view, and makes none of its own. The elements are the bin's; they go with this, when all viewers have given their
// pads back. To be used by one thread at a time.
class ViewerRequests {
 public:
  // Throws Error if GStreamer's elements for that are not there.
  ViewerRequests(GstBin* bin, const HostPort& from, const Admission& admission);

  // Links the viewer, whose pads these are. Throws Error.
  std::unique_ptr<RequestedPads> connect(ViewerChain& viewer);

 private:
  AddedElements elements_;
  GstElement* split_;
};

// The cameras that the viewers of a bin share: where their requests go and their answers come from. The elements are
// the bin's; they go with this, when all viewers have given their pads back. To be used by one thread at a time.
class ViewerCameras {
 public:
  virtual ~ViewerCameras() = default;
  // Links the viewer, whose pads these are. Throws Error.
  virtual std::unique_ptr<RequestedPads> connect(ViewerChain& viewer) = 0;
};

// The cameras of a rig that are on this machine: one lfcameranode, "node".
std::unique_ptr<ViewerCameras> cameras_here(GstBin* bin);
// Cameras on hosts that are reached by RTP, as CameraHosts has them. Throws Error.
std::unique_ptr<ViewerCameras> cameras_on_hosts(GstBin* bin, const std::vector<NodeAddress>& nodes,
                                                const std::string& key_file);

}  // namespace lf
