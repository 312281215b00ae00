// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/viewer_cameras.h"

#include "base/error.h"
#include "bins/rtp_link.h"
#include "bins/view_split.h"
#include "rtp/host_lookup.h"
#include "viewrequest/lfviewrequest.h"

namespace lf {
namespace {

// Takes both references.
void link(GstPad* src, GstPad* sink) {
  const bool linked = src && sink && gst_pad_link(src, sink) == GST_PAD_LINK_OK;
  if (src) gst_object_unref(src);
  if (sink) gst_object_unref(sink);
  if (!linked) throw Error("a viewer can't be linked with the cameras");
}

void remove_element(GstBin* bin, GstElement* element) {
  gst_element_set_state(element, GST_STATE_NULL);
  gst_bin_remove(bin, element);
}

// Each viewer has a request pad of the node to itself, and with it a thread.
class CamerasHere : public ViewerCameras {
 public:
  explicit CamerasHere(GstBin* bin) : bin_(bin), node_(add_element(bin, "lfcameranode", "node")) {}
  ~CamerasHere() override { remove_element(bin_, node_); }

  std::unique_ptr<RequestedPads> connect(ViewerChain& viewer) override {
    auto pads = std::make_unique<RequestedPads>();
    lf_view_request_set_in_process(LF_VIEW_REQUEST(viewer.view()), TRUE);
    std::string ending;
    GstPad* request = nullptr;
    if (viewer.view_id() == 0) {
      request = gst_element_get_static_pad(node_, "request");
    } else {
      ending = "_" + std::to_string(viewer.view_id() - 1);
      request = gst_element_request_pad_simple(node_, ("request" + ending).c_str());
      if (request) gst_object_ref(pads->add(node_, request));
    }
    link(viewer.requests(), request);
    link(gst_element_get_static_pad(node_, ("src" + ending).c_str()), viewer.add_answers(false));
    return pads;
  }

 private:
  GstBin* bin_;
  GstElement* node_;
};

// Of a host that is this machine itself nothing comes from outside.
HostPort place_of_answers(const NodeAddress& node) {
  std::string address = node.answer_host;
  if (address.empty() && (node.host.starts_with("127.") || node.host == "::1")) address = node.host;
  return {address, node.answer_port};
}

// Requests of all viewers go to all hosts in one stream; the answers of each host are told apart here.
class CamerasOnHosts : public ViewerCameras {
 public:
  CamerasOnHosts(GstBin* bin, const std::vector<NodeAddress>& nodes, const std::string& key_file) : bin_(bin) {
    try {
      add_all(nodes, key_file);
    } catch (const Error&) {
      remove();
      throw;
    }
  }
  ~CamerasOnHosts() override { remove(); }

  std::unique_ptr<RequestedPads> connect(ViewerChain& viewer) override {
    auto pads = std::make_unique<RequestedPads>();
    lf_view_request_set_in_process(LF_VIEW_REQUEST(viewer.view()), FALSE);
    GstPad* request = gst_element_request_pad_simple(requests_, "sink_%u");
    link(viewer.requests(), GST_PAD(gst_object_ref(pads->add(requests_, request))));
    for (size_t i = 0; i < splits_.size(); i++) {
      GstElement* split = splits_[i];
      GstPad* answers = GST_PAD(gst_object_ref(lf_view_split_add_view(LF_VIEW_SPLIT(split), viewer.view_id())));
      link(GST_PAD(gst_object_ref(pads->add(split, answers))), viewer.add_answers(true, hosts_[i]));
    }
    return pads;
  }

 private:
  void add_all(const std::vector<NodeAddress>& nodes, const std::string& key_file) {
    requests_ = add("funnel", "all_requests");
    GstElement* pay = add("rtplfpay", "request_pay");
    GstElement* seal = add("lfrtpseal", "request_seal");
    if (!key_file.empty()) g_object_set(seal, "key-file", key_file.c_str(), nullptr);
    GstElement* udp = add("multiudpsink", "request_udp");
    g_object_set(udp, "sync", FALSE, "async", FALSE, nullptr);
    std::vector<std::vector<std::string>> addresses;
    for (const NodeAddress& node : nodes) {
      addresses.push_back(addresses_of(node.host));
      hosts_.push_back(node.host + ":" + std::to_string(node.request_port));
      g_signal_emit_by_name(udp, "add", addresses.back().front().c_str(), node.request_port, nullptr);
    }
    if (!gst_element_link_many(requests_, pay, seal, udp, nullptr))
      throw Error("requests can't be linked with the network");
    for (size_t i = 0; i < nodes.size(); i++) {
      const std::string name = "host" + std::to_string(i);
      GstPad* answers = add_receiver(bin_, place_of_answers(nodes[i]), "X-LIGHTFIELD-ANSWER",
                                     admission_of({key_file, ""}, addresses[i]), name, &all_);
      GstElement* split = GST_ELEMENT(g_object_new(LF_TYPE_VIEW_SPLIT, "name", (name + "_answers").c_str(), nullptr));
      gst_bin_add(bin_, split);
      all_.push_back(split);
      splits_.push_back(split);
      link(answers, gst_element_get_static_pad(split, "sink"));
    }
  }

  GstElement* add(const char* factory, const char* name) {
    all_.push_back(add_element(bin_, factory, name));
    return all_.back();
  }

  void remove() {
    for (GstElement* element : all_) remove_element(bin_, element);
  }

  GstBin* bin_;
  std::vector<GstElement*> all_;
  GstElement* requests_ = nullptr;
  std::vector<GstElement*> splits_;
  std::vector<std::string> hosts_;  // as many, as users named them
};

}  // namespace

std::unique_ptr<ViewerCameras> cameras_here(GstBin* bin) { return std::make_unique<CamerasHere>(bin); }

std::unique_ptr<ViewerCameras> cameras_on_hosts(GstBin* bin, const std::vector<NodeAddress>& nodes,
                                                const std::string& key_file) {
  return std::make_unique<CamerasOnHosts>(bin, nodes, key_file);
}

}  // namespace lf
