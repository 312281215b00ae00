// SPDX-License-Identifier: LGPL-2.1-or-later
#include "film.h"

#include <glib.h>

#include <cstdio>
#include <filesystem>

#include "base/error.h"

namespace lf::serve {

namespace fs = std::filesystem;

std::string film_of_scene() {
  const fs::path folder = fs::path(g_get_user_cache_dir()) / "gst-lightfield" / "scene-" LF_VERSION;
  const std::string rig = folder / "rig.json";
  if (fs::exists(rig)) return rig;  // written last
  std::printf("filming the built-in scene (once, kept in %s)\n", folder.c_str());
  std::error_code none;
  const fs::path beside = fs::read_symlink("/proc/self/exe", none).parent_path() / "lf-scene";
  const std::string program = fs::exists(beside, none) ? beside.string() : "lf-scene";
  const std::string out = folder.string();
  const char* const arguments[] = {program.c_str(), "--out",    out.c_str(), "--grid",   "8x8", "--width",
                                   "320",           "--height", "240",       "--frames", "60",  nullptr};
  GError* error = nullptr;
  gint status = 0;
  if (!g_spawn_sync(nullptr, const_cast<gchar**>(arguments), nullptr, G_SPAWN_SEARCH_PATH, nullptr, nullptr, nullptr,
                    nullptr, &status, &error) ||
      !g_spawn_check_wait_status(status, &error)) {
    const std::string text = std::string("lf-scene: ") + error->message;
    g_error_free(error);
    throw Error(text);
  }
  return rig;
}

}  // namespace lf::serve
