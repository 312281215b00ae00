// SPDX-License-Identifier: LGPL-2.1-or-later
#include "film.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "base/error.h"

namespace lf::serve {

namespace fs = std::filesystem;

namespace {

fs::path folder() { return fs::path(g_get_user_cache_dir()) / "gst-lightfield" / "scene-" LF_VERSION; }

}  // namespace

std::string Film::rig() { return folder() / "rig.json"; }

bool Film::exists() { return fs::exists(rig()); }  // written last

Film::Film(std::function<void(const std::string&)> on_end)
    : on_end_(std::move(on_end)), cancellable_(g_cancellable_new()), began_(g_get_monotonic_time()) {
  std::error_code none;
  const fs::path beside = fs::read_symlink("/proc/self/exe", none).parent_path() / "lf-scene";
  const std::string program = fs::exists(beside, none) ? beside.string() : "lf-scene", out = folder();
  const char* const arguments[] = {program.c_str(), "--out",    out.c_str(), "--grid",   "8x8", "--width",
                                   "320",           "--height", "240",       "--frames", "60",  nullptr};
  GError* error = nullptr;
  process_ = g_subprocess_newv(arguments, G_SUBPROCESS_FLAGS_STDERR_PIPE, &error);
  if (!process_) {
    const std::string text = std::string("lf-scene: ") + error->message;
    g_error_free(error);
    g_object_unref(cancellable_);
    throw Error(text);
  }
  says_ = g_data_input_stream_new(g_subprocess_get_stderr_pipe(process_));
  read_line();
}

Film::~Film() {
  g_cancellable_cancel(cancellable_);
  g_subprocess_force_exit(process_);
  g_object_unref(says_);
  g_object_unref(process_);
  g_object_unref(cancellable_);
}

void Film::read_line() {
  g_data_input_stream_read_line_async(
      says_, G_PRIORITY_DEFAULT, cancellable_,
      [](GObject* stream, GAsyncResult* result, gpointer data) {
        GError* error = nullptr;
        g_autofree gchar* line =
            g_data_input_stream_read_line_finish(G_DATA_INPUT_STREAM(stream), result, nullptr, &error);
        const bool cancelled = g_error_matches(error, G_IO_ERROR, G_IO_ERROR_CANCELLED);
        g_clear_error(&error);
        if (cancelled) return;  // `data` is gone
        Film* self = static_cast<Film*>(data);
        if (line) return self->take_line(line);
        g_subprocess_wait(self->process_, nullptr, nullptr);  // it has closed its standard error: it ends
        const bool made =
            g_subprocess_get_if_exited(self->process_) && g_subprocess_get_exit_status(self->process_) == 0;
        self->on_end_(made ? "" : "lf-scene: " + (self->last_line_.empty() ? "was ended" : self->last_line_));
      },
      this);
}

// "filming: 40 %".
void Film::take_line(const std::string& line) {
  int percent = 0;
  if (std::sscanf(line.c_str(), "filming: %d %%", &percent) == 1) {
    told_ = std::clamp(percent, 0, 100) * 0.01;
    told_at_ = g_get_monotonic_time();
  } else {
    last_line_ = line;
  }
  read_line();
}

// It is told every ten seconds, and goes on as fast between.
double Film::progress() const {
  if (told_at_ <= began_) return 0;
  const double speed = told_ / static_cast<double>(told_at_ - began_);
  constexpr double kNearlyDone = 0.99;
  return std::clamp(speed * static_cast<double>(g_get_monotonic_time() - began_), told_, kNearlyDone);
}

}  // namespace lf::serve
