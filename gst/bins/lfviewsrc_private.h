// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "bins/viewer_cameras.h"
#include "bins/viewer_requests.h"
#include "common/properties.h"
#include "node/card.h"

#define LF_TYPE_VIEW_SRC (lf_view_src_get_type())
G_DECLARE_FINAL_TYPE(LfViewSrc, lf_view_src, LF, VIEW_SRC, GstBin)

// What the files of lfviewsrc share: lfviewsrc.cc (the element), view_src_properties.cc (properties, URIs, actions) and
// view_src_viewers.cc (viewers that come and go, and their pads).

struct LfViewSrcViewer {
  LfViewSrcViewer(GstBin* bin, guint view_id, const std::string& ending) : chain(bin, view_id, ending) {}
  lf::ViewerChain chain;
  std::unique_ptr<lf::RequestedPads> pads;      // link the viewer with the cameras
  std::unique_ptr<lf::RequestedPads> requests;  // link the viewer with hosts that ask for its view
};

// Other hosts, as properties name them.
struct LfViewSrcHosts {
  std::string nodes, listen, key_file, peers;
  bool operator==(const LfViewSrcHosts&) const = default;
  bool any() const { return !nodes.empty() || !listen.empty(); }
};

// The properties of lfviewsrc, but for those of the elements inside.
struct LfViewSrcSettings : LfViewSrcHosts {
  std::string rig;
  bool is_live = true;
  std::string record;
  bool trusted = false;
  lf::RendererChoice renderer = lf::RendererChoice::kCpu;

  static lf::PropertyTable<LfViewSrcSettings>& properties();
};

struct _LfViewSrc {
  GstBin parent;
  // Under the object lock.
  LfViewSrcSettings* settings;
  bool by_uri;  // the rig was named by a URI, which may come from anywhere

  gint failed;  // atomic; 1: something inside has posted an error since the last change of state began

  GstElement *view, *compositor;  // the viewer of the pad `src`; null where the elements are not installed
  // What is inside, under its own lock, which is taken before any other: bins tell applications of children.
  struct Inside {
    std::recursive_mutex mutex;
    std::map<std::string, std::shared_ptr<LfViewSrcViewer>> viewers;  // by the name of the viewer's pad
    std::set<guint> view_ids;                                         // numbers that some viewer has or had
    std::unique_ptr<lf::ViewerCameras> cameras;
    std::unique_ptr<lf::ViewerRequests> requests;  // null where viewers make their own
    LfViewSrcHosts hosts;                          // the hosts that `cameras` and `requests` were made for
    GstClock* realtime = nullptr;                  // made when it is asked for
  } * inside;
};

// view_src_properties.cc
void lf_view_src_install_properties(GObjectClass* klass);
void lf_view_src_install_actions(GObjectClass* klass);
void lf_view_src_uri_handler_init(gpointer iface, gpointer data);
// The path of the rig that the element is set to; "" where there is none. Takes the object lock.
std::string lf_view_src_rig(LfViewSrc* self);
LfViewSrcHosts lf_view_src_hosts(LfViewSrc* self);
bool lf_view_src_is_live(LfViewSrc* self);
std::string lf_view_src_record(LfViewSrc* self);
// Gives lfcameranode, if there is one inside, those of its properties that the bin decides.
void lf_view_src_set_node(LfViewSrc* self);
// Has a viewer send the commands that the cameras of "node" need (access).
void lf_view_src_follow_access(LfViewSrc* self, const lf::ViewerChain& viewer);
// Gives a new viewer the properties that all viewers of the bin have in common.
void lf_view_src_copy_settings(LfViewSrc* self, const lf::ViewerChain& to);

// view_src_viewers.cc
void lf_view_src_install_pads(GstElementClass* klass);
// Links a viewer with what it has in common with the others, as far as that is there. Throws Error.
void lf_view_src_connect(LfViewSrc* self, LfViewSrcViewer& viewer);
// The viewer of the pad that is always there, and the pad. Throws Error.
void lf_view_src_add_main_viewer(LfViewSrc* self);
