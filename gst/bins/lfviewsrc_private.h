// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "bins/lfviewsrc.h"
#include "bins/viewer_cameras.h"

// What the files of lfviewsrc share: lfviewsrc.cc (the element), view_src_properties.cc (properties, URIs, actions) and
// view_src_viewers.cc (viewers that come and go, and their pads).

struct LfViewSrcViewer {
  LfViewSrcViewer(GstBin* bin, guint view_id, const std::string& ending) : chain(bin, view_id, ending) {}
  lf::ViewerChain chain;
  std::unique_ptr<lf::RequestedPads> pads;  // that link it with the cameras
};

struct _LfViewSrc {
  GstBin parent;
  // Under the object lock.
  gchar *rig, *nodes, *key_file;
  gboolean is_live;

  GstElement *view, *compositor;  // of `src`: children; null where the elements are not installed
  // What is inside, under its own lock, which is taken before any other: bins tell applications of children.
  struct Inside {
    std::recursive_mutex mutex;
    std::map<std::string, std::shared_ptr<LfViewSrcViewer>> viewers;  // by the name of their pad
    guint next_view_id = 0;                                           // of a closed viewer there may still be answers
    std::unique_ptr<lf::ViewerCameras> cameras;
    std::string nodes, key_file;   // that `cameras` were made for
    GstClock* realtime = nullptr;  // made when it is asked for
  } * inside;
};

// view_src_properties.cc
void lf_view_src_install_properties(GObjectClass* klass);
void lf_view_src_install_actions(GObjectClass* klass);
void lf_view_src_uri_handler_init(gpointer iface, gpointer data);
// A copy of `rig`, `nodes` or `key_file`, "" for null.
std::string lf_view_src_text(LfViewSrc* self, gchar* const* text);
bool lf_view_src_is_live(LfViewSrc* self);
// Of lfcameranode, if there is one, what is the bin's to say.
void lf_view_src_set_node(LfViewSrc* self);
// What the viewers of a bin have in common goes over to one more.
void lf_view_src_copy_settings(LfViewSrc* self, const lf::ViewerChain& to);

// view_src_viewers.cc
void lf_view_src_install_pads(GstElementClass* klass);
// The viewer of the pad that is always there, and the pad. Throws Error.
void lf_view_src_add_main_viewer(LfViewSrc* self);
