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

// One viewer inside a bin: its lfviewrequest ("view"), its lfcompositor ("compositor") and the queues around the
// cameras:
//
//   view ! requests (tee) ! queue ! [cameras] ! queue ! compositor.sink_N    compositor ! queue ! pictures (tee) !
//   [out]
//          requests       ! queue ! compositor.request
//
// In live mode a slow consumer does not block the chain, because the queue behind the compositor drops the oldest
// pictures. Requests are dropped early too, because a backlog of requests would delay the feedback to the view by
// several pictures.
//
// The bin owns the elements. `ending` is the suffix of their names, for example "view_0", and must be unique for each
// viewer of the bin. Not thread-safe.
class ViewerChain {
 public:
  ViewerChain(GstBin* bin, guint view_id, const std::string& ending);
  ~ViewerChain();
  ViewerChain(const ViewerChain&) = delete;
  ViewerChain& operator=(const ViewerChain&) = delete;

  guint view_id() const { return view_id_; }
  GstElement* view() const { return view_; }              // borrowed
  GstElement* compositor() const { return compositor_; }  // borrowed
  // Returns the pad that delivers the pictures of this viewer. Pictures are dropped while the pad is not linked.
  PadPtr pictures() const { return PadPtr(gst_element_get_static_pad(pictures_, "src_0")); }
  // Adds an output of the compositor, one of its request pads for depths, with a queue of its own. Returns the source
  // pad of the queue. remove_output() removes the output of such a pad; do not call it from a streaming thread of the
  // queue.
  PadPtr add_output(const std::string& compositor_pad);
  void remove_output(GstPad* pad);
  // Returns the pad that sends this viewer's requests to the cameras.
  PadPtr requests() const { return PadPtr(gst_element_get_static_pad(to_cameras_, "src")); }
  // Adds an input for the answers of one more camera node, and returns its sink pad. If `drops` is set, a full queue
  // drops its oldest answers instead of blocking. `from` is the name of the node in warnings of lfcompositor.
  PadPtr add_answers(bool drops, const std::string& from = "");
  // Removes all inputs of add_answers(). Call while nothing runs.
  void drop_answers();

  // Enlarges the request queues, so that they can hold this many requests. Call this if requests arrive in bursts,
  // because small queues would drop requests. For sets of views, such as stereo pairs, the class enlarges the queues
  // without this call.
  void make_room(guint requests) { make_room_in(to_cameras_, requests), make_room_in(to_compositor_, requests); }
  // Selects live operation. If live, late requests and pictures are dropped, so that nothing blocks. Call this only
  // while no data flows.
  void set_live(bool live);
  // Starts the elements, downstream first. Their state is locked until this call and follows the bin from then on.
  void follow_bin();

  // First step of the shutdown: removes the elements from the bin, so that the bin does not receive their messages any
  // more. The elements keep running until close().
  void take_out();
  // Second step of the shutdown: stops the elements, from downstream to upstream, because a stopped element no longer
  // blocks upstream elements. `leave_cameras` is called after the compositor and before the view has been stopped, and
  // must disconnect the cameras. Do not call this from a streaming thread of these elements.
  void close(const std::function<void()>& leave_cameras);

 private:
  static void make_room_in(GstElement* queue, guint requests);
  static void set_queue_of_pictures(GstElement* queue, bool live);
  static void follow_set(GstElement* view, GParamSpec* changed, gpointer queue);
  GstElement* add(const char* factory, const char* name);
  std::vector<GstElement*> behind_cameras() const;
  std::vector<GstElement*> before_cameras() const;
  std::vector<GstElement*> all() const;

  GstBin* bin_;
  guint view_id_;
  std::string ending_;
  GstElement *view_, *requests_, *to_cameras_, *to_compositor_, *compositor_, *to_src_, *pictures_;
  std::vector<GstElement*> answers_;
  std::vector<GstElement*> outputs_;  // queues of add_output()
  bool live_ = true;
  bool follows_ = false;
};

// Receives the view requests of remote viewers by RTP at one port, for a bin that renders the pictures. Each viewer
// chain of the bin then relays the requests with its view id instead of generating requests. Destroy all results of
// connect() before this object. Not thread-safe.
class ViewerRequests {
 public:
  ViewerRequests(GstBin* bin, const HostPort& from, const RtpSecurity& security);

  std::unique_ptr<RequestedPads> connect(ViewerChain& viewer);

 private:
  ScopedElements elements_;
  GstElement* split_;
};

// The cameras that all viewers of a bin share, on this machine or on other hosts. connect() links the cameras with one
// viewer, until its result is destroyed. Destroy all results of connect() before this object. Not thread-safe.
class ViewerCameras {
 public:
  virtual ~ViewerCameras() = default;
  virtual std::unique_ptr<RequestedPads> connect(ViewerChain& viewer) = 0;
};

// Create the connection to cameras in this process (an lfcameranode in the bin), or on other hosts by RTP. `key_file`
// is the file with the shared secret, or "". Throw Error if an element is not installed or a host name cannot be
// resolved.
std::unique_ptr<ViewerCameras> make_local_cameras(GstBin* bin);
std::unique_ptr<ViewerCameras> make_remote_cameras(GstBin* bin, const std::vector<NodeAddress>& nodes,
                                                   const std::string& key_file);

}  // namespace lf
