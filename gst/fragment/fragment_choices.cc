// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/lffragment_private.h"

GType lf_fragment_codec_get_type(void) {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<gint>(lf::CodecChoice::kAuto),
         "Uncompressed to a compositor in this process, else JPEG of the quality that the request asks for", "auto"},
        {static_cast<gint>(lf::CodecChoice::kRaw), "8 bits a value", "raw"},
        {static_cast<gint>(lf::CodecChoice::kRaw16), "16 bits a value: sums are rounded in the picture alone", "raw16"},
        {static_cast<gint>(lf::CodecChoice::kJpeg),
         "JPEG of the quality that the request asks for, raw where that is 0", "jpeg"},
        {0, nullptr, nullptr}};
    return g_enum_register_static("LfFragmentCodec", values);
  }();
  return type;
}

GType lf_fragment_resampling_get_type(void) {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<gint>(lf::Resampling::kBilinear), "Bilinear", "bilinear"},
        {static_cast<gint>(lf::Resampling::kSharpened), "Bilinear, of images sharpened before", "sharpened"},
        {static_cast<gint>(lf::Resampling::kCatmullRom), "Catmull-Rom, of the 4x4 pixels around", "catmull-rom"},
        {0, nullptr, nullptr}};
    return g_enum_register_static("LfFragmentResampling", values);
  }();
  return type;
}

GType lf_fragment_renderer_get_type(void) {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<gint>(lf::RendererChoice::kCpu), "The CPU, with the widest vectors that it has", "cpu"},
        {static_cast<gint>(lf::RendererChoice::kGl),
         "OpenGL ES 3.1 without a window, where there is a driver for it; else the CPU", "gl"},
        {0, nullptr, nullptr}};
    return g_enum_register_static("LfFragmentRenderer", values);
  }();
  return type;
}

void lf_fragment_install_choices(GObjectClass* klass, guint first_id) {
  constexpr auto kFlags = GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);
  g_object_class_install_property(
      klass, first_id,
      g_param_spec_enum("codec", "Codec", "How pixels travel in the answers", LF_TYPE_FRAGMENT_CODEC,
                        static_cast<gint>(lf::CodecChoice::kAuto), kFlags));
  g_object_class_install_property(
      klass, first_id + 1,
      g_param_spec_uint(
          "threads", "Threads",
          "Threads that work on an answer at most, out of those that all lffragments of the process share "
          "(0: as many as there are processors)",
          0, 256, 0, kFlags));
  g_object_class_install_property(
      klass, first_id + 2,
      g_param_spec_uint64(
          "max-skew", "Largest skew",
          "Live: how far, in nanoseconds, a frame may be from the capture time asked for; a camera with "
          "no frame as near counts as blind, and others make up for it (0: any)",
          0, G_MAXINT64, 500 * GST_MSECOND, kFlags));
  g_object_class_install_property(
      klass, first_id + 3,
      g_param_spec_int("strip-pixels", "Pixels of a strip",
                       "How many pixels the fragments have, about, that a sum in 8 bits or JPEG is cut into: with "
                       "fewer, a lost packet loses less (16 rows are the least)",
                       1, 1 << 28, lf::wire::kStripPixels, kFlags));
  g_object_class_install_property(
      klass, first_id + 4,
      g_param_spec_boolean("post-messages", "Post messages",
                           "Post an element message \"lightfield-answer\" for every answer", FALSE, kFlags));
  g_object_class_install_property(
      klass, first_id + 5,
      g_param_spec_enum("access", "Access",
                        "What the cameras know, and so what is answered: view requests, or the commands that "
                        "lfviewrequest sends with the same setting. Pixels need an lfcompositor with a rig",
                        LF_TYPE_ACCESS, static_cast<gint>(lf::Access::kSelf), kFlags));
  g_object_class_install_property(
      klass, first_id + 6,
      g_param_spec_enum("resampling", "Resampling",
                        "How cameras' images are sampled: sharpening makes up for what bilinear samples lose, which is "
                        "what is left of the error where the focus is right; Catmull-Rom loses less and takes longer. "
                        "With access=pixels the compositor samples",
                        LF_TYPE_FRAGMENT_RESAMPLING, static_cast<gint>(lf::Resampling::kSharpened), kFlags));
  g_object_class_install_property(
      klass, first_id + 7,
      g_param_spec_uint64("max-delay", "Largest delay",
                          "Live: how long, in nanoseconds, after a request has come its answer can be of use; one that "
                          "would come later, by what such answers have taken, is not begun (0: any time)",
                          0, G_MAXINT64, 500 * GST_MSECOND, kFlags));
  g_object_class_install_property(
      klass, first_id + 8,
      g_param_spec_enum("renderer", "Renderer",
                        "What draws the sums: both give the same picture to 1 of 255. Trials, and views that are not "
                        "blended by the array's mesh, are the CPU's in any case",
                        LF_TYPE_FRAGMENT_RENDERER, static_cast<gint>(lf::RendererChoice::kCpu), kFlags));
  lf::RequestGuard::install(klass, first_id + kNumOwnFragmentChoices);
  gst_type_mark_as_plugin_api(LF_TYPE_FRAGMENT_RENDERER, GstPluginAPIFlags(0));
  gst_type_mark_as_plugin_api(LF_TYPE_FRAGMENT_RESAMPLING, GstPluginAPIFlags(0));
  gst_type_mark_as_plugin_api(LF_TYPE_ACCESS, GstPluginAPIFlags(0));
  gst_type_mark_as_plugin_api(LF_TYPE_FRAGMENT_CODEC, GstPluginAPIFlags(0));
}
