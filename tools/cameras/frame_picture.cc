// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/frame_picture.h"

#include <gst/video/video.h>

#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

#include "base/error.h"
#include "jpeg/jpeg_frame.h"

namespace lf::cameras {
namespace {

Image rgb_of_jpeg(GstBuffer* buffer) {
  auto bytes = std::make_shared<std::vector<uint8_t>>(gst_buffer_get_size(buffer));
  gst_buffer_extract(buffer, 0, bytes->data(), bytes->size());
  std::string reason;
  const std::shared_ptr<JpegFrame> frame = JpegFrame::open(bytes, std::span<const uint8_t>(*bytes), &reason);
  if (!frame || !frame->ensure({0, 0, frame->width(), frame->height()}, &reason)) throw Error(reason);
  const ImageView view = frame->view();
  Image image(PixelFamily::kI420, view.width, view.height);
  for (int plane = 0; plane < 3; plane++) {
    const int width = plane ? chroma_size(view.width) : view.width,
              height = plane ? chroma_size(view.height) : view.height;
    for (int y = 0; y < height; y++)
      std::memcpy(image.plane(plane) + static_cast<ptrdiff_t>(y) * width, view.plane[plane] + y * view.stride[plane],
                  static_cast<size_t>(width));
  }
  return to_rgb(image);
}

}  // namespace

Image rgb_of(GstBuffer* buffer, GstCaps* caps) {
  if (!caps || !buffer) throw Error("a frame without caps");
  if (gst_structure_has_name(gst_caps_get_structure(caps, 0), "image/jpeg")) return rgb_of_jpeg(buffer);
  GstVideoInfo from, to;
  GstVideoFrame in, out;
  if (!gst_video_info_from_caps(&from, caps) || !gst_video_frame_map(&in, &from, buffer, GST_MAP_READ))
    throw Error("a frame that can't be read");
  gst_video_info_set_format(&to, GST_VIDEO_FORMAT_RGB, static_cast<guint>(from.width), static_cast<guint>(from.height));
  // A converter does not change rates, nor what is interlaced.
  to.fps_n = from.fps_n;
  to.fps_d = from.fps_d;
  to.interlace_mode = from.interlace_mode;
  GstBuffer* converted = gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&to), nullptr);
  gst_video_frame_map(&out, &to, converted, GST_MAP_WRITE);
  GstVideoConverter* converter = gst_video_converter_new(&from, &to, nullptr);
  Image image(PixelFamily::kRgb, from.width, from.height);
  if (converter) {
    gst_video_converter_frame(converter, &in, &out);
    for (int y = 0; y < from.height; y++)
      std::memcpy(image.pixel(0, y),
                  static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&out, 0)) +
                      static_cast<ptrdiff_t>(y) * GST_VIDEO_FRAME_PLANE_STRIDE(&out, 0),
                  3 * static_cast<size_t>(from.width));
    gst_video_converter_free(converter);
  }
  gst_video_frame_unmap(&out);
  gst_video_frame_unmap(&in);
  gst_buffer_unref(converted);
  if (!converter) throw Error("a frame in a format that can't be converted");
  return image;
}

GreyPicture small_grey_of(GstSample* sample, int smaller) {
  GstVideoInfo info;
  GstVideoFrame frame;
  GstCaps* caps = gst_sample_get_caps(sample);
  if (!caps || !gst_video_info_from_caps(&info, caps) ||
      !gst_video_frame_map(&frame, &info, gst_sample_get_buffer(sample), GST_MAP_READ))
    throw Error("a frame that can't be read");
  GreyPicture picture{info.width / smaller, info.height / smaller, {}};
  picture.samples.reserve(static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height));
  // Luma, or the mean of red, green and blue: lights have colours.
  const int components = GST_VIDEO_INFO_IS_RGB(&info) ? 3 : 1;
  const int count = smaller * smaller * components;
  for (int y = 0; y < picture.height; y++)
    for (int x = 0; x < picture.width; x++) {
      int sum = 0;
      for (int c = 0; c < components; c++) {
        const int step = GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, c);
        const auto* row = static_cast<const uint8_t*>(GST_VIDEO_FRAME_COMP_DATA(&frame, c)) +
                          static_cast<ptrdiff_t>(y) * smaller * GST_VIDEO_FRAME_COMP_STRIDE(&frame, c) +
                          static_cast<ptrdiff_t>(x) * smaller * step;
        for (int v = 0; v < smaller; v++, row += GST_VIDEO_FRAME_COMP_STRIDE(&frame, c))
          for (int u = 0; u < smaller; u++) sum += row[u * step];
      }
      picture.samples.push_back(static_cast<uint8_t>(sum / count));
    }
  gst_video_frame_unmap(&frame);
  return picture;
}

bool is_jpeg(GstSample* sample) {
  GstCaps* caps = gst_sample_get_caps(sample);
  return caps && gst_structure_has_name(gst_caps_get_structure(caps, 0), "image/jpeg");
}

std::vector<uint8_t> bytes_of(GstSample* sample) {
  GstBuffer* buffer = gst_sample_get_buffer(sample);
  std::vector<uint8_t> bytes(gst_buffer_get_size(buffer));
  gst_buffer_extract(buffer, 0, bytes.data(), bytes.size());
  return bytes;
}

double brightness_of(const Image& rgb) {
  uint64_t sum = 0;
  for (size_t i = 0; i + 2 < rgb.data().size(); i += 3)
    sum += 299u * rgb.data()[i] + 587u * rgb.data()[i + 1] + 114u * rgb.data()[i + 2];
  const double pixels = static_cast<double>(rgb.data().size()) / 3;
  return pixels > 0 ? static_cast<double>(sum) / 1000 / pixels : 0;
}

}  // namespace lf::cameras
