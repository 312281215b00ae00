// SPDX-License-Identifier: LGPL-2.1-or-later
//
// A picture of a light field from images that an application has: here, binary PPM files beside the rig's file, which
// are named as the stills that it names (cam_00_00.png: cam_00_00.ppm). A film of lf-scene has stills of its cameras;
// these lines make PPM files of them:
//
//   lf-scene --out scene --frames 1
//   for still in scene/cam_*.png; do
//     gst-launch-1.0 -q filesrc location=$still ! pngdec ! videoconvert ! pnmenc ! filesink location=${still%.png}.ppm
//   done
//   g++ -std=c++20 render.cc $(pkg-config --cflags --libs lightfield) -o render && ./render scene/rig.json out.ppm
#include <lightfield/lightfield.h>

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
  if (!file || magic != "P6" || levels != 255) throw lf::Error(path + ": is no binary PPM of 8 bits");
  lf::Image image = lf::make_image(lf::PixelFormat::kRgb, width, height);
  file.get();
  file.read(reinterpret_cast<char*>(image.pixels.data()), static_cast<std::streamsize>(image.pixels.size()));
  if (!file) throw lf::Error(path + ": ends too early");
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
  // Every call looks closer at where things are. With film, these are its frames; a still has to be shown again.
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
