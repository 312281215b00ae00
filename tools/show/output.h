// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "command_line.h"
#include "image/image.h"
#include "mjpeg_writer.h"
#include "view/views_json.h"

// Where lf-show writes its pictures: NAME.png or NAME.jpg, one of them; a name with one %d (%03d), numbered from 0 on;
// or NAME.mkv, a film in Motion JPEG. One thread at a time.
class Output {
 public:
  // Throws lf::Error for a name that ends otherwise, or that has another '%' than that.
  explicit Output(const std::string& path, FrameRate rate = {});

  bool takes_many() const { return kind_ != Kind::kOne; }
  // All pictures of one film have the size of the first. Throws lf::Error naming the file.
  void add(const lf::Image& rgb);
  // Ends a film; its file is there only now.
  void finish();

 private:
  enum class Kind { kOne, kNumbered, kFilm };
  std::string path_;
  FrameRate rate_;
  Kind kind_;
  int count_ = 0;
  std::unique_ptr<MjpegWriter> film_;
};

// Where to write pictures of views, on the command line of a command.
struct OutputOptions {
  std::string out;
  double framerate = 15;
  std::vector<const cli::Option*> framerate_options;  // one of each command

  // This outlives the command.
  void add_to(cli::App& command,
              const char* what = "Picture (.png, .jpg); several are numbered (NAME_%03d.png) or a film (NAME.mkv)");
  // Throws lf::Error for a frame rate of pictures that are not a film.
  void check() const;
  Output open() const;
};

// Writes what `make` makes of each view.
void show_views(const OutputOptions& options, const std::vector<lf::NamedView>& views,
                const std::function<lf::Image(const lf::NamedView&)>& make);
