// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/camera_files.h"

#include "image/image.h"
#include "rig/rig_json.h"
#include "support/rigs.h"

namespace lf::test {

void run_to_end(const std::string& line) {
  const std::string error = run(line);
  if (!error.empty()) throw std::runtime_error(line + ": " + error);
}

namespace {

bool is_installed(const char* name) {
  GstElementFactory* factory = gst_element_factory_find(name);
  const bool yes = factory != nullptr;
  gst_clear_object(&factory);
  return yes;
}

}  // namespace

std::string CameraFiles::h264_encoder() {
  if (!is_installed("h264parse") || !(is_installed("avdec_h264") || is_installed("openh264dec"))) return "";
  if (is_installed("x264enc"))
    return "x264enc tune=zerolatency key-int-max=30 quantizer=18 pass=quant ! video/x-h264,profile=main";
  return is_installed("openh264enc") ? "openh264enc" : "";
}

CameraFiles::CameraFiles() {
  g_autofree gchar* folder = g_dir_make_tmp("lightfield-XXXXXX", nullptr);
  if (!folder) throw std::runtime_error("no temporary folder");
  folder_ = folder;
  for (int k = 0; k < kFrames; ++k) {
    Image image(PixelFamily::kRgb, kWidth, kHeight);
    std::fill(image.data().begin(), image.data().end(), static_cast<uint8_t>(grey_of(k)));
    save_image(image, path("jpeg_0" + std::to_string(k) + ".jpg"));
    save_image(image, path("png_" + std::to_string(k + 1) + ".png"));
  }
  std::ofstream stream(path("pictures.mjpeg"), std::ios::binary);
  for (int k = 0; k < kFrames; ++k)
    stream << std::ifstream(path("jpeg_0" + std::to_string(k) + ".jpg"), std::ios::binary).rdbuf();
  stream.close();
  const std::string frames = "multifilesrc location=" + path("jpeg_%02d.jpg") +
                             " caps=image/jpeg,framerate=15/1 ! jpegdec ! videoconvert ! video/x-raw,format=I420 ! ";
  run_to_end(frames + "jpegenc quality=95 ! matroskamux ! filesink location=" + path("mjpeg.mkv"));
  run_to_end(frames + "jpegenc quality=95 ! avimux ! filesink location=" + path("mjpeg.avi"));
  run_to_end(frames + "matroskamux ! filesink location=" + path("raw.mkv"));
  if (const std::string encoder = h264_encoder(); !encoder.empty()) {
    run_to_end(frames + encoder + " ! h264parse ! mp4mux ! filesink location=" + path("h264.mp4"));
    run_to_end(frames + encoder + " ! h264parse ! matroskamux ! filesink location=" + path("h264.mkv"));
  }
  run_to_end("videotestsrc num-buffers=1 ! video/x-raw,format=GRAY8,width=64,height=48 ! pngenc ! filesink location=" +
             path("grey.png"));
  run_to_end("audiotestsrc num-buffers=5 ! matroskamux ! filesink location=" + path("sound.mkv"));
}

CameraFiles::~CameraFiles() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

std::string CameraFiles::save(const std::string& name, int count, const std::function<void(Camera&)>& edit) const {
  Rig rig = camera_grid(1, count, 0.1, kWidth, kHeight, 60);
  for (Camera& camera : rig.cameras) {
    camera.name = "cam_" + std::to_string(camera.id);
    edit(camera);
  }
  save_rig(rig, path(name));
  return path(name);
}

}  // namespace lf::test
