// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/fragment_settings.h"

#include "fragment/lffragment.h"

GType lf_fragment_codec_get_type(void) {
  static const GType type = lf::register_enum<lf::CodecChoice>(
      "LfFragmentCodec",
      {{lf::CodecChoice::kAuto,
        "Uncompressed to a compositor in this process, else JPEG of the quality that the request asks for", "auto"},
       {lf::CodecChoice::kRaw, "8 bits a value", "raw"},
       {lf::CodecChoice::kRaw16, "16 bits a value: sums are rounded in the picture alone", "raw16"},
       {lf::CodecChoice::kJpeg, "JPEG of the quality that the request asks for, raw where that is 0", "jpeg"}});
  return type;
}

GType lf_fragment_resampling_get_type(void) {
  static const GType type = lf::register_enum<lf::Resampling>(
      "LfFragmentResampling", {{lf::Resampling::kBilinear, "Bilinear", "bilinear"},
                               {lf::Resampling::kSharpened, "Bilinear, of images sharpened before", "sharpened"}});
  return type;
}

GType lf_fragment_renderer_get_type(void) {
  static const GType type = lf::register_enum<lf::RendererChoice>(
      "LfFragmentRenderer",
      {{lf::RendererChoice::kCpu, "The CPU, with the widest vectors that it has", "cpu"},
       {lf::RendererChoice::kGl, "OpenGL ES 3.1 without a window, where there is a driver for it; else the CPU", "gl"},
       {lf::RendererChoice::kAuto, "The faster one, as the first answers tell; never a driver that computes on the CPU",
        "auto"}});
  return type;
}

namespace lf {

PropertyTable<FragmentSettings>& FragmentSettings::properties() {
  using S = FragmentSettings;
  static PropertyTable<S> table = {
      property<&S::rig>(kWhilePlaying, "rig", "Rig",
                        "Rig file (rig.json) of the whole array; required. Set while running, it is read again and "
                        "serves from the next request on; cameras keep their pads by id"),
      property<&S::node>(kWhileReady, "node", "Node", "Number of this node, carried in its answers", 0, G_MAXUINT),
      property<&S::codec>(kWhilePlaying, "codec", "Codec", "How pixels travel in the answers", LF_TYPE_FRAGMENT_CODEC),
      property<&S::threads>(kWhilePlaying, "threads", "Threads",
                            "Threads that work on an answer at most, out of those that all lffragments of the process "
                            "share (0: as many as there are processors)",
                            0, 256),
      property<&S::max_skew>(kWhilePlaying, "max-skew", "Largest skew",
                             "Live: how far, in nanoseconds, a frame may be from the capture time asked for; a camera "
                             "with no frame as near counts as blind, and others make up for it (0: any)",
                             0, G_MAXINT64),
      property<&S::strip_pixels>(kWhilePlaying, "strip-pixels", "Pixels of a strip",
                                 "How many pixels the fragments have, about, that a sum in 8 bits or JPEG is cut into: "
                                 "with fewer, a lost packet loses less (16 rows are the least)",
                                 1, 1 << 28),
      property<&S::post_messages>(kWhilePlaying, "post-messages", "Post messages",
                                  "Post an element message \"lightfield-answer\" for every answer"),
      property<&S::access>(kWhilePlaying, "access", "Access",
                           "What the cameras know, and so what is answered: view requests, or the commands that "
                           "lfviewrequest sends with the same setting. Pixels need an lfcompositor with a rig",
                           LF_TYPE_ACCESS),
      property<&S::resampling>(kWhilePlaying, "resampling", "Resampling",
                               "How cameras' images are sampled: sharpening makes up for what bilinear samples lose, "
                               "which is what is left of the error where the focus is right. With access=pixels the "
                               "compositor samples",
                               LF_TYPE_FRAGMENT_RESAMPLING),
      property<&S::max_delay>(kWhilePlaying, "max-delay", "Largest delay",
                              "Live: how long, in nanoseconds, after a request has come its answer can be of use; one "
                              "that would come later, by what such answers have taken, is not begun (0: any time)",
                              0, G_MAXINT64),
      property<&S::renderer>(
          kWhilePlaying, "renderer", "Renderer",
          "What draws the sums, and trials: both give the same picture to 1 of 255, in the format that cameras have. "
          "auto: the faster one, as the first answers tell, and never a driver that computes on the CPU, as Mesa's "
          "llvmpipe does; stats say what renders, and why",
          LF_TYPE_FRAGMENT_RENDERER),
  };
  return table;
}

}  // namespace lf
