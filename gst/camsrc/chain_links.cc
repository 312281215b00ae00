// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/chain_links.h"

#include <vector>

#include "camsrc/camera_chain.h"
#include "common/common.h"

namespace lf {

GstElement* add(GstBin* bin, const char* factory, const char* name) {
  GstElement* element = gst_element_factory_make(factory, name);
  if (!element) throw MissingElement(factory);
  gst_bin_add(bin, element);
  return element;
}

GstPad* borrow_pad(GstElement* element, const char* name) {
  GstPad* pad = gst_element_get_static_pad(element, name);
  gst_object_unref(pad);
  return pad;
}

GstElement* append(GstElement* tail, GstElement* next) {
  if (tail) gst_element_link_pads_full(tail, "src", next, "sink", GST_PAD_LINK_CHECK_NOTHING);
  return next;
}

GstElement* add_jpeg_decoder(GstBin* bin) {
  GstElement* decoder = add(bin, "jpegdec");
  gst_util_set_object_arg(G_OBJECT(decoder), "idct-method", "islow");  // the default's errors cost PSNR, not time
  g_object_set(decoder, "qos", FALSE, nullptr);                        // no frame is skipped for being late
  return decoder;
}

namespace {

// Links a pad that has just appeared with the sink pad of `next`, if that is still free. Unchecked, so that a picture
// of the wrong size comes as far as to be named.
void link_new_pad(GstPad* pad, GstElement* next) {
  GstPad* sink = borrow_pad(next, "sink");
  if (!gst_pad_is_linked(sink)) gst_pad_link_full(pad, sink, GST_PAD_LINK_CHECK_NOTHING);
}

bool is_media(GstPad* pad, const char* prefix) {
  GstCaps* caps = gst_pad_query_caps(pad, nullptr);
  const bool yes = !gst_caps_is_empty(caps) && !gst_caps_is_any(caps) &&
                   g_str_has_prefix(gst_structure_get_name(gst_caps_get_structure(caps, 0)), prefix);
  gst_caps_unref(caps);
  return yes;
}

// Whether the pad gives pictures in a graphics card's memory.
bool is_on_card(GstPad* pad) {
  GstCaps* caps = gst_pad_query_caps(pad, nullptr);
  const bool yes = !gst_caps_is_empty(caps) && !gst_caps_is_any(caps) &&
                   gst_caps_features_contains(gst_caps_get_features(caps, 0), LF_GL_MEMORY);
  gst_caps_unref(caps);
  return yes;
}

// Whether who is behind the chain's last identity takes the pad's pictures as they are.
bool takes_pictures(GstElement* before, GstPad* pad) {
  GstObject* bin = gst_element_get_parent(before);
  if (!bin) return false;  // being taken apart
  GstElement* after = gst_bin_get_by_name(GST_BIN(bin), kAfterConvert);
  GstCaps* given = gst_pad_query_caps(pad, nullptr);
  GstCaps* taken = gst_pad_peer_query_caps(borrow_pad(after, "src"), given);
  const bool takes = !gst_caps_is_empty(taken);
  gst_caps_unref(taken);
  gst_caps_unref(given);
  gst_object_unref(after);
  gst_object_unref(bin);
  return takes;
}

// Calls f(pad) for each source pad inside of the bin.
template <typename F>
void for_each_source_pad(GstBin* bin, F f) {
  const GstElementForeachPadFunc call_f = [](GstElement*, GstPad* pad, gpointer data) -> gboolean {
    (*static_cast<F*>(data))(pad);
    return TRUE;
  };
  GstIterator* elements = gst_bin_iterate_recurse(bin);
  GValue item = G_VALUE_INIT;
  GstIteratorResult next = GST_ITERATOR_OK;
  while ((next = gst_iterator_next(elements, &item)) == GST_ITERATOR_OK || next == GST_ITERATOR_RESYNC) {
    if (next == GST_ITERATOR_RESYNC) {
      gst_iterator_resync(elements);
      continue;
    }
    gst_element_foreach_src_pad(GST_ELEMENT(g_value_get_object(&item)), call_f, &f);
    g_value_reset(&item);
  }
  g_value_unset(&item);
  gst_iterator_free(elements);
}

// Demuxers say it before their first picture.
GstVideoOrientationMethod turn_of_film(GstBin* bin) {
  GstVideoOrientationMethod turn = GST_VIDEO_ORIENTATION_IDENTITY;
  for_each_source_pad(bin, [&turn](GstPad* pad) {
    if (turn == GST_VIDEO_ORIENTATION_IDENTITY) turn = turn_of(pad);
  });
  return turn;
}

// Links pictures with `head`: those on a card by way of gldownload, those that are to be turned by way of videoflip.
void link_decoded(GstElement* decoder, GstPad* pad, GstElement* head, bool on_card) {
  GstObject* bin = gst_element_get_parent(head);
  if (!bin) return;  // being taken apart
  try {
    const GstVideoOrientationMethod turn = turn_of_film(GST_BIN(bin));
    std::vector<GstElement*> between;
    if (on_card) between.push_back(add(GST_BIN(bin), "gldownload"));
    if (turn != GST_VIDEO_ORIENTATION_IDENTITY) {
      between.push_back(add(GST_BIN(bin), "videoconvert"));
      between.push_back(add(GST_BIN(bin), "videoflip"));
      g_object_set(between.back(), "video-direction", turn, nullptr);
    }
    GstElement* next = head;
    for (auto element = between.rbegin(); element != between.rend(); ++element) {
      append(*element, next);
      gst_element_sync_state_with_parent(*element);
      next = *element;
    }
    link_new_pad(pad, next);
  } catch (const MissingElement& missing) {
    GST_ELEMENT_ERROR(decoder, CORE, MISSING_PLUGIN, ("element %s is not installed", missing.what()), (nullptr));
  }
  gst_object_unref(bin);
}

}  // namespace

bool may_bypass(GstElement* head) { return g_strcmp0(GST_OBJECT_NAME(head), kBeforeConvert) == 0; }

void bypass(GstElement* before) {
  GstObject* bin = gst_element_get_parent(before);
  if (!bin) return;  // being taken apart
  GstElement* after = gst_bin_get_by_name(GST_BIN(bin), kAfterConvert);
  GstPad* src = borrow_pad(before, "src");
  GstPad* sink = borrow_pad(after, "sink");
  for (GstPad* pad : {src, sink}) {
    GstPad* peer = gst_pad_get_peer(pad);
    if (!peer) continue;
    if (pad == src)
      gst_pad_unlink(pad, peer);
    else
      gst_pad_unlink(peer, pad);
    gst_object_unref(peer);
  }
  gst_pad_link_full(src, sink, GST_PAD_LINK_CHECK_NOTHING);
  gst_object_unref(after);
  gst_object_unref(bin);
}

void on_decoded_pad(GstElement* decoder, GstPad* pad, gpointer head_element) {
  GstElement* const head = GST_ELEMENT(head_element);
  if (gst_pad_is_linked(borrow_pad(head, "sink"))) return;
  const bool is_raw = is_media(pad, "video/x-raw"), on_card = is_raw && is_on_card(pad);
  const bool passes = may_bypass(head) && (on_card ? takes_pictures(head, pad) : is_media(pad, "image/jpeg"));
  if (passes) bypass(head);
  if (passes)
    link_new_pad(pad, head);
  else if (is_raw)
    link_decoded(decoder, pad, head, on_card);
}

void on_matroska_pad(GstElement* demuxer, GstPad* pad, gpointer head) {
  if (may_bypass(GST_ELEMENT(head)) && is_media(pad, "image/jpeg")) return on_decoded_pad(demuxer, pad, head);
  GstPad* sink = borrow_pad(GST_ELEMENT(head), "sink");
  if (gst_pad_is_linked(sink) || !(is_media(pad, "video/") || is_media(pad, "image/"))) return;
  if (is_media(pad, "video/x-raw")) return link_new_pad(pad, GST_ELEMENT(head));

  GstObject* bin = gst_element_get_parent(demuxer);
  if (!bin) return;  // being taken apart
  GstElement* decoder = nullptr;
  try {
    if (is_media(pad, "image/jpeg")) {
      decoder = add_jpeg_decoder(GST_BIN(bin));
      append(decoder, GST_ELEMENT(head));
    } else {
      decoder = add(GST_BIN(bin), "decodebin");
      g_signal_connect(decoder, "pad-added", G_CALLBACK(lf::callback<on_decoded_pad>), head);
    }
    gst_element_sync_state_with_parent(decoder);
    link_new_pad(pad, decoder);
  } catch (const MissingElement& missing) {
    GST_ELEMENT_ERROR(demuxer, CORE, MISSING_PLUGIN, ("element %s is not installed", missing.what()), (nullptr));
  }
  gst_object_unref(bin);
}

GstVideoOrientationMethod turn_of(GstPad* pad) {
  GstVideoOrientationMethod turn = GST_VIDEO_ORIENTATION_IDENTITY;
  for (guint i = 0; turn == GST_VIDEO_ORIENTATION_IDENTITY; i++) {
    g_autoptr(GstEvent) event = gst_pad_get_sticky_event(pad, GST_EVENT_TAG, i);
    if (!event) break;
    GstTagList* tags = nullptr;
    gst_event_parse_tag(event, &tags);
    gst_video_orientation_from_tag(tags, &turn);
  }
  return turn;
}

bool has_sound(GstBin* bin) {
  bool found = false;
  for_each_source_pad(bin, [&found](GstPad* pad) { found |= is_media(pad, "audio/"); });
  return found;
}

void on_no_more_pads(GstElement* element, gpointer /*unused*/) {
  bool linked = false;
  GST_OBJECT_LOCK(element);
  for (GList* pad = element->srcpads; pad; pad = pad->next) linked |= GST_PAD_IS_LINKED(GST_PAD(pad->data));
  GST_OBJECT_UNLOCK(element);
  if (!linked) GST_ELEMENT_ERROR(element, STREAM, WRONG_TYPE, ("no video in it"), (nullptr));
}

}  // namespace lf
