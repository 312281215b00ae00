// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <cstring>

#include <jerror.h>
#include <jpeglib.h>
#include <png.h>

namespace lf::jpeg {

// Replaces libjpeg's error handling, which would end the process.
struct Errors {
  jpeg_error_mgr manager;  // must be first, because libjpeg returns a pointer to this member
  std::jmp_buf jump;

  // Errors jump to `jump`, and so do warnings if `warnings_too`. Nothing is printed.
  jpeg_error_mgr* install(bool warnings_too) {
    jpeg_std_error(&manager);
    manager.error_exit = fail;
    manager.emit_message = warnings_too ? fail_on_warning : [](j_common_ptr, int) {};
    return &manager;
  }

 private:
  [[noreturn]] static void fail(j_common_ptr info) { std::longjmp(reinterpret_cast<Errors*>(info->err)->jump, 1); }
  static void fail_on_warning(j_common_ptr info, int level) {
    if (level < 0) fail(info);  // other levels are traces
  }
};

// A source of bytes in memory. Reading past its end is an error. The caller sets next_input_byte and bytes_in_buffer.
inline jpeg_source_mgr memory_source() {
  jpeg_source_mgr source{};
  source.init_source = [](j_decompress_ptr) {};
  source.fill_input_buffer = [](j_decompress_ptr info) -> boolean {
    ERREXIT(info, JERR_INPUT_EOF);
    return FALSE;
  };
  source.skip_input_data = [](j_decompress_ptr info, long count) {
    if (count <= 0) return;
    if (static_cast<size_t>(count) > info->src->bytes_in_buffer) ERREXIT(info, JERR_INPUT_EOF);
    info->src->next_input_byte += count;
    info->src->bytes_in_buffer -= static_cast<size_t>(count);
  };
  source.resync_to_restart = jpeg_resync_to_restart;
  source.term_source = [](j_decompress_ptr) {};
  return source;
}

}  // namespace lf::jpeg

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
