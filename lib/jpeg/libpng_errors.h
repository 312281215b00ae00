// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <csetjmp>
#include <cstring>

#include <png.h>

namespace lf {

// Replaces libpng's error handling, which would end the process. Errors jump to `jump`; `text` is then the reason.
// Nothing is printed. The object is the error pointer of the png_struct.
struct PngErrors {
  std::jmp_buf jump;
  char text[128] = "";

  [[noreturn]] static void fail(png_structp png, png_const_charp reason) {
    auto* errors = static_cast<PngErrors*>(png_get_error_ptr(png));
    std::strncpy(errors->text, reason, sizeof errors->text - 1);
    std::longjmp(errors->jump, 1);
  }
  static void ignore(png_structp, png_const_charp) {}
};

}  // namespace lf
