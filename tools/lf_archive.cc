// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-archive: a recording, or another rig of films, in less bytes.
#include <gst/gst.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "archive/film_archive.h"
#include "base/error.h"
#include "base/file.h"
#include "base/worker_pool.h"
#include "command_line.h"
#include "progress.h"
#include "rig/rig_json.h"

namespace {

namespace fs = std::filesystem;
using lf::archive::ArchivedFilm;

struct Options {
  std::string recording, out;
  int quantizer = 18;
};

// The rig file that is named, or that of the folder that is.
std::string rig_path(const std::string& recording) {
  return fs::is_directory(recording) ? (fs::path(recording) / "rig.json").string() : recording;
}

// Where the camera's film is. Throws lf::Error where its source is no file.
std::string film_of(const lf::Rig& rig, const lf::Camera& camera) {
  const std::string film = rig.resolve(camera.source);
  if (!fs::is_regular_file(film))
    throw lf::Error("camera " + std::to_string(camera.id) + ": its source is no file" +
                    (camera.source.empty() ? "" : " (" + film + ")") + ": what is archived is a recording");
  return film;
}

std::string name_of(const lf::Camera& camera) {
  return std::to_string(camera.id) + (camera.name.empty() ? "" : " (" + camera.name + ")");
}

double megabytes(uint64_t bytes) { return static_cast<double>(bytes) / 1e6; }

// All films, one on each processor. The bar is of all of them.
std::vector<ArchivedFilm> archive_films(const lf::Rig& rig, const std::vector<std::string>& films,
                                        const lf::Rig& archived, const std::string& folder, int quantizer) {
  std::vector<ArchivedFilm> results(films.size());
  Progress bar("archiving", 0);
  std::mutex mutex;
  double done = 0;
  const unsigned threads = std::max(1u, std::thread::hardware_concurrency());
  lf::WorkerPool::shared()->run(threads, films.size(), [&](size_t i) {
    double last = 0;
    results[i] =
        lf::archive::archive_film(rig.cameras[i], films[i], (fs::path(folder) / archived.cameras[i].source).string(),
                                  quantizer, [&](double share) {
                                    const std::lock_guard lock(mutex);
                                    done += share - last;
                                    last = share;
                                    bar.reach(done / static_cast<double>(films.size()));
                                  });
  });
  return results;
}

// A line for each camera, and one for all.
void print(const lf::Rig& rig, const std::vector<ArchivedFilm>& films, const std::string& out) {
  ArchivedFilm all;
  double worst = INFINITY;
  for (size_t i = 0; i < films.size(); i++) {
    const ArchivedFilm& film = films[i];
    std::printf("camera %s: %llu frames, %.3f -> %.3f MB, ", name_of(rig.cameras[i]).c_str(),
                static_cast<unsigned long long>(film.frames), megabytes(film.bytes_before),
                megabytes(film.bytes_after));
    if (film.is_copy)
      std::printf("as it was\n");
    else
      std::printf("%.2f dB\n", film.psnr());
    if (film.unreadable > 0)
      std::printf("  %llu frames that can't be read are left out\n", static_cast<unsigned long long>(film.unreadable));
    all.bytes_before += film.bytes_before;
    all.bytes_after += film.bytes_after;
    all.squares += film.squares;
    all.pixels += film.pixels;
    if (!film.is_copy) worst = std::min(worst, film.psnr());
  }
  std::printf("%s: %.2f MB -> %.2f MB, %.2f times less", out.c_str(), megabytes(all.bytes_before),
              megabytes(all.bytes_after), static_cast<double>(all.bytes_before) / static_cast<double>(all.bytes_after));
  if (all.pixels > 0) std::printf(", %.2f dB of luma (the worst camera %.2f)", all.psnr(), worst);
  std::printf("\n");
}

// The rig comes last, so that what is not whole is no recording.
void run(const Options& options) {
  gst_init(nullptr, nullptr);
  const std::string path = rig_path(options.recording), out = (fs::path(options.out) / "rig.json").string();
  const lf::Rig rig = lf::load_rig(path);
  if (fs::exists(out)) throw lf::Error(out + ": there is a recording already: name another folder, or remove it first");
  std::vector<std::string> films;
  for (const lf::Camera& camera : rig.cameras) films.push_back(film_of(rig, camera));
  lf::FolderUpdate update(options.out);
  lf::Rig archived = rig;
  lf::relocate(archived, fs::weakly_canonical(options.out).string());
  for (lf::Camera& camera : archived.cameras) camera.source = "camera" + std::to_string(camera.id) + ".mkv";
  const std::vector<ArchivedFilm> results = archive_films(rig, films, archived, update.staging(), options.quantizer);
  update.commit();
  lf::save_rig_like(path, archived, out);
  print(rig, results, options.out);
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  cli::App app(
      "Keeps a recording in less bytes: Motion JPEG becomes H.264, with the same times, and plays as the recording "
      "does. "
      "Tells the bytes, and how far luma is from what it was.",
      "lf-archive");
  app.add_option("RECORDING", o.recording, "Its folder or rig file; any rig whose cameras' sources are Matroska films")
      ->required()
      ->check(cli::ExistingPath);
  app.add_option("--out", o.out, "Folder to write")->required()->type_name("FOLDER");
  app.add_option("--quantizer", o.quantizer, "Of x264: the less, the better and the larger")
      ->capture_default_str()
      ->check(cli::Range(1, 51));
  return cli::run_tool(app, argc, argv, [&] { run(o); });
}
