// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Renders a view from images that the application loads itself. This example reads binary PPM files next to the rig
// file. For example, it reads cam_00_00.ppm if the rig names the still cam_00_00.png. The following commands make such
// files from a synthetic scene:
//
//   lf-scene --out scene --frames 1
//   for still in scene/cam_*.png; do
//     gst-launch-1.0 -q filesrc location=$still ! pngdec ! videoconvert ! pnmenc ! filesink location=${still%.png}.ppm
//   done
//   g++ -std=c++20 render.cc $(pkg-config --cflags --libs lightfield) -o render && ./render scene/rig.json out.ppm
#include <lightfield/lf.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace {

lf::Image read_ppm(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string magic;
  int width = 0, height = 0, levels = 0;
  file >> magic >> width >> height >> levels;
  if (!file || magic != "P6" || levels != 255) throw lf::Error(path + ": not an 8-bit binary PPM");
  lf::Image image = lf::make_image(lf::PixelFormat::kRgb, width, height);
  file.get();
  file.read(reinterpret_cast<char*>(image.pixels.data()), static_cast<std::streamsize>(image.pixels.size()));
  if (!file) throw lf::Error(path + ": file is truncated");
  return image;
}

void write_ppm(const lf::Image& image, const std::string& path) {
  std::ofstream file(path, std::ios::binary);
  file << "P6 " << image.width << " " << image.height << " 255\n";
  file.write(reinterpret_cast<const char*>(image.pixels.data()), static_cast<std::streamsize>(image.pixels.size()));
  if (!file) throw lf::Error(path + ": can't be written");
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 3) throw lf::Error("usage: render RIG.json OUT.ppm");
  const lf::Rig rig = lf::load_rig(argv[1]);
  std::vector<lf::Image> images;
  for (size_t i = 0; i < rig.size(); i++) {
    const auto still = std::filesystem::path(argv[1]).parent_path() / rig.camera(i).image;
    images.push_back(read_ppm(std::filesystem::path(still).replace_extension(".ppm").string()));
  }

  lf::Renderer renderer(rig);
  const lf::View view = lf::home_view(rig, 640, 480);
  // Every call improves the focal surface. A video passes a new frame each time; for a still, pass the same images
  // repeatedly.
  lf::Image picture;
  for (int i = 0; i < 16; i++) picture = renderer.render(view, images, {.focus = lf::Focus::kAuto});
  write_ppm(picture, argv[2]);
  std::printf("%s: %dx%d pixels from %zu of %zu cameras\n", argv[2], picture.width, picture.height,
              renderer.cameras(view).size(), rig.size());
  return 0;
} catch (const lf::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
